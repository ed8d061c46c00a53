"""The front end that fills in what a sparse LiDAR did not measure."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from enrichment.calibration import Calibrated
from enrichment.geometry import kernels
from enrichment.geometry.rays import Prediction, RayGrid, columns_for
from enrichment.geometry.sparse_scan import Method, SparseScan, heights
from slam.data.cloud import Array, Frame, History, PointCloud
from slam.data.sensor import Sensor

BEAMS = 64  # about so many lines where the sensor's own are fewer
FIRST_SCANS = 10  # that tell how many columns are usual
ENOUGH = 90  # points on its fullest ring that a scan needs to tell: a quarter of a turn at the coarsest
OTHERWISE = 1.25  # times more columns, or fewer, than those that are filled now


class Enricher:
    """A sparse scan, and the image beside it, become a cloud on many virtual beams.

    All measured points come first, as they are; behind them the predicted ones, on the rays of `target`'s lines
    through the centres of the azimuth columns, each with its sigma and `measured` False. Rings are numbered as in
    `target`. A scan whose rings are unknown is handed on as it is.

    It belongs to one run: the calibration of sigma, and how many columns a scan fills, are learned from the scans.

    measure   gives the sparse cloud of a frame, in the sensor's own geometry
    method    predicts ranges and sigmas; these are calibrated while driving
    lines     the laser line of every ring id of the sparse cloud; `rings` (K,) those that it has, top first
    target    the lines to fill; by default `denser(lines, rings)`
    coverage  share of the predicted points that are kept, those of least sigma for their range
    """

    def __init__(
        self,
        measure: Callable[[Frame, History], PointCloud],
        method: Method,
        lines: Sensor,
        rings: Array,
        target: Sensor | None = None,
        coverage: float = 1.0,
    ) -> None:
        self.measure, self.method, self.coverage = measure, Calibrated(method), coverage
        self.lines, self.rings = lines, rings
        self.target = target or denser(lines, rings)
        self._columns_of = UsualColumns()
        self._row_of_ring = np.abs(heights(lines)[:, None] - heights(self.target)).argmin(axis=1)
        self._ring_of_row = np.full(self.target.ring_count, -1)
        self._ring_of_row[self._row_of_ring[rings]] = rings

    def __call__(self, frame: Frame, history: History) -> PointCloud:
        """The cloud of a frame, in the sensor's own geometry: neither deskewed nor vertically corrected."""
        cloud = self.measure(frame, history)
        if cloud.ring is None or len(cloud) == 0:
            return cloud
        columns = self._columns_of(cloud)
        grid = RayGrid(self.target, columns)

        def past() -> History:
            return [(self._as_measured(then), T_now_then) for then, T_now_then in history if then.ring is not None]

        scan = SparseScan(cloud, self.lines, self.rings, frame.read_image, frame.calibration, columns, past)
        return self._joined(scan, grid, self.method(scan, grid))

    def _as_measured(self, cloud: PointCloud) -> PointCloud:
        """What was measured of a cloud made here, with the sparse cloud's ring ids."""
        measured = cloud.select(cloud.measured)
        return replace(measured, ring=self._ring_of_row[measured.ring])

    def _joined(self, scan: SparseScan, grid: RayGrid, prediction: Prediction) -> PointCloud:
        """The scan's points and the predicted ones that are kept."""
        cloud, sensor = scan.cloud, grid.sensor
        time = np.zeros(0, np.float32) if cloud.time is None else cloud.time
        xyz, intensity, sigma, ring, times = kernels.collect(
            prediction.ranges, prediction.sigma, self._kept(prediction), scan.points, *scan.rows_around(sensor),
            cloud.intensity, time, grid.azimuth, np.cos(sensor.elevation), np.sin(sensor.elevation), sensor.offset,
        )  # fmt: skip
        return PointCloud(
            xyz=np.concatenate([cloud.xyz, xyz]),
            intensity=np.concatenate([cloud.intensity, intensity]),
            ring=np.concatenate([self._row_of_ring[cloud.ring], ring]),
            time=None if cloud.time is None else np.concatenate([cloud.time, times]),
            sigma=np.concatenate([cloud.sigma, sigma]),
            measured=np.concatenate([cloud.measured, np.zeros(len(xyz), bool)]),
        )

    def _kept(self, prediction: Prediction) -> Array:
        """(R, W) bool."""
        if self.coverage >= 1:
            return prediction.trusted
        relative = (prediction.sigma / np.maximum(prediction.ranges, np.float32(1e-3)))[prediction.trusted]
        limit = np.quantile(relative, self.coverage) if len(relative) else 0.0
        return prediction.trusted & (prediction.sigma <= limit * prediction.ranges)


class UsualColumns:
    """How many columns a drive's scans fill: as the first one says, unless the first few together say otherwise.

    A scan of few points, as at the start of a recording, says nothing.
    """

    def __init__(self) -> None:
        self._seen: list[int] = []
        self._chosen = 0

    def __call__(self, cloud: PointCloud) -> int:
        """Of the grid for the next scan, which has rings."""
        if len(self._seen) == FIRST_SCANS:
            return self._chosen
        assert cloud.ring is not None
        found = columns_for(cloud)
        if np.bincount(cloud.ring).max() >= ENOUGH:
            self._seen.append(found)
            usual = sorted(self._seen)[len(self._seen) // 2]
            if not 1 / OTHERWISE < self._chosen / usual < OTHERWISE:
                self._chosen = usual
        return self._chosen or found


def denser(lines: Sensor, rings: Array) -> Sensor:
    """The lines of the rings (K,) with so many put evenly between each two that there are about 64."""
    between = max(1, round(BEAMS / len(rings)))
    places, known = np.arange((len(rings) - 1) * between + 1) / between, np.arange(len(rings))
    return replace(
        lines,
        name=f"{lines.name}, enriched",
        elevation=np.interp(places, known, lines.elevation[rings]),
        offset=np.interp(places, known, lines.offset[rings]),
        azimuth=np.interp(places, known, lines.azimuth[rings]),
    )
