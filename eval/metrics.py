"""Figures of a trajectory against its reference, the content of metrics.json."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

from eval import consistency
from eval.consistency import Consistency
from eval.kitti_metric import Drift
from eval.trajectory import Statistics


@dataclass(frozen=True)
class AbsoluteErrors:
    """The absolute trajectory error (ATE) [m] by alignment, see `eval.alignment.alignment_transform`.

    Attributes:
        aligned: After SE(3) Umeyama alignment over all positions, without scale.
        origin: With the first pose aligned to the first pose of the reference.
        unaligned: Without alignment.
    """

    aligned: Statistics
    origin: Statistics
    unaligned: Statistics


@dataclass(frozen=True)
class RelativeErrors:
    """The relative pose error (RPE) over consecutive frames; it does not depend on the alignment.

    Attributes:
        frame: Error of the translation [m].
        frame_rotation: Angle of the rotation error [deg].
    """

    frame: Statistics
    frame_rotation: Statistics


@dataclass(frozen=True)
class Metrics:
    """All figures of one trajectory against its reference.

    Attributes:
        frames: Number of poses that were compared.
        path_length_m: Path length of the estimate over these frames [m].
        reference_path_length_m: Path length of the reference [m].
        ate: Absolute trajectory error [m].
        rpe: Relative pose error over consecutive frames [m, deg].
        drift: KITTI's odometry metric.
        paper_table_iii: The error in Table III of the paper [m], see `eval.trajectory.paper_table_iii`.
        notes: Sentences to be printed with the figures.
        protocol: Definition of each figure, to be printed with it.
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
        """Return one entry of metrics.json; the protocol is written once for all entries."""
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
        """Restore the result of `as_dict`.

        Raises:
            KeyError: An entry is missing.
            TypeError: An entry has another type.
        """
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
    """Content of metrics.json in a run folder.

    Attributes:
        slam: Figures of the trajectory after loop closure.
        odometry: Figures of the trajectory before loop closure; the same if no loop was closed.
        nees: Consistency of the covariances of the trajectory after loop closure; None without covariances, or if the
            first frame has no reference.
    """

    slam: Metrics
    odometry: Metrics
    nees: Consistency | None = None

    def as_dict(self) -> dict[str, Any]:
        """Return the content for JSON: "slam", "odometry", "nees" and "protocol"."""
        entries = {"slam": self.slam.as_dict(), "odometry": self.odometry.as_dict()}
        nees = self.nees.as_dict() if self.nees else None
        return {**entries, "nees": nees, "protocol": {**self.slam.protocol, **consistency.PROTOCOL}}

    @classmethod
    def from_dict(cls, content: Mapping[str, Any]) -> RunMetrics:
        """Restore the result of `as_dict`.

        Raises:
            KeyError: An entry is missing.
            TypeError: An entry has another type.
        """
        protocol = {name: text for name, text in content["protocol"].items() if name not in consistency.PROTOCOL}
        slam, odometry = (Metrics.from_dict(content[name], protocol) for name in ("slam", "odometry"))
        nees = content.get("nees")  # not there in runs of earlier versions
        return cls(slam, odometry, Consistency(**nees) if nees else None)
