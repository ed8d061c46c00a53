"""How long a command still takes."""

from __future__ import annotations

import pytest

from lidarlift.cli.forecast import REFERENCE, Forecast, timed_loops

STEPS = {"simulation": 60.0, "16": 30.0, "64": 90.0}


class Clock:
    now = 100.0

    def __call__(self) -> float:
        return self.now


def test_the_first_forecast_uses_the_benchmark() -> None:
    assert str(Forecast(STEPS, timed=lambda: REFERENCE)) == "about 3 minutes"
    assert str(Forecast(STEPS, timed=lambda: 1.15 * REFERENCE)) == "about 3.5 minutes"
    assert str(Forecast(STEPS, timed=lambda: 4 * REFERENCE)) == "about 12 minutes"
    assert str(Forecast(STEPS, timed=lambda: REFERENCE / 3)) == "about 60 seconds"


def test_later_forecasts_use_the_finished_steps() -> None:
    clock = Clock()
    forecast = Forecast(STEPS, clock, lambda: 7 * REFERENCE)
    clock.now += 30
    forecast.done("simulation")  # twice as fast as usual, whatever the timing was
    assert str(forecast) == "about 60 seconds"
    clock.now += 60
    forecast.done("16")  # 90 usual seconds in 90
    assert str(forecast) == "about 90 seconds"
    assert forecast.left
    forecast.done("64")
    assert not forecast.left


def test_steps_of_zero_seconds_do_not_change_the_scale() -> None:
    clock = Clock()
    forecast = Forecast({"simulation": 0.0, "16": 100.0}, clock, lambda: REFERENCE)
    clock.now += 1
    forecast.done("simulation")
    assert str(forecast) == "about 100 seconds"


def test_the_forecast_is_at_least_ten_seconds() -> None:
    assert str(Forecast({"16": 0.1}, timed=lambda: REFERENCE)) == "about 10 seconds"


def test_timed_loops_returns_seconds(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("lidarlift.cli.forecast.LOOPS", 1000)
    assert timed_loops() > 0
