"""Data set, settings and front end of a run from the caller's arguments. This module joins slam and enrichment."""

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

FEW_RINGS = 16  # scans of a sensor with no more rings than this are used in full
MOST_ENRICHED = 42  # rings; above, there is no room for a virtual line between two rings of a target of about 64
TRAINING_FREE = "ray-segment"  # the method without weights


def opened(dataset: Dataset | str | Path, sequence: str | None, sensor: str | Path | None) -> Dataset:
    """Return the data set itself, or open it from its path.

    Raises:
        InputError: As `open_dataset`.
        ValueError: The data set is already open, so `sequence` and `sensor` would be ignored.
    """
    from slam.data.dataset import open_dataset

    if isinstance(dataset, str | Path):
        return open_dataset(dataset, sequence, sensor)
    if sequence is not None or sensor is not None:
        raise ValueError("the data set is already open; pass sequence and sensor to open_dataset")
    return dataset


def settings_for(
    rings: int | None,
    input: str | None = None,
    enricher: str | None = None,
    config: Config | str | Path | None = None,
    overrides: Sequence[str] = (),
) -> Config:
    """Return the settings of a run.

    Args:
        rings: Number of rings of the LiDAR (`ring_count`), None if unknown.
        input: 'full' (as recorded; also '64' with 64 rings), '16' or 'enriched'; by default as recorded.
        enricher: The enrichment method for input 'enriched'.
        config: A preset's name, a YAML file, or complete settings.
        overrides: Single settings, as in 'odometry.voxel_size=1.0'.

    Raises:
        InputError: The sensor does not have the rings for this input, or as `load_config` and
            `with_runnable_enricher`.
        ValueError: Other settings are given together with complete ones.
    """
    if isinstance(config, Config):
        if input or enricher or overrides:
            raise ValueError("config already holds all settings; leave input, enricher and overrides out")
        return with_runnable_enricher(config)
    if input == "64" and rings is not None and rings != 64:
        raise InputError(f"--input 64: the LiDAR has {rings} rings; use --input full, or leave it out")
    default = None if rings in (None, 64) else "16" if rings <= FEW_RINGS else "full"
    settings = load_config(config, overrides, input=input or default, enricher=enricher)
    if enricher and settings.front_end.input != "enriched":
        raise InputError(f"--enricher {enricher}: scans are not enriched without --input enriched; add it")
    return with_runnable_enricher(settings)


def with_runnable_enricher(settings: Config) -> Config:
    """Return the settings, with ray-segment if their enricher is a network whose weights are not installed.

    Settings, titles and run.json then name the method that is used, and the replacement is logged.

    Raises:
        InputError: As `Registry.load`, for the name of the enricher.
    """
    from enrichment.methods.registry import METHODS, runnable

    name = settings.front_end.enricher
    if settings.front_end.input != "enriched":
        return settings
    METHODS.load(name)  # a wrong name or a broken package is reported before any work begins
    if name in runnable():
        return settings
    log.warning("%s: the weights are not installed; %s is used instead", name, TRAINING_FREE)
    front_end = settings.front_end.model_copy(update={"enricher": TRAINING_FREE})
    return settings.model_copy(update={"front_end": front_end})


def front_end_for(
    settings: FrontEndSettings, sensor: Sensor | None, name: object, rings: int | None = None
) -> FrontEnd:
    """Return a new front end for one run. See `front_end_maker`."""
    return front_end_maker(settings, sensor, name, rings)()


def front_end_maker(
    settings: FrontEndSettings, sensor: Sensor | None, name: object, rings: int | None = None
) -> Callable[[], FrontEnd]:
    """Return a factory of the front end in the settings: measured rings alone, or enriched.

    An enriching front end calibrates itself on the scans it receives, and its method may too: each run needs its own.

    Args:
        settings: Settings of the front end.
        sensor: The LiDAR, None if unknown.
        name: Name of the data set, for error messages.
        rings: Number of rings of the LiDAR, if counted in its scans.

    Raises:
        InputError: As `RingFrontEnd`; or for input 'enriched' the laser lines or the method are unknown, or the laser
            lines are too dense.
    """
    from slam.front_end import RingFrontEnd

    measured = RingFrontEnd(settings, sensor, rings)
    if settings.input != "enriched":
        return lambda: RingFrontEnd(settings, sensor, rings)
    if sensor is None:
        raise InputError(
            f"{name}: enrichment needs the laser lines, and the sensor model is unknown; "
            "name the LiDAR: --sensor hdl64, --sensor vlp16 or --sensor FILE.yaml with its beams"
        )
    from enrichment.enricher import Enricher
    from enrichment.methods.registry import METHODS

    target = sensor if sensor.ring_count == 64 else None
    if target is None and sensor.ring_count > MOST_ENRICHED:
        raise InputError(
            f"{name}: {sensor.name} has {sensor.ring_count} rings, too dense for virtual beams between them; use "
            "--input full or --input 16"
        )
    make_method = METHODS.load(settings.enricher)
    return lambda: Enricher(measured, make_method(), *measured.lines(), target, coverage=settings.coverage)


def input_name(settings: Config) -> str:
    """Return the name of the input for titles, such as 'enriched by lift' or '16 channels'."""
    front_end = settings.front_end
    if front_end.input == "enriched":
        return f"enriched by {front_end.enricher}"
    return "all channels" if front_end.input == "full" else f"{front_end.input} channels"
