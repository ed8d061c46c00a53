"""The laser lines of a spinning LiDAR, fitted to raw scans of it."""

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
from slam.data.scan_drive import ScanDrive

#: Points used in all; 64 rings then get 15,000 each, which bring coordinates rounded to 1 mm down to some 0.01 mm.
POINTS = 1_000_000
#: A ring with fewer points is not fitted.
FEWEST = 100
#: Prior standard deviations [m] of an offset: from the next ring's, and from zero. They count only where a ring's
#: returns lie all at about one distance, so that offset and elevation cannot be told apart.
NEIGHBOURS, ORIGIN = 0.02, 0.2
#: Float32 coordinates are no better than this [m].
FINEST = 1e-5
#: Points this near to the sensor's axis [m] are not used.
NEAREST = 0.1
#: Huber's constant, in standard deviations: 95 % efficient where the noise is Gaussian.
HUBER = 1.345
#: Points farther off their lines than this part of the angle between two rings lie on no lines.
MISFIT_LIMIT = 0.25


@dataclass(frozen=True, eq=False)
class LaserLines:
    """R lines z = tan(elevation) * rho + offset, rho = hypot(x, y), ring 0 = top; each field is (R,).

    elevation, elevation_error  radians, and its standard error
    offset, offset_error        metres, and its standard error
    residual                    radians: how far the points lie off their line as seen from the sensor, as a standard
                                deviation (1.4826 times the median)
    points                      how many were used
    """

    elevation: Array
    elevation_error: Array
    offset: Array
    offset_error: Array
    residual: Array
    points: Array


class _Line(NamedTuple):
    """What a ring's points say about its line: means and scatters, weighted by 1 / variance of z."""

    weight: float
    rho: float
    z: float
    rho_rho: float
    rho_z: float


def fit_lines(ring: Array, rho: Array, z: Array, rings: int) -> LaserLines:
    """Lines of the rings 0..R-1 through points (N,) with `ring` (int), `rho` and `z` [m]; every ring needs some.

    Errors of range move a point along its line; what moves it off is mostly the rounding of coordinates, the same at
    all distances. So z is regressed on rho with equal weights, robustly (Huber's M-estimator with the scale from the
    median, by reweighting). Offsets and elevations of all rings then follow from one least-squares problem in which
    offsets have a weak Gaussian prior (`NEIGHBOURS`, `ORIGIN`), and the errors from its covariance.
    """
    order = np.argsort(ring, kind="stable")
    parts = np.split(order, np.searchsorted(ring[order], np.arange(1, rings)))
    weight, mean_rho, mean_z, rho_rho, rho_z = np.array([_robust_line(rho[part], z[part]) for part in parts]).T
    square = rho_rho + weight * mean_rho**2  # sum of w rho^2
    slope = np.divide(rho_z, rho_rho, out=np.zeros(rings), where=rho_rho > 0)
    information = weight * rho_rho / square  # about the offset, whatever the slope
    steps = np.diff(np.eye(rings), axis=0)
    prior = steps.T @ steps / NEIGHBOURS**2 + np.eye(rings) / ORIGIN**2
    covariance = np.linalg.inv(np.diag(information) + prior)
    offset = covariance @ (information * (mean_z - slope * mean_rho))
    lever = weight * mean_rho / square  # by how much the slope falls when the offset rises
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
    """Points of a scan, evenly from all rings; `found` rings, by the file's numbers (`numbered`) or by wraparound."""

    number: int
    found: int
    numbered: bool
    ring: Array
    rho: Array
    z: Array


def fit_dataset(
    data: Dataset, positions: Sequence[int], rings: int | None = None, on_scan: Callable[[], None] = lambda: None
) -> tuple[LaserLines, tuple[Problem, ...]]:
    """The laser lines of a data set's sensor from its scans at `positions`, and which of these were left out.

    Rings are the files' own, counted from the top or the bottom, else counted by azimuth wraparound (`recover_rings`).
    Scans with another number of rings than `rings` (default: the sensor's, else what most scans have) are left out.
    Raises InputError where scans are motion-compensated, where no scan is left, where a ring has nearly no points, and
    where points do not lie on lines that rise or fall from ring to ring.
    """
    if data.sensor is not None and data.sensor.motion_compensated:
        raise InputError(
            f"{data.path}: motion-compensated scans, whose points have left the lasers' lines; take raw ones (a "
            "sensor.yaml beside them with 'motion_compensated: false' says that these are)"
        )
    scans = _read_scans(data, positions, on_scan)
    numbered = any(scan.numbered for scan in scans)
    usual = _usual(scans, numbered)
    rings = rings or (data.sensor.ring_count if data.sensor else usual)
    used = [scan for scan in scans if (0 < scan.found <= rings if numbered else scan.found == rings)]
    if not used or not 1 < rings <= MOST_RINGS:
        wanted = f" where {rings} are expected (--rings)" if rings != usual else ""
        lines, fault = None, f"its scans have {usual} rings{wanted}"
    else:
        lines, fault = _sound_lines(used, rings)
    if lines is None:
        raise InputError(f"{data.path}: {fault}; {NUMBERED if numbered else UNNUMBERED}")
    return lines, _left_out(data, scans, used, rings)


