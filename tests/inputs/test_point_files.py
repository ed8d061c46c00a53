"""Point files as they come: what users of other programs stumbled over, and their kin, each read as it is meant.

`CASES` is a table: what is in the file, what lidarlift made of it before it read these files itself, and what it makes
of it now.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import laspy
import lzf
import numpy as np
import pytest

from slam.data.bin_layout import parsed_columns
from slam.data.point_files import Points, Reading, read_points

Array = np.ndarray
COUNT = 2000


def _scan() -> dict[str, Array]:
    rng = np.random.default_rng(0)
    azimuth, reach = rng.uniform(-np.pi, np.pi, COUNT), rng.uniform(3, 40, COUNT)
    return {
        "x": reach * np.cos(azimuth),
        "y": reach * np.sin(azimuth),
        "z": rng.uniform(-2, 2, COUNT),
        "intensity": rng.integers(1, 256, COUNT),
        "ring": rng.integers(0, 16, COUNT),
        "time": np.sort(rng.uniform(0, 0.1, COUNT)),
    }


SCAN = _scan()
XYZ = np.column_stack([SCAN[axis] for axis in "xyz"]).astype(np.float32)
NANOSECONDS = (1_662_622_237_000_000_000 + (SCAN["time"] * 1e9).astype(np.uint64)).astype(np.uint64)


# ---- files, written by hand


def pcd(
    fields: Sequence[str],
    columns: Mapping[str, Array] = SCAN,
    data: str = "binary",
    header: Mapping[str, str] | None = None,
) -> bytes:
    """A .pcd file. A field is 'name:type' or 'name:type*count', as in 'x:F4', '_:U1*10'; '_' is filled with 0xAA."""
    parsed = [(name, kind[0], int(kind[1:].partition("*")[0]), int(kind.partition("*")[2] or 1)) for name, _, kind in
              (each.partition(":") for each in fields)]  # fmt: skip
    count = len(next(iter(columns.values())))
    entries = {
        "VERSION": "0.7",
        "FIELDS": " ".join(name for name, *_ in parsed),
        "SIZE": " ".join(str(size) for *_, size, _ in parsed),
        "TYPE": " ".join(letter for _, letter, *_ in parsed),
        "COUNT": " ".join(str(elements) for *_, elements in parsed),
        "WIDTH": str(count),
        "HEIGHT": "1",
        "VIEWPOINT": "0 0 0 1 0 0 0",
        "POINTS": str(count),
        "DATA": data,
        **(header or {}),
    }
    parts = []
    for name, letter, size, elements in parsed:
        if name in columns and elements:
            part = columns[name].astype(f"<{letter.lower()}{size}").reshape(count, -1)
            parts.append(np.repeat(part, elements // part.shape[1], axis=1))
        else:
            parts.append(np.full((count, size * elements), 0xAA, np.uint8))
    raw = [np.ascontiguousarray(part).view(np.uint8).reshape(count, -1) for part in parts]
    kind = entries["DATA"].lower()
    if kind == "ascii":
        body = "".join(
            " ".join(repr(value.item()) for part in parts for value in part[at]) + "\n" for at in range(count)
        )
        content = body.encode()
    elif kind == "binary":
        content = np.concatenate(raw, axis=1).tobytes()
    else:
        by_column = b"".join(part.tobytes() for part in raw)
        packed = lzf.compress(by_column) or by_column
        content = struct.pack("<II", len(packed), len(by_column)) + packed
    return "".join(f"{key} {value}\n" for key, value in entries.items() if value != "-").encode() + content


PLY_KINDS = {
    **{"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4", "float": "f4"},
    **{"double": "f8", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4"},
    **{"float32": "f4", "float64": "f8"},
}


def ply(
    properties: Sequence[str],
    columns: Mapping[str, Array] = SCAN,
    form: str = "binary_little_endian",
    eol: str = "\n",
    before: tuple[str, bytes] = ("", b""),
    after: tuple[str, bytes] = ("", b""),
) -> bytes:
    """A .ply file of vertices with `properties` like 'float x', and elements before and after: header and content."""
    order = ">" if "big" in form else "<"
    kinds = [each.split() for each in properties]
    table = np.empty(COUNT, [(name, order + PLY_KINDS[kind]) for kind, name in kinds])
    for _, name in kinds:
        table[name] = columns[name]
    header = f"ply\nformat {form} 1.0\ncomment by hand\n{before[0]}element vertex {COUNT}\n"
    header += "".join(f"property {each}\n" for each in properties) + after[0] + "end_header\n"
    rows = "".join(" ".join(repr(value.item()) for value in row) + "\n" for row in table)
    content = rows.encode() if form == "ascii" else table.tobytes()
    return header.replace("\n", eol).encode() + before[1] + content + after[1]


def npy(array: Array, **options: Any) -> bytes:
    import io

    file = io.BytesIO()
    np.save(file, array, **options)
    return file.getvalue()


def las(suffix: str, shift: Sequence[float] = (0, 0, 0), cut: int = 0) -> bytes:
    import io

    points = laspy.LasData(laspy.LasHeader(point_format=3, version="1.2"))
    points.header.offsets, points.header.scales = np.array(shift), np.full(3, 0.001)
    points.x, points.y, points.z = (XYZ + np.asarray(shift)).T
    points.intensity, points.gps_time = SCAN["intensity"].astype(np.uint16), SCAN["time"]
    points.red = points.green = points.blue = np.full(COUNT, 200 * 257, np.uint16)
    file = io.BytesIO()
    points.write(file, do_compress=suffix == ".laz")
    content = file.getvalue()
    return content[: len(content) - cut]


def table(*names: str, kind: str = "f4") -> Array:
    return np.column_stack([SCAN[name] for name in names]).astype(kind)


BASIC = ("x:F4", "y:F4", "z:F4")
FULL = (*BASIC, "intensity:F4", "ring:U2", "time:F4")
PLAIN = ("float x", "float y", "float z")
SEEN = np.arange(COUNT) % 3 > 0


# ---- what is expected of the points


def has(*names: str, rows: slice | Array = slice(None), tolerance: float = 1e-6) -> Callable[[Points], None]:
    """The scan's points, and its columns of these names; any other column is absent."""

    def check(points: Points) -> None:
        np.testing.assert_allclose(points.xyz, XYZ[rows], atol=max(tolerance, 1e-6), rtol=0)
        found = {"intensity": points.intensity, "ring": points.ring, "time": next(iter(points.times.values()), None)}
        for name, values in found.items():
            if name in names:
                assert values is not None, name
                np.testing.assert_allclose(values, SCAN[name][rows], rtol=1e-6)
            else:
                assert values is None, name

    return check


