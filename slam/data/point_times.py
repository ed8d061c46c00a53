"""When in its sweep each point was seen: which field of a drive's scans says so, in which unit, from which instant on.

Found once a drive, from its first scans, so that one odd scan changes nothing for the others.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from slam.data.cloud import Array
from slam.data.conventions import INSTANTS, UNITS, Conventions
from slam.data.errors import InputError
from slam.data.stamp_digits import epoch_unit

PERIOD = 0.1  # s from scan to scan, where no stamp tells
LONGEST = 3.0  # periods that a sweep takes at most; without stamps
LONGEST_UNSTAMPED = 10.0  # of PERIOD
SHORTEST = 0.01  # periods that points span at least: 4 degrees of a turn
SPREAD = 6.0  # interquartile ranges from the median: farther away are stray values
COARSE = 0.05  # of the points' span: a field whose numbers lie farther apart says too little
BLOCK = 0.05  # of a sweep, from the stamp: times of 0 that lie among later ones are of lost packets
MOST_STRAY = 0.5  # of a scan's times; where more are unusable, it has none
NEAR = 0.1  # of the span, on either side of 0
BINS = 24  # parts of a sweep in which the turning is measured,
NARROW = 0.7  # mean of the unit vectors to the points of a part: there the sensor looks into one direction
EVEN, ALIKE = 0.3, 0.6  # within so much of the usual step in so large a share of them, or it does not turn
AZIMUTH = "azimuth"  # in place of a field
SWEEP_UNIT = "sweep"  # of fields that say which share of the sweep had gone by


@dataclass(frozen=True, eq=False)
class Sample:
    """One of a drive's first scans: its fields that may be times (M,) by their names, its points (M, 3), and its stamp
    [s] where that was recorded."""

    times: Mapping[str, Array]
    xyz: Array
    stamp: float | None = None


@dataclass(frozen=True)
class PointTimes:
    """The verdict on a drive: how seconds from a scan's stamp are made of its points' times.

    Attributes:
        field: The field's name; 'azimuth' where the points' directions tell; '' where there are no times, and
        why: the reason for that.
        unit: Of the field: 's', 'ms', 'us', 'ns' or 'sweep'.
        absolute: Whether it counts on from scan to scan, as a clock does.
        clock: Whether that clock is the one of the stamps.
        first: When the first points are usually seen [s] from the stamp, and
        last: the last ones.
        sweep: Seconds that a whole sweep takes; a scan may have a part of it.
        stamp: The instant of the sweep that stamp and pose belong to: 'start', 'middle' or 'end'.
        shift: Seconds that are added to what the field says, for the stamp to be at 0.
        period: Seconds from scan to scan by an absolute field, None where there is no such.
    """

    field: str = ""
    why: str = ""
    unit: str = "s"
    absolute: bool = False
    clock: bool = False
    first: float = 0.0
    last: float = 0.0
    sweep: float = PERIOD
    stamp: str = "middle"
    shift: float = 0.0
    period: float | None = None

    def seconds(self, values: Array, stamp: float) -> tuple[Array | None, int]:
        """Times (M,) float32 [s] from the `stamp` [s] of a scan, of its field's values (M,), and how many had to be put
        between those beside them in the file: not finite, or outside of any sweep. None where most are so."""
        time, origin = _from_origin(values, self._factor)
        sound = np.isfinite(time)
        if not sound.any():
            return None, len(time)
        reach = max(self.sweep, self.last - self.first)
        with np.errstate(invalid="ignore"):
            sound &= np.abs(time - np.median(time[sound])) <= reach
        if not self.absolute:
            time = time + origin
            sound &= ~_lost(time, BLOCK * self.sweep)
        elif self.clock:
            time = time + (origin - stamp)
        else:
            time = time - (time[sound].min() if sound.any() else 0.0)
        missing = len(time) - int(np.count_nonzero(sound))
        if missing > MOST_STRAY * len(time):
            return None, missing
        if missing:
            places = np.flatnonzero(sound)
            time[~sound] = np.interp(np.flatnonzero(~sound), places, time[places])
        return (time + self.shift).astype(np.float32), missing

    @property
    def _factor(self) -> float:
        return self.sweep if self.unit == SWEEP_UNIT else UNITS[self.unit]

    def verdict(self, timed: int, scans: int) -> str:
        """In one line for people, with how many of a run's `scans` had times."""
        if not self.field:
            return f"point times: none ({self.why}); stamp = {self.stamp}"
        how = f"field {self.field}, {self.unit}, {'absolute' if self.absolute else 'relative'}"
        how = "from the azimuth" if self.field == AZIMUTH else how
        span = f"{_milliseconds(self.first)} to {_milliseconds(self.last)} ms of a {_milliseconds(self.sweep)} ms sweep"
        return f"point times: {how}, {span}, in {timed} of {scans} scans; stamp = {self.stamp}"


