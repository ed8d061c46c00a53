"""Poses at the stamps for any instant of the sweep, and equal results for all file formats."""

from __future__ import annotations

import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from slam.config import load_config
from slam.data import se3
from slam.data.cloud import PointCloud
from slam.data.dataset import open_dataset
from slam.mid_sweep import middle_of
from slam.pipeline import Pipeline
from slam.run import Run
from slam.simulation.layouts import FolderLayout
from slam.simulation.rig import SimulatedFrame
from slam.simulation.simulation import Simulation, SimulationConfig

Array = np.ndarray
FRAMES, EPOCH = 30, 1_700_000_000


@pytest.fixture(scope="module")
def simulation() -> Simulation:
    """A VLP-16 on a straight road at 20 m/s, with motion distortion."""
    return Simulation(SimulationConfig(drive="straight", spacing=2.0, sensor="vlp16", distort=True, camera=False))


@pytest.fixture(scope="module")
def frames(simulation: Simulation) -> list[SimulatedFrame]:
    return [simulation.rig.frame(number) for number in range(FRAMES)]


def run(folder: Path, **said: str) -> Run:
    return Pipeline(load_config(None, ["loops.enabled=false"])).run(open_dataset(folder, **said))


def ate(result: Run) -> float:
    """Root mean square distance [m] to the ground truth after alignment."""
    truth = result.ground_truth
    assert truth is not None
    found, true = result.poses[:, :3, 3], truth[:, :3, 3]
    u, _, v = np.linalg.svd((true - true.mean(0)).T @ (found - found.mean(0)))
    turn = u @ np.diag([1, 1, np.linalg.det(u @ v)]) @ v
    return float(np.sqrt(np.mean(np.sum(((found - found.mean(0)) @ turn.T - (true - true.mean(0))) ** 2, axis=1))))


def test_poses_refer_to_the_stamps(simulation: Simulation, frames: list[SimulatedFrame], tmp_path: Path) -> None:
    """At 20 m/s half a sweep is a metre."""
    errors, steps = {}, {}
    for stamp in ("start", "middle", "end"):
        layout = FolderLayout(tmp_path / stamp, 0.1, stamp)
        for number, frame in enumerate(frames):
            layout.write(frame, number)
        layout.write_surroundings(simulation.rig, simulation.drive.stamps)
        rows = (tmp_path / stamp / "times.txt").read_text().splitlines()[:FRAMES]
        (tmp_path / stamp / "times.txt").write_text("\n".join(rows) + "\n")
        result = run(tmp_path / stamp)
        assert result.counts()["registered"] == FRAMES
        assert result.times().endswith(f"in {FRAMES} of {FRAMES} scans; stamp = {stamp}")
        np.testing.assert_array_equal(result.poses[0], np.eye(4))
        errors[stamp], steps[stamp] = ate(result), result.poses[1, 0, 3]
    assert max(errors.values()) < 0.05
    assert max(errors.values()) - min(errors.values()) < 0.01
    assert steps == pytest.approx(dict.fromkeys(steps, 2.0), abs=0.05)


def test_poses_refer_to_the_stamp_that_is_set(frames: list[SimulatedFrame], tmp_path: Path) -> None:
    """The same files with stamps of the start and of the end: the same trajectory, one sweep later."""
    layout = FolderLayout(tmp_path, 0.1, "start")
    for number, frame in enumerate(frames[:12]):
        layout.write(frame, number)
    (tmp_path / "times.txt").write_text("".join(f"{0.1 * k:.1f}\n" for k in range(12)))
    (tmp_path / "sensor.yaml").write_text("model: vlp16\nstamp: middle\n")
    runs = {stamp: run(tmp_path, stamp=stamp) for stamp in ("start", "end")}
    assert "-100 to " in runs["end"].times()
    assert run(tmp_path).times().endswith("stamp = middle")
    clouds = [open_dataset(tmp_path, stamp=stamp)[3].cloud for stamp in ("start", "end")]
    np.testing.assert_allclose(clouds[0].time - clouds[1].time, 0.1, atol=1e-6)  # type: ignore[operator]
    apart = se3.inverse(runs["start"].poses[4:]) @ runs["end"].poses[4:]
    assert np.abs(apart[:, :3, 3]).max() < 0.3  # both start at their first stamp with constant speed


