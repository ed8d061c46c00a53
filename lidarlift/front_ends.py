"""Data set, settings and front end of a run from the caller's arguments. This module joins slam and enrichment."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from slam.data.errors import InputError

if TYPE_CHECKING:
    from slam.data.dataset import Dataset
    from slam.data.sensor import Sensor
    from slam.front_end import FrontEnd
    from slam.settings import Config, FrontEndSettings

log = logging.getLogger("lidarlift")

FEW_RINGS = 16  # of the sparse input; scans of a sensor with no more rings are used in full
MOST_ENRICHED = 42  # rings; above, there is no room for a virtual line between two rings of a target of about 64
TRAINING_FREE = "ray-segment"  # the method without weights
LIFT = "lift"


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
        input: 'full' (as recorded; also '64' with 64 rings), a number of rings, or 'enriched'; by default that of
            `config`, else as recorded.
        enricher: The enrichment method for input 'enriched'.
        config: A preset's name, a YAML file, or complete settings.
        overrides: Single settings, as in 'odometry.voxel_size=1.0'.

    Raises:
        InputError: The sensor does not have the rings for this input, or as `load_config` and
            `with_runnable_enricher`.
        ValueError: Other settings are given together with complete ones.
    """
    from slam.config import load_config  # pydantic takes a while to import
    from slam.settings import Config

    if isinstance(config, Config):
        if input or enricher or overrides:
            raise ValueError("config already contains all settings; leave input, enricher and overrides out")
        return with_runnable_enricher(config)
    settings = load_config(config, overrides, input=input, enricher=enricher)
    if "input" not in settings.front_end.model_fields_set:
        settings = _with_front_end(settings, input=recorded_input(rings))
    _check_input(settings.front_end.input, rings)
    if enricher and settings.front_end.input != "enriched":
        raise InputError(f"--enricher {enricher}: scans are not enriched without --input enriched; add it")
    return with_runnable_enricher(settings)


def recorded_input(rings: int | None) -> str:
    """Return the name of the input that is the scan as recorded: '64' or '16' for so many rings, else 'full'."""
    return str(rings) if rings in (FEW_RINGS, 64) else "full"


def _check_input(name: str, rings: int | None) -> None:
    """Raise InputError if the LiDAR does not have as many rings; 64 always stands for all of 64 rings."""
    if rings is None or name in ("full", "enriched", str(FEW_RINGS)):
        return
    if int(name) > rings or (name == "64" and rings != 64):
        raise InputError(f"--input {name}: the LiDAR has {rings} rings; use --input full, or leave it out")


def _with_front_end(settings: Config, **values: str) -> Config:
    return settings.model_copy(update={"front_end": settings.front_end.model_copy(update=values)})


def with_runnable_enricher(settings: Config) -> Config:
    """Return the settings, with ray-segment if their enricher is a network whose weights are not installed.

    Settings, titles and run.json then name the method that is used, and the replacement is logged.

    Raises:
        InputError: As `Registry.load`, for the name of the enricher.
    """
    from enrichment.methods.registry import METHODS, can_run

    name = settings.front_end.enricher
    if settings.front_end.input != "enriched":
        return settings
    METHODS.load(name)  # a wrong name or a broken package is reported before any work begins
    if can_run(name):
        return settings
    log.warning("%s: the weights are not installed; %s is used instead", name, TRAINING_FREE)
    return _with_front_end(settings, enricher=TRAINING_FREE)


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
    target = None if measured.kept is None else sensor  # dropped rings are predicted on their own lines
    if sensor is None or (target is None and why_not_enriched(sensor, rings)):
        raise InputError(f"{name}: no enrichment: {why_not_enriched(sensor, rings)}")
    from enrichment.enricher import Enricher
    from enrichment.methods.registry import METHODS

    make_method = METHODS.load(settings.enricher)
    return lambda: Enricher(measured, make_method(), *measured.lines(), target, coverage=settings.coverage)


def why_not_enriched(sensor: Sensor | None, rings: int | None) -> str | None:
    """Return why the scans of a LiDAR are not enriched, and what to do; None if they are.

    Args:
        sensor: The LiDAR, None if unknown.
        rings: Number of rings, if known.
    """
    if sensor is None:
        lines = "the laser lines are unknown" if rings else "the scans have no rings, and the laser lines are unknown"
        remedy = "name the LiDAR: --sensor hdl64, --sensor vlp16 or --sensor FILE.yaml with its laser lines"
        return f"{lines}; {remedy} (a LiDAR without rings is not enriched: --input full)"
    if sensor.ring_count == 64 or sensor.ring_count <= MOST_ENRICHED:
        return None
    return (
        f"{sensor.name} has {sensor.ring_count} rings, too dense for virtual beams between them; use --input full, or "
        "enrich some of them: --set front_end.enriched_rings=16"
    )


def front_end_notes(settings: FrontEndSettings, sensor: Sensor | None, rings: int | None = None) -> tuple[str, ...]:
    """Return notes about the input for the reader of the results. Arguments as in `front_end_maker`."""
    if settings.input != "enriched" or settings.enricher != LIFT or sensor is None:
        return ()
    from enrichment.methods.lift import gap_note
    from slam.front_end import RingFrontEnd

    note = gap_note(*RingFrontEnd(settings, sensor, rings).lines())
    return () if note is None else (note,)


def input_name(settings: Config) -> str:
    """Return the name of the input for titles, such as 'enriched by lift' or '16 channels'."""
    front_end = settings.front_end
    if front_end.input == "enriched":
        return f"enriched by {front_end.enricher}"
    return "all channels" if front_end.input == "full" else f"{front_end.input} channels"
