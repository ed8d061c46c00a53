"""Laser lines of a spinning LiDAR, fitted to its raw scans."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from typing import NamedTuple

import numpy as np
import yaml

from slam.data.beams import recover_rings
from slam.data.cloud import Array
from slam.data.dataset import Dataset
from slam.data.errors import InputError
from slam.data.problem import Problem, spans
from slam.data.scan_sequence import ScanSequence

#: Total number of points used; each of 64 rings then has 15,000, which average a rounding to 1 mm down to some 0.01 mm.
POINTS = 1_000_000
#: Minimum number of points for the fit of a ring.
FEWEST = 100
#: Prior standard deviations [m] of an offset: from the next ring's, and from zero. They matter only if all returns of a
#: ring have about the same distance, so that offset and elevation cannot be separated.
NEIGHBOURS, ORIGIN = 0.02, 0.2
#: Resolution of float32 coordinates [m].
FINEST = 1e-5
#: Minimum distance of used points from the sensor's axis [m].
NEAREST = 0.1
#: Huber's constant, in standard deviations: 95 % efficiency for Gaussian noise.
HUBER = 1.345
#: Maximum median residual, as a share of the angle between two rings; above, the points do not lie on lines.
MISFIT_LIMIT = 0.25


@dataclass(frozen=True, eq=False)
class LaserLines:
    """R lines z = tan(elevation) * rho + offset, rho = hypot(x, y), ring 0 = top; each field is (R,).

    Attributes:
        elevation: Elevation [rad].
        elevation_error: Standard error of the elevation [rad].
        offset: Height offset [m].
        offset_error: Standard error of the offset [m].
        residual: Angle between points and line, seen from the sensor [rad], as a standard deviation (1.4826 times the
            median).
        points: Number of points used.
    """

    elevation: Array
    elevation_error: Array
    offset: Array
    offset_error: Array
    residual: Array
    points: Array


class _Line(NamedTuple):
    """Sufficient statistics of a ring's line: means and scatters, weighted by 1 / variance of z."""

    weight: float
    rho: float
    z: float
    rho_rho: float
    rho_z: float


def fit_lines(ring: Array, rho: Array, z: Array, rings: int) -> LaserLines:
    """Fit the lines of the rings 0..R-1; every ring needs points.

    Range errors move a point along its line; its distance from the line is mostly due to the rounding of coordinates,
    the same at all ranges. So z is regressed on rho with equal weights, robustly (Huber's M-estimator with the scale
    from the median, by reweighting). Offsets and elevations of all rings then follow from one least-squares problem
    with a weak Gaussian prior on the offsets (`NEIGHBOURS`, `ORIGIN`), and their standard errors from its covariance.

    Args:
        ring: (N,) int, ring of each point.
        rho: (N,) horizontal distance from the sensor's axis [m].
        z: (N,) height [m].
        rings: Number of rings R.
    """
    order = np.argsort(ring, kind="stable")
    parts = np.split(order, np.searchsorted(ring[order], np.arange(1, rings)))
    weight, mean_rho, mean_z, rho_rho, rho_z = np.array([_robust_line(rho[part], z[part]) for part in parts]).T
    square = rho_rho + weight * mean_rho**2  # sum of w rho^2
    slope = np.divide(rho_z, rho_rho, out=np.zeros(rings), where=rho_rho > 0)
    information = weight * rho_rho / square  # of the offset, marginal over the slope
    steps = np.diff(np.eye(rings), axis=0)
    prior = steps.T @ steps / NEIGHBOURS**2 + np.eye(rings) / ORIGIN**2
    covariance = np.linalg.inv(np.diag(information) + prior)
    offset = covariance @ (information * (mean_z - slope * mean_rho))
    lever = weight * mean_rho / square  # decrease of the slope per increase of the offset
    tangent = rho_z / square + lever * (mean_z - offset)
    elevation, variance = np.arctan(tangent), np.diag(covariance)
    tangent_error = np.sqrt(1 / square + lever**2 * variance)
    across = [np.abs(z[p] - tangent[k] * rho[p] - offset[k]) / rho[p] for k, p in enumerate(parts)]
    seen = np.cos(elevation) ** 2  # d elevation / d tangent
    return LaserLines(
        elevation=elevation,
        elevation_error=tangent_error * seen,
        offset=offset,
        offset_error=np.sqrt(variance),
        residual=1.4826 * np.array([np.median(angles) for angles in across]) * seen,
        points=np.array([len(part) for part in parts]),
    )