def times(name: str, values: Array, kind: str) -> Callable[[Points], None]:
    """Exactly these times, in the type of the file."""

    def check(points: Points) -> None:
        assert points.times[name].dtype == np.dtype(kind)
        np.testing.assert_array_equal(points.times[name], values)

    return check


def colour(red: int, green: int, blue: int) -> Callable[[Points], None]:
    def check(points: Points) -> None:
        assert points.colour is not None
        assert (points.colour == (red, green, blue)).all()

    return check


def nothing(points: Points) -> None:
    assert len(points.xyz) == 0


def moved(*offset: float) -> Callable[[Points], None]:
    def check(points: Points) -> None:
        assert len(points.xyz) == COUNT
        assert points.offset == pytest.approx(offset, abs=3)
        np.testing.assert_allclose(points.xyz - points.xyz[0], XYZ - XYZ[0], atol=2e-3)

    return check


@dataclass(frozen=True)
class Case:
    """A file and what becomes of it.

    Attributes:
        number: Of the report that it comes from; with a letter for kin.
        title: What is special about the file.
        before: What lidarlift made of it before.
        now: What it makes of it.
        name: The file's suffix.
        content: Its bytes.
        check: Of the points that are read.
        kinds: The problems that are reported, by their kinds, and no others.
        said: A part of what the first of them says.
        columns: What the user says of the columns.
    """

    number: str
    title: str
    before: str
    now: str
    name: str
    content: Callable[[], bytes]
    check: Callable[[Points], None]
    kinds: tuple[str, ...] = ()
    said: str = ""
    columns: str | None = None


