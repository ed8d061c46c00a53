"""Stamps out of digits, as names of files and lines of text have them: in s, ms, us or ns, whole or in two parts."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from slam.data.cloud import Array

EPOCH = (9.4e8, 4.3e9)  # s since 1970: the years 2000 to 2106
LONGEST_STEP = 10.0  # s from scan to scan; longer ones are of another unit
#: How many of a unit make a second.
PER_SECOND = {"s": 1, "ms": 10**3, "us": 10**6, "ns": 10**9}
DIGITS = {3: "ms", 6: "us", 9: "ns"}  # after the second, of a count of these


def seconds_of(values: Sequence[int | float]) -> tuple[Array, str]:
    """Stamps (N,) [s], exact to the last bit, and their unit.

    The unit follows from what the values are since 1970, else from their usual step: scans come 0.01 to 10 s apart.
    """
    table = np.array(values, np.float64)
    unit = epoch_unit(table) or _unit_of_steps(table)
    return np.array([value / PER_SECOND[unit] for value in values], np.float64), unit


def epoch_unit(values: Array) -> str | None:
    """The unit in which all values (N,) are times since 1970, None where there is none."""
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
    """Stamps (N,) [s] of whole seconds and what follows them, and how that was read.

    What follows is a decimal fraction, whose last zeros may have been left out, or a count, whose first zeros may have
    been: of ns, us or ms, where the longest has 9, 6 or 3 digits. Where these are not equally many, that is right by
    which the scans come at more regular intervals; where both are the same, a decimal `point` between the two makes it
    a fraction.
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
    """How much the steps between stamps (N,), in their order, differ: 0 where they are equal, inf without order."""
    steps = np.diff(stamps)
    if len(steps) == 0 or np.median(steps) <= 0:
        return np.inf if len(steps) else 0.0
    return round(float(np.mean(np.abs(steps / np.median(steps) - 1).clip(max=5))), 3)
