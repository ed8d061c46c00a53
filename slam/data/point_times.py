"""Point times of a sequence: the field that holds them, its unit, and the instant from which it counts.

They are estimated once per sequence, from its first scans, so that one damaged scan does not affect the others.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from slam.data.cloud import Array
from slam.data.conventions import INSTANTS, UNITS, Conventions
from slam.data.errors import InputError
from slam.data.stamp_digits import epoch_unit

PERIOD = 0.1  # scan period [s] without stamps
LONGEST = 3.0  # maximum duration of a sweep, in scan periods
LONGEST_UNSTAMPED = 10.0  # the same without stamps, in PERIODs
SHORTEST = 0.01  # minimum span of the point times, in scan periods: 4 degrees of a turn
SPREAD = 6.0  # interquartile ranges from the median, beyond which a value is an outlier
COARSE = 0.05  # maximum resolution of a float32 field, as a share of the span of the point times
BLOCK = 0.05  # of a sweep: times of 0 between times farther than this from the stamp are of lost packets,
LOST_AT_ONCE = 8  # if at least this many are consecutive
MOST_STRAY = 0.5  # maximum share of unusable times of a scan; above, the scan has no times
NEAR = 0.1  # tolerance on either side of 0, as a share of the span
BINS = 24  # parts of a sweep in which the rotation is measured
NARROW = 0.7  # minimum length of a part's mean unit vector, for which the sensor points in one direction
EVEN, ALIKE = 0.3, 0.6  # the sensor rotates if this share (ALIKE) of the steps is within EVEN of the median step
AZIMUTH = "azimuth"  # in place of a field
SWEEP_UNIT = "sweep"  # unit of fields that hold the elapsed share of the sweep


@dataclass(frozen=True, eq=False)
class Sample:
    """One of the first scans of a sequence.

    Attributes:
        times: Fields that may hold the point times, (M,) each, by their names.
        xyz: Points (M, 3) [m].
        stamp: Recorded stamp of the scan [s], or None.
    """

    times: Mapping[str, Array]
    xyz: Array
    stamp: float | None = None


@dataclass(frozen=True)
class PointTimes:
    """Interpretation of a sequence's point times: their conversion to seconds from the scan's stamp.

    Attributes:
        field: Name of the field; 'azimuth' if the times follow from the azimuths; '' if there are no times.
        why: Reason if there are no times.
        unit: Unit of the field: 's', 'ms', 'us', 'ns' or 'sweep'.
        absolute: True if the field continues from scan to scan, as a clock does.
        clock: True if this clock is that of the stamps.
        first: Median time of a scan's first points, from the stamp [s].
        last: Median time of a scan's last points, from the stamp [s].
        sweep: Duration of a whole sweep [s]; a scan may cover a part of it.
        stamp: Instant of the sweep that stamp and pose refer to: 'start', 'middle' or 'end'.
        shift: Seconds added to the field's values, so that the stamp is at 0.
        period: Scan period [s] by an absolute field, else None.
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
        """Convert the values of the field in a scan to point times.

        Values that are not finite or lie outside of any sweep are interpolated between those next to them in the file.

        Args:
            values: (M,) of the field.
            stamp: Stamp of the scan [s].

        Returns:
            Times (M,) float32 [s] from the stamp, None if most of the values are unusable; and the number of unusable
            values.
        """
        time, origin = _from_origin(values, self._factor)
        sound = np.isfinite(time)
        if not sound.any():
            return None, len(time)
        reach = max(self.sweep, self.last - self.first)
        with np.errstate(invalid="ignore"):
            sound &= np.abs(time - np.median(time[sound])) <= reach
        if not self.absolute:
            time = time + origin
            sound &= ~_lost_packets(time, BLOCK * self.sweep)
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
        """Describe the point times in one line, for a run in which `timed` of `scans` scans had times."""
        if not self.field:
            return f"point times: none ({self.why}); no scan is deskewed"
        how = f"field {self.field}, {self.unit}, {'absolute' if self.absolute else 'relative'}"
        how = "from the azimuth" if self.field == AZIMUTH else how
        span = f"{_milliseconds(self.first)} to {_milliseconds(self.last)} ms of a {_milliseconds(self.sweep)} ms sweep"
        return f"point times: {how}, {span}, in {timed} of {scans} scans; stamp = {self.stamp}"


