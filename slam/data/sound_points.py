"""The points of a file that are of use, gathered block by block, in metres from the sensor."""

from __future__ import annotations

import numpy as np

from slam.data.cloud import Array
from slam.data.point_blocks import Block, Content, UnreadableError

#: No LiDAR sees farther [m]: larger coordinates come from damaged files.
FARTHEST = 1e4
#: Scans half of whose points are farther [m] than any LiDAR's are not in metres.
NOT_METRES = 1e3
#: So many points at least, before anything is said of all of them.
FEWEST = 10
Offset = tuple[float, float, float]
NONE: Offset = (0.0, 0.0, 0.0)


def gathered(
    content: Content, everything: bool = False, offset: Offset | None = None
) -> tuple[dict[str, Array], Offset]:
    """The sound points of a file: `xyz` (N, 3) float32 and each column (N,) in its type, by their names.

    Left out are points at the origin, which drivers write where a laser got no answer, and NaN, in an organised cloud
    or in all three coordinates, silently for the same reason; other points that are not finite or farther than
    `FARTHEST`, with a fault. Coordinates of a map's frame (UTM, ECEF) are moved to the first points.

    Args:
        content: The file's. Its faults are added to.
        everything: Keep all points that are finite, wherever they are: for maps.
        offset: What is subtracted from the coordinates; by default found in the first points.

    Returns:
        The columns, and the offset [m] that was subtracted.

    Raises:
        UnreadableError: The file has no x, y and z, or is damaged beyond use.
    """
    missing = sorted({"x", "y", "z"} - set(content.names))
    if missing:
        has = ", ".join(map(str, content.names[:12]))
        raise UnreadableError(f"fields x, y and z are needed; it has {has[:200]}")
    gathering = _Gathering(content.count, everything, NONE if everything else offset)
    for block in content.blocks:
        gathering.add(block, content.organised)
    if gathering.bad:
        text = f"{gathering.bad} of {gathering.read} points are not finite, or farther than {FARTHEST / 1000:g} km"
        content.faults.append(("non-finite points", f"{text}; left out"))
    return gathering.finished(), gathering.offset or NONE


def map_frame(offset: Offset) -> str:
    """What to say of coordinates from which `offset` was subtracted."""
    place = " ".join(f"{value:g}" if abs(value) < 1e6 else f"{value:.0f}" for value in offset)
    return (
        f"coordinates of a map's frame, about {place} (UTM?); that offset was subtracted. Scans are needed in the "
        "sensor's own frame, and in float64 where they are so far from 0"
    )


class _Gathering:
    """Columns that grow by the sound points of one block after another."""

    def __init__(self, count: int, everything: bool, offset: Offset | None) -> None:
        self.offset, self.farthest = offset, np.inf if everything else FARTHEST
        self.everything = everything
        self.read, self.kept, self.bad = 0, 0, 0
        self.xyz = np.empty((count, 3), np.float32)
        self.columns: dict[str, Array] = {}

    def add(self, block: Block, organised: bool) -> None:
        if not block.keys() >= {"x", "y", "z"}:
            raise UnreadableError("its coordinates are no numbers, one a point")
        axes = [block[axis] for axis in "xyz"]
        size = len(axes[0])
        self._make_room(size)
        room = self.xyz[self.kept : self.kept + size]
        if self.offset is None:
            self.offset = found_offset(axes)
        with np.errstate(over="ignore", invalid="ignore"):  # what float32 cannot hold is infinite, and left out
            for at, (values, shift) in enumerate(zip(axes, self.offset or NONE, strict=True)):
                room[:, at] = values - shift if shift else values
            chosen = self._chosen(room, organised)
        if chosen is not None:
            room = room[chosen]
        end = self.kept + len(room)
        self.xyz[self.kept : end] = room
        for name, values in block.items():
            if name not in "xyz":
                self._column(name, values)[self.kept : end] = values if chosen is None else values[chosen]
        self.read, self.kept = self.read + size, end

    def _make_room(self, size: int) -> None:
        """For as many more points. Only those of packed files are not counted beforehand."""
        if self.kept + size > len(self.xyz):
            for values in (self.xyz, *self.columns.values()):
                values.resize((2 * self.kept + size, *values.shape[1:]), refcheck=False)

    def _chosen(self, xyz: Array, organised: bool) -> Array | None:
        """Which points are of use, (n,) bool; None for all."""
        if len(xyz) == 0 or (-self.farthest < xyz.min() and xyz.max() < self.farthest and xyz.all()):
            return None  # a NaN fails these, so it is the common case of a scan that is all right
        axes = xyz.T  # one by one, which is several times faster than along the rows of three
        sound = np.logical_and.reduce([np.abs(axis) < self.farthest for axis in axes])
        none = [np.isnan(axis) for axis in axes]
        unseen = np.logical_or.reduce(none) if organised else np.logical_and.reduce(none)
        self.bad += len(xyz) - int(np.count_nonzero(sound | unseen))
        return np.asarray(sound if self.everything else sound & np.logical_or.reduce([axis != 0 for axis in axes]))

    def _column(self, name: str, like: Array) -> Array:
        """The column of that name. One of another type than before, as lines of text may give, becomes float64."""
        column, kind = self.columns.get(name), like.dtype.newbyteorder("=")
        if column is None:
            column = self.columns[name] = np.empty(len(self.xyz), kind)
        elif column.dtype != kind and len(like):
            column = self.columns[name] = column.astype(np.float64)
        return column

    def finished(self) -> dict[str, Array]:
        self.columns["xyz"] = self.xyz
        for values in self.columns.values():
            values.resize((self.kept, *values.shape[1:]), refcheck=False)  # gives back the room that was not needed
        return self.columns


def found_offset(axes: list[Array]) -> Offset | None:
    """What to subtract from coordinates of a map's frame; 0 where they are the sensor's, None where none is there.

    Raises UnreadableError where they are no metres.
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
        raise UnreadableError("half of its points are farther than 1 km; metres are expected: are these millimetres?")
    return NONE
