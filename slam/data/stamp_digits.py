"""Conversion of digits in file names and lines of text to stamps: in s, ms, us or ns, in one or two numbers."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from slam.data.cloud import Array

EPOCH = (9.4e8, 4.3e9)  # s since 1970: the years 2000 to 2106
LONGEST_STEP = 10.0  # maximum scan period [s]; larger steps mean another unit
#: Units per second.
PER_SECOND = {"s": 1, "ms": 10**3, "us": 10**6, "ns": 10**9}
DIGITS = {3: "ms", 6: "us", 9: "ns"}  # by the number of digits of the second number


def seconds_of(values: Sequence[int | float]) -> tuple[Array, str]:
    """Convert numbers to stamps.

    The unit is that in which the values are times since 1970, else it follows from their median step: scans are 0.01 to
    10 s apart.

    Returns:
        Stamps (N,) [s], exact to the last bit, and their unit.
    """
    table = np.array(values, np.float64)
    unit = epoch_unit(table) or _unit_of_steps(table)
    return np.array([value / PER_SECOND[unit] for value in values], np.float64), unit


def epoch_unit(values: Array) -> str | None:
    """Return the unit in which the values (N,) are times since 1970, or None."""
    known = values[np.isfinite(values) & (values != 0)]
    for unit, many in PER_SECOND.items():
        if len(known) and EPOCH[0] * many <= np.median(known) <= EPOCH[1] * many:
            return unit
    return None


def _unit_of_steps(values: Array) -> str:
    steps = np.diff(values[np.isfinite(values)])
    step = float(np.median(steps[steps > 0])) if (steps > 0).any() else 0.0
    return next((unit for unit, many in PER_SECOND.items() if step <= LONGEST_STEP * many), "ns")


def seconds_of_pairs(whole: Sequence[str], part: Sequence[str], point: bool) -> tuple[Array, str]:
    """Convert pairs of whole seconds and a second number to stamps.

    The second number is a decimal fraction, perhaps without trailing zeros, or a count of ns, us or ms (if the longest
    has 9, 6 or 3 digits), perhaps without leading zeros. If the numbers of digits differ, the reading with the more
    regular intervals is taken; if both are equally regular, `point` decides.

    Args:
        whole: N texts, seconds.
        part: N texts, the second numbers.
        point: Whether a decimal point separates the two, which makes the second a fraction.

    Returns:
        Stamps (N,) [s], and the reading: 's', or 's and ns' etc.
    """
    fraction = np.array([float(f"{a}.{b}") for a, b in zip(whole, part, strict=True)])
    unit = DIGITS.get(max(len(text) for text in part))
    if unit is None:
        return fraction, "s"
    many = PER_SECOND[unit]
    count = np.array([(int(a) * many + int(b)) / many for a, b in zip(whole, part, strict=True)])
    readings = [(fraction, "s"), (count, f"s and {unit}")]
    if not point:
        readings.reverse()
    return min(readings, key=lambda reading: unevenness(np.sort(reading[0])))


def unevenness(stamps: Array) -> float:
    """Return the mean relative deviation of the steps between stamps (N,) from their median, infinite if that is 0."""
    steps = np.diff(stamps)
    if len(steps) == 0 or np.median(steps) <= 0:
        return np.inf if len(steps) else 0.0
    return round(float(np.mean(np.abs(steps / np.median(steps) - 1).clip(max=5))), 3)