NUMBERED = "rings must be numbered from 0 by height, scans be raw, and every ring see something in some of them"
UNNUMBERED = (
    "without a ring field, scans must be raw and stored ring after ring, counter-clockwise from ahead; else save them "
    "with one (.pcd, .ply, .npy)"
)
MOST_RINGS = 1024


def _read_scans(data: Dataset, positions: Sequence[int], on_scan: Callable[[], None]) -> list[_Scan]:
    """Rings are never taken from the lines of a known sensor, which are what is looked for."""
    scans = []
    for position in positions:
        if isinstance(data, ScanDrive):
            points = data.points(position)
            xyz, ring = points.xyz, points.ring
        else:
            xyz, ring = data[position].cloud.xyz, None
        where = f"{data.path}: scan {data.numbers[position]}"
        scans.append(_thinned(int(data.numbers[position]), xyz, ring, POINTS // len(positions), where))
        on_scan()
    return scans


def _thinned(number: int, xyz: Array, ring: Array | None, limit: int, where: str) -> _Scan:
    """A scan with about `limit` of its points."""
    numbered = ring is not None and len(xyz) > 0
    if ring is None or not numbered:
        ring, found = recover_rings(xyz)
    else:
        ring = np.nan_to_num(ring, nan=-1).astype(np.int64)
        found = int(ring.max()) + 1
        if ring.min() < 0 or found > MOST_RINGS:
            raise InputError(f"{where}: rings {ring.min()} to {ring.max()}, but 0 to {MOST_RINGS - 1} make sense")
    step = max(1, round(len(xyz) / max(limit, 1)))
    kept = np.argsort(ring, kind="stable")[::step]  # in file order a step might always meet the same ring
    kept = kept[np.hypot(xyz[kept, 0], xyz[kept, 1]) > NEAREST]
    xyz = xyz[kept].astype(np.float64)
    return _Scan(number, found, numbered, ring[kept], np.hypot(xyz[:, 0], xyz[:, 1]), xyz[:, 2])


def _usual(scans: Sequence[_Scan], numbered: bool) -> int:
    """How many rings the sensor seems to have; its top ones may see nothing but sky in any one scan."""
    found = [scan.found for scan in scans]
    return max(found) if numbered else Counter(found).most_common(1)[0][0]


def _sound_lines(scans: Sequence[_Scan], rings: int) -> tuple[LaserLines | None, str]:
    """The lines, top first, or None and what is wrong with them."""
    ring, rho, z = (np.concatenate([getattr(scan, name) for scan in scans]) for name in ("ring", "rho", "z"))
    few = [(int(k), int(k)) for k in np.flatnonzero(np.bincount(ring, minlength=rings) < FEWEST)]
    if few:
        return None, f"fewer than {FEWEST} points of ring {spans(few)} of 0-{rings - 1}"
    lines = _top_first(fit_lines(ring, rho, z, rings))
    steps = -np.diff(lines.elevation)
    off, apart = np.rad2deg([np.median(lines.residual), np.median(np.abs(steps))])
    if off > MISFIT_LIMIT * apart:
        return None, f"points lie {off:.3f} deg off the best lines, which are {apart:.3f} deg apart"
    if (steps <= 0).any():
        return None, f"the elevations of its {rings} rings neither rise nor fall from ring to ring"
    return lines, ""


def _top_first(lines: LaserLines) -> LaserLines:
    if lines.elevation[0] > lines.elevation[-1]:
        return lines
    return LaserLines(*(getattr(lines, field.name)[::-1] for field in fields(lines)))


def _left_out(data: Dataset, scans: Sequence[_Scan], used: Sequence[_Scan], rings: int) -> tuple[Problem, ...]:
    kept = {scan.number for scan in used}
    odd = [f"{scan.number} ({scan.found})" for scan in scans if scan.number not in kept]
    if not odd:
        return ()
    more = f" and {len(odd) - 8} more" if len(odd) > 8 else ""
    text = f"{data.path}: left out, for they have not {rings} rings: scan {', '.join(odd[:8])}{more}"
    return (Problem("ring count", text),)


def sensor_text(lines: LaserLines, name: str, vertical_correction: float = 0.0) -> str:
    """A sensor.yaml (see `load_sensor`) with these lines; `vertical_correction` in radians."""
    beams = np.column_stack([np.rad2deg(lines.elevation).round(5), lines.offset.round(5)])
    content = {
        "model": name,
        "beams": beams.tolist(),
        "vertical_correction_deg": round(float(np.rad2deg(vertical_correction)), 6),
        "motion_compensated": False,
    }
    about = "# Laser lines fitted by lidarlift: elevation [deg] and offset [m] of each, top first\n"
    return about + yaml.safe_dump(content, sort_keys=False, default_flow_style=None, allow_unicode=True)
