"""Scans, images and motion that a calibration is estimated from."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from slam.data.errors import InputError

if TYPE_CHECKING:
    from lidarlift.reporting import Reporter
    from slam.calibration.observations import View
    from slam.data.cloud import Array, Calibration, Frame
    from slam.data.dataset import Dataset

MIN_VIEWS, MAX_VIEWS = 10, 50


@dataclass(frozen=True, eq=False)
class ChosenCamera:
    """A camera and its guess.

    Attributes:
        recorded: Calibration by which a frame's view is found; None: the view of the frame itself.
        guess: The guess.
        file: The calib.yaml that the guess is from, if any; its other cameras are kept.
        name: Name of the camera in it.
    """

    recorded: Calibration | None
    guess: Calibration
    file: Path | None
    name: str

    def image(self, frame: Frame) -> Array | None:
        """The image of a frame."""
        for view in frame.views:
            if self.recorded is not None and np.array_equal(
                view.calibration.T_camera_lidar, self.recorded.T_camera_lidar
            ):
                return view.read_image()
        return frame.image if self.recorded is None else None


def chosen_camera(data: Dataset, name: str | None, guess: Calibration | str | Path | None) -> ChosenCamera:
    """The camera that is meant. Raises InputError if there is none, or no guess."""
    from slam.data.calibration_file import camera_named
    from slam.data.cloud import Calibration

    own = data.path / "calib.yaml" if data.path.is_dir() else data.path.with_name("calib.yaml")
    recorded = data.calibration
    if name is not None:
        if not own.is_file():
            raise InputError(f"{data.path}: one camera, without a name; leave --camera out")
        recorded = camera_named(own, name).calibration
    if isinstance(guess, Calibration):
        return ChosenCamera(recorded, guess, None, name or "")
    if guess is not None:
        found = camera_named(Path(guess), name)
        return ChosenCamera(recorded, found.calibration, Path(guess), found.name)
    if recorded is None:
        raise InputError(
            f"{data.path}: no calibration of a camera to start from; give --guess FILE with K and T_camera_lidar"
        )
    if not own.is_file():
        return ChosenCamera(recorded, recorded, None, "")
    return ChosenCamera(recorded, recorded, own, camera_named(own, name).name)


def views_of(data: Dataset, chosen: ChosenCamera, frames: slice, reporter: Reporter) -> tuple[list[Frame], list[View]]:
    """Up to MAX_VIEWS scans with rings, an image and a known motion, evenly spaced over the sequence."""
    from slam.calibration.fields import pinhole_grey
    from slam.calibration.observations import view_of

    recorded: list[Frame] = []
    views: list[View] = []
    velocities, positions = _velocities(data, frames, reporter)
    moving = [at for at, velocity in enumerate(velocities) if np.isfinite(velocity).all()]
    picked = np.unique(np.linspace(0, max(len(moving) - 1, 0), MAX_VIEWS).round().astype(int))
    ringless = 0
    with reporter.progress(f"{data.name}: reading images", len(picked) if moving else 0) as advance:
        for at in (moving[place] for place in picked if moving):
            frame = data[positions[at]]
            image = chosen.image(frame)
            ringless += frame.cloud.ring is None
            if image is not None and frame.cloud.ring is not None:
                recorded.append(frame)
                views.append(view_of(frame.cloud, velocities[at], pinhole_grey(image, chosen.guess)))
            advance()
    if ringless > len(views):
        raise InputError(f"{data.path}: the scans have no rings, which the edges are found along; name the --sensor")
    if len(views) < MIN_VIEWS:
        raise InputError(
            f"{data.path}: {len(views)} scans with an image and a known motion, at least {MIN_VIEWS} are needed; give "
            "images of the camera, and more frames"
        )
    return recorded, views


def _velocities(data: Dataset, frames: slice, reporter: Reporter) -> tuple[Array, range]:
    """Velocities (N, 6) [rad/s, m/s] of the LiDAR at the chosen scans by the odometry, NaN where it failed."""
    from lidarlift.reporting import COMPILING
    from slam.compilation import compile_odometry
    from slam.config import load_config
    from slam.data import se3
    from slam.data.dataset import chosen_positions, ring_count
    from slam.front_end import RingFrontEnd
    from slam.mid_sweep import MidSweepOdometry
    from slam.odometry import Odometry, OdometryStep
    from slam.source import sweep_duration, vertical_correction
    from slam.tracking import Tracker

    positions = chosen_positions(data, frames)
    config = load_config(None, (), input="full")
    about: Any = {
        "sweep_duration": sweep_duration(data),
        "vertical_correction": vertical_correction(config.front_end, data.sensor),
    }
    compile_odometry(config, lambda: reporter.note(COMPILING))
    front_end = RingFrontEnd(config.front_end, data.sensor, ring_count(data))
    tracker = Tracker(front_end, MidSweepOdometry(Odometry(config.odometry, **about)), config.front_end.deskew)
    steps: list[OdometryStep] = []
    with reporter.progress(f"{data.name}: odometry", len(positions)) as advance:
        for position in positions:
            step = tracker(data[position]).step
            if not step.provisional:
                steps += [*step.revised, step]
            advance()
    steps += tracker.settle()
    stamps = data.stamps[positions]
    velocities = np.full((len(steps), 6), np.nan)
    for at in range(len(steps)):
        before, after = max(at - 1, 0), min(at + 1, len(steps) - 1)
        failed = any(step.status == "failed" for step in steps[before : after + 1])
        if not failed and stamps[after] > stamps[before]:
            motion = se3.log(se3.inverse(steps[before].pose) @ steps[after].pose)
            velocities[at] = motion / (stamps[after] - stamps[before])
    return velocities, positions
