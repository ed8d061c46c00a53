"""The source of a run: what is known of its scans before the first one."""

from __future__ import annotations

import numpy as np

from slam.data.cloud import Array
from slam.data.dataset import Dataset, chosen_positions
from slam.data.sensor import Sensor
from slam.data.stamps import usual_step
from slam.run import Source
from slam.settings import FrontEndSettings

SWEEP = 0.1  # s; most spinning LiDARs rotate at 10 Hz


def source_of(dataset: Dataset, frames: slice = slice(None)) -> Source:
    """Return the source of a run: the selected frames of a data set.

    Raises:
        InputError: No frames are selected.
    """
    positions = chosen_positions(dataset, frames)
    truth = None if dataset.ground_truth is None else dataset.ground_truth[positions]
    true_positions: Array | None = getattr(dataset, "true_positions", None)
    return Source(
        dataset.name,
        dataset.path,
        dataset.sensor,
        dataset.calibration,
        positions,
        truth,
        {order: poses[positions] for order, poses in getattr(dataset, "truth_readings", {}).items()},
        getattr(dataset, "point_times", None),
        getattr(dataset, "stamps_from", None),
        getattr(dataset, "topics", {}),
        None if true_positions is None else true_positions[positions],
    )


def vertical_correction(settings: FrontEndSettings, sensor: Sensor | None) -> float:
    """Return the angle [rad] added to each elevation: that of the settings, else that of the sensor."""
    own = sensor.vertical_correction if sensor else 0.0
    angle = settings.vertical_correction_deg
    return own if angle is None else float(np.deg2rad(angle))


def sweep_duration(dataset: Dataset, stamps: Array | None = None) -> float:
    """Return the time [s] between successive scans: the usual step between the stamps.

    Args:
        dataset: The data set; its attribute `scan_period`, if it has one, is used before its stamps, since scans may be
            missing.
        stamps: Times (N,) [s] in place of those of the data set.
    """
    if stamps is not None:
        return usual_step(stamps) or SWEEP
    return float(getattr(dataset, "scan_period", None) or usual_step(dataset.stamps) or SWEEP)
