"""Selection of the valid points of a file, block by block, in metres in the sensor's frame."""

from __future__ import annotations

import numpy as np

from slam.data.cloud import Array
from slam.data.point_blocks import Block, Content, UnreadableError

#: Upper bound of any LiDAR's range [m]: larger coordinates come from damaged files.
FARTHEST = 1e4
#: Median range above which a scan is not in metres.
NOT_METRES = 1e3
#: Minimum number of points for the estimate of an offset or of a wrong unit.
FEWEST = 10
Offset = tuple[float, float, float]
NONE: Offset = (0.0, 0.0, 0.0)


def gathered(
    content: Content, everything: bool = False, offset: Offset | None = None
) -> tuple[dict[str, Array], Offset]:
    """Read the valid points of a file.

    Missing returns are left out without a report: points at the origin, as drivers write them, and NaN in an organised
    cloud or in all three coordinates. Other points that are not finite or farther than `FARTHEST` are left out and
    reported. From coordinates in a map frame (UTM, ECEF), an offset is subtracted, estimated from the first points.

    Args:
        content: The opened file; faults are appended to it.
        everything: Keep all finite points at any distance, as for maps.
        offset: Offset to subtract from the coordinates [m]; by default estimated.

    Returns:
        The columns by their names, `xyz` (N, 3) float32 and the others (N,) in their types, and the offset [m] that was
        subtracted.

    Raises:
        UnreadableError: The file has no x, y and z, or is too damaged to be read.
    """
    missing = sorted({"x", "y", "z"} - set(content.names))
    if missing:
        has = ", ".join(map(str, content.names[:12]))
        raise UnreadableError(f"fields x, y and z are required; the file has {has[:200]}")
    gathering = _Gathering(content.count, everything, NONE if everything else offset)
    for block in content.blocks:
        gathering.add(block, content.organised)
    if gathering.bad:
        text = f"{gathering.bad} of {gathering.read} points are not finite or farther than {FARTHEST / 1000:g} km"
        content.faults.append(("non-finite points", f"{text}; left out"))
    return gathering.finished(), gathering.offset or NONE


def map_frame(offset: Offset) -> str:
    """Return the message for coordinates from which `offset` was subtracted."""
    place = " ".join(f"{value:g}" if abs(value) < 1e6 else f"{value:.0f}" for value in offset)
    return (
        f"coordinates in a map frame, about {place} (UTM?); this offset was subtracted. Save scans in the sensor's "
        "frame, and coordinates so far from 0 as float64"
    )


class _Gathering:
    """Columns that grow block by block by the valid points."""

    def __init__(self, count: int, everything: bool, offset: Offset | None) -> None:
        self.offset, self.farthest = offset, np.inf if everything else FARTHEST
        self.everything = everything
        self.read, self.kept, self.bad = 0, 0, 0
        self.xyz = np.empty((count, 3), np.float32)
        self.columns: dict[str, Array] = {}

    def add(self, block: Block, organised: bool) -> None:
        if not block.keys() >= {"x", "y", "z"}:
            raise UnreadableError("x, y and z are not one number per point")
        axes = [block[axis] for axis in "xyz"]
        size = len(axes[0])
        self._make_room(size)
        room = self.xyz[self.kept : self.kept + size]
        if self.offset is None:
            self.offset = found_offset(axes)
        with np.errstate(over="ignore", invalid="ignore"):  # overflow of float32 gives inf, which is left out
            for at, (values, shift) in enumerate(zip(axes, self.offset or NONE, strict=True)):
                room[:, at] = values - shift if shift else values
            chosen = self._valid(room, organised)
        if chosen is not None:
            room = room[chosen]
        end = self.kept + len(room)
        self.xyz[self.kept : end] = room
        for name, values in block.items():
            if name not in ("x", "y", "z"):
                self._column(name, values)[self.kept : end] = values if chosen is None else values[chosen]
        self.read, self.kept = self.read + size, end

    def _make_room(self, size: int) -> None:
        """Make room for `size` more points; only the points of compressed files are not counted in advance."""
        if self.kept + size > len(self.xyz):
            for values in (self.xyz, *self.columns.values()):
                values.resize((2 * self.kept + size, *values.shape[1:]), refcheck=False)

    def _valid(self, xyz: Array, organised: bool) -> Array | None:
        """Mask of the valid points, (n,) bool; None for all."""
        if len(xyz) == 0 or (-self.farthest < xyz.min() and xyz.max() < self.farthest):  # NaN fails this
            level = xyz[xyz[:, 0] == 0]
            if level.any(axis=1).all():
                return None  # the common case of a scan without faults
        axes = xyz.T  # axis by axis, which is several times faster than along the rows of three
        sound = np.logical_and.reduce([np.abs(axis) < self.farthest for axis in axes])
        none = [np.isnan(axis) for axis in axes]
        unseen = np.logical_or.reduce(none) if organised else np.logical_and.reduce(none)
        self.bad += len(xyz) - int(np.count_nonzero(sound | unseen))
        return np.asarray(sound if self.everything else sound & np.logical_or.reduce([axis != 0 for axis in axes]))

    def _column(self, name: str, like: Array) -> Array:
        """The column `name`; float64 if its blocks have different types, as lines of text may give."""
        column, kind = self.columns.get(name), like.dtype.newbyteorder("=")
        if column is None:
            column = self.columns[name] = np.empty(len(self.xyz), kind)
        elif column.dtype != kind and len(like):
            column = self.columns[name] = column.astype(np.float64)
        return column

    def finished(self) -> dict[str, Array]:
        self.columns["xyz"] = self.xyz
        for values in self.columns.values():
            values.resize((self.kept, *values.shape[1:]), refcheck=False)  # releases unused memory
        return self.columns


def found_offset(axes: list[Array]) -> Offset | None:
    """Estimate the offset of coordinates in a map frame.

    Args:
        axes: x, y and z, (n,) each [m].

    Returns:
        The offset [m]; 0 for coordinates in the sensor's frame, None if there are too few points.

    Raises:
        UnreadableError: The coordinates are not in metres.
    """
    if len(axes[0]) == 0:
        return None
    if all(values.min() > -NOT_METRES and values.max() < NOT_METRES for values in axes):
        return NONE
    some = slice(None, None, max(1, len(axes[0]) // 4096))
    with np.errstate(invalid="ignore"):
        xyz = np.column_stack([values[some].astype(np.float64) for values in axes])
        xyz = xyz[np.isfinite(xyz).all(axis=1) & (xyz != 0).any(axis=1)]
    if len(xyz) < FEWEST:
        return None
    middle = np.median(xyz, axis=0)
    around = np.abs(xyz - middle).max(axis=1)
    if np.abs(middle).max() > FARTHEST and np.mean(around < FARTHEST) > 0.9:
        x, y, z = (float(round(value)) if abs(value) > 50 else 0.0 for value in middle)
        return (x, y, z)
    if NOT_METRES < np.median(np.abs(xyz).max(axis=1)) < 1e3 * NOT_METRES:
        raise UnreadableError("half of the points are farther than 1 km; save metres (are these millimetres?)")
    return NONE
