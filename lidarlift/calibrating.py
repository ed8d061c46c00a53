"""Extrinsics of a camera from a sequence, without targets: data in, calibration file and picture out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from lidarlift.calibration_views import ChosenCamera, chosen_camera, views_of
from lidarlift.front_ends import opened
from lidarlift.reporting import Quiet, Reporter
from slam.data.atomic import require_writable
from slam.data.errors import InputError

if TYPE_CHECKING:
    from slam.calibration.estimate import Estimate
    from slam.calibration.observations import View
    from slam.data.cloud import Calibration, Frame
    from slam.data.dataset import Dataset

PICTURE = "{stem}_overlay.png"


@dataclass(frozen=True, eq=False)
class CalibrationResult:
    """An extrinsic calibration.

    Attributes:
        camera: Name of the camera, None for the only one.
        guess: The calibration that the search began with.
        calibration: The estimated one.
        estimate: Standard deviations, and which values the sequence determines.
        views: Number of scans with images that were used.
    """

    camera: str | None
    guess: Calibration
    calibration: Calibration
    estimate: Estimate
    views: int


def calibrate(
    dataset: Dataset | str | Path,
    *,
    sequence: str | None = None,
    sensor: str | Path | None = None,
    camera: str | None = None,
    guess: Calibration | str | Path | None = None,
    delay: float | None = None,
    frames: slice = slice(None),
    out: str | Path | None = None,
    reporter: Reporter | None = None,
) -> CalibrationResult:
    """Estimate the extrinsics of a camera to the LiDAR from a sequence, without targets.

    Edges that the LiDAR sees (jumps of range and intensity) are aligned with the edges of up to 50 images; the motion
    during a sweep comes from the odometry. The time of the images after the stamps is estimated, too, since at speed it
    looks like a shift of the camera.

    Args:
        dataset: An open data set; or a path that `open_dataset` takes, with `sequence` and `sensor`.
        sequence: Name of the sequence, if the folder has several.
        sensor: Name of the LiDAR or a YAML file with its beams, if the folder does not say.
        camera: Name of the camera in calib.yaml, if there are several. Default: the one that looks ahead.
        guess: A calibration within 5 deg and 20 cm, or a calib.yaml with one. Default: that of the data set.
        delay: Time of the images after the scans' stamps [s], if it is known. Default: estimated.
        frames: Positions in the data set, as a slice of a list.
        out: The calib.yaml to write, which must not exist; a picture is written beside it. Default: nothing is written.
        reporter: Receives progress and notes.

    Returns:
        The calibration, with standard deviations. Values that the sequence does not determine are those of the guess.

    Raises:
        InputError: There is no camera, no guess, fewer than 10 scans with images and known motion, or no rings; the
            guess is too far off; `out` exists or cannot be written.
        ValueError: `sequence` or `sensor` is given for a data set that is already open.

    Example:
        >>> found = lidarlift.calibrate("my_drive", guess="measured.yaml", out="calib.yaml")
        >>> found.calibration.T_camera_lidar, found.estimate.sigma
    """
    from slam.calibration.estimate import estimate

    target = None if out is None else Path(out)
    if target is not None:
        if target.exists():
            raise InputError(f"{target}: already exists; choose another --out, or move the file")
        require_writable(target.parent)
    data = opened(dataset, sequence, sensor)
    chosen = chosen_camera(data, camera, guess)
    reporter = reporter or Quiet()
    recorded, views = views_of(data, chosen, frames, reporter)
    try:
        found = estimate(views, chosen.guess.K, chosen.guess.T_camera_lidar, delay)
    except InputError as error:
        raise InputError(f"{data.path}: {error}") from error
    calibration = replace(chosen.guess, T_camera_lidar=found.T_camera_lidar)
    result = CalibrationResult(camera, chosen.guess, calibration, found, len(views))
    if target is not None:
        _write(target, result, chosen, recorded[len(recorded) // 2], views[len(views) // 2])
    return result


def _write(target: Path, result: CalibrationResult, chosen: ChosenCamera, frame: Frame, view: View) -> None:
    """Write the calib.yaml and the picture."""
    from slam.calibration.overlay import save_overlays
    from slam.data.atomic import write_text
    from slam.data.calibration_file import calibration_text

    write_text(target, calibration_text(result.calibration, chosen.file, chosen.name, comments(result)))
    image = chosen.image(frame)
    assert image is not None
    labels = {
        f"guess, score {result.estimate.score_of_guess:.2f}": result.guess,
        f"calibrated, score {result.estimate.score:.2f}": result.calibration,
    }
    save_overlays(target.with_name(PICTURE.format(stem=target.stem)), image, view.xyz, labels)


def comments(result: CalibrationResult) -> Sequence[str]:
    """Return the figures of a calibration in a few lines, for people."""
    found = result.estimate
    degrees, centimetres = np.rad2deg(found.sigma[:3]), 100 * found.sigma[3:]
    from slam.calibration.observations import Parameters

    change = Parameters(result.guess.T_camera_lidar).change_to(result.calibration.T_camera_lidar)
    names = ("pitch", "yaw", "roll", "right", "down", "forward")
    held = [name for name, sure in zip(names[3:], found.determined, strict=True) if not sure]
    turn, shift = np.rad2deg(np.linalg.norm(change[:3])), 100 * np.linalg.norm(change[3:])
    lines = [
        f"{result.views} views: turned by {turn:.2f} deg and moved by {shift:.1f} cm from the guess; score "
        f"{found.score_of_guess:.2f} before, {found.score:.2f} after",
        "standard deviations: "
        + ", ".join(f"{n} {d:.2f} deg" for n, d in zip(names[:3], degrees, strict=True))
        + ", "
        + ", ".join(f"{n} {c:.1f} cm" for n, c in zip(names[3:], centimetres, strict=True) if n not in held),
        f"images {1e3 * found.delay:+.1f} ms after the scans' stamps"
        + (f" (standard deviation {1e3 * found.delay_sigma:.1f} ms)" if found.delay_sigma else " (given)"),
    ]
    if held:
        lines.append(
            f"not determined by this sequence, so as in the guess: {', '.join(held)}; drive turns near "
            "objects, or give the delay of the images"
        )
    return lines