def _milliseconds(seconds: float) -> str:
    return f"{round(1e3 * seconds, 1) + 0.0:g}"  # + 0.0 makes -0 0


def azimuth_times(sweep: float, stamp: str) -> PointTimes:
    """Of scans that turn once in `sweep` [s], from the rear: see `turn_times`."""
    first = -INSTANTS[stamp] * sweep
    return PointTimes(AZIMUTH, first=first, last=first + sweep, sweep=sweep, stamp=stamp)


def find_point_times(samples: Sequence[Sample], period: float | None, said: Conventions) -> PointTimes:
    """The verdict on a drive.

    Args:
        samples: Its first scans, those without points left out.
        period: Seconds from scan to scan by the stamps, None where there are none.
        said: What the user says of field, unit and stamp.

    Raises:
        InputError: The field that the user names is not there.
    """
    names = dict.fromkeys(name for sample in samples for name in sample.times)
    if said.time_field is not None:
        if samples and said.time_field not in names:
            known = f"there are {', '.join(names)}" if names else "there are none"
            raise InputError(f"no field '{said.time_field}' with the points' times in the first scans; {known}")
        names = {name: None for name in names if name == said.time_field}
    faults = []
    for name in names:
        found = _of_field(name, [sample for sample in samples if name in sample.times], period, said)
        if found.field:
            return found
        faults.append(found.why)
    sweep = period or PERIOD
    return PointTimes(why="; ".join(faults) or "no field for them", sweep=sweep, stamp=said.stamp or "middle")


@dataclass(frozen=True, eq=False)
class _Seen:
    """A field in one scan: its values (M,), the first and the last, stray ones left out, in the field's unit, how far
    apart its type keeps them, and the points and stamp of the scan."""

    values: Array
    first: float
    last: float
    apart: float
    xyz: Array
    stamp: float | None


def _seen(sample: Sample, name: str) -> _Seen | None:
    """None where the values are all the same, or mostly not finite."""
    values = sample.times[name]
    if values.dtype.kind not in "fiu" or len(values) == 0:
        return None
    known = values[np.isfinite(values)]
    if len(known) * 2 < len(values):
        return None
    away, origin = _from_origin(known, 1.0)
    quarter, middle, three = np.percentile(away, [25, 50, 75])
    near = away[np.abs(away - middle) <= SPREAD * (three - quarter)]
    if near.min() == near.max():
        return None
    apart = float(np.spacing(np.abs(known).max())) if values.dtype == np.float32 else 0.0
    return _Seen(values, origin + near.min(), origin + near.max(), apart, sample.xyz, sample.stamp)


def _of_field(name: str, samples: Sequence[Sample], period: float | None, said: Conventions) -> PointTimes:
    """The verdict if this field has the times; without `field`, but with the reason, where it has none."""
    scans = [found for sample in samples if (found := _seen(sample, name)) is not None]
    if len(scans) * 2 <= len(samples):
        return PointTimes(why=f"{name} is the same for all points, or not finite")
    span = _median(scan.last - scan.first for scan in scans)
    apart = max(scan.apart for scan in scans)
    if apart > COARSE * span:
        return PointTimes(why=f"{name} is float32 and too large for it, its numbers are {apart:.3g} apart")
    usual = min(max(period or PERIOD, 0.05), 0.5)
    longest = LONGEST * usual if period else LONGEST_UNSTAMPED * PERIOD
    unit = said.time_unit or _unit(scans, span, longest)
    factor = usual if unit == SWEEP_UNIT else UNITS[unit]
    if not SHORTEST * usual <= span * factor <= longest:
        return PointTimes(why=f"{name} spans {span:.4g}, which is no sweep in any unit of time")
    absolute = _counts_on(scans, factor, span, usual)
    clock = absolute and _same_clock(scans, factor, usual)
    first, last = 0.0, span * factor
    if clock or not absolute:
        first = _median(scan.first * factor - (scan.stamp or 0.0) * clock for scan in scans)
        last = _median(scan.last * factor - (scan.stamp or 0.0) * clock for scan in scans)
    steps = np.diff([scan.first for scan in scans])
    own_period = float(np.median(steps)) * factor if absolute and len(steps) and np.median(steps) > 0 else None
    sweep = _sweep(scans, factor, period or own_period, last - first)
    own = _instant(first, last)
    stamp = said.stamp or own
    shift = (INSTANTS[own] - INSTANTS[stamp]) * sweep
    return PointTimes(name, "", unit, absolute, clock, first + shift, last + shift, sweep, stamp, shift, own_period)


def _median(values: Iterable[float]) -> float:
    return float(np.median(list(values)))


