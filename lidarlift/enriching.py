"""A drive's scans with what lies between their rings filled in."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from lidarlift.front_ends import front_end_for, opened, settings_for

if TYPE_CHECKING:
    from slam.data.cloud import Frame, PointCloud
    from slam.data.dataset import Dataset


def enrich(
    dataset: Dataset | str | Path,
    *,
    sequence: str | None = None,
    sensor: str | Path | None = None,
    enricher: str | None = None,
    config: str | Path | None = None,
    overrides: Sequence[str] = (),
    frames: slice = slice(None),
) -> Iterator[tuple[Frame, PointCloud]]:
    """Fill in the scans of a drive, one after the other.

    Of 64-ring scans every fourth ring is taken (front_end.phase, front_end.drop); of other sensors all.

    Args:
        dataset: An open data set; or a path that `open_dataset` takes, with `sequence` and `sensor`.
        sequence: Which sequence or drive, where the folder has several.
        sensor: The LiDAR's name or a YAML file with its beams, where the folder does not say.
        enricher: The method, such as 'ray-segment', which needs no training, or 'lift', our network, the default.
        config: A preset's name or a YAML file.
        overrides: Single settings, as in 'front_end.coverage=0.8'.
        frames: Positions in the data set, as in a list's slice.

    Yields:
        Each frame with its cloud on about 64 virtual beams, as recorded: neither deskewed nor vertically corrected.
        `measured` tells returns from predictions, and `sigma` how sure these are [m].

    Raises:
        InputError: No frames are left, or the laser lines are unknown: at once, before anything is yielded.
        ValueError: `sequence` or `sensor` is given for a data set that is open already.

    Example:
        >>> for frame, cloud in lidarlift.enrich("my_drive", sensor="vlp16", enricher="ray-segment"):
        ...     print(frame.index, len(cloud), cloud.sigma[~cloud.measured].mean())
    """
    from slam.data.dataset import chosen_positions

    data = opened(dataset, sequence, sensor)
    from slam.data.dataset import ring_count

    settings = settings_for(ring_count(data), "enriched", enricher, config, overrides).front_end
    front_end = front_end_for(settings, data.sensor, data.path)
    recorded = (data[position] for position in chosen_positions(data, frames))
    return ((frame, front_end(frame, ())) for frame in recorded)
