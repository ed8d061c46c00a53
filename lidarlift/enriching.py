"""Enrichment of the scans of a sequence: points are predicted between the measured rings."""

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
    """Enrich the scans of a sequence one by one.

    64-ring scans are first reduced to every fourth ring (front_end.phase, front_end.ring_selection); scans of other
    sensors keep all rings.

    Args:
        dataset: An open data set; or a path that `open_dataset` takes, with `sequence` and `sensor`.
        sequence: Name of the sequence, if the folder has several.
        sensor: Name of the LiDAR or a YAML file with its beams, if the folder does not say.
        enricher: The enrichment method: 'ray-segment', the default, needs no training; 'lift' is our network.
        config: A preset's name or a YAML file.
        overrides: Single settings, as in 'front_end.coverage=0.8'.
        frames: Positions in the data set, as a slice of a list.

    Yields:
        Each frame and its cloud on about 64 virtual beams, as recorded: neither deskewed nor vertically corrected.
        `measured` separates returns from predictions; `sigma` [m] is the predicted uncertainty of the range.

    Raises:
        InputError: The slice selects no frames, or the laser lines are unknown. Raised at once, before anything is
            yielded.
        ValueError: `sequence` or `sensor` is given for a data set that is already open.

    Example:
        >>> for frame, cloud in lidarlift.enrich("my_sequence", sensor="vlp16", enricher="ray-segment"):
        ...     print(frame.index, len(cloud), cloud.sigma[~cloud.measured].mean())
    """
    from slam.data.dataset import chosen_positions

    data = opened(dataset, sequence, sensor)
    from slam.data.dataset import ring_count

    settings = settings_for(ring_count(data), "enriched", enricher, config, overrides).front_end
    front_end = front_end_for(settings, data.sensor, data.path)
    recorded = (data[position] for position in chosen_positions(data, frames))
    return ((frame, front_end(frame, ())) for frame in recorded)
