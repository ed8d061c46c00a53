"""The figures of a trajectory against its reference: what metrics.json holds."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

from eval.kitti_metric import Drift
from eval.trajectory import Statistics


@dataclass(frozen=True)
class AbsoluteErrors:
    """The absolute trajectory error (ATE) [m] by alignment, see `eval.alignment.alignment_transform`.

    Attributes:
        aligned: After SE(3) Umeyama alignment over all positions, without scale.
        origin: With the first pose laid onto the reference's first pose.
        unaligned: As the poses stand.
    """

    aligned: Statistics
    origin: Statistics
    unaligned: Statistics


@dataclass(frozen=True)
class RelativeErrors:
    """The relative pose error (RPE) over consecutive frames; no alignment changes it.

    Attributes:
        frame: Of the translation [m].
        frame_rotation: Angle of the rotation [deg].
    """

    frame: Statistics
    frame_rotation: Statistics


@dataclass(frozen=True)
class Metrics:
    """All figures of one trajectory against its reference.

    Attributes:
        frames: How many poses were compared.
        path_length_m: Length of the estimate's path over these frames [m].
        reference_path_length_m: The same of the reference [m].
        ate: Absolute trajectory error [m].
        rpe: Relative pose error over consecutive frames [m, deg].
        drift: KITTI's odometry metric.
        paper_table_iii: The error in Table III of the paper [m], see `eval.trajectory.paper_table_iii`.
        notes: Sentences to be printed with the figures.
        protocol: What each figure means, to be printed beside it.
    """

    frames: int
    path_length_m: float
    reference_path_length_m: float
    ate: AbsoluteErrors
    rpe: RelativeErrors
    drift: Drift
    paper_table_iii: Statistics
    notes: tuple[str, ...] = ()
    protocol: Mapping[str, str] = field(default_factory=dict)

    def as_dict(self) -> dict[str, Any]:
        """For JSON: one entry of metrics.json, where the protocol stands once, beside the entries."""
        return {
            "frames": self.frames,
            "path_length_m": self.path_length_m,
            "reference_path_length_m": self.reference_path_length_m,
            "ate": asdict(self.ate),
            "rpe": asdict(self.rpe),
            "drift": self.drift.as_dict(),
            "paper_table_iii": asdict(self.paper_table_iii),
            "notes": list(self.notes),
        }

    @classmethod
    def from_dict(cls, entry: Mapping[str, Any], protocol: Mapping[str, str]) -> Metrics:
        """What `as_dict` gave, as it was. Raises KeyError or TypeError where it is something else."""
        ate, rpe = entry["ate"], entry["rpe"]
        return cls(
            frames=entry["frames"],
            path_length_m=entry["path_length_m"],
            reference_path_length_m=entry["reference_path_length_m"],
            ate=AbsoluteErrors(*(Statistics.from_dict(ate[name]) for name in ("aligned", "origin", "unaligned"))),
            rpe=RelativeErrors(*(Statistics.from_dict(rpe[name]) for name in ("frame", "frame_rotation"))),
            drift=Drift.from_dict(entry["drift"]),
            paper_table_iii=Statistics.from_dict(entry["paper_table_iii"]),
            notes=tuple(entry["notes"]),
            protocol=protocol,
        )


@dataclass(frozen=True)
class RunMetrics:
    """What metrics.json of a run folder holds.

    Attributes:
        slam: Of the trajectory with loops closed.
        odometry: Of the trajectory before loops; the same where none was closed.
    """

    slam: Metrics
    odometry: Metrics

    def as_dict(self) -> dict[str, Any]:
        """For JSON: "slam", "odometry" and "protocol"."""
        entries = {"slam": self.slam.as_dict(), "odometry": self.odometry.as_dict()}
        return {**entries, "protocol": dict(self.slam.protocol)}

    @classmethod
    def from_dict(cls, content: Mapping[str, Any]) -> RunMetrics:
        """What `as_dict` gave, as it was. Raises KeyError or TypeError where it is something else."""
        slam, odometry = (Metrics.from_dict(content[name], content["protocol"]) for name in ("slam", "odometry"))
        return cls(slam, odometry)
