"""What depth.json holds: the figures of every method, and what they were measured on."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from eval.depth.maps import DepthMapFigures
from eval.depth.metrics import RangeFigures

#: Which returns figures are over, as named in depth.json, and for people.
VIEWS = {"image": "In the image", "full": "All around"}


@dataclass(frozen=True)
class MethodReport:
    """One method.

    Attributes:
        ms: Median of the time it takes a frame [ms].
        image: Over what the camera sees; None without a camera.
        full: Over all returns of the scans; None of depth maps.
        parameters: How many it learned; None without learning.
    """

    ms: float
    image: RangeFigures | DepthMapFigures | None = None
    full: RangeFigures | None = None
    parameters: int | None = None

    def as_dict(self) -> dict[str, Any]:
        """For JSON, without what is None."""
        views = {"image": self.image, "full": self.full}
        parameters = {} if self.parameters is None else {"parameters": self.parameters}
        return {**{view: found.as_dict() for view, found in views.items() if found}, "ms": self.ms, **parameters}


@dataclass(frozen=True)
class AboutSequence:
    """A drive whose scans methods saw some rings of.

    Attributes:
        title: For people.
        dataset: The drive's name.
        frames: The numbers of the frames that were chosen.
        frames_left_out: The numbers of those that were empty or had no rings.
        sensor: The LiDAR's name.
        ring_step: Every so-many-th ring was kept.
        phase: The first ring that was kept.
        columns: Azimuth columns of the grid of rays.
        protocol: What each figure means.
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
    """Depth maps of KITTI's depth completion benchmark.

    Attributes:
        title: For people.
        images: The names of the files with sparse depths.
        protocol: What each figure means.
    """

    title: str
    images: tuple[str, ...]
    protocol: Mapping[str, str]


@dataclass(frozen=True)
class DepthReport:
    """The figures of every method on the same data.

    Attributes:
        methods: By name.
        about: What they were measured on.
    """

    methods: Mapping[str, MethodReport]
    about: AboutSequence | AboutDepthMaps

    def as_dict(self) -> dict[str, Any]:
        """For JSON: the methods by name, and "about"."""
        return {**{name: method.as_dict() for name, method in self.methods.items()}, "about": asdict(self.about)}
