"""Front end that enriches a sparse scan with predicted points on virtual beams."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, Protocol, runtime_checkable

import numpy as np

from enrichment.calibration import Calibrated
from enrichment.geometry import kernels
from enrichment.geometry.rays import Prediction, RayGrid, columns_for
from enrichment.geometry.sparse_scan import Method, SparseScan, heights
from slam.data.cloud import Array, Frame, History, PointCloud
from slam.data.sensor import Sensor

BEAMS = 64  # approximate number of lines after enrichment, if the sensor has fewer
FIRST_SCANS = 10  # used to choose the number of columns
MIN_RING_POINTS = 90  # on the fullest ring of a scan used for this: a quarter turn at the coarsest resolution
MAX_RATIO = 1.25  # between the median and the chosen number of columns, above which the choice is changed


@runtime_checkable
class Adaptive(Protocol):
    """A method or a source of sparse clouds whose results depend on earlier scans."""

    def state(self) -> Any:
        """Return what it learned: numbers, texts, arrays, lists, tuples and dicts."""
        ...

    def restore(self, state: Any) -> None:
        """Continue from the state of another one."""
        ...


class Enricher:
    """Enriches sparse scans, with their images, to clouds on many virtual beams.

    The measured points come first, unchanged; then the predicted points, on the rays of `target`'s lines through the
    centres of the azimuth columns, each with its sigma and `measured` False. Rings are numbered as in `target`. A scan
    without rings is returned unchanged.

    An enricher is for one run: the calibration of sigma and the number of columns are estimated from its scans.

    Args:
        measure: Returns the sparse cloud of a frame, in the sensor's geometry.
        method: Predicts ranges and sigmas, which are calibrated while running.
        lines: The laser line of each ring index of the sparse cloud.
        rings: Ring indices (K,) of the sparse cloud, top first.
        target: The lines after enrichment. Default: `denser(lines, rings)`.
        coverage: Share of the predicted points that are kept: those with the smallest sigma relative to their range.
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
        rings = rings[np.argsort(-heights(lines)[rings], kind="stable")]  # top first, whatever their numbers
        self.lines, self.rings = lines, rings
        self.target = target or denser(lines, rings)
        self._column_count = ColumnCount()
        self._row_of_ring = np.abs(heights(lines)[:, None] - heights(self.target)).argmin(axis=1)
        self._ring_of_row = np.full(self.target.ring_count, -1)
        self._ring_of_row[self._row_of_ring[rings]] = rings

    def __call__(self, frame: Frame, history: History) -> PointCloud:
        """Return the enriched cloud of a frame, in the sensor's geometry: neither deskewed nor vertically corrected."""
        cloud = self.measure(frame, history)
        if cloud.ring is None or len(cloud) == 0:
            return cloud
        columns = self._column_count(cloud)
        grid = RayGrid(self.target, columns)

        def measured_history() -> History:
            return [(self._as_measured(then), T_now_then) for then, T_now_then in history if then.ring is not None]

        scan = SparseScan(
            cloud, self.lines, self.rings, lambda: frame.image, frame.calibration, columns, measured_history
        )
        between = (scan.rows_above(self.target) >= 0).any()
        return self._merge(scan, grid, self.method(scan, grid) if between else Prediction.empty(grid.shape))

    def state(self) -> dict[str, Any]:
        """Return what is estimated from the scans so far, for `restore`."""
        return {name: part.state() for name, part in self._adaptive().items()}

    def restore(self, state: dict[str, Any]) -> None:
        """Continue from the state of another enricher with the same settings."""
        for name, part in self._adaptive().items():
            part.restore(state[name])

    def _adaptive(self) -> dict[str, Adaptive]:
        """The parts that adapt to the scans."""
        parts: dict[str, Any] = {"measure": self.measure, "method": self.method.method}
        known = {name: part for name, part in parts.items() if isinstance(part, Adaptive)}
        return {"columns": self._column_count, "calibration": self.method, **known}

    def _as_measured(self, cloud: PointCloud) -> PointCloud:
        """The measured points of an enriched cloud, with the ring indices of the sparse cloud."""
        measured = cloud.select(cloud.measured)
        return replace(measured, ring=self._ring_of_row[measured.ring])

    def _merge(self, scan: SparseScan, grid: RayGrid, prediction: Prediction) -> PointCloud:
        """The measured points and the predicted points that are kept."""
        cloud, sensor = scan.cloud, grid.sensor
        time = np.zeros(0, np.float32) if cloud.time is None else cloud.time
        xyz, intensity, sigma, ring, times = kernels.collect(
            prediction.ranges, prediction.sigma, self._selection(prediction), scan.points, *scan.rows_around(sensor),
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

    def _selection(self, prediction: Prediction) -> Array:
        """Which predictions are kept, (R, W) bool."""
        if self.coverage >= 1:
            return prediction.trusted
        relative = (prediction.sigma / np.maximum(prediction.ranges, np.float32(1e-3)))[prediction.trusted]
        limit = np.quantile(relative, self.coverage) if len(relative) else 0.0
        return prediction.trusted & (prediction.sigma <= limit * prediction.ranges)


class ColumnCount:
    """Chooses the number of azimuth columns: that of the first scan, unless the median of the first few differs.

    Scans with few points, as at the start of a recording, are not used.
    """

    def __init__(self) -> None:
        self._seen: list[int] = []
        self._chosen = 0

    def state(self) -> list[Any]:
        """Return the columns of the first scans, and the choice."""
        return [list(self._seen), self._chosen]

    def restore(self, state: list[Any]) -> None:
        """Continue from the state of another one."""
        self._seen, self._chosen = state

    def __call__(self, cloud: PointCloud) -> int:
        """Return the number of columns for the next scan, which has rings."""
        if len(self._seen) == FIRST_SCANS:
            return self._chosen
        assert cloud.ring is not None
        found = columns_for(cloud)
        if np.bincount(cloud.ring).max() >= MIN_RING_POINTS:
            self._seen.append(found)
            median = sorted(self._seen)[len(self._seen) // 2]
            if not 1 / MAX_RATIO < self._chosen / median < MAX_RATIO:
                self._chosen = median
        return self._chosen or found


def denser(lines: Sensor, rings: Array) -> Sensor:
    """Return the lines of the rings (K,) with evenly spaced lines between each two, about 64 in total."""
    between = max(1, round(BEAMS / len(rings)))
    places, known = np.arange((len(rings) - 1) * between + 1) / between, np.arange(len(rings))
    return replace(
        lines,
        name=f"{lines.name}, enriched",
        elevation=np.interp(places, known, lines.elevation[rings]),
        offset=np.interp(places, known, lines.offset[rings]),
        azimuth=np.interp(places, known, lines.azimuth[rings]),
    )
