"""Data set, settings and front end of a run, by what the caller asks for. Here slam and enrichment meet."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from slam.config import load_config
from slam.data.errors import InputError
from slam.settings import Config

if TYPE_CHECKING:
    from slam.data.dataset import Dataset
    from slam.data.sensor import Sensor
    from slam.front_end import FrontEnd
    from slam.settings import FrontEndSettings

log = logging.getLogger("lidarlift")

FEW_RINGS = 16  # a sensor that has no more is taken as it is
MOST_ENRICHED = 42  # rings, between which there is room for one line and more where there are to be about 64
TRAINING_FREE = "ray-segment"  # the method that needs no weights


def opened(dataset: Dataset | str | Path, sequence: str | None, sensor: str | Path | None) -> Dataset:
    """A data set, or the one that `open_dataset` finds.

    Raises:
        InputError: As `open_dataset`.
        ValueError: The data set is open already, so that `sequence` and `sensor` would be ignored.
    """
    from slam.data.dataset import open_dataset

    if isinstance(dataset, str | Path):
        return open_dataset(dataset, sequence, sensor)
    if sequence is not None or sensor is not None:
        raise ValueError("the data set is open already; give sequence and sensor to open_dataset")
    return dataset


def settings_for(
    rings: int | None,
    input: str | None = None,
    enricher: str | None = None,
    config: Config | str | Path | None = None,
    overrides: Sequence[str] = (),
) -> Config:
    """The settings of a run.

    Args:
        rings: How many rings the LiDAR has (`ring_count`), None where that is unknown.
        input: 'full' (as recorded; 64 rings also '64'), '16' or 'enriched'; by default as recorded.
        enricher: The method that fills in, for input 'enriched'.
        config: A preset's name, a YAML file, or settings that are complete already.
        overrides: Single settings, as in 'odometry.voxel_size=1.0'.

    Raises:
        InputError: The sensor does not have what is asked for, or as `load_config` and `with_runnable_enricher`.
        ValueError: Complete settings and others beside them are given.
    """
    if isinstance(config, Config):
        if input or enricher or overrides:
            raise ValueError("config holds all settings already; leave input, enricher and overrides out")
        return with_runnable_enricher(config)
    if input == "64" and rings is not None and rings != 64:
        raise InputError(f"--input 64: the LiDAR has {rings} rings; use --input full, or leave it out")
    default = None if rings in (None, 64) else "16" if rings <= FEW_RINGS else "full"
    settings = load_config(config, overrides, input=input or default, enricher=enricher)
    if enricher and settings.front_end.input != "enriched":
        raise InputError(f"--enricher {enricher}: nothing is filled in here; add --input enriched")
    return with_runnable_enricher(settings)


def with_runnable_enricher(settings: Config) -> Config:
    """The same settings, or with ray-segment where their enricher is a network whose weights are not installed.

    Settings, titles and run.json then name the method that really runs; the log says so.

    Raises:
        InputError: As `Registry.load`, on the name of the enricher.
    """
    from enrichment.methods.registry import METHODS, runnable

    name = settings.front_end.enricher
    if settings.front_end.input != "enriched":
        return settings
    METHODS.load(name)  # a wrong name or a broken package is refused before any work begins
    if name in runnable():
        return settings
    log.warning("%s: its weights are not installed; %s takes its place", name, TRAINING_FREE)
    front_end = settings.front_end.model_copy(update={"enricher": TRAINING_FREE})
    return settings.model_copy(update={"front_end": front_end})


def front_end_for(
    settings: FrontEndSettings, sensor: Sensor | None, name: object, rings: int | None = None
) -> FrontEnd:
    """The front end of one run, which has seen no scan as yet. See `front_end_maker`."""
    return front_end_maker(settings, sensor, name, rings)()


def front_end_maker(
    settings: FrontEndSettings, sensor: Sensor | None, name: object, rings: int | None = None
) -> Callable[[], FrontEnd]:
    """What makes the front end that the settings ask for: the rings that are there, or what fills them in.

    A front end that fills in learns from the scans that it is shown, and so may its method: each run has its own.

    Args:
        settings: Of the front end.
        sensor: The LiDAR, None where it is unknown.
        name: Of the data set, for messages.
        rings: How many rings the LiDAR has, where that was counted.

    Raises:
        InputError: As `RingFrontEnd`; or the scans are to be enriched and the laser lines are unknown, or too dense for
            it, or the method is unknown.
    """
    from slam.front_end import RingFrontEnd

    measured = RingFrontEnd(settings, sensor, rings)
    if settings.input != "enriched":
        return lambda: RingFrontEnd(settings, sensor, rings)
    if sensor is None:
        raise InputError(
            f"{name}: to enrich its scans the laser lines have to be known; "
            "name the LiDAR: --sensor hdl64, --sensor vlp16 or --sensor FILE.yaml with its beams"
        )
    from enrichment.enricher import Enricher
    from enrichment.methods.registry import METHODS

    target = sensor if sensor.ring_count == 64 else None
    if target is None and sensor.ring_count > MOST_ENRICHED:
        raise InputError(
            f"{name}: {sensor.name} has {sensor.ring_count} rings, as dense as what enriching gives: there are no rays "
            "between them to fill; use --input full or --input 16"
        )
    make_method = METHODS.load(settings.enricher)
    return lambda: Enricher(measured, make_method(), *measured.lines(), target, coverage=settings.coverage)


def input_name(settings: Config) -> str:
    """Of a configuration, for people."""
    front_end = settings.front_end
    if front_end.input == "enriched":
        return f"enriched by {front_end.enricher}"
    return "all channels" if front_end.input == "full" else f"{front_end.input} channels"
