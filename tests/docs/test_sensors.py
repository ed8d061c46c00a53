"""The page of the built-in LiDARs."""

from __future__ import annotations

from benchmarks.sensors.table import MODELS, PAGE, page
from slam.data.sensor import load_sensor
from slam.data.sensor_names import SENSORS


def test_the_page_has_the_tables() -> None:
    """If this fails, run `python -m benchmarks.sensors.table`."""
    assert PAGE.read_text(encoding="utf-8") == page()


def test_every_lidar_has_a_row_and_a_source() -> None:
    assert list(MODELS) == SENSORS.names()
    assert all(load_sensor(name).source for name in MODELS)


def test_makers_names_are_understood() -> None:
    for name, model in MODELS.items():
        assert load_sensor(model.partition(" (")[0].removesuffix(" Plus")).name == name
