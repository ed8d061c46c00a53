"""Check of the camera's extrinsics and time stamps after a run."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from slam.data import se3
from slam.data.problem import Problem

if TYPE_CHECKING:
    from slam.data.cloud import Calibration, PointCloud
    from slam.data.dataset import Dataset
    from slam.run import Run

CHECKED = 8  # frames, evenly spaced
MARGIN = 0.1  # of the image's size: points that are searched for edges beyond its borders


def camera_problems(data: Dataset, run: Run) -> tuple[Problem, ...]:
    """Return a Problem if extrinsics or time stamps of the camera that looks ahead seem to be wrong.

    Eight frames with rings and images are read again, about half a second in total. Nothing is returned without a
    calibration, or if there are too few images or edges to tell.
    """
    from slam.calibration.check import camera_fault
    from slam.calibration.fields import pinhole_grey
    from slam.calibration.observations import view_of

    calibration, positions = data.calibration, run.source.positions
    if calibration is None or positions is None or len(run.records) < CHECKED:
        return ()
    poses, stamps = run.odometry_poses, run.stamps
    views = []
    for at in np.linspace(1, len(poses) - 2, CHECKED).round().astype(int):
        frame = data[positions[int(at)]]
        seconds = stamps[at + 1] - stamps[at - 1]
        if frame.calibration is None or frame.cloud.ring is None or seconds <= 0 or (image := frame.image) is None:
            continue
        velocity = se3.log(se3.inverse(poses[at - 1]) @ poses[at + 1]) / seconds
        cloud = _seen(frame.cloud, calibration, image.shape)
        views.append(view_of(cloud, velocity, pinhole_grey(image, calibration)))
    fault = camera_fault(views, calibration.K, calibration.T_camera_lidar)
    return () if fault is None else (Problem("camera", f"{data.path}: {fault}"),)


def _seen(cloud: PointCloud, calibration: Calibration, shape: tuple[int, ...]) -> PointCloud:
    """The points in front of the camera that its image (H, W, 3), or a margin around it, may show."""
    from slam.data.camera import project

    pixels, _ = project(cloud.xyz, calibration)
    size = np.array(shape[1::-1])
    return cloud.select((np.abs(pixels / size - 0.5) < 0.5 + MARGIN).all(axis=1))