def _milliseconds(seconds: float) -> str:
    return f"{round(1e3 * seconds, 1) + 0.0:g}"  # + 0.0 makes -0 0


def azimuth_times(sweep: float, stamp: str) -> PointTimes:
    """Return the point times of a sensor that rotates once per `sweep` [s], from the rear: see `turn_times`."""
    first = -INSTANTS[stamp] * sweep
    return PointTimes(AZIMUTH, first=first, last=first + sweep, sweep=sweep, stamp=stamp)


def find_point_times(samples: Sequence[Sample], period: float | None, said: Conventions) -> PointTimes:
    """Estimate the interpretation of a sequence's point times.

    Args:
        samples: The first scans, without empty ones.
        period: Scan period by the stamps [s], None without stamps.
        said: Field, unit and instant as the user states them.

    Raises:
        InputError: The stated field does not exist.
    """
    names = dict.fromkeys(name for sample in samples for name in sample.times)
    if said.time_field is not None:
        if samples and said.time_field not in names:
            known = f"there are {', '.join(names)}" if names else "there are none"
            raise InputError(f"no field '{said.time_field}' with point times in the first scans; {known}")
        names = {name: None for name in names if name == said.time_field}
    faults = []
    for name in names:
        found = _interpretation(name, [sample for sample in samples if name in sample.times], period, said)
        if found.field:
            return found
        faults.append(found.why)
    sweep = period or PERIOD
    return PointTimes(why="; ".join(faults) or "no time field", sweep=sweep, stamp=said.stamp or "middle")


@dataclass(frozen=True, eq=False)
class _FieldRange:
    """A field in one scan, in the field's unit.

    Attributes:
        values: (M,).
        first: Smallest value that is not an outlier.
        last: Largest value that is not an outlier.
        apart: Resolution of the values by their type; 0 if it is sufficient.
        xyz: Points of the scan (M, 3) [m].
        stamp: Stamp of the scan [s], or None.
    """

    values: Array
    first: float
    last: float
    apart: float
    xyz: Array
    stamp: float | None


def _field_range(sample: Sample, name: str) -> _FieldRange | None:
    """The field in a scan; None if all its values are equal, or most are not finite."""
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
    return _FieldRange(values, origin + near.min(), origin + near.max(), apart, sample.xyz, sample.stamp)


def _interpretation(name: str, samples: Sequence[Sample], period: float | None, said: Conventions) -> PointTimes:
    """Interpretation of this field; without `field`, but with the reason, if it does not hold point times."""
    scans = [found for sample in samples if (found := _field_range(sample, name)) is not None]
    if len(scans) * 2 <= len(samples):
        return PointTimes(why=f"{name} is the same for all points, or not finite")
    span = _median(scan.last - scan.first for scan in scans)
    apart = max(scan.apart for scan in scans)
    if apart > COARSE * span:
        return PointTimes(why=f"{name} is too coarse: its float32 values have a resolution of {apart:.3g}")
    usual = min(max(period or PERIOD, 0.05), 0.5)
    longest = LONGEST * usual if period else LONGEST_UNSTAMPED * PERIOD
    unit = said.time_unit or _unit(scans, span, longest)
    factor = usual if unit == SWEEP_UNIT else UNITS[unit]
    if not SHORTEST * usual <= span * factor <= longest:
        return PointTimes(why=f"{name} spans {span:.4g}, which is not a sweep in any unit of time")
    absolute = _is_absolute(scans, factor, span, usual)
    clock = absolute and _same_clock(scans, factor, usual)
    first, last = 0.0, span * factor
    if clock or not absolute:
        first = _median(scan.first * factor - (scan.stamp or 0.0) * clock for scan in scans)
        last = _median(scan.last * factor - (scan.stamp or 0.0) * clock for scan in scans)
    steps = np.diff([scan.first for scan in scans])
    own_period = float(np.median(steps)) * factor if absolute and len(steps) and np.median(steps) > 0 else None
    sweep = _sweep_duration(scans, factor, period or own_period, last - first)
    own = _instant(first, last)
    stamp = said.stamp or own
    shift = (INSTANTS[own] - INSTANTS[stamp]) * sweep
    return PointTimes(name, "", unit, absolute, clock, first + shift, last + shift, sweep, stamp, shift, own_period)