def _from_origin(values: Array, factor: float) -> tuple[Array, float]:
    """Values (M,) from the first finite one on, (M,) float64, and this one, both times `factor`: large whole numbers
    of ns keep all of their digits."""
    finite = np.flatnonzero(np.isfinite(values))
    if len(finite) == 0:
        return np.full(len(values), np.nan), 0.0
    if values.dtype.kind in "iu":
        origin = int(values[finite[0]])
        away = values.astype(np.int64) - np.int64(min(origin, 2**63 - 1))
        return away * factor, origin * factor
    origin_value = float(values[finite[0]])
    return (values.astype(np.float64) - origin_value) * factor, origin_value * factor


def _unit(scans: Sequence[_Seen], span: float, longest: float) -> str:
    """That of times since 1970; shares of the sweep, 0 to 1; or the largest in which no sweep takes too long."""
    epoch = epoch_unit(np.array([scan.first for scan in scans]))
    if epoch:
        return epoch
    first, last = _median(scan.first for scan in scans), _median(scan.last for scan in scans)
    floats = all(scan.values.dtype.kind == "f" for scan in scans)
    if floats and first >= -1.01 and last <= 1.01 and span > max(0.9, longest):
        return SWEEP_UNIT
    return next((unit for unit, factor in UNITS.items() if span * factor <= longest), "ns")


def _counts_on(scans: Sequence[_Seen], factor: float, span: float, usual: float) -> bool:
    """Does the field go on from scan to scan, or begin anew with each?"""
    starts = np.array([scan.first for scan in scans])
    if np.abs(np.median(starts)) * factor > 10 * max(usual, span * factor):
        return True
    return len(starts) > 1 and float(np.median(np.abs(np.diff(starts)))) > 0.5 * span


def _same_clock(scans: Sequence[_Seen], factor: float, usual: float) -> bool:
    apart = [scan.first * factor - scan.stamp for scan in scans if scan.stamp is not None]
    return len(apart) == len(scans) and abs(_median(apart)) < 2 * usual


def _instant(first: float, last: float) -> str:
    """Which instant of the sweep 0 is, by when the points are seen."""
    slack = NEAR * (last - first)
    if first > -slack:
        return "start"
    return "end" if last < slack else "middle"


def _sweep(scans: Sequence[_Seen], factor: float, period: float | None, span: float) -> float:
    """Seconds of a whole sweep: of one turn, where the points turn; else from scan to scan, or what they span."""
    turns = [turn * factor for scan in scans if (turn := _turn(scan)) is not None]
    if len(turns) * 2 <= len(scans):
        return max(period, span) if period else span if span > 0.5 * PERIOD else PERIOD
    turn = _median(turns)
    return next((known for known in (period or PERIOD, 0.05, 0.1, 0.2) if abs(turn / known - 1) < 0.1), turn)


def _turn(scan: _Seen) -> float | None:
    """How long a whole turn takes, in the field's unit, by how azimuths go with time; None where they do not turn."""
    span = scan.last - scan.first
    time = _from_origin(scan.values, 1.0)
    share = (time[0] + (time[1] - scan.first)) / span
    with np.errstate(invalid="ignore"):
        inside = (share >= 0) & (share <= 1)
    part = np.minimum((share[inside] * BINS).astype(np.int64), BINS - 1)
    ahead = scan.xyz[inside, 0] + 1j * scan.xyz[inside, 1]
    ahead = ahead / np.maximum(np.abs(ahead), 1e-9)
    mean = np.bincount(part, ahead.real, BINS) + 1j * np.bincount(part, ahead.imag, BINS)
    narrow = np.abs(mean) > NARROW * np.maximum(np.bincount(part, minlength=BINS), 1)
    steps = np.angle(mean[1:] * np.conj(mean[:-1]))[narrow[1:] & narrow[:-1]]
    usual = float(np.median(steps)) if len(steps) > BINS // 2 else 0.0
    if usual == 0 or np.mean(np.abs(steps / usual - 1) < EVEN) < ALIKE:
        return None
    return 2 * np.pi / abs(usual) * span / BINS


def _lost(time: Array, slack: float) -> Array:
    """(M,) bool: times of exactly 0 between others that are not near it, as drivers write where packets were lost."""
    zero = time == 0
    others = np.flatnonzero(~zero & np.isfinite(time))
    places = np.flatnonzero(zero)
    if len(places) == 0 or len(others) == 0:
        return np.zeros(len(time), bool)
    after = np.searchsorted(others, places)
    inside = (after > 0) & (after < len(others))
    before, behind = others[np.maximum(after - 1, 0)], others[np.minimum(after, len(others) - 1)]
    lost = np.zeros(len(time), bool)
    lost[places] = inside & (np.abs(time[before]) > slack) & (np.abs(time[behind]) > slack)
    return lost