def _robust_line(rho: Array, z: Array) -> _Line:
    weight, scale = np.ones(len(rho)), 1.0
    for _ in range(20):
        total = weight.sum()
        mean_rho, mean_z = weight @ rho / total, weight @ z / total
        run, rise = rho - mean_rho, z - mean_z
        rho_rho, rho_z = weight @ run**2, weight @ (run * rise)
        residual = np.abs(rise - rho_z / rho_rho * run if rho_rho > 0 else rise)
        before, scale = scale, max(1.4826 * float(np.median(residual)), FINEST)
        if abs(scale - before) < 1e-6 * scale:
            break
        weight = np.minimum(1, HUBER * scale / np.maximum(residual, FINEST))
    variance = scale**2
    return _Line(total / variance, mean_rho, mean_z, rho_rho / variance, rho_z / variance)


class _Scan(NamedTuple):
    """Sample of a scan, evenly from all rings; `found`: ring count, from a ring field (`numbered`) or wraparounds."""

    number: int
    found: int
    numbered: bool
    ring: Array
    rho: Array
    z: Array


def fit_dataset(
    data: Dataset, positions: Sequence[int], rings: int | None = None, on_scan: Callable[[], None] = lambda: None
) -> tuple[LaserLines, tuple[Problem, ...]]:
    """Fit the laser lines of a data set's sensor.

    Rings are read from the ring field, counted from the top or the bottom, else recovered from azimuth wraparounds
    (`recover_rings`). Scans with another number of rings are left out.

    Args:
        data: The data set.
        positions: Positions of the scans to use.
        rings: Number of rings; by default the sensor's, else that of most scans.
        on_scan: Called after each scan that was read.

    Returns:
        The lines, and a Problem that lists the scans that were left out.

    Raises:
        InputError: The scans are motion-compensated, no scan is left, a ring has too few points, or the points do not
            lie on lines whose elevations rise or fall from ring to ring.
    """
    if data.sensor is not None and data.sensor.motion_compensated:
        raise InputError(
            f"{data.path}: motion-compensated scans, whose points no longer lie on the laser lines; use raw scans (or "
            "state 'motion_compensated: false' in a sensor.yaml beside the scans if they are raw)"
        )
    scans = _read_scans(data, positions, on_scan)
    numbered = any(scan.numbered for scan in scans)
    usual = _probable_ring_count(scans, numbered)
    rings = rings or (data.sensor.ring_count if data.sensor else usual)
    used = [scan for scan in scans if (0 < scan.found <= rings if numbered else scan.found == rings)]
    if not used or not 1 < rings <= MOST_RINGS:
        wanted = f" where {rings} are expected (--rings)" if rings != usual else ""
        lines, fault = None, f"the scans have {usual} rings{wanted}"
    else:
        lines, fault = _checked_lines(used, rings)
    if lines is None:
        raise InputError(f"{data.path}: {fault}; {NUMBERED if numbered else UNNUMBERED}")
    return lines, _omitted_scans(data, scans, used, rings)


NUMBERED = "rings must be numbered from 0 by height, scans must be raw, and every ring must have returns in some scan"
UNNUMBERED = (
    "without a ring field, scans must be raw and stored ring by ring, counter-clockwise from the forward direction; "
    "else save them with a ring field (.pcd, .ply, .npy)"
)
MOST_RINGS = 1024


