"""Damaged input: each kind ends in a correct result, with the damage reported, or in an error of one line."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.faults.process import run
from slam.data.cloud import Array
from slam.data.pose_files import read_poses

FRAMES, AT = 16, 8  # of the sequence, and the one that is damaged
LIMIT = 300.0  # s; a run that takes longer has hung
TOLERANCE = 0.5  # m between the poses of sound scans with and without the damage

Damage = Callable[[Path], object]


def _scan(folder: Path, number: int = AT) -> Path:
    return folder / "velodyne" / f"{number:06d}.bin"


def _image(folder: Path) -> Path:
    return folder / "image_2" / f"{AT:06d}.png"


def _points(change: Callable[[Array], Array]) -> Damage:
    """Change the points (N, 4) float32 of the scan."""

    def damage(folder: Path) -> None:
        points = np.fromfile(_scan(folder), np.float32).reshape(-1, 4)
        _scan(folder).write_bytes(np.ascontiguousarray(change(points)).tobytes())

    return damage


def _bytes(change: Callable[[bytes], bytes], file: Callable[[Path], Path] = _scan) -> Damage:
    """Change the bytes of a file."""
    return lambda folder: file(folder).write_bytes(change(file(folder).read_bytes()))


def _lines(name: str, change: Callable[[list[str]], list[str]]) -> Damage:
    """Change the lines of a text file of the sequence."""

    def damage(folder: Path) -> None:
        lines = (folder / name).read_text(encoding="utf-8").splitlines()
        (folder / name).write_text("".join(f"{line}\n" for line in change(lines)), encoding="utf-8")

    return damage


def _set(points: Array, rows: slice, columns: slice, value: float) -> Array:
    points[rows, columns] = value
    return points


def _matrix(name: str, change: Callable[[Array], Array]) -> Damage:
    """Change a matrix (3, 4) of calib.txt."""

    def changed(lines: list[str]) -> list[str]:
        result = []
        for line in lines:
            key, _, values = line.partition(":")
            if key == name:
                matrix = change(np.array(values.split(), float).reshape(3, 4))
                line = f"{name}: {' '.join(f'{value:.9e}' for value in matrix.ravel())}"
            result.append(line)
        return result

    return _lines("calib.txt", changed)


def _written(change: Callable[[Array], Array]) -> Damage:
    """Change the image (H, W, 3)."""

    def damage(folder: Path) -> None:
        import cv2

        image = cv2.imread(str(_image(folder)))
        assert image is not None
        cv2.imwrite(str(_image(folder)), change(image))

    return damage


def _removed(*names: str) -> Damage:
    def damage(folder: Path) -> None:
        for name in names:
            path = folder / name
            shutil.rmtree(path) if path.is_dir() else path.unlink()

    return damage


def _stamps(change: Callable[[Array], Array]) -> Damage:
    return _lines("times.txt", lambda lines: [f"{stamp:.9e}" for stamp in change(np.array(lines, float))])


def _truth(change: Callable[[list[str]], list[str]]) -> Damage:
    return lambda folder: _lines("../../poses/00.txt", change)(folder)


def _without(folder: Path, numbers: range) -> None:
    for number in numbers:
        _scan(folder, number).unlink()


def _folder_in_place(path: Path) -> None:
    path.unlink()
    path.mkdir()


def _link_in_place(path: Path) -> None:
    path.unlink()
    path.symlink_to("nothing")


SCAN_DAMAGE: dict[str, Damage] = {
    "empty file": _bytes(lambda _: b""),
    "cut off within a point": _bytes(lambda content: content[: len(content) // 2 + 7]),
    "cut off after 40 points": _bytes(lambda content: content[:640]),
    "zeros": _bytes(lambda content: bytes(len(content))),
    "text": _bytes(lambda _: b"no such scan\n" * 500),
    "random bytes": _bytes(lambda content: np.random.default_rng(1).bytes(len(content))),
    "the other byte order": _points(lambda points: points.byteswap()),
    "NaN in all points": _points(lambda points: _set(points, slice(None), slice(3), np.nan)),
    "NaN in half of the points": _points(lambda points: _set(points, slice(None, None, 2), slice(3), np.nan)),
    "infinity in all points": _points(lambda points: _set(points, slice(None), slice(3), np.inf)),
    "infinity in half of the points": _points(lambda points: _set(points, slice(None, None, 2), slice(3), -np.inf)),
    "1e30 m in half of the points": _points(lambda points: _set(points, slice(None, None, 2), slice(3), 1e30)),
    "NaN in all intensities": _points(lambda points: _set(points, slice(None), slice(3, 4), np.nan)),
    "intensities of -1e9": _points(lambda points: _set(points, slice(None), slice(3, 4), -1e9)),
    "all points equal": _points(lambda points: np.tile(points[:1], (len(points), 1))),
    "one point": _points(lambda points: points[:1]),
    "three points": _points(lambda points: points[:3]),
    "10 million points": _points(lambda _: np.random.default_rng(0).normal(0, 20, (10_000_000, 4)).astype(np.float32)),
    "x and y swapped": _points(lambda points: points[:, [1, 0, 2, 3]]),
    "x reflected": _points(lambda points: points * np.array([-1, 1, 1, 1], np.float32)),
    "in millimetres": _points(lambda points: points * np.array([1000, 1000, 1000, 1], np.float32)),
    "points in random order": _points(lambda points: np.random.default_rng(2).permutation(points)),
    "each point twice": _points(lambda points: np.repeat(points, 2, axis=0)),
    "the scan before": lambda folder: shutil.copy(_scan(folder, AT - 1), _scan(folder)),
    "a scan of another place": lambda folder: shutil.copy(_scan(folder, 0), _scan(folder)),
    "missing file": lambda folder: _scan(folder).unlink(),
    "a folder in place of the file": lambda folder: _folder_in_place(_scan(folder)),
    "a link to nothing": lambda folder: _link_in_place(_scan(folder)),
    "three missing files, 10 m": lambda folder: _without(folder, range(AT, AT + 3)),
    "all scans empty": lambda folder: [path.write_bytes(b"") for path in (folder / "velodyne").iterdir()],
    "no scans": lambda folder: _without(folder, range(FRAMES)),
}
OTHER_DAMAGE: dict[str, Damage] = {
    "stamps missing": _removed("times.txt"),
    "stamps too few": _lines("times.txt", lambda lines: lines[:-3]),
    "stamps too many": _lines("times.txt", lambda lines: [*lines, *lines]),
    "stamps duplicate": _stamps(lambda stamps: np.concatenate([stamps[:AT], stamps[AT - 1 : -1]])),
    "stamps reversed": _stamps(lambda stamps: stamps[::-1]),
    "stamps jump an hour": _stamps(lambda stamps: stamps + 3600.0 * (np.arange(len(stamps)) >= AT)),
    "stamps NaN": _stamps(lambda stamps: np.where(np.arange(len(stamps)) == AT, np.nan, stamps)),
    "stamps text": _lines("times.txt", lambda lines: ["noon"] * len(lines)),
    "image empty": _bytes(lambda _: b"", _image),
    "image cut off": _bytes(lambda content: content[:1000], _image),
    "image of random bytes": _bytes(lambda _: np.random.default_rng(3).bytes(1000), _image),
    "image of 16 bits": _written(lambda image: image.astype(np.uint16) * 257),
    "image grey": _written(lambda image: image[:, :, 0]),
    "image of one pixel": _written(lambda image: image[:1, :1]),
    "image missing": lambda folder: _image(folder).unlink(),
    "calibration missing": _removed("calib.txt"),
    "calibration with a reflection": _matrix("Tr", lambda matrix: matrix * np.array([[1], [1], [-1]])),
    "calibration not a rotation": _matrix("Tr", lambda matrix: 2 * matrix),
    "calibration NaN": _matrix("Tr", lambda matrix: np.nan * matrix),
    "focal length 0": _matrix("P2", lambda matrix: matrix * np.array([[0], [0], [1]])),
    "calibration text": _lines("calib.txt", lambda _: ["Tr: to be done"]),
    "ground truth jumps 5 m": _truth(lambda lines: [*lines[:AT], *_moved(lines[AT:])]),
    "ground truth NaN": _truth(lambda lines: [*lines[:AT], " ".join(["nan"] * 12), *lines[AT + 1 :]]),
    "ground truth zeros": _truth(lambda lines: [*lines[:AT], " ".join(["0"] * 12), *lines[AT + 1 :]]),
    "ground truth too short": _truth(lambda lines: lines[:AT]),
    "ground truth text": _truth(lambda _: ["no poses"]),
    "sensor file text": _lines("sensor.yaml", lambda _: ["]["]),
    "sensor unknown": _lines("sensor.yaml", lambda _: ["model: vlp17"]),
}


def _moved(lines: list[str]) -> list[str]:
    poses = np.array([line.split() for line in lines], float)
    poses[:, 11] += 5
    return [" ".join(f"{value:.9e}" for value in pose) for pose in poses]


def campaign(drive: Path, folder: Path) -> dict[str, Any]:
    """Run over the first scans of a drive with each kind of damage.

    Args:
        drive: A simulated data set in KITTI's layout.
        folder: An empty folder.

    Returns:
        By kind of damage: how the run ended, what was said, and the largest distance [m] of sound scans from their
        positions without damage.
    """
    _copied(drive, folder / "sound")
    sound = run(folder / "sound", folder / "sound-run", limit=LIMIT)
    assert sound.how == "done", sound.message
    expected = _positions(folder / "sound-run")
    found = {}
    for part, kinds in (("scan", SCAN_DAMAGE), ("", OTHER_DAMAGE)):
        for kind, damage in kinds.items():
            data, out = folder / "data", folder / "run"
            _copied(drive, data)
            damage(data / "sequences" / "00")
            ending = run(data, out, limit=LIMIT)
            said = ending.message.replace(f"{data}/", "").replace(str(data), "the folder")
            result = _result(out, expected) if ending.how == "done" else {"said": said}
            found[f"{part}: {kind}" if part else kind] = {"how": ending.how, **result}
            for path in (data, out):
                shutil.rmtree(path, ignore_errors=True)
    return found


def is_sound(figures: dict[str, Any]) -> bool:
    """Check whether a run ended as it must."""
    if figures["how"] == "done":
        return bool(figures["off"] < TOLERANCE)
    return figures["how"] == "error in one line" and "\n" not in figures["said"]


def _copied(drive: Path, folder: Path) -> None:
    """Copy the first scans with images, calibration, stamps and poses."""
    source, target = drive / "sequences" / "00", folder / "sequences" / "00"
    for kind, suffix in (("velodyne", "bin"), ("image_2", "png")):
        (target / kind).mkdir(parents=True)
        for number in range(FRAMES):
            shutil.copy(source / kind / f"{number:06d}.{suffix}", target / kind)
    for name in ("calib.txt", "sensor.yaml"):
        shutil.copy(source / name, target)
    (folder / "poses").mkdir()
    for path in (Path("sequences", "00", "times.txt"), Path("poses", "00.txt")):
        lines = (drive / path).read_text(encoding="utf-8").splitlines()[:FRAMES]
        (folder / path).write_text("".join(f"{line}\n" for line in lines), encoding="utf-8")


def _positions(out: Path) -> dict[int, Array]:
    """Positions (3,) of the scans by their numbers."""
    rows = (out / "timings.csv").read_text(encoding="utf-8").splitlines()[1:]
    numbers = [int(row.split(",")[0]) for row in rows]
    return dict(zip(numbers, read_poses(out / "trajectory_kitti.txt")[1][:, :3, 3], strict=True))


def _result(out: Path, expected: dict[int, Array]) -> dict[str, Any]:
    """What a run says about damage, and the largest distance of its sound scans [m] to the expected positions."""
    report = json.loads((out / "run.json").read_text(encoding="utf-8"))
    found = _positions(out)
    statuses = {
        int(row.split(",")[0]): row.split(",")[2]
        for row in (out / "timings.csv").read_text(encoding="utf-8").splitlines()[1:]
    }
    sound = [number for number in found if statuses[number] != "failed" and number != AT]
    off = max((float(np.linalg.norm(found[number] - expected[number])) for number in sound), default=0.0)
    failed = [number for number, status in statuses.items() if status == "failed"]
    problems = sorted({key for key in report["counts"] if key not in COUNTS})
    return {"off": round(off, 3), "failed": len(failed), "said": ", ".join(problems).replace("_", " ")}


COUNTS = ("frames", "registered", "retried", "degenerate", "failed")
