"""KITTI's odometry metric: relative error over segments of the ground-truth path."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from typing import Any

import numpy as np

from eval.alignment import nearest_rotation
from eval.trajectory import distances
from slam.data import se3
from slam.data.cloud import Array

#: A segment starts at every 10th frame, as in the devkit: once per second at KITTI's 10 Hz.
FRAMES_BETWEEN_STARTS = 10

#: Minimum length of the reference path for a set of segment lengths [m], and that set [m]. KITTI's own lengths from
#: 200 m on (those that fit); below, one short length, so that a short sequence has several segments.
LENGTHS = (
    (200.0, (100.0, 200.0, 300.0, 400.0, 500.0, 600.0, 700.0, 800.0)),
    (60.0, (50.0,)),
    (12.0, (10.0,)),
)

#: The body rotation ignores directions whose singular value is below this share of the largest.
OBSERVABLE = 0.01

#: Segment lengths [m] of `drift_by_length`.
LADDER = (5.0, 10.0, 20.0, 50.0, *LENGTHS[0][1])

PROTOCOL = {
    "drift": "KITTI devkit's odometry metric, no alignment: mean over segments of the reference's path of the error of "
    "the relative pose, divided by the length; a start every 10 frames. 100-800 m as far as they fit from 200 m of "
    "path on; a short drive: 50 m from 60 m on, 10 m from 12 m on",
    "drift.body_rotation_removed": "the same over the same segments after e' = e X with the constant rotation X of the "
    "body frame that minimises sum |X dg - de|^2 / length^2, dg and de the segments' translations in the body frame "
    "of their first pose",
}


@dataclass(frozen=True)
class BodyRotationRemoved:
    """The drift after removing the best constant rotation between the two body frames.

    Attributes:
        translation_percent: Mean translation error [%].
        rotation_deg_per_100m: Mean rotation error [deg/100 m].
        rotation_deg: Angle of the constant rotation [deg].
    """

    translation_percent: float
    rotation_deg_per_100m: float
    rotation_deg: float


@dataclass(frozen=True)
class Drift:
    """KITTI's translation and rotation error.

    Attributes:
        translation_percent: Mean translation error [%], None if no segment fits.
        rotation_deg_per_100m: Mean rotation error [deg/100 m], None if no segment fits.
        lengths_m: Segment lengths used [m].
        segments: Number of segments.
        name: Name of the metric: "KITTI 100-800 m", or "short drive, 50 m".
        body_rotation_removed: The drift without a constant body rotation, None if no segment fits.
        reason: Why no segment fits, else None.
    """

    translation_percent: float | None
    rotation_deg_per_100m: float | None
    lengths_m: tuple[float, ...]
    segments: int
    name: str
    body_rotation_removed: BodyRotationRemoved | None = None
    reason: str | None = None

    def as_dict(self) -> dict[str, Any]:
        """Return the content for JSON."""
        return {**asdict(self), "lengths_m": list(self.lengths_m)}

    @classmethod
    def from_dict(cls, content: Mapping[str, Any]) -> Drift:
        """Restore the result of `as_dict`.

        Raises:
            KeyError: An entry is missing.
            TypeError: An entry has another type.
        """
        values = {field.name: content[field.name] for field in fields(cls)}
        removed = content["body_rotation_removed"]
        return cls(
            **values
            | {
                "lengths_m": tuple(content["lengths_m"]),
                "body_rotation_removed": removed and BodyRotationRemoved(**removed),
            }
        )


@dataclass(frozen=True)
class SegmentMeans:
    """Mean errors over all segments of one length.

    Attributes:
        length_m: The length [m].
        segments: Number of segments.
        translation_percent: Mean translation error [%].
        rotation_deg_per_100m: Mean rotation error [deg/100 m].
    """

    length_m: float
    segments: int
    translation_percent: float
    rotation_deg_per_100m: float


def kitti_drift(estimate: Array, reference: Array) -> Drift:
    """Compute the drift of an estimate against its reference by KITTI's odometry metric.

    Geiger, Lenz, Urtasun, CVPR 2012, as in the odometry development kit. For every first frame i (every 10th) and each
    length L, j is the first frame more than L metres after i along the reference path, and

        E = inv(inv(e_i) e_j) (inv(g_i) g_j),  translation error |trans(E)| / L,  rotation error angle(E) / L,

    averaged over all segments, without alignment. `LENGTHS` defines the lengths: KITTI's 100-800 m as far as they fit
    on paths of 200 m or more, 50 m from 60 m on, 10 m from 12 m on; the result is named after them.

    Args:
        estimate: Poses e (N, 4, 4) [m].
        reference: Poses g (N, 4, 4) [m] of the same body at the same instants.

    Returns:
        The means over all segments; None if the path is too short for any.

    Example:
        >>> line = np.tile(np.eye(4), (31, 1, 1)); line[:, 0, 3] = 1.01 * np.arange(31)
        >>> long = line.copy(); long[:, 0, 3] *= 1.02
        >>> drift = kitti_drift(long, line)
        >>> drift.name, drift.segments, round(drift.translation_percent, 2)
        ('short drive, 10 m', 3, 2.02)
    """
    travelled = distances(reference)
    lengths = next((lengths for least, lengths in LENGTHS if travelled[-1] >= least), ())
    first, last, length = _segments(travelled, lengths)
    if len(first) == 0:
        reason = f"the reference path of {travelled[-1]:.1f} m is shorter than {LENGTHS[-1][0]:g} m"
        return Drift(None, None, (), 0, "no segment fits", None, reason)
    delta_e = se3.inverse(estimate[first]) @ estimate[last]
    delta_g = se3.inverse(reference[first]) @ reference[last]
    used = tuple(sorted(set(length.tolist())))
    translation, rotation = _mean_errors(delta_e, delta_g, length)
    return Drift(translation, rotation, used, len(first), _name(used), _without_rotation(delta_e, delta_g, length))


def drift_by_length(estimate: Array, reference: Array) -> list[SegmentMeans]:
    """Compute the errors of `kitti_drift` for each segment length of `LADDER` that fits, separately.

    Args:
        estimate: Poses e (N, 4, 4) [m].
        reference: Poses g (N, 4, 4) [m] of the same body at the same instants.

    Returns:
        The means, shortest length first; empty if the path is too short for any.

    Example:
        >>> line = np.tile(np.eye(4), (31, 1, 1)); line[:, 0, 3] = 1.01 * np.arange(31)
        >>> long = line.copy(); long[:, 0, 3] *= 1.02
        >>> [(means.length_m, means.segments) for means in drift_by_length(long, line)]
        [(5.0, 3), (10.0, 3), (20.0, 2)]
    """
    first, last, length = _segments(distances(reference), LADDER)
    delta_e = se3.inverse(estimate[first]) @ estimate[last]
    delta_g = se3.inverse(reference[first]) @ reference[last]
    means = []
    for value in np.unique(length):
        of = length == value
        means.append(SegmentMeans(float(value), int(of.sum()), *_mean_errors(delta_e[of], delta_g[of], length[of])))
    return means


def _segments(travelled: Array, lengths: tuple[float, ...]) -> tuple[Array, Array, Array]:
    """First frame, last frame and length [m] of each segment; as in the devkit, the last is strictly farther."""
    starts = np.arange(0, len(travelled), FRAMES_BETWEEN_STARTS)
    first = np.tile(starts, len(lengths))
    length = np.repeat(np.array(lengths), len(starts))
    last = np.searchsorted(travelled, travelled[first] + length, side="right")
    fits = last < len(travelled)
    return first[fits], last[fits], length[fits]


def _name(lengths: tuple[float, ...]) -> str:
    if lengths[0] < 100:
        return f"short drive, {lengths[0]:g} m"
    return "KITTI " + "-".join(f"{value:g}" for value in dict.fromkeys((lengths[0], lengths[-1]))) + " m"


def _mean_errors(delta_e: Array, delta_g: Array, length: Array) -> tuple[float, float]:
    """Mean translation error [%] and rotation error [deg/100 m] of segments (K, 4, 4) of `length` (K,) metres."""
    E = se3.inverse(delta_e) @ delta_g
    translation = np.linalg.norm(E[:, :3, 3], axis=1) / length
    rotation = np.degrees(se3.angle(E)) / length
    return float(100 * translation.mean()), float(100 * rotation.mean())


def _without_rotation(delta_e: Array, delta_g: Array, length: Array) -> BodyRotationRemoved:
    """The errors of e' = e X. Since |trans(E')| = |X trans(delta_g) - trans(delta_e)|, X is a Kabsch problem."""
    X = np.eye(4)
    X[:3, :3] = best_rotation(delta_g[:, :3, 3] / length[:, None], delta_e[:, :3, 3] / length[:, None])
    translation, rotation = _mean_errors(se3.inverse(X) @ delta_e @ X, delta_g, length)
    return BodyRotationRemoved(translation, rotation, float(np.degrees(se3.angle(X))))


def best_rotation(a: Array, b: Array) -> Array:
    """Return the rotation X (3, 3) that minimises sum |X a_k - b_k|^2 over vectors a, b (K, 3).

    Unobservable components are not rotated: on a straight path the roll about the direction of travel is noise, so
    singular values below `OBSERVABLE` of the largest are dropped and the smallest optimal rotation is returned.
    """
    U, values, Vt = np.linalg.svd(b.T @ a)
    values = np.where(values < OBSERVABLE * values[0], 0.0, values)
    return nearest_rotation(U @ np.diag(values) @ Vt + 1e-9 * max(float(values[0]), 1e-12) * np.eye(3))
