"""A folder of scans and a command for inputs that caused errors, and ground truth files to put into it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from slam.data import se3
from slam.data.cloud import Array
from slam.data.dataset import Dataset, open_dataset
from slam.data.errors import InputError

SCANS, START = 300, 1.7e9
STAMPS = START + 0.1 * np.arange(SCANS)
#: T_world_lidar: half a metre per scan along x, in bends.
POSES = np.array([se3.exp(np.array([0, 0, 0.3 * np.sin(k / 40), 0, 0, 0])) for k in range(SCANS)])
POSES[1:, :2, 3] = np.cumsum(0.5 * POSES[:-1, :2, 0], axis=0)
#: Rotation to the axes of camera 0 (x right, y down, z forward), and a lever arm.
T_CAMERA_LIDAR = np.array([[0, -1, 0, 0.1], [0, 0, -1, -0.2], [1, 0, 0, -0.3], [0, 0, 0, 1.0]])
CALIBRATION = """K: [[700, 0, 600], [0, 700, 180], [0, 0, 1]]
T_camera_lidar: [[0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1]]
"""


@dataclass(frozen=True)
class Bench:
    """Fixtures of a case.

    Attributes:
        folder: A sequence of SCANS scans of three points each, with times.txt.
        lidarlift: The command, in this process.
        street: Writes the short sequence in KITTI's layout.
        street_poses: True poses of this sequence.
        street_scans: Scans of this sequence, (N, 4) float32.
    """

    folder: Path
    lidarlift: Callable[..., Any]
    street: Callable[..., Path]
    street_poses: Array
    street_scans: list[Array]

    def poses(self, *lines: str) -> None:
        (self.folder / "poses.txt").write_text("\n".join(lines) + "\n", encoding="utf-8")


Play = Callable[[Bench], None]


@dataclass(frozen=True)
class Case:
    """One input.

    Attributes:
        number: Number of the input (41), of a similar one (41b), or of a finding of a review (R12).
        title: Property of the input.
        before: Result of earlier versions.
        now: Result.
        play: Writes the input and checks the result.
    """

    number: str
    title: str
    before: str
    now: str
    play: Play

    def __str__(self) -> str:
        return f"{self.number} {self.title}".replace(" ", "-")


def rows(order: str = "xyzw", stamps: Array = STAMPS, poses: Array = POSES) -> Array:
    """(N, 8): stamp, position, quaternion."""
    quaternion = Rotation.from_matrix(poses[:, :3, :3]).as_quat()
    return np.column_stack([stamps, poses[:, :3, 3], quaternion if order == "xyzw" else quaternion[:, [3, 0, 1, 2]]])


def text(table: Array, comma: str = " ") -> list[str]:
    return [comma.join(f"{value:.9g}" if k else f"{value:.3f}" for k, value in enumerate(row)) for row in table]


def truth(*kinds: str, known: Array | slice = slice(None), poses: Array = POSES) -> Callable[[Dataset], None]:
    """Check that exactly the scans `known` have the ground truth `poses`, and that the problems are of these kinds."""

    def check(data: Dataset) -> None:
        assert [problem.kind for problem in data.problems] == list(kinds)
        found = data.ground_truth
        assert found is not None
        having = np.isfinite(found[:, 0, 0])
        expected = np.zeros(len(data), bool)
        expected[known] = True
        np.testing.assert_array_equal(having, expected)
        first = np.argmax(having)
        np.testing.assert_allclose(found[having], (se3.inverse(poses[first]) @ poses)[having], atol=2e-3)

    return check


def no_truth(*kinds: str) -> Callable[[Dataset], None]:
    def check(data: Dataset) -> None:
        assert [problem.kind for problem in data.problems] == list(kinds)
        assert data.ground_truth is None

    return check


def opened(
    lines: Sequence[str], check: Callable[[Dataset], None], sensor: str | None = None
) -> Callable[[Bench], None]:
    """Open the sequence with these lines as poses.txt."""

    def play(bench: Bench) -> None:
        bench.poses(*lines)
        if sensor:
            (bench.folder / "sensor.yaml").write_text(sensor)
        check(open_dataset(bench.folder))

    return play


def refused(lines: Sequence[str], *words: str) -> Play:
    def play(bench: Bench) -> None:
        bench.poses(*lines)
        with pytest.raises(InputError, match=r"poses\.txt") as error:
            open_dataset(bench.folder)
        assert all(word in str(error.value) for word in words), str(error.value)

    return play


def changed(values: Array, at: int | slice, to: float, columns: slice = slice(None)) -> Array:
    table = values.copy()
    table[at, columns] = to
    return table


def without(*gone: int) -> Array:
    return np.setdiff1d(np.arange(SCANS), gone)


def euroc() -> list[str]:
    header = "#timestamp [ns], p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], q_RS_y [], q_RS_z []"
    header += "".join(f", {name}_{axis} [u]" for name in ("v_RS_R", "b_w_RS_S", "b_a_RS_S") for axis in "xyz")
    table = rows("wxyz")[:, 1:]
    lines = [
        ",".join([f"{int(1000 * stamp) * 10**6}", *map(str, row), *["0.1"] * 9])
        for stamp, row in zip(STAMPS, table, strict=True)
    ]
    return [header, *lines]


def kitti() -> Array:
    return POSES[:, :3].reshape(-1, 12).copy()


def nanoseconds() -> list[str]:
    lines = zip(STAMPS, text(rows()), strict=True)
    return [f"{round(10 * stamp)}00000000 {line.partition(' ')[2]}" for stamp, line in lines]


def numbered(columns: int) -> list[str]:
    """KITTI-360's format: the frame number first; every fifth frame from the tenth."""
    full = POSES.reshape(-1, 16)[:, : columns - 1]
    return [" ".join([str(k), *map(str, full[k])]) for k in range(10, SCANS, 5)]


def mirrored() -> list[str]:
    table = kitti()
    table[4, [1, 5, 9]] *= -1
    return text(table)


ONE_HZ = np.arange(0, SCANS, 10)
COARSE = se3.interpolate(STAMPS[ONE_HZ], POSES[ONE_HZ], STAMPS)
FINE = START + 0.01 * np.arange(10 * SCANS)
LINE = np.tile(np.eye(4), (SCANS, 1, 1))
LINE[:, 0, 3] = np.arange(SCANS)
