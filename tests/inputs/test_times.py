"""Point times, names and stamps that caused errors in other programs or earlier versions are read as intended.

`CASES` is a table: the number (R: found in a review, K: a similar case), the content of the files, the result before
the times of a sequence were estimated as a whole, and the result now.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from slam.data.dataset import Dataset, open_dataset
from slam.data.errors import InputError
from slam.data.sensor import load_sensor

Array = np.ndarray
COUNT, SCANS, EPOCH = 1600, 6, 1_700_000_000
FRACTION = np.sort(np.random.default_rng(0).uniform(0, 1, COUNT))
FRACTION[[0, -1]] = 0.0001, 0.9999
T = 0.1 * FRACTION  # s in a sweep of 0.1 s
Check = Callable[[Path], None]
Fields = Mapping[str, Array]


# ---- files


def scan(fraction: Array, **fields: Array) -> Array:
    """A scan of a VLP-16 that rotates clockwise from the rear, as a structured array."""
    sensor, ring = load_sensor("vlp16"), np.arange(len(fraction)) % 16
    azimuth, rho = np.pi - 2 * np.pi * fraction, 10 + 5 * np.sin(20 * fraction)
    columns = {"x": rho * np.cos(azimuth), "y": rho * np.sin(azimuth)}
    columns = {name: values.astype(np.float32) for name, values in columns.items()}
    columns["z"] = (np.tan(sensor.elevation)[ring] * rho + sensor.offset[ring]).astype(np.float32)
    columns |= {"intensity": (ring * 10).astype(np.float32), **fields}
    table = np.zeros(len(fraction), [(name, values.dtype) for name, values in columns.items()])
    for name, values in columns.items():
        table[name] = values
    return table


def write(folder: Path, scans: Iterable[Array], names: Sequence[str] = (), times: str | bytes | None = "") -> None:
    """Scans as .npy, numbered by default; `times` is times.txt, "" for ten scans per second from EPOCH."""
    count = 0
    for count, table in enumerate(scans, 1):
        np.save(folder / f"{names[count - 1] if names else f'{count - 1:06d}'}.npy", table)
    if times == "":
        times = "".join(f"{EPOCH + 0.1 * k:.6f}\n" for k in range(count))
    if times is not None:
        (folder / "times.txt").write_bytes(times.encode() if isinstance(times, str) else times)


# ---- expected results


def timed(
    of: Callable[[int], Fields],
    verdict: str,
    expected: Array | None,
    *,
    tolerance: float = 1e-6,
    fraction: Array = FRACTION,
    odd: Sequence[str] = (),
    step: float = 0.1,
    yaml: str = "",
    **said: str,
) -> Check:
    """Fields `of` each scan, words of the verdict, and the point times of scan 2."""

    def check(folder: Path) -> None:
        stamps = "".join(f"{EPOCH + step * k:.6f}\n" for k in range(SCANS))
        write(folder, (scan(fraction, **of(k)) for k in range(SCANS)), times=stamps)
        if yaml:
            (folder / "sensor.yaml").write_text(yaml)
        data = open_dataset(folder, **said)
        assert verdict in data.point_times.verdict(SCANS, SCANS)  # type: ignore[attr-defined]
        frame = data[2]
        assert [problem.kind for problem in frame.problems] == list(odd)
        if expected is None:
            assert frame.cloud.time is None
        else:
            assert frame.cloud.time is not None
            np.testing.assert_allclose(frame.cloud.time, expected, atol=tolerance)

    return check


def spoilt(values: Array, stray: float, *places: int) -> Array:
    result = values.copy()
    result[list(places)] = stray
    return result


def clock(k: int, unit: float = 1.0, offset: float = 0.0) -> Array:
    """Absolute times of scan k in a unit: (COUNT,) float64."""
    return np.asarray((EPOCH + 0.1 * k + offset + T) / unit)


def stamped(
    names: Sequence[str], times: str | bytes | None, expected: Sequence[float], kinds: Sequence[str] = (), **want: Any
) -> Check:
    """Scans of these names with these times: stamps from the first, and the problems of the sequence."""

    def check(folder: Path) -> None:
        write(folder, (scan(FRACTION[:40]) for _ in names), names, times)
        data = open_dataset(folder)
        np.testing.assert_allclose(data.stamps - data.stamps[0], expected, atol=2e-6)
        assert [problem.kind for problem in data.problems] == list(kinds)
        if "order" in want:
            files = [path.stem for path in data._files]  # type: ignore[attr-defined]
            assert files == want["order"]
        if "said" in want:
            assert data.stamps_from == want["said"]  # type: ignore[attr-defined]

    return check


def numbered(count: int) -> list[str]:
    return [f"{k:06d}" for k in range(count)]


def refused(times: str, *words: str) -> Check:
    def check(folder: Path) -> None:
        write(folder, (scan(FRACTION[:40]) for _ in range(3)), times=times)
        with pytest.raises(InputError, match=r"times\.txt") as error:
            open_dataset(folder)
        assert all(word in str(error.value) for word in words)

    return check


def ringed(spoil: Callable[[Array], Array], kind: str | None, left: int, sensor: str | None = "vlp16") -> Check:
    """The ring field of scan 2 is damaged: its problem, and the number of points left with the right ring."""

    def check(folder: Path) -> None:
        ring = (np.arange(COUNT) % 16).astype(np.float32)
        write(folder, (scan(FRACTION, ring=spoil(ring) if k == 2 else ring) for k in range(SCANS)))
        frame = open_dataset(folder, sensor=sensor)[2]
        assert [problem.kind for problem in frame.problems] == ([kind] if kind else [])
        cloud = frame.cloud
        if sensor is None and left == 0:
            assert (cloud.ring, len(cloud)) == (None, COUNT)
            return
        assert len(cloud) == left
        lines = load_sensor("vlp16")
        assert cloud.ring is not None
        line = np.tan(lines.elevation)[cloud.ring] * np.hypot(*cloud.xyz[:, :2].T) + lines.offset[cloud.ring]
        assert np.abs(cloud.xyz[:, 2] - line).max() < 1e-3

    return check


def rings_as(kind: str, to_file: Callable[[Array], Array], sensor: str | None) -> Check:
    """A ring field of another type or order in all scans: every point lies on the line of its ring."""

    def check(folder: Path) -> None:
        ring = to_file(np.arange(COUNT) % 16).astype(kind)
        write(folder, (scan(FRACTION, ring=ring) for _ in range(SCANS)))
        cloud = open_dataset(folder, sensor=sensor)[2].cloud
        assert cloud.ring is not None
        assert cloud.ring.tolist() == (np.arange(COUNT) % 16).tolist()

    return check


def bright(first: Array, later: Array, expected: float) -> Check:
    """Scans with intensities `first`, the last with `later`: mean intensity of the last."""

    def check(folder: Path) -> None:
        values = [first] * 9 + [later]
        write(folder, (scan(FRACTION[:40], intensity=value) for value in values))
        assert open_dataset(folder)[9].cloud.intensity.mean() == pytest.approx(expected, rel=0.02)

    return check


def raw(missing: Sequence[int], blank: bool, without: Sequence[str] = ()) -> Check:
    """KITTI raw, ten scans, some missing, perhaps with blank lines: stamps, and the ground truth at them."""

    def check(folder: Path) -> None:
        drive = folder / "2011_09_26_drive_0009_sync"
        for part in ("velodyne_points/data", "oxts/data"):
            (drive / part).mkdir(parents=True)
        lines = []
        for k in range(10):
            lines.append(f"2011-09-26 13:00:{32 + 0.1 * k:012.9f}")
            latitude = 49 + np.rad2deg(k / 6378137.0)
            packet = f"{latitude:.14f} 8.4 112.0 0 0 {np.pi / 2} " + "0 " * 24
            (drive / f"oxts/data/{k:010d}.txt").write_text(packet)
            if k not in missing:
                np.full((50, 4), 5 + k, np.float32).tofile(drive / f"velodyne_points/data/{k:010d}.bin")
        (drive / "oxts/timestamps.txt").write_text("\n".join(lines) + "\n")
        kept = ["" if k in missing and blank else line for k, line in enumerate(lines)]
        (drive / "velodyne_points/timestamps.txt").write_text("\n".join(kept) + "\n")
        (drive / "calib_imu_to_velo.txt").write_text("R: 1 0 0 0 1 0 0 0 1\nT: 0 0 0\n")
        for name in without:
            (drive / name).unlink()
        data = open_dataset(drive)
        there = np.array([k for k in range(10) if k not in missing])
        np.testing.assert_allclose(data.stamps, 0.1 * (there - there[0]), atol=1e-6)
        if not without:
            assert data.ground_truth is not None
            np.testing.assert_allclose(data.ground_truth[:, 0, 3], there - there[0], atol=1e-3)
        said = [problem.kind for problem in data.problems]
        assert ("no time stamps" in said) is ("velodyne_points/timestamps.txt" in without)

    return check


def odd_files(*names: str) -> Check:
    """Files beside three scans that are not scans."""

    def check(folder: Path) -> None:
        write(folder, (scan(FRACTION[:40]) for _ in range(3)))
        for name in names:
            (folder / name).write_bytes(bytes(4096))
        data = open_dataset(folder)
        assert (len(data), data.problems) == (3, ())

    return check


def without_times(folder: Path) -> None:
    """A sensor that rotates twice as fast: point times, but no stamps."""
    write(folder, (scan(FRACTION, t=(T / 2 * 1e9).astype(np.uint32)) for _ in range(SCANS)), times=None)
    data = open_dataset(folder)
    assert [problem.kind for problem in data.problems] == ["no time stamps"]
    assert "20 scans a second as in field t" in data.problems[0].message
    np.testing.assert_allclose(np.diff(data.stamps), 0.05, atol=1e-9)


def clock_without_times(folder: Path) -> None:
    """Absolute point times without stamps, every other scan left out."""
    write(folder, (scan(FRACTION, timestamp=clock(2 * k)) for k in range(SCANS)), times=None)
    data = open_dataset(folder)
    np.testing.assert_allclose(np.diff(data.stamps), 0.2, atol=1e-6)
    assert data[2].cloud.time == pytest.approx(T - T[0], abs=1e-6)


def wrong_field(folder: Path) -> None:
    write(folder, (scan(FRACTION, t=T) for _ in range(SCANS)))
    with pytest.raises(InputError, match=r"no field 'stamp' .* there are t"):
        open_dataset(folder, point_time="stamp")
    with pytest.raises(InputError, match="UNIT one of s, ms, us, ns"):
        open_dataset(folder, point_time="t:hours")


def one_scan_without(folder: Path) -> None:
    """Half of the point times of one scan are NaN."""
    times = [spoilt(T, np.nan, *range(COUNT // 2 + 1)) if k == 2 else T for k in range(SCANS)]
    write(folder, (scan(FRACTION, t=time) for time in times))
    frame = open_dataset(folder)[2]
    assert (frame.cloud.time, [problem.kind for problem in frame.problems]) == (None, ["no point times"])


def column_major(folder: Path) -> None:
    """16 points per instant, as in an organised cloud, and the same stored ring by ring."""
    time = np.repeat(0.1 * np.arange(100) / 100, 16).astype(np.float32)
    for place, order in (("columns", np.arange(COUNT)), ("rings", np.argsort(np.arange(COUNT) % 16, kind="stable"))):
        (folder / place).mkdir()
        write(folder / place, (scan(time * 10, time=time)[order] for _ in range(SCANS)))
        frame = open_dataset(folder / place)[2]
        np.testing.assert_allclose(frame.cloud.time, time[order], atol=1e-6)
        assert frame.problems == ()


def wrong_rings(folder: Path) -> None:
    ring = (np.arange(COUNT) % 32).astype(np.uint16)
    write(folder, (scan(FRACTION, ring=ring) for _ in range(SCANS)))
    with pytest.raises(InputError, match="rings 0 to 31, but the sensor vlp16 has 16; name the right one"):
        open_dataset(folder, sensor="vlp16")


def nonsense_rings(folder: Path) -> None:
    write(folder, (scan(FRACTION, ring=np.full(COUNT, 40000, np.uint16)) for _ in range(SCANS)))
    data = open_dataset(folder)
    assert [problem.kind for problem in data.problems] == ["ring unknown"]
    assert data[1].cloud.ring is None


def relative_to(instant: float, **said: str) -> Check:
    """ns from the start of the sweep, and a stamp stated at another instant: the time 0 is there."""
    return timed(
        lambda _: {"t": (1e9 * T).astype(np.uint32)}, f"stamp = {said['stamp']}", T - 0.1 * instant, **said
    )  # fmt: skip


# ---- the table


@dataclass(frozen=True)
class Case:
    number: str
    title: str
    before: str
    now: str
    check: Check


HALF = 0.5 * FRACTION
E0 = [EPOCH + 0.1 * k for k in range(12)]
TENTHS = [0.1 * k for k in range(12)]
UNEVEN = [EPOCH + 0.1 * k + 0.00162 for k in range(12)]

CASES = [
    Case("18", "points of half a turn: times from 0 to 50 ms in a sweep of 100 ms", "stretched to a whole sweep",
         "0 to 50 ms of a 100 ms sweep",
         timed(lambda _: {"time": (T / 2).astype("f4")}, "50 ms of a 100 ms sweep", T / 2, fraction=HALF)),
    Case("19a", "one absolute time is 0", "all other points at one instant",
         "time interpolated between the neighbouring points",
         timed(lambda k: {"timestamp": spoilt(clock(k), 0, 7)}, "s, absolute", spoilt(T, (T[6] + T[8]) / 2, 7),
               odd=["stray point times"])),
    Case("19b", "some relative times are 3.6 s", "all other times near 0",
         "times interpolated between the neighbouring points",
         timed(lambda _: {"time": spoilt(T, 3.6, 7, 90).astype("f4")}, "s, relative",
               spoilt(spoilt(T, (T[6] + T[8]) / 2, 7), (T[89] + T[91]) / 2, 90), odd=["stray point times"])),
    Case("19c", "times of lost packets are 0", "points placed at the start",
         "times interpolated between the neighbouring points",
         timed(lambda _: {"t": spoilt(1e9 * T, 0, *range(600, 640)).astype(np.uint32)}, "ns, relative",
               np.interp(np.arange(COUNT), np.delete(np.arange(COUNT), slice(600, 640)),
                         np.delete(T, slice(600, 640))), odd=["stray point times"])),
    Case("21a", "seconds since 1970 in float32", "no times, no message", "no times, and the reason",
         timed(lambda k: {"time": clock(k).astype("f4")}, "none (time is", None)),
    Case("21b", "field t is always 0, field timestamp is valid", "no times, no message", "field timestamp is used",
         timed(lambda k: {"t": np.zeros(COUNT, np.uint32), "timestamp": clock(k)}, "field timestamp, s, absolute", T)),
    Case("21c", "other names of the time field", "no times, no message", "recognised",
         timed(lambda _: {"offset_times": (1e9 * T).astype(np.uint32)}, "field offset_times, ns", T)),
    Case("22", "absolute seconds (Hesai, RoboSense)", "right", "right, on the clock of the stamps",
         timed(lambda k: {"timestamp": clock(k)}, "field timestamp, s, absolute, 0 to 100 ms", T)),
    Case("23a", "Livox: absolute ns as float64", "right", "right",
         timed(lambda k: {"timestamp": clock(k, 1e-9)}, "ns, absolute", T)),
    Case("23b", "Livox: absolute ns as uint64", "right", "right",
         timed(lambda k: {"timestamp": np.uint64((EPOCH * 10 + k) * 10**8) + (1e9 * T).astype(np.uint64)},
               "ns, absolute", T)),
    Case("23c", "Livox: offset_time, ns as uint32", "right", "right",
         timed(lambda _: {"offset_time": (1e9 * T).astype(np.uint32)}, "field offset_time, ns, relative", T)),
    Case("24", "times before the stamp (Velodyne)", "deskewed, but the pose refers to mid-sweep", "stamp = end",
         timed(lambda _: {"time": (T - 0.1).astype("f4")}, "stamp = end", T - 0.1)),
    Case("25a", "stamp at the start of the sweep", "could not be stated", "stamp = start",
         relative_to(0, stamp="start")),
    Case("25b", "stamp in the middle of the sweep", "could not be stated", "stamp = middle",
         relative_to(0.5, stamp="middle")),
    Case("25c", "stamp at the end of the sweep", "could not be stated", "stamp = end", relative_to(1, stamp="end")),
    Case("25d", "sensor.yaml states field, unit and stamp", "could not be stated", "as stated",
         timed(lambda _: {"t": np.sin(FRACTION), "dt": 1e3 * T}, "field dt, ms, relative", T - 0.1,
               yaml="time_field: dt:ms\nstamp: end\nfull_intensity: 255\n")),
    Case("25e", "absolute point times before the stamp", "the pose refers to mid-sweep", "stamp = end",
         timed(lambda k: {"timestamp": clock(k, offset=-0.1)}, "stamp = end", T - 0.1)),
    Case("27", "all times are equal", "no times, no message", "no times, and the reason",
         timed(lambda _: {"t": np.full(COUNT, 7.0)}, "none (t is the same for all points", None)),
    Case("28", "no time field", "no times, no message", "no times, and the reason",
         timed(lambda _: {}, "none (no time field", None)),
    Case("29a", "ring as uint8", "right", "right", rings_as("u1", lambda ring: ring, "vlp16")),
    Case("29b", "ring as int32, counted from the bottom", "decided per scan", "reversed, decided once per sequence",
         rings_as("i4", lambda ring: 15 - ring, None)),
    Case("29c", "ring as float32", "right", "right", rings_as("f4", lambda ring: ring, None)),
    Case("29d", "one ring is 65535", "the run ended", "the point is left out and reported",
         ringed(lambda ring: spoilt(ring, 65535, 3), "ring unknown", COUNT - 1)),
    Case("29e", "one ring is -1", "the run ended", "the point is left out and reported",
         ringed(lambda ring: spoilt(ring, -1, 3), "ring unknown", COUNT - 1)),
    Case("29f", "one ring is NaN", "the run ended", "the point is left out and reported",
         ringed(lambda ring: spoilt(ring, np.nan, 3), "ring unknown", COUNT - 1)),
    Case("29g", "a scan with invalid rings only", "the run ended", "rings from the laser lines, reported",
         ringed(lambda ring: ring + 100, "ring unknown", COUNT)),
    Case("29h", "a scan with invalid rings only, of an unknown sensor", "the run ended",
         "no rings for this scan, reported", ringed(lambda ring: ring + 100, "ring unknown", 0, None)),
    Case("29i", "rings of another sensor", "the run ended at the scan", "refused before the run", wrong_rings),
    Case("29j", "rings that no sensor has", "the run ended", "a run without rings, reported", nonsense_rings),
    Case("30", "the scans of a folder have no times", "not estimated", "not estimated, and reported",
         timed(lambda _: {}, "point times: none", None)),
    Case("31a", "names in ns, with a valid times.txt", "a sweep of 1e-9 s", "stamps of times.txt",
         stamped([f"{EPOCH * 10**9 + k * 10**8}" for k in range(12)], "".join(f"{t:.1f}\n" for t in E0), TENTHS)),
    Case("31b", "names in ns", "10 Hz assumed", "the names are the stamps",
         stamped([f"{EPOCH * 10**9 + k * 10**8}" for k in range(12)], None, TENTHS, said="the scans' names, ns")),
    Case("31c", "names in us (NCLT, Boreas)", "10 Hz assumed", "the names are the stamps",
         stamped([f"{EPOCH * 10**6 + k * 10**5}" for k in range(12)], None, TENTHS, said="the scans' names, us")),
    Case("31d", "names in ns, from 0", "10 Hz assumed", "the names are the stamps",
         stamped([f"{k * 10**8}" for k in range(12)], None, TENTHS, said="the scans' names, ns")),
    Case("32a", "1.npy to 12.npy, not zero-padded", "right order", "right order",
         stamped([f"{k}" for k in range(1, 13)], None, TENTHS, ["no time stamps"],
                 order=[f"{k}" for k in range(1, 13)])),
    Case("32b", "numbers from 1, scan 3 missing, times for all numbers", "refused", "assigned by number",
         stamped(["1", "2", "4", "5"], "0\n0.1\n0.2\n0.3\n0.4\n", [0, 0.1, 0.3, 0.4], ["gap in numbering"])),
    Case("33a", "KITTI raw with blank lines for missing scans", "stamps 4 rows off", "right",
         raw([3, 4, 5, 6], blank=True)),
    Case("33b", "KITTI raw without blank lines", "right", "right", raw([3, 4, 5, 6], blank=False)),
    Case("33c", "KITTI raw without timestamps.txt", "refused", "10 Hz assumed, and reported",
         raw([3], blank=False, without=["velodyne_points/timestamps.txt"])),
    Case("33d", "KITTI raw without the packets' timestamps.txt", "refused", "assigned by the numbers of the packets",
         raw([3], blank=False, without=["oxts/timestamps.txt"])),
    Case("33e", "a folder with blank lines for missing scans", "stamps off", "right",
         stamped(["0", "1", "4", "5"], "0\n0.1\n\n\n0.4\n0.5\n", [0, 0.1, 0.4, 0.5], ["gap in numbering"])),
    Case("34a", "a repeated stamp", "refused", "interpolated, and reported",
         stamped(numbered(5), "0\n.1\n.1\n.3\n.4\n", TENTHS[:5], ["mended stamps"])),
    Case("34b", "a stamp that runs backward", "refused", "interpolated, and reported",
         stamped(numbered(5), "0\n.1\n.05\n.3\n.4\n", TENTHS[:5], ["mended stamps"])),
    Case("34c", "one stamp far ahead", "refused", "interpolated, and reported",
         stamped(numbered(5), "0\n.1\n99\n.3\n.4\n", TENTHS[:5], ["mended stamps"])),
    Case("34d", "the clock was set back", "refused", "continued after one usual step, and reported",
         stamped(numbered(6), "9\n9.1\n9.2\n0\n.1\n.2\n", TENTHS[:6], ["mended stamps"])),
    Case("34e", "all stamps are 0", "refused", "10 Hz assumed, and reported",
         stamped(numbered(4), "0\n0\n0\n0\n", TENTHS[:4], ["no time stamps"])),
    Case("34f", "a header, and file names (EuRoC)", "refused", "right",
         stamped(["a1", "b2", "c3"], "#timestamp [ns],filename\n" + "".join(
             f"{EPOCH * 10**9 + k * 10**8},{name}.npy\n" for k, name in ((2, "c3"), (0, "a1"), (1, "b2"))),
             TENTHS[:3])),
    Case("34g", "a byte order mark, CRLF and a header", "refused", "right",
         stamped(numbered(3), b"\xef\xbb\xbftime\r\n0\r\n0.1\r\n0.2\r\n", TENTHS[:3])),
    Case("34h", "columns of number and time", "refused", "right",
         stamped(numbered(3), "0 5.0\n1 5.1\n2 5.2\n", TENTHS[:3])),
    Case("34i", "columns of seconds and nanoseconds", "refused", "right",
         stamped(numbered(3), "".join(f"{EPOCH},{k * 10**8 + 5000}\n" for k in range(3)), TENTHS[:3])),
    Case("34j", "decimal commas", "refused", "right", stamped(numbered(3), "0,0\n0,1\n0,2\n", TENTHS[:3])),
    Case("34k", "decimal commas and semicolons", "refused", "right",
         stamped(numbered(3), "n;t\n0;0,00\n1;0,10\n2;0,20\n", TENTHS[:3])),
    Case("34l", "stamps in ns", "refused", "right",
         stamped(numbered(3), "".join(f"{EPOCH * 10**9 + k * 10**8}\n" for k in range(3)), TENTHS[:3],
                 said="times.txt, ns")),
    Case("34m", "stamps in ms, from 0", "refused", "right", stamped(numbered(3), "0\n100\n200\n", TENTHS[:3])),
    Case("34n", "dates", "refused", "right",
         stamped(numbered(3), "".join(f"2024-01-01 12:00:0{k}.5\n" for k in range(3)), [0, 1, 2])),
    Case("34o", "one line that is not a number", "refused", "interpolated, and reported",
         stamped(numbered(4), "0\n?\n.2\n.3\n", TENTHS[:4], ["mended stamps"])),
    Case("34p", "fewer times than scans", "refused", "refused", refused("0\n1\n", "2 rows for 3 scans")),
    Case("34q", "words in place of times", "refused", "refused", refused("a\nb\nc\n", "one number per line")),
    Case("34r", "UTF-16, as Windows writes it", "refused", "right",
         stamped(numbered(3), "0\n0.1\n0.2\n".encode("utf-16"), TENTHS[:3])),
    Case("34s", "empty lines between all lines", "right", "right",
         stamped(numbered(3), "0\n\n0.1\n\n0.2\n", TENTHS[:3])),
    Case("R4a", "points of a third of a turn, ahead", "stretched to a whole sweep", "33 to 67 ms of a 100 ms sweep",
         timed(lambda _: {"time": (0.1 * (1 + FRACTION) / 3).astype("f4")}, "66.7 ms of a 100 ms sweep",
               0.1 * (1 + FRACTION) / 3, fraction=(1 + FRACTION) / 3)),
    Case("R4b", "every second scan kept and renumbered", "stretched to 200 ms", "0 to 100 ms of a 100 ms sweep",
         timed(lambda _: {"t": (1e9 * T).astype(np.uint32)}, "100 ms of a 100 ms sweep", T, step=0.2)),
    Case("R4c", "one time is NaN", "no times for the scan, no message",
         "time interpolated between the neighbouring points",
         timed(lambda _: {"time": spoilt(T, np.nan, 7).astype("f4")}, "s, relative", spoilt(T, (T[6] + T[8]) / 2, 7),
               odd=["stray point times"])),
    Case("R4d", "half of a scan's times are NaN", "no times for the scan, no message", "no times, and reported",
         one_scan_without),
    Case("R8", "the map of a run among the scans", "read as a scan", "left out", odd_files("map.pcd")),
    Case("R9", "seconds with fewer digits in some names", "one scan in ten out of order",
         "in order, and the names are the stamps",
         stamped([f"{t}" for t in UNEVEN], None, TENTHS, order=[f"{t}" for t in UNEVEN])),
    Case("R10", "lasers numbered in firing order", "13 % of the rings right", "all right, by the laser lines",
         rings_as("u1", lambda ring: np.argsort(np.r_[0:16:2, 1:16:2])[ring], "vlp16")),
    Case("R10b", "rings from 1 (Hesai)", "the run ended", "right", rings_as("u2", lambda ring: ring + 1, "vlp16")),
    Case("R19a", "a dark scan of a sensor with intensities 0 to 255", "six times brighter", "scaled as the sequence",
         bright(np.full(40, 200, "f4"), np.full(40, 0.7, "f4"), 0.7 / 255)),
    Case("R19b", "intensity as uint8", "a dark scan brighter", "255 is full intensity",
         bright(np.full(40, 1, "u1"), np.full(40, 51, "u1"), 0.2)),
    Case("R19c", "16-bit intensity (Ouster's signal)", "most points at full intensity",
         "scaled by the brightest points of the first scans",
         bright(np.linspace(0, 4000, 40).astype("u2"), np.full(40, 1980, "u2"), 0.5)),
    Case("R19d", "intensity 0 to 1", "right", "right", bright(np.full(40, 0.9, "f4"), np.full(40, 0.3, "f4"), 0.3)),
    Case("R20", "macOS's companion files", "read as scans", "left out",
         odd_files("._000000.npy", "._000001.npy", ".000002.npy")),
    Case("K1", "times in us", "right", "right",
         timed(lambda _: {"t": (1e6 * T).astype(np.uint32)}, "us, relative", T,
               tolerance=2e-6)),
    Case("K2", "times in ms", "right", "right", timed(lambda _: {"time": (1e3 * T).astype("f4")}, "ms, relative", T)),
    Case("K3", "times as shares of the sweep, 0 to 1", "right", "shares of a sweep of 100 ms",
         timed(lambda _: {"time": FRACTION.astype("f4")}, "sweep, relative", T)),
    Case("K4", "absolute times in us", "right", "right",
         timed(lambda k: {"timestamp": clock(k, 1e-6)}, "us, absolute", T)),
    Case("K5", "a clock that starts with the sensor", "right", "relative to the first point of each scan",
         timed(lambda k: {"t": ((12345 + 0.1 * k + T) * 1e9).astype(np.uint64)}, "ns, absolute", T - T[0])),
    Case("K5b", "us of the hour (Velodyne)", "right", "relative to the first point of each scan",
         timed(lambda k: {"time": (2_000_000_000 + 1e5 * k + 1e6 * T).astype(np.uint32)}, "us, absolute", T - T[0],
               tolerance=2e-6)),
    Case("K6", "organised clouds, by columns and by rows", "right", "right", column_major),
    Case("K7", "points of half a turn, before the stamp", "stretched to a whole sweep", "stamp = end",
         timed(lambda _: {"time": (T / 2 - 0.05).astype("f4")}, "stamp = end", T / 2 - 0.05, fraction=HALF)),
    Case("K8", "no times.txt, points that span 50 ms", "10 Hz assumed", "20 Hz, by the points", without_times),
    Case("K9", "no times.txt, points with absolute times", "10 Hz assumed", "5 Hz, by the absolute times",
         clock_without_times),
    Case("K10", "a stated field that does not exist", "could not be stated", "refused; the existing fields are listed",
         wrong_field),
    Case("K11", "packets: 75 different times in a scan", "right", "right",
         timed(lambda _: {"time": (np.floor(75 * FRACTION) / 750).astype("f4")}, "s, relative",
               np.floor(75 * FRACTION) / 750)),
    Case("K12", "names sec_nsec", "10 Hz assumed", "the names are the stamps",
         stamped([f"cloud_{EPOCH}_{k * 10**8 % 10**9:09d}" for k in range(10)], None, TENTHS[:10])),
    Case("K13", "names sec_nsec, not zero-padded", "out of order", "in order, and the names are the stamps",
         stamped([f"cloud_{EPOCH}_{k * 10**8 + 1620000}" for k in range(10)], None, TENTHS[:10])),
    Case("K14", "names sec.nsec, not zero-padded", "10 Hz assumed", "in order, and the names are the stamps",
         stamped([f"{EPOCH}.{k * 10**8 + 1620000}" for k in range(10)], None, TENTHS[:10])),
    Case("K15", "dates in names", "10 Hz assumed", "the names are the stamps",
         stamped([f"2024-01-01-12-00-0{k}" for k in range(5)], None, [0, 1, 2, 3, 4])),
    Case("K16", "a constant number after the frame number", "gap not detected", "the gap is reported",
         stamped([f"{k:04d}_lidar0" for k in (0, 1, 2, 5)], None, [0, 0.1, 0.2, 0.5],
                 ["gap in numbering", "no time stamps"])),
    Case("K17", "version numbers in names", "right", "right",
         stamped([f"run1.{k}" for k in range(1, 12)], None, TENTHS[:11], ["no time stamps"],
                 order=[f"run1.{k}" for k in range(1, 12)])),
    Case("K18", "times.txt of zeros, names in ns", "refused", "the names are the stamps",
         stamped([f"{EPOCH * 10**9 + k * 10**8}" for k in range(4)], "0\n0\n0\n0\n", TENTHS[:4])),
]  # fmt: skip


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.number)
def test_times_names_and_stamps_are_read_as_intended(case: Case, tmp_path: Path) -> None:
    case.check(tmp_path)


def test_case_numbers_are_unique() -> None:
    assert len({case.number for case in CASES}) == len(CASES)


def test_a_dataset_states_the_source_of_its_stamps(tmp_path: Path) -> None:
    write(tmp_path, (scan(FRACTION[:40]) for _ in range(3)))
    data: Dataset = open_dataset(tmp_path)
    assert data.stamps_from == "times.txt, s"  # type: ignore[attr-defined]
