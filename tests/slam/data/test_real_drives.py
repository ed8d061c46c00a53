"""The loaders on recorded KITTI sequences."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from slam.data.beams import recover_rings, rings_in_file_order
from slam.data.dataset import Dataset, open_dataset
from slam.data.ring_patterns import drop_rings

RealData = Callable[[str], Path]

#: Scans that the wraparound does not give 64 rings of: 42 ends with a stray point of the last ring, the other two are
#: the last files of their sequences, truncated.
ODD = {"kitti_raw_0005": {42: (65, 63), 153: (53, 52)}, "kitti_raw_0013": {143: (56, 55)}, "kitti_odometry_04": {}}


def path_length(dataset: Dataset) -> float:
    assert dataset.ground_truth is not None
    return float(np.linalg.norm(np.diff(dataset.ground_truth[:, :3, 3], axis=0), axis=1).sum())


@pytest.mark.parametrize("name", ODD)
def test_every_scan_has_its_rings(real_data: RealData, name: str) -> None:
    dataset = open_dataset(real_data(name))
    assert dataset.problems == ()
    odd = {}
    for i in range(len(dataset)):
        frame = dataset[i]
        ring = frame.cloud.ring
        assert ring is not None
        if frame.problems:
            assert [problem.kind for problem in frame.problems] == ["ring count"]
            odd[frame.index] = (recover_rings(frame.cloud.xyz)[1], int(ring.max()))
            assert np.unique(ring).tolist() == list(range(ring.max() + 1))
        else:
            assert len(np.unique(ring)) == 64
            assert np.bincount(ring).min() > 700
    assert odd == ODD[name]


@pytest.mark.parametrize(
    ("name", "length"), [("kitti_raw_0005", 69.3), ("kitti_raw_0013", 173.0), ("kitti_odometry_04", 69.1)]
)
def test_path_lengths_of_the_ground_truth(real_data: RealData, name: str, length: float) -> None:
    assert path_length(open_dataset(real_data(name))) == pytest.approx(length, abs=0.1)


@pytest.mark.parametrize("name", ["kitti_odometry_04", "kitti_raw_0005"])
def test_points_project_into_the_image(real_data: RealData, name: str) -> None:
    dataset = open_dataset(real_data(name))
    frame = dataset[10]
    image, calibration = frame.image, frame.calibration
    assert image is not None
    assert calibration is not None
    in_camera = frame.cloud.transformed(calibration.T_camera_lidar).xyz.astype(float)
    in_camera = in_camera[in_camera[:, 2] > 0]
    pixels = in_camera @ calibration.K.T
    pixels = pixels[:, :2] / pixels[:, 2:]
    inside = ((pixels >= 0) & (pixels < image.shape[1::-1])).all(axis=1)
    assert 15_000 < inside.sum() < 21_000
    assert pixels[inside, 1].min() > 75  # no beam looks at the top of the image


def test_sequences_of_single_frames_are_gaps(real_data: RealData) -> None:
    dataset = open_dataset(real_data("kitti_odometry_mini"), sequence="07")
    assert dataset.numbers.tolist() == [0, 3, 6, 9]
    assert [problem.kind for problem in dataset.problems] == ["gap in numbering"]
    assert dataset.ground_truth is None


def test_a_cut_compensated_scan_keeps_its_rings(real_data: RealData) -> None:
    dataset = open_dataset(real_data("kitti_odometry_04"))
    cloud = dataset[20].cloud
    assert cloud.ring is not None
    assert dataset.sensor is not None
    missing = ~np.isin(cloud.ring, [0, 5, 20, 33, 50])
    for kept in (cloud.ring < 39, np.arange(len(cloud)) > 0.2 * len(cloud), missing):
        ring, problems = rings_in_file_order(cloud.xyz[kept], dataset.sensor, dataset.path)
        assert np.array_equal(ring, cloud.ring[kept])
        assert len(problems) == 1


def test_a_quarter_of_the_rings_is_a_quarter_of_the_points(real_data: RealData) -> None:
    cloud = open_dataset(real_data("kitti_odometry_04"))[0].cloud
    assert len(drop_rings(cloud)) == pytest.approx(len(cloud) / 4, rel=0.05)
    assert len(drop_rings(cloud, "average-pool")) == pytest.approx(len(cloud) / 4, rel=0.1)
