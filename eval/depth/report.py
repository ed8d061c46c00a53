"""Content of depth.json: the figures of each method, and the data they were measured on."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from eval.depth.maps import DepthMapFigures
from eval.depth.metrics import RangeFigures

#: Which returns the figures cover: the name in depth.json, and the title.
VIEWS = {"image": "Camera field of view", "full": "All returns (360 deg)"}


@dataclass(frozen=True)
class MethodReport:
    """Figures of one method.

    Attributes:
        ms: Median time per frame [ms].
        image: Figures in the camera's field of view; None without a camera.
        full: Figures over all returns of the scans; None for depth maps.
        parameters: Number of learned parameters; None without learning.
    """

    ms: float
    image: RangeFigures | DepthMapFigures | None = None
    full: RangeFigures | None = None
    parameters: int | None = None

    def as_dict(self) -> dict[str, Any]:
        """Return the content for JSON, without entries that are None."""
        views = {"image": self.image, "full": self.full}
        parameters = {} if self.parameters is None else {"parameters": self.parameters}
        return {**{view: found.as_dict() for view, found in views.items() if found}, "ms": self.ms, **parameters}


@dataclass(frozen=True)
class AboutSequence:
    """The sequence that methods were measured on.

    Attributes:
        title: Title for display.
        dataset: Name of the sequence.
        frames: Numbers of the selected frames.
        frames_left_out: Numbers of the frames that were empty or had no rings.
        sensor: Name of the LiDAR.
        ring_step: Every `ring_step`-th ring was kept.
        phase: Index of the first ring that was kept.
        columns: Azimuth columns of the ray grid.
        protocol: Definition of each figure.
    """

    title: str
    dataset: str
    frames: tuple[int, ...]
    frames_left_out: tuple[int, ...]
    sensor: str
    ring_step: int
    phase: int
    columns: int
    protocol: Mapping[str, str]


@dataclass(frozen=True)
class AboutDepthMaps:
    """The depth maps of KITTI's depth completion benchmark that methods were measured on.

    Attributes:
        title: Title for display.
        images: Names of the files with sparse depths.
        protocol: Definition of each figure.
    """

    title: str
    images: tuple[str, ...]
    protocol: Mapping[str, str]


@dataclass(frozen=True)
class DepthReport:
    """Figures of several methods on the same data.

    Attributes:
        methods: The methods by name.
        about: The data that they were measured on.
    """

    methods: Mapping[str, MethodReport]
    about: AboutSequence | AboutDepthMaps

    def as_dict(self) -> dict[str, Any]:
        """Return the content for JSON: the methods by name, and "about"."""
        return {**{name: method.as_dict() for name, method in self.methods.items()}, "about": asdict(self.about)}