@pytest.mark.parametrize(
    ("first", "last", "middle"),
    [(0, 0.1, 0.05), (-0.1, 0, -0.05), (-0.05, 0.05, 0), (-0.051, 0.052, 0), (0.03, 0.07, 0.05)],
)
def test_the_middle_of_a_sweep(first: float, last: float, middle: float) -> None:
    assert middle_of(np.linspace(first, last, 1001).astype(np.float32)) == pytest.approx(middle, abs=1e-6)


# ---- the same points in files of all kinds

XYZI = np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("intensity", "<f4")])


def pcd(data: str) -> Callable[[Array], bytes]:
    def content(points: Array) -> bytes:
        header = (
            "VERSION 0.7\nFIELDS x y z intensity\nSIZE 4 4 4 4\nTYPE F F F F\nCOUNT 1 1 1 1\n"
            f"WIDTH {len(points)}\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {len(points)}\nDATA {data}\n"
        ).encode()
        if data == "binary":
            return header + points.tobytes()
        if data == "ascii":
            return header + rows(points)
        columns = b"".join(np.ascontiguousarray(points[name]).tobytes() for name in XYZI.names or ())
        blocks = [columns[at : at + 32] for at in range(0, len(columns), 32)]
        packed = b"".join(bytes([len(block) - 1]) + block for block in blocks)  # LZF without back references
        return header + struct.pack("<II", len(packed), len(columns)) + packed

    return content


def ply(form: str) -> Callable[[Array], bytes]:
    def content(points: Array) -> bytes:
        lines = ["ply", f"format {form} 1.0", f"element vertex {len(points)}"]
        lines += [f"property float {name}" for name in XYZI.names or ()]
        header = "\n".join([*lines, "end_header", ""]).encode()
        if form == "ascii":
            return header + rows(points)
        return header + (points if "little" in form else points.astype(XYZI.newbyteorder(">"))).tobytes()

    return content


def rows(points: Array) -> bytes:
    """Rows of text with enough digits for float32."""
    return "".join(" ".join(f"{value:.9g}" for value in point) + "\n" for point in points.tolist()).encode()


def npy(points: Array) -> bytes:
    form = f"{{'descr': {XYZI.descr}, 'fortran_order': False, 'shape': ({len(points)},), }}"
    header = form.encode().ljust((10 + len(form)) // 64 * 64 + 53) + b"\n"
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header + points.tobytes()


KINDS: dict[str, tuple[str, Callable[[Array], bytes]]] = {
    "bin": (".bin", lambda points: points.tobytes()),
    **{f"pcd {data}": (".pcd", pcd(data)) for data in ("ascii", "binary", "binary_compressed")},
    **{f"ply {form}": (".ply", ply(form)) for form in ("ascii", "binary_little_endian", "binary_big_endian")},
    "npy": (".npy", npy),
}
NAMES: dict[str, Callable[[int], str]] = {
    "numbers": lambda k: f"{k:06d}",
    "seconds": lambda k: f"{EPOCH}.{k}",
    "nanoseconds": lambda k: f"{EPOCH * 10**9 + k * 10**8}",
}


@pytest.fixture(scope="module")
def tables(frames: list[SimulatedFrame]) -> list[Array]:
    found = []
    for frame in frames[:6]:
        table = np.empty(len(frame.scan.xyz), XYZI)
        for axis, name in enumerate("xyz"):
            table[name] = frame.scan.xyz[:, axis]
        table["intensity"] = frame.scan.reflectance
        found.append(table)
    return found


@pytest.fixture(scope="module")
def expected(tables: list[Array]) -> Array:
    from slam.data.cloud import Frame
    from slam.slam import Slam

    with Slam(load_config(None, ["loops.enabled=false"])) as slam:
        for k, table in enumerate(tables):
            xyz = np.column_stack([table[axis] for axis in "xyz"])
            slam.add(Frame(k, (EPOCH * 10 + k) / 10, PointCloud(xyz, table["intensity"])))
        return slam.finish().poses


@pytest.mark.parametrize("names", NAMES)
@pytest.mark.parametrize("kind", KINDS)
def test_all_formats_give_the_same_bytes(
    kind: str, names: str, tables: list[Array], expected: Array, tmp_path: Path
) -> None:
    suffix, content = KINDS[kind]
    for k, table in enumerate(tables):
        (tmp_path / (NAMES[names](k) + suffix)).write_bytes(content(table))
    if names == "numbers":
        (tmp_path / "times.txt").write_text("".join(f"{EPOCH}.{k}\n" for k in range(len(tables))))
    assert run(tmp_path, sensor="vlp16").poses.tobytes() == expected.tobytes()
