"""Rigid motions, deskewing, the vertical correction and pose files."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from slam.data import se3
from slam.data.cloud import PointCloud
from slam.data.distortion import correct_vertical, deskew
from slam.data.errors import InputError
from slam.data.pose_files import kitti_text, read_poses, tum_text

tangents = st.tuples(
    st.lists(st.floats(-1.7, 1.7), min_size=3, max_size=3), st.lists(st.floats(-100, 100), min_size=3, max_size=3)
).map(lambda parts: np.array(parts[0] + parts[1]))


@given(tangents)
def test_log_inverts_exp(xi: np.ndarray) -> None:
    assert se3.log(se3.exp(xi)) == pytest.approx(xi, abs=1e-7)


@given(tangents, tangents)
def test_inverse_and_angle_match_their_definitions(xi: np.ndarray, other: np.ndarray) -> None:
    T = se3.exp(xi)
    assert se3.inverse(T) @ T == pytest.approx(np.eye(4), abs=1e-9)
    assert se3.inverse(np.stack([T, se3.exp(other)]))[0] == pytest.approx(np.linalg.inv(T), abs=1e-9)
    assert se3.angle(T) == pytest.approx(np.linalg.norm(xi[:3]), abs=1e-7)


@given(tangents)
def test_half_a_motion_applied_twice_is_the_whole_motion(xi: np.ndarray) -> None:
    T = se3.exp(xi)
    assert se3.scale(T, 0.5) @ se3.scale(T, 0.5) == pytest.approx(T, abs=1e-7)


def test_interpolation_is_linear_and_spherical() -> None:
    poses = np.stack([np.eye(4), se3.exp(np.array([0, 0, 1.0, 0, 0, 0]))])
    poses[1, :3, 3] = [4, 0, 0]
    found = se3.interpolate(np.array([0.0, 1]), poses, np.array([-1, 0.25, 2]))
    assert found[1, :3, 3] == pytest.approx([1, 0, 0])
    assert Rotation.from_matrix(found[1, :3, :3]).as_rotvec() == pytest.approx([0, 0, 0.25])
    assert found[0] == pytest.approx(poses[0])
    assert found[2] == pytest.approx(poses[1])


def a_cloud(seed: int, timed: bool = True) -> PointCloud:
    rng = np.random.default_rng(seed)
    xyz = rng.uniform(-40, 40, (50, 3))
    return PointCloud(xyz, rng.random(50), time=rng.uniform(-0.05, 0.05, 50) if timed else None)


def test_deskewing_at_zero_velocity_changes_nothing() -> None:
    cloud = a_cloud(0)
    np.testing.assert_allclose(deskew(cloud, np.zeros(6)).xyz, cloud.xyz, rtol=1e-6)


def test_a_cloud_without_times_is_returned_unchanged() -> None:
    cloud = a_cloud(0, timed=False)
    assert deskew(cloud, np.ones(6)) is cloud


@settings(deadline=None)
@given(seed=st.integers(0, 50), yaw=st.floats(-0.15, 0.15), forward=st.floats(-3, 3))
def test_deskewing_restores_a_static_world_at_the_stamp(seed: int, yaw: float, forward: float) -> None:
    """`yaw` and `forward` are per sweep of 0.1 s; half of the sweep is before the stamp."""
    world, velocity = a_cloud(seed), 10 * np.array([0, 0, yaw, forward, 0.1, 0])
    assert world.time is not None
    seen = np.empty((50, 3))
    for i, time in enumerate(world.time):
        T_stamp_now = se3.exp(float(time) * velocity)
        seen[i] = (se3.inverse(T_stamp_now) @ [*world.xyz[i], 1])[:3]
    assert np.abs(deskew(world.with_xyz(seen), velocity).xyz - world.xyz).max() < 0.001


@given(tangents, tangents)
def test_the_adjoint_maps_tangents_to_another_frame(xi: np.ndarray, other: np.ndarray) -> None:
    T, small = se3.exp(xi), 1e-3 * other
    assert T @ se3.exp(small) @ se3.inverse(T) == pytest.approx(se3.exp(se3.adjoint(T) @ small), abs=1e-6)


def test_the_vertical_correction_raises_elevations_and_keeps_range_and_azimuth() -> None:
    cloud, angle = a_cloud(3), np.deg2rad(0.205)
    raised = correct_vertical(cloud, angle).xyz.astype(float)
    before, after = cloud.xyz.astype(float), raised

    def elevation(points: np.ndarray) -> np.ndarray:
        return np.arctan2(points[:, 2], np.hypot(points[:, 0], points[:, 1]))

    assert elevation(after) - elevation(before) == pytest.approx(angle, abs=1e-6)
    assert np.linalg.norm(after, axis=1) == pytest.approx(np.linalg.norm(before, axis=1), rel=1e-6)
    assert np.arctan2(after[:, 1], after[:, 0]) == pytest.approx(np.arctan2(before[:, 1], before[:, 0]), abs=1e-6)


@settings(max_examples=30)
@given(st.lists(tangents, min_size=1, max_size=4))
def test_poses_are_read_back_as_written(tmp_path_factory: pytest.TempPathFactory, xis: list[np.ndarray]) -> None:
    path = tmp_path_factory.mktemp("poses") / "poses.txt"
    poses = np.stack([se3.exp(xi) for xi in xis])
    path.write_text(kitti_text(poses))
    stamps, found = read_poses(path)
    assert stamps is None
    assert found == pytest.approx(poses, abs=1e-6)
    path.write_text(tum_text(np.arange(len(poses)) / 10, poses))
    stamps, found = read_poses(path)
    assert stamps == pytest.approx(np.arange(len(poses)) / 10)
    assert found == pytest.approx(poses, abs=1e-6)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "no poses"),
        ("1 2 3\n", "3 columns"),
        ("a b\n", "not a table"),
        ("1 0 0 nan 0 1 0 0 0 0 1 0\n", "line 1"),
        ("0 0 0 0 0 0 0 0\n", "quaternion of length zero"),
    ],
)
def test_invalid_pose_files_are_refused(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "poses.txt"
    path.write_text(text)
    with pytest.raises(InputError, match=r"poses\.txt") as error:
        read_poses(path)
    assert message in str(error.value)
