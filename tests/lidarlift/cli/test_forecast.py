"""How long a command still takes."""

from __future__ import annotations

import pytest

from lidarlift.cli.forecast import USUAL, Forecast, timed_loops

STEPS = {"simulation": 60.0, "16": 30.0, "64": 90.0}


class Clock:
    now = 100.0

    def __call__(self) -> float:
        return self.now


def test_at_first_a_short_timing_tells() -> None:
    assert str(Forecast(STEPS, timed=lambda: USUAL)) == "about 3 minutes"
    assert str(Forecast(STEPS, timed=lambda: 1.15 * USUAL)) == "about 3.5 minutes"
    assert str(Forecast(STEPS, timed=lambda: 4 * USUAL)) == "about 12 minutes"
    assert str(Forecast(STEPS, timed=lambda: USUAL / 3)) == "about 60 seconds"


def test_then_what_the_steps_took_tells() -> None:
    clock = Clock()
    forecast = Forecast(STEPS, clock, lambda: 7 * USUAL)
    clock.now += 30
    forecast.done("simulation")  # twice as fast as usual, whatever the timing was
    assert str(forecast) == "about 60 seconds"
    clock.now += 60
    forecast.done("16")  # 90 usual seconds in 90
    assert str(forecast) == "about 90 seconds"
    assert forecast.left
    forecast.done("64")
    assert not forecast.left


def test_a_step_with_nothing_to_do_tells_nothing() -> None:
    clock = Clock()
    forecast = Forecast({"simulation": 0.0, "16": 100.0}, clock, lambda: USUAL)
    clock.now += 1
    forecast.done("simulation")
    assert str(forecast) == "about 100 seconds"


def test_never_less_than_ten_seconds() -> None:
    assert str(Forecast({"16": 0.1}, timed=lambda: USUAL)) == "about 10 seconds"


def test_the_timing_of_this_machine_is_a_time(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("lidarlift.cli.forecast.LOOPS", 1000)
    assert timed_loops() > 0