KILLED = "the process was killed (SIGABRT), without a message"
LOST = "the whole scan was lost"
FINE = "fine"
UNTRIED = "not tried"
OUSTER = (*BASIC, "_:U1*4", "intensity:F4", "time:U4", "reflectivity:U2", "ring:U1", "_:U1*0", "noise:U2", "_:U1*0",
          "range:U4", "_:U1*15")  # fmt: skip
COLUMNS_NS = {**SCAN, "time": (SCAN["time"] * 1e9).astype(np.uint32)}

# fmt: off
CASES = [
    Case("1", "PCD with several padding fields '_' of different size (pcl_ros bag_to_pcd)", KILLED,
         "All points with intensity and ring.", ".pcd",
         lambda: pcd((*BASIC, "_:U1*4", "intensity:F4", "ring:U2", "_:U1*10")), has("intensity", "ring")),
    Case("1b", "the same as text", UNTRIED, "All points with intensity and ring.", ".pcd",
         lambda: pcd((*BASIC, "_:U1*4", "intensity:F4", "ring:U2", "_:U1*10"), data="ascii"),
         has("intensity", "ring")),
    Case("1c", "the same compressed", UNTRIED, "All points with intensity and ring.", ".pcd",
         lambda: pcd((*BASIC, "_:U1*4", "intensity:F4", "ring:U2", "_:U1*10"), data="binary_compressed"),
         has("intensity", "ring")),
    Case("2", "Ouster's PCD: padding with COUNT 0 between the fields, time in uint32 ns", KILLED,
         "All points with intensity, ring and time.", ".pcd", lambda: pcd(OUSTER, COLUMNS_NS),
         times("time", COLUMNS_NS["time"], "u4")),
    Case("3", ".bin of 5 float32 a point (nuScenes: x y z intensity ring)",
         "silent nonsense: 2500 'points' of 2000, one in five true",
         "All points with intensity and ring: told by the numbers, and said once.", ".bin",
         lambda: table("x", "y", "z", "intensity", "ring").tobytes(), has("intensity", "ring")),
    Case("3b", ".bin of 6 float32 (x y z intensity ring time)", "silent nonsense",
         "All points with intensity, ring and time.", ".bin",
         lambda: table("x", "y", "z", "intensity", "ring", "time").tobytes(), has("intensity", "ring", "time")),
    Case("3c", ".bin of 3 float32", "silent nonsense", "All points.", ".bin", lambda: table("x", "y", "z").tobytes(),
         has()),
    Case("3d", ".bin of 4 float64", "silent nonsense", "All points with intensity.", ".bin",
         lambda: table("x", "y", "z", "intensity", kind="f8").tobytes(), has("intensity")),
    Case("3e", ".bin of 4 float32, cut short in a point", FINE, "The whole points, and a problem.", ".bin",
         lambda: table("x", "y", "z", "intensity").tobytes()[:-5], has("intensity", rows=slice(COUNT - 1)),
         ("truncated scan",)),
    Case("3f", ".bin with a struct a point, named by the user (HeLiPR: x y z i, t uint32, three uint16)",
         "silent nonsense", "All points with intensity, ring and time, by --columns.", ".bin",
         lambda: np.rec.fromarrays([*XYZ.T, SCAN["intensity"].astype("f4"), COLUMNS_NS["time"],
                                          *[SCAN["ring"].astype("u2")] * 3]).tobytes(),
         times("time", COLUMNS_NS["time"], "u4"), columns="x,y,z,intensity,time:u4,_:u2,ring:u2,_:u2"),
    Case("3g", ".bin of which nobody knows what it is (packed uint16, text)", "silent nonsense",
         "No point, and a problem that names --columns; a folder of them is refused.", ".bin",
         lambda: np.random.default_rng(1).integers(0, 256, 32_000, np.uint8).tobytes(), nothing, ("missing scan",),
         "--columns"),
    Case("4", "PLY with ushort intensity, ushort ring and uint time", "these properties were dropped without a word",
         "All points with intensity, ring and time.", ".ply",
         lambda: ply((*PLAIN, "ushort intensity", "ushort ring", "uint time"), COLUMNS_NS),
         times("time", COLUMNS_NS["time"], "u4")),
    Case("4b", "PLY with char, short and double", "char and short were dropped",
         "All points with intensity, ring and time.", ".ply",
         lambda: ply(("double x", "double y", "double z", "short intensity", "char ring", "double time")),
         has("intensity", "ring", "time")),
    Case("4c", "PLY in big endian, types by their lengths (uint16, float32)", UNTRIED,
         "All points with intensity, ring and time.", ".ply",
         lambda: ply(("float32 x", "float32 y", "float32 z", "uint16 intensity", "uint8 ring", "float64 time"),
                     form="binary_big_endian"),
         has("intensity", "ring", "time")),
    Case("4d", "PLY as text, with faces behind the vertices", UNTRIED, "All points with intensity, ring and time.",
         ".ply",
         lambda: ply((*PLAIN, "uint intensity", "uchar ring", "double time"), form="ascii",
                     after=("element face 1\nproperty list uchar int vertex_index\n", b"3 0 1 2\n")),
         has("intensity", "ring", "time")),
    Case("4e", "PLY with lists before the vertices", UNTRIED, "All points with intensity.", ".ply",
         lambda: ply((*PLAIN, "float intensity"),
                     before=("element face 2\nproperty list uchar int vertex_index\nproperty float a\n",
                             struct.pack("<B3ifB4if", 3, 0, 1, 2, 0.5, 4, 0, 1, 2, 3, 0.5))),
         has("intensity")),
    Case("5", "compressed PCD whose block is stored as it is, since it could not be made smaller", LOST,
         "All points with their fields.", ".pcd", lambda: pcd((*BASIC, "intensity:F4"), data="binary_compressed"),
         has("intensity")),
    Case("5b", "compressed PCD of points that repeat", FINE, "All points with their fields.", ".pcd",
         lambda: pcd(FULL, data="binary_compressed"), has("intensity", "ring", "time")),
    Case("6", "PCD with TYPE in lower case", FINE, "All points with intensity.", ".pcd",
         lambda: pcd((*BASIC, "intensity:F4"), header={"TYPE": "f f f f"}), has("intensity")),
    Case("7", "PCD with a coordinate whose bytes are 'DATA'", FINE, "All points.", ".pcd",
         lambda: pcd(BASIC, {**SCAN, "x": np.r_[np.frombuffer(b"DATA", "<f4"), SCAN["x"][1:]]}),
         lambda points: np.testing.assert_array_equal(points.xyz[0, 0], np.frombuffer(b"DATA", "<f4")[0])),
    Case("8", "PCD with names in upper case (PDAL: X Y Z Intensity GpsTime)", LOST,
         "All points with intensity and time.", ".pcd",
         lambda: pcd(("X:F4", "Y:F4", "Z:F4", "Intensity:U2", "GpsTime:F8"),
                     {**{axis.upper(): SCAN[axis] for axis in "xyz"}, "Intensity": SCAN["intensity"],
                      "GpsTime": SCAN["time"]}),
         has("intensity", "time")),
    Case("8b", "PCD with coordinates behind other fields, of different types, and no POINTS", UNTRIED,
         "All points with ring and time.", ".pcd",
         lambda: pcd(("ring:U1", "time:F8", "z:F8", "y:F4", "x:F4"), header={"POINTS": "-"}), has("ring", "time")),
    Case("9", "PCD as text with stamps in uint64 ns, more digits than a float64 has", "time as float, cut",
         "All points, stamps exact.", ".pcd",
         lambda: pcd((*BASIC, "timestamp:U8"), {**SCAN, "timestamp": NANOSECONDS}, "ascii"),
         times("timestamp", NANOSECONDS, "u8")),
    Case("9b", "PCD with float64 stamps of Hesai and RoboSense, and rings of one byte", FINE,
         "All points, stamps exact.", ".pcd",
         lambda: pcd((*BASIC, "ring:U1", "timestamp:F8"), {**SCAN, "timestamp": 1.7e9 + SCAN["time"]}),
         times("timestamp", 1.7e9 + SCAN["time"], "f8")),
    Case("9c", "PCD as text with rings that their type does not hold (inf, -1); found by the fuzzer", UNTRIED,
         "All points, rings as they are written.", ".pcd",
         lambda: pcd((*BASIC, "ring:U1"), data="ascii").replace(b" 3\n", b" inf\n").replace(b" 4\n", b" -1\n"),
         lambda points: np.testing.assert_array_equal(np.unique(points.ring)[[0, -1]], [-1, np.inf])),
    Case("10", "PCD with CRLF in the header", FINE, "All points.", ".pcd",
         lambda: (lambda whole: (whole[: whole.index(b"binary\n")].replace(b"\n", b"\r\n")
                                + b"binary\r\n" + whole[whole.index(b"binary\n") + 7 :]))(pcd(FULL)),
         has("intensity", "ring", "time")),
    Case("10b", "PLY with CRLF in the header", FINE, "All points.", ".ply",
         lambda: ply((*PLAIN, "float intensity"), eol="\r\n"), has("intensity")),
    Case("11", "organised PCD with NaN in x where there was no return", "every scan counted as damaged",
         "The other points, no problem.", ".pcd",
         lambda: pcd(FULL, {**SCAN, "x": np.where(SEEN, SCAN["x"], np.nan)}, header={"WIDTH": "500", "HEIGHT": "4"}),
         has("intensity", "ring", "time", rows=SEEN)),
    Case("11b", "NaN in all three coordinates, not organised", "every scan counted as damaged",
         "The other points, no problem.", ".pcd",
         lambda: pcd(FULL, {**SCAN, **{axis: np.where(SEEN, SCAN[axis], np.nan) for axis in "xyz"}}),
         has("intensity", "ring", "time", rows=SEEN)),
    Case("11c", "organised array (.npy) with NaN for no return", LOST, "The other points, no problem.", ".npy",
         lambda: npy(np.where(SEEN[:, None], XYZ, np.nan).reshape(4, COUNT // 4, 3)), has(rows=SEEN)),
    Case("11d", "one coordinate NaN in a cloud that is not organised: damage", "a problem",
         "The other points, and a problem.", ".pcd",
         lambda: pcd(FULL, {**SCAN, "x": np.where(np.arange(COUNT) == 5, np.nan, SCAN["x"])}),
         has("intensity", "ring", "time", rows=np.arange(COUNT) != 5), ("non-finite points",)),
    Case("12", "NaN among the points, times beside them", FINE, "The other points with their own times.", ".ply",
         lambda: ply((*PLAIN, "double time"), {**SCAN, **{axis: np.where(SEEN, SCAN[axis], np.nan) for axis in "xyz"}}),
         has("time", rows=SEEN)),
    Case("13", "binary PCD cut short", LOST, "The whole points, and a problem.", ".pcd", lambda: pcd(FULL)[:-5000],
         has("intensity", "ring", "time", rows=slice((COUNT * 22 - 5000) // 22)), ("truncated scan",)),
    Case("13b", "compressed PCD cut short", LOST, "The points all of whose columns are there, and a problem.", ".pcd",
         lambda: pcd((*BASIC, "intensity:F4"), {**SCAN, "x": SCAN["x"].round()}, "binary_compressed")[:-2000],
         lambda points: np.testing.assert_allclose(points.xyz[:, 1:], XYZ[: len(points.xyz), 1:]), ("truncated scan",)),
    Case("13c", "PCD as text, cut in a number", LOST, "The whole lines, and a problem.", ".pcd",
         lambda: pcd((*BASIC, "intensity:F4"), data="ascii")[:-7], has("intensity", rows=slice(COUNT - 1)),
         ("truncated scan",)),
    Case("13d", "PLY cut short", "nine points of ten", "The whole points, and a problem.", ".ply",
         lambda: ply((*PLAIN, "float intensity"))[:-5000], has("intensity", rows=slice((COUNT * 16 - 5000) // 16)),
         ("truncated scan",)),
    Case("13e", ".npy cut short", LOST, "The whole points, and a problem.", ".npy",
         lambda: npy(table("x", "y", "z", "intensity"))[:-5000],
         has("intensity", rows=slice((COUNT * 16 - 5000) // 16)), ("truncated scan",)),
    Case("13f", "PCD as text with lines that are no numbers", LOST, "The other points, and a problem.", ".pcd",
         lambda: (pcd((*BASIC, "intensity:F4"), data="ascii")
                  .replace(b"\n", b"\nx y z i\n", 100).replace(b"x y z i\n", b"", 10)),
         lambda points: np.testing.assert_allclose(points.xyz, XYZ[: len(points.xyz)], atol=1e-6), ("damaged lines",)),
    Case("14", "PCD with a field of three numbers (normal)", FINE, "All points.", ".pcd",
         lambda: pcd((*BASIC, "normal:F4*3", "intensity:F4")), has("intensity")),
    Case("15", "UTM coordinates in float64", "all points dropped as damaged, no hint at an offset",
         "All points, moved to where they are dense; the offset is said.", ".pcd",
         lambda: pcd(("x:F8", "y:F8", "z:F8"), {**SCAN, "x": SCAN["x"] + 457000, "y": SCAN["y"] + 5428000}),
         moved(457000, 5428000, 0), ("map coordinates",), "UTM"),
    Case("15c", "UTM coordinates as text, the first line damaged", UNTRIED, "The other points, moved.", ".pcd",
         lambda: pcd(("x:F8", "y:F8", "z:F8"), {**SCAN, "x": SCAN["x"] + 457000, "y": SCAN["y"] + 5428000},
                     "ascii").replace(b"DATA ascii\n", b"DATA ascii\nx y z\n"),
         lambda points: np.testing.assert_array_less(np.abs(points.xyz), 100), ("damaged lines", "map coordinates")),
    Case("15b", "ECEF coordinates in .npy", "all points dropped as damaged",
         "All points, moved to where they are dense; the offset is said.", ".npy",
         lambda: npy(table("x", "y", "z", kind="f8") + np.array([4_075_580, 931_854, 4_801_568])),
         moved(4_075_580, 931_854, 4_801_568), ("map coordinates",)),
    Case("16", "coordinates in millimetres", "most points dropped as damaged",
         "No point, and a problem that asks for metres; a folder of them is refused.", ".ply",
         lambda: ply(("int x", "int y", "int z"), {axis: np.round(SCAN[axis] * 1000) for axis in "xyz"}), nothing,
         ("missing scan",), "millimetres"),
    Case("18", "an empty scan, saved as np.array([])", "the run ended", "No point, and a problem.", ".npy",
         lambda: npy(np.array([])), nothing, ("empty scan",)),
    Case("18b", ".npy whose header speaks of 10^12 points", "MemoryError, a traceback",
         "The points that are there, and a problem.", ".npy",
         lambda: npy(table("x", "y", "z", "intensity")).replace(b"(2000, 4), }" + b" " * 9, b"(1000000000000, 4), }"),
         has("intensity"), ("truncated scan",)),
    Case("18c", ".npy with a field of three numbers", "a traceback", "All points, without that field.", ".npy",
         lambda: npy(np.rec.fromarrays([*XYZ.T, XYZ], dtype="f4,f4,f4,(3,)f4")
                     .astype([("x", "f4"), ("y", "f4"), ("z", "f4"), ("intensity", "f4", 3)])),
         has(), ("unusable field",)),
    Case("18d", ".npy with time as text", "a traceback", "All points, without their times, and a problem.", ".npy",
         lambda: npy(np.rec.fromarrays([*XYZ.T, SCAN["time"].astype("U8")], names="x,y,z,time")), has(),
         ("unusable field",), "time"),
    Case("18e", ".npy with dates of numpy as time", "a traceback", "All points, times as whole numbers.", ".npy",
         lambda: npy(np.rec.fromarrays([*XYZ.T, NANOSECONDS.astype("M8[ns]")], names="x,y,z,time")),
         times("time", NANOSECONDS, "i8")),
    Case("18f", "a pickle", "the run ended", "No point, and a problem; nothing of it is executed.", ".npy",
         lambda: npy(np.array([{}], object), allow_pickle=True), nothing, ("missing scan",), "Python objects"),
    Case("18g", ".npy of another shape", "the run ended", "No point, and a problem with the remedy.", ".npy",
         lambda: npy(table("x", "y", "z", "intensity").T), nothing, ("missing scan",), "points.T"),
    Case("18h", ".npy in Fortran's order and big endian", UNTRIED, "All points with intensity.", ".npy",
         lambda: npy(np.asfortranarray(table("x", "y", "z", "intensity", kind=">f8"))), has("intensity")),
    Case("18j", "an empty structured array", LOST, "No point, and a problem.", ".npy",
         lambda: npy(np.zeros(0, [("x", "f4"), ("y", "f4"), ("z", "f4"), ("t", "f8")])), nothing, ("empty scan",)),
    Case("18i", ".npy of six columns, named by the user", "refused", "All points with their fields, by --columns.",
         ".npy", lambda: npy(table("x", "y", "z", "intensity", "ring", "time")), has("intensity", "ring", "time"),
         columns="x,y,z,intensity,ring,time"),
    *(
        Case(
            "19" + letter,
            f"a header that lies: {fault}",
            "refused",
            "No point, and a problem.",
            ".pcd",
            lambda header=header: pcd(FULL, header=header)[: 200 + 22 * 4],  # type: ignore[misc]
            nothing,
            ("missing scan",),
        )
        for letter, fault, header in [
            ("a", "SIZE -4", {"SIZE": "-4 4 4 4 2 4"}),
            ("b", "POINTS -5", {"POINTS": "-5"}),
            ("c", "as many SIZE as not", {"SIZE": "4 4"}),
            ("d", "no fields", {"FIELDS": "", "SIZE": "", "TYPE": "", "COUNT": ""}),
            ("e", "SIZE 3 of x", {"SIZE": "3 4 4 4 2 4"}),
            ("f", "DATA zip", {"DATA": "zip"}),
        ]
    ),
    Case("19g", "PCD whose header speaks of 10^12 points", "refused", "The points that are there, and a problem.",
         ".pcd", lambda: pcd(FULL, header={"POINTS": str(10**12), "WIDTH": str(10**12)}),
         has("intensity", "ring", "time"), ("truncated scan",)),
    Case("19h", "PLY whose header speaks of 10^12 points", "refused", "The points that are there, and a problem.",
         ".ply", lambda: ply((*PLAIN, "float intensity")).replace(b"vertex 2000", b"vertex 1000000000000"),
         has("intensity"), ("truncated scan",)),
    Case("19i", "compressed PCD that says it holds 4 GB", "refused", "No point, and a problem.", ".pcd",
         lambda: pcd(FULL, data="binary_compressed", header={"POINTS": str(10**9), "WIDTH": str(10**9)})
                  .replace(struct.pack("<I", 22 * COUNT), struct.pack("<I", 2**32 - 1)),
         nothing, ("missing scan",)),
    Case("19j", "PCD with a field of 10^12 elements", UNTRIED, "No point, and a problem.", ".pcd",
         lambda: pcd(FULL, header={"COUNT": "1 1 1 1000000000000 1 1"}), nothing,
         ("unusable field", "truncated scan", "empty scan")),
    Case("19k", "PCD whose POINTS are not WIDTH x HEIGHT", UNTRIED, "All points, and a problem.", ".pcd",
         lambda: pcd(FULL, header={"WIDTH": "7"}), has("intensity", "ring", "time"), ("odd header",)),
    Case("19l", "PCD that begins with a byte order mark", LOST, "All points.", ".pcd",
         lambda: b"\xef\xbb\xbf" + pcd(FULL), has("intensity", "ring", "time")),
    Case("19m", "PCD with three intensities a point", FINE, "All points without it, and a problem.", ".pcd",
         lambda: pcd((*BASIC, "intensity:F4*3")), has(), ("unusable field",), "intensity"),
    Case("19n", "PLY in big endian with lists of 16-bit length in each vertex", UNTRIED, "All points.", ".ply",
         lambda: b"ply\nformat binary_big_endian 1.0\nelement vertex 2000\nproperty float x\nproperty float y\n"
                 b"property float z\nproperty list ushort uchar seen_by\nend_header\n"
                 + b"".join(point.astype(">f4").tobytes() + b"\0\2ab" for point in XYZ), has()),
    Case("20", "PCD with colour packed into a float", "without colour in a scan", "All points with colour.", ".pcd",
         lambda: pcd((*BASIC, "rgb:F4"), {**SCAN, "rgb": np.full(COUNT, 0x00C86432, np.uint32).view(np.float32)}),
         colour(200, 100, 50)),
    Case("20b", "PCD with colour packed into a whole number, with alpha", "without colour in a scan",
         "All points with colour.", ".pcd",
         lambda: pcd((*BASIC, "rgba:U4"), {**SCAN, "rgba": np.full(COUNT, 0xFFC86432, np.uint32)}),
         colour(200, 100, 50)),
    Case("20d", "PCD with colour in a float64 that is no colour; found by the fuzzer", UNTRIED, "All points.", ".pcd",
         lambda: pcd((*BASIC, "rgb:F8"), {**SCAN, "rgb": np.full(COUNT, 1e300)}), has()),
    Case("20c", "PLY with red, green, blue", FINE, "All points with colour.", ".ply",
         lambda: ply((*PLAIN, "uchar red", "uchar green", "uchar blue"),
                     {**SCAN, "red": np.full(COUNT, 200), "green": np.full(COUNT, 100), "blue": np.full(COUNT, 50)}),
         colour(200, 100, 50)),
    Case("21", "LAS with intensity, GPS time and colour", "not read", "All points with intensity and time.", ".las",
         lambda: las(".las"), has("intensity", "time", tolerance=6e-4)),
    Case("21b", "LAZ with colour of 16 bits", "not read", "All points with colour.", ".laz", lambda: las(".laz"),
         colour(200, 200, 200)),
    Case("21c", "LAS in UTM", "not read", "All points, moved to where they are dense; the offset is said.", ".las",
         lambda: las(".las", (457000, 5428000, 115)), moved(457000, 5428000, 115), ("map coordinates",)),
    Case("21d", "LAS cut short", "not read", "The whole points, and a problem.", ".las",
         lambda: las(".las", cut=5000),
         has("intensity", "time", rows=slice((COUNT * 34 - 5000) // 34), tolerance=6e-4), ("truncated scan",)),
]
# fmt: on


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.number)
def test_a_point_file_is_read_as_it_is_meant(case: Case, tmp_path: Path) -> None:
    path = tmp_path / f"000000{case.name}"
    path.write_bytes(case.content())
    layout = None if case.columns is None else parsed_columns(case.columns)
    points = read_points(path, Reading(layout))
    case.check(points)
    assert tuple(problem.kind for problem in points.problems) == case.kinds
    assert all(problem.message.startswith(f"{path}: ") for problem in points.problems)
    assert not case.said or case.said in points.problems[0].message


def test_the_numbers_of_the_cases_are_their_own() -> None:
    assert len({case.number for case in CASES}) == len(CASES)
