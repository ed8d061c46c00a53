"""Point files with any damage: they give points or a problem, never an exception, and take little memory.

`python -m benchmarks.inputs.fuzz` does the same for longer, guided by what the damage reaches.
"""

from __future__ import annotations

import io
import struct
import tracemalloc
from pathlib import Path

import laspy
import lzf
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slam.data.point_files import Points, points_in

COUNT = 30
RNG = np.random.default_rng(0)
XYZ = RNG.uniform(-20, 20, (COUNT, 3)).astype(np.float32)
PCD = "VERSION 0.7\nFIELDS x y z _ t\nSIZE 4 4 4 1 4\nTYPE F F F U U\nCOUNT 1 1 1 {pad} 1\nWIDTH {count}\nHEIGHT 1\n"
PCD += "VIEWPOINT 0 0 0 1 0 0 0\nPOINTS {count}\nDATA {data}\n"
PLY = "ply\nformat {form} 1.0\n{before}element vertex {count}\nproperty float x\nproperty float y\n"
PLY += "property float z\n{more}end_header\n"
FACES = "element face 1\nproperty list uchar int vertex_index\n"


def pcd(data: str, pad: int = 0, count: int = COUNT) -> bytes:
    return PCD.format(data=data, pad=pad, count=count).encode()


def ply(form: str, before: str = "", more: str = "", count: int = COUNT) -> bytes:
    return PLY.format(form=form, before=before, more=more, count=count).encode()


def packed(columns: bytes) -> bytes:
    smaller = lzf.compress(columns) or columns
    return struct.pack("<II", len(smaller), len(columns)) + smaller


def npy(array: np.ndarray) -> bytes:
    file = io.BytesIO()
    np.save(file, array)
    return file.getvalue()


def las(compressed: bool) -> bytes:
    points = laspy.LasData(laspy.LasHeader(point_format=3, version="1.2"))
    points.x, points.y, points.z = XYZ.T.astype(np.float64)
    file = io.BytesIO()
    points.write(file, do_compress=compressed)
    return file.getvalue()


LINES = "".join(f"{x} {y} {z} 7\n" for x, y, z in XYZ).encode()
SOUND = {
    "ascii.pcd": pcd("ascii") + LINES,
    "binary.pcd": pcd("binary", 6) + bytes(22 * COUNT),
    "compressed.pcd": pcd("binary_compressed") + packed(XYZ.round().T.tobytes() + bytes(4 * COUNT)),
    "ascii.ply": ply("ascii", more="property uint t\n") + LINES,
    "big.ply": ply("binary_big_endian", FACES) + b"\3" + bytes(12) + XYZ.astype(">f4").tobytes(),
    "lists.ply": ply("binary_little_endian", more="property list uchar ushort a\n")
    + b"".join(point.tobytes() + b"\1\0\0" for point in XYZ),
    "table.npy": npy(XYZ),
    "by_column.npy": npy(np.asfortranarray(XYZ.astype(">f8"))),
    "fields.npy": npy(np.zeros(COUNT, [("x", "f4"), ("y", "f8"), ("z", "i2"), ("t", "M8[ns]"), ("n", "f4", 3)])),
    "four.bin": np.column_stack([XYZ, RNG.random(COUNT)]).astype("<f4").tobytes(),
    "six.bin": np.column_stack([XYZ, RNG.random((COUNT, 3))]).astype("<f8").tobytes(),
    "points.las": las(False),
    "packed.laz": las(True),
}
#: What headers lie with.
WORDS = [
    b"0",
    b"-1",
    b"1000000000000",
    b"99999999999999999999999",
    b"nan",
    b"",
    b"x",
    b"F 8",
    b"list uint double",
    b"\n",
]


@st.composite
def damaged(draw: st.DrawFn, content: bytes) -> bytes:
    """The content with some bytes, words and parts changed, moved, left out, or cut off."""
    data = bytearray(content)
    for _ in range(draw(st.integers(1, 4))):
        at = draw(st.integers(0, max(len(data) - 1, 0)))
        match draw(st.sampled_from(("byte", "word", "cut", "insert", "remove", "number"))):
            case "byte" if data:
                data[at] = draw(st.integers(0, 255))
            case "word":
                start = max(data.rfind(b" ", 0, at), data.rfind(b"\n", 0, at)) + 1
                ends = [end for end in (data.find(b" ", at), data.find(b"\n", at)) if end >= 0]
                data[start : min(ends, default=at)] = draw(st.sampled_from(WORDS))
            case "cut":
                del data[at:]
            case "insert":
                data[at:at] = draw(st.binary(max_size=20))
            case "remove":
                del data[at : at + draw(st.integers(1, 40))]
            case "number":
                data[at : at + 4] = draw(
                    st.sampled_from((b"\xff" * 4, bytes(4), b"\x00\x00\xc0\x7f", b"\x01\x00\x00\x80"))
                )
    return bytes(data)