def _read_scans(data: Dataset, positions: Sequence[int], on_scan: Callable[[], None]) -> list[_Scan]:
    """Read samples of the scans; rings are never taken from the lines of a known sensor, since these are estimated."""
    scans = []
    for position in positions:
        if isinstance(data, ScanSequence):
            points = data.points(position)
            xyz, ring = points.xyz, points.ring
        else:
            xyz, ring = data[position].cloud.xyz, None
        where = f"{data.path}: scan {data.numbers[position]}"
        scans.append(_sampled(int(data.numbers[position]), xyz, ring, POINTS // len(positions), where))
        on_scan()
    return scans


def _sampled(number: int, xyz: Array, ring: Array | None, limit: int, where: str) -> _Scan:
    """Sample about `limit` points of a scan."""
    numbered = ring is not None and len(xyz) > 0
    if ring is None or not numbered:
        ring, found = recover_rings(xyz)
    else:
        ring = np.nan_to_num(ring, nan=-1).astype(np.int64)
        found = int(ring.max()) + 1
        if ring.min() < 0 or found > MOST_RINGS:
            fault = f"rings {ring.min()} to {ring.max()}, but 0 to {MOST_RINGS - 1} are possible"
            raise InputError(f"{where}: {fault}; correct the ring field, or save the scans without it")
    step = max(1, round(len(xyz) / max(limit, 1)))
    kept = np.argsort(ring, kind="stable")[::step]  # in file order, every step-th point might be of the same ring
    kept = kept[np.hypot(xyz[kept, 0], xyz[kept, 1]) > NEAREST]
    xyz = xyz[kept].astype(np.float64)
    return _Scan(number, found, numbered, ring[kept], np.hypot(xyz[:, 0], xyz[:, 1]), xyz[:, 2])


def _probable_ring_count(scans: Sequence[_Scan], numbered: bool) -> int:
    """Probable number of rings; in a single scan, the top rings may have no returns because they see the sky."""
    found = [scan.found for scan in scans]
    return max(found) if numbered else Counter(found).most_common(1)[0][0]


def _checked_lines(scans: Sequence[_Scan], rings: int) -> tuple[LaserLines | None, str]:
    """Fit the lines and check them: the lines, top first, or None and the fault."""
    ring, rho, z = (np.concatenate([getattr(scan, name) for scan in scans]) for name in ("ring", "rho", "z"))
    few = [(int(k), int(k)) for k in np.flatnonzero(np.bincount(ring, minlength=rings) < FEWEST)]
    if few:
        return None, f"fewer than {FEWEST} points of ring {spans(few)} of 0-{rings - 1}"
    lines = _top_first(fit_lines(ring, rho, z, rings))
    steps = -np.diff(lines.elevation)
    off, apart = np.rad2deg([np.median(lines.residual), np.median(np.abs(steps))])
    if off > MISFIT_LIMIT * apart:
        return None, f"the points lie {off:.3f} deg off the best lines, which are {apart:.3f} deg apart"
    if (steps <= 0).any():
        return None, f"the elevations of the {rings} rings neither rise nor fall from ring to ring"
    return lines, ""


def _top_first(lines: LaserLines) -> LaserLines:
    if lines.elevation[0] > lines.elevation[-1]:
        return lines
    return LaserLines(*(getattr(lines, field.name)[::-1] for field in fields(lines)))


def _omitted_scans(data: Dataset, scans: Sequence[_Scan], used: Sequence[_Scan], rings: int) -> tuple[Problem, ...]:
    kept = {scan.number for scan in used}
    odd = [f"{scan.number} ({scan.found})" for scan in scans if scan.number not in kept]
    if not odd:
        return ()
    more = f" and {len(odd) - 8} more" if len(odd) > 8 else ""
    text = f"{data.path}: scans without {rings} rings, left out (number of rings): {', '.join(odd[:8])}{more}"
    return (Problem("ring count", text),)


def sensor_text(lines: LaserLines, name: str, vertical_correction: float = 0.0) -> str:
    """Return the text of a sensor.yaml (see `load_sensor`) with these lines; `vertical_correction` [rad]."""
    beams = np.column_stack([np.rad2deg(lines.elevation).round(5), lines.offset.round(5)])
    content = {
        "model": name,
        "beams": beams.tolist(),
        "vertical_correction_deg": round(float(np.rad2deg(vertical_correction)), 6),
        "motion_compensated": False,
    }
    about = "# Laser lines fitted by lidarlift: elevation [deg] and height offset [m] of each laser, top first\n"
    return about + yaml.safe_dump(content, sort_keys=False, default_flow_style=None, allow_unicode=True)