def _median(values: Iterable[float]) -> float:
    return float(np.median(list(values)))


def _from_origin(values: Array, factor: float) -> tuple[Array, float]:
    """Values (M,) minus the first finite one, (M,) float64, and the first finite one, both times `factor`.

    Subtracting first keeps all digits of large integers in ns.
    """
    finite = np.flatnonzero(np.isfinite(values))
    if len(finite) == 0:
        return np.full(len(values), np.nan), 0.0
    if values.dtype.kind in "iu":
        origin = int(values[finite[0]])
        away = values.astype(np.int64) - np.int64(min(origin, 2**63 - 1))
        return away * factor, origin * factor
    origin_value = float(values[finite[0]])
    return (values.astype(np.float64) - origin_value) * factor, origin_value * factor


def _unit(scans: Sequence[_FieldRange], span: float, longest: float) -> str:
    """The unit in which the values are times since 1970; else 'sweep' for 0 to 1; else the largest plausible unit."""
    epoch = epoch_unit(np.array([scan.first for scan in scans]))
    if epoch and span * UNITS[epoch] <= longest:
        return epoch
    first, last = _median(scan.first for scan in scans), _median(scan.last for scan in scans)
    floats = all(scan.values.dtype.kind == "f" for scan in scans)
    if floats and first >= -1.01 and last <= 1.01 and span > max(0.9, longest):
        return SWEEP_UNIT
    return next((unit for unit, factor in UNITS.items() if span * factor <= longest), "ns")


def _is_absolute(scans: Sequence[_FieldRange], factor: float, span: float, usual: float) -> bool:
    """Whether the field continues from scan to scan, instead of being reset at each."""
    starts = np.array([scan.first for scan in scans])
    if np.abs(np.median(starts)) * factor > 10 * max(usual, span * factor):
        return True
    return len(starts) > 1 and float(np.median(np.abs(np.diff(starts)))) > 0.5 * span


def _same_clock(scans: Sequence[_FieldRange], factor: float, usual: float) -> bool:
    apart = [scan.first * factor - scan.stamp for scan in scans if scan.stamp is not None]
    return len(apart) == len(scans) and abs(_median(apart)) < 2 * usual


def _instant(first: float, last: float) -> str:
    """Instant of the sweep at time 0, from the first and last point times."""
    slack = NEAR * (last - first)
    if first > -slack:
        return "start"
    return "end" if last < slack else "middle"


def _sweep_duration(scans: Sequence[_FieldRange], factor: float, period: float | None, span: float) -> float:
    """Duration of a whole sweep [s]: one turn if the sensor rotates, else the scan period or the span of the points."""
    turns = [turn * factor for scan in scans if (turn := _rotation_period(scan)) is not None]
    if len(turns) * 2 <= len(scans):
        return max(period, span) if period else span if span > 0.5 * PERIOD else PERIOD
    turn = _median(turns)
    return next((known for known in (period or PERIOD, 0.05, 0.1, 0.2) if abs(turn / known - 1) < 0.1), turn)


def _rotation_period(scan: _FieldRange) -> float | None:
    """Duration of a whole turn in the field's unit, from azimuth over time; None if the sensor does not rotate."""
    span = scan.last - scan.first
    time = _from_origin(scan.values, 1.0)
    with np.errstate(invalid="ignore", over="ignore"):
        share = (time[0] + (time[1] - scan.first)) / span
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


def _lost_packets(time: Array, slack: float) -> Array:
    """Find runs of times that are exactly 0 between times far from 0, as drivers write for lost packets: (M,) bool."""
    lost, zero = np.zeros(len(time), bool), time == 0
    others = np.flatnonzero(~zero & np.isfinite(time))
    runs = np.split(places := np.flatnonzero(zero), np.flatnonzero(np.diff(places) > 1) + 1)
    places = np.concatenate([run for run in runs if len(run) >= LOST_AT_ONCE] or [np.zeros(0, np.int64)])
    if len(places) == 0 or len(others) == 0:
        return lost
    after = np.searchsorted(others, places)
    inside = (after > 0) & (after < len(others))
    before, behind = others[np.maximum(after - 1, 0)], others[np.minimum(after, len(others) - 1)]
    lost[places] = inside & (np.abs(time[before]) > slack) & (np.abs(time[behind]) > slack)
    return lost