def checked(name: str, content: bytes) -> Points:
    points = points_in(io.BytesIO(content), Path(name))
    assert points.xyz.dtype == np.float32
    assert np.isfinite(points.xyz).all()
    assert len(points.xyz) or points.problems
    for column in (points.intensity, points.ring, points.colour, *points.times.values()):
        assert column is None or len(column) == len(points.xyz)
    assert all("\n" not in problem.message and len(problem.message) < 600 for problem in points.problems)
    return points


@pytest.mark.parametrize("name", SOUND)
def test_the_sound_file_is_read(name: str) -> None:
    assert checked(name, SOUND[name]).problems in ((), checked(name, SOUND[name]).problems[:1])


@pytest.mark.parametrize("name", SOUND)
@settings(max_examples=60)
@given(st.data())
def test_any_damage_gives_points_or_a_problem(name: str, data: st.DataObject) -> None:
    checked(name, data.draw(damaged(SOUND[name])))


@pytest.mark.parametrize("suffix", ["pcd", "ply", "npy", "bin", "las", "laz"])
@settings(max_examples=20)
@given(content=st.binary(max_size=300))
def test_anything_gives_points_or_a_problem(suffix: str, content: bytes) -> None:
    checked(f"any.{suffix}", content)


MANY = 200_000
MANY_XYZ = RNG.uniform(-20, 20, (MANY, 3)).astype(np.float32)
NOISE = MANY_XYZ.T.tobytes() + RNG.integers(0, 256, 4 * MANY, np.uint8).tobytes()
UNSEEN = np.where(np.arange(MANY)[:, None] % 3, MANY_XYZ, np.float32(np.nan))
LIE = 10**12
HEAVY = {
    "xyz.pcd": pcd("binary", count=MANY).replace(b" _ t", b"").replace(b" 1 4\n", b"\n").replace(b" U U", b"").replace(
        b" 0 1\n", b"\n") + MANY_XYZ.tobytes(),
    "liar.pcd": pcd("binary", count=LIE) + bytes(16 * MANY),
    "liar_text.pcd": pcd("ascii", count=LIE) + b"10.25 20.25 30.25 4\n" * 50_000,
    "no_numbers.pcd": pcd("ascii", count=LIE) + b"a b c d\n" * 300_000,
    "one_line.pcd": pcd("ascii", count=LIE) + b"1 " * 2_000_000,
    "stored.pcd": pcd("binary_compressed", count=MANY) + packed(NOISE),
    "no_end.pcd": b"# comment\n" * 300_000,
    "liar.ply": ply("binary_big_endian", count=LIE) + MANY_XYZ.astype(">f4").tobytes(),
    "liar_lists.ply": ply("binary_little_endian", more="property list uint double a\n", count=LIE)
    + (bytes(12) + b"\xff" * 4) * 100_000,
    "liar_before.ply": ply("binary_little_endian", FACES.replace("face 1", f"face {LIE}")) + bytes(200_000),
    "liar.npy": npy(MANY_XYZ).replace(b"(200000, 3), }" + b" " * 7, b"(1000000000000, 3), }"),
    "unseen.npy": npy(UNSEEN),
    "by_column.npy": npy(np.asfortranarray(MANY_XYZ)),
    "wide.bin": np.column_stack([MANY_XYZ, MANY_XYZ[:, :1]]).astype("<f4").tobytes(),
    "zeros.bin": bytes(16 * MANY),
}  # fmt: skip


@pytest.mark.parametrize("name", HEAVY)
def test_reading_takes_no_more_than_twice_the_file(name: str) -> None:
    file, path = io.BytesIO(HEAVY[name]), Path(name)
    points_in(file, path)  # what is imported and cached does not count
    tracemalloc.start()
    try:
        points_in(file, path)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < 2 * len(HEAVY[name]) + (1 << 20)
