"""A run in the viewer rerun, or in a file for it."""

from __future__ import annotations

import os
import shutil
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from slam.data.cloud import Array, Frame, PointCloud
from slam.data.errors import InputError
from slam.data.images import ImageFile
from slam.data.se3 import from_first
from slam.mapping_result import LoopProgress
from slam.records import FrameRecord
from slam.run import Observer, Run

MAX_POINTS = 15_000  # of a scan, measured and enriched each: half a megabyte per frame
LOCAL_SCANS, LOCAL_POINTS = 20, 2_000  # of the local map, and points of each of its scans
MAX_MAP_POINTS = 500_000  # of the global map
MAX_LINE = 2_000  # vertices of a trajectory while it grows
LINE_EVERY = 5  # frames after which the growing trajectory is drawn again
IMAGE_WIDTH, JPEG_QUALITY = 800, 80
MAX_SIGMA = 0.5  # m, end of the colour scale
MEASURED, LOCAL, TRUTH, ODOMETRY, TRAJECTORY, LOOP = (
    (230, 230, 230),
    (110, 130, 160),
    (150, 150, 150),
    (0, 114, 178),
    (213, 94, 0),
    (0, 158, 115),
)
LEVELS = {"registered": "INFO", "retried": "WARN", "degenerate": "WARN", "failed": "ERROR"}


class RerunLog(Observer):
    """Logs a run: scans, enriched points by sigma, local map, trajectory, loops, images, figures of each frame.

    Everything is in the world frame below `world/`, on the timelines `frame` (number in the data set) and `stamp`
    (seconds since the first scan).

    Args:
        title: Name of the recording.
        show: Open the viewer.
        file: Write a .rrd file, None for none.

    Raises:
        InputError: rerun is not installed, there is no display for the viewer, or the file cannot be written.
    """

    def __init__(self, title: str, *, show: bool = False, file: Path | None = None) -> None:
        if show:
            require_display()
        self._rr = rr = _rerun()
        self._stream = rr.RecordingStream("lidarlift")
        self._stream.send_recording_name(title)
        blueprint = _blueprint()
        if show:
            _open_viewer(rr, self._stream)
        sinks = [rr.GrpcSink()] if show else []
        if file is not None:
            _require_writable(file)
            sinks.append(rr.FileSink(str(file)))
        self._stream.set_sinks(*sinks, default_blueprint=blueprint)
        self._stream.log("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        self._colours = _sigma_colours()
        self._local: list[Array] = []  # points of the last scans in the world frame
        self._positions: list[Array] = []
        self._first_stamp = 0.0

    def started(self, run: Run) -> None:
        """Log the ground truth."""
        self.log_truth(run.ground_truth)

    def registered(self, frame: Frame, cloud: PointCloud, record: FrameRecord) -> None:
        """Log a frame."""
        if not self._positions:
            self._first_stamp = record.stamp
        self._stream.set_time("frame", sequence=record.index)
        self._stream.set_time("stamp", duration=record.stamp - self._first_stamp)
        self._positions.append(record.pose[:3, 3])
        self._log_scan(cloud, record)
        self._log_local_map(cloud, record)
        if len(self._positions) % LINE_EVERY == 0:
            self._log_trajectory(np.array(self._positions))
        if (picture := image_of(frame)) is not None:
            self._stream.log("camera/image", self._rr.Image(_smaller(picture)).compress(jpeg_quality=JPEG_QUALITY))
        self._log_figures(record)

    def loops_closed(self, progress: LoopProgress) -> None:
        """Log the corrected keyframes, and the loops between them."""
        place = {int(index): k for k, index in enumerate(progress.indices)}
        positions = progress.optimised[:, :3, 3]
        edges = [positions[[place[i], place[j]]] for i, j in progress.loops]
        self._stream.log("world/loops", _lines(self._rr, edges, LOOP))
        self._stream.log("world/corrected", _line(self._rr, positions, TRAJECTORY))

    def finished(self, run: Run) -> None:
        """Log trajectory, accepted loops and map of the complete run, at the last frame."""
        self.log_truth(run.ground_truth)  # the odometry may have settled how it is read
        self.log_result(run.odometry_poses, run.poses, run.loops(), run.map)

    def log_truth(self, truth: Array | None) -> None:
        """Log true poses (N, 4, 4) T_world_lidar, NaN where unknown."""
        known = None if truth is None else from_first(truth)
        if known is not None:
            line = known[np.isfinite(known).all(axis=(1, 2)), :3, 3]
            self._stream.log("world/ground_truth", _line(self._rr, line, TRUTH), static=True)

    def log_result(self, odometry: Array, poses: Array, loops: Sequence[tuple[int, int]], world: PointCloud) -> None:
        """Log a complete run.

        Args:
            odometry: Poses (N, 4, 4) before loop closure.
            poses: (N, 4, 4) after loop closure.
            loops: Positions of the two frames of each loop.
            world: The global map; it is coloured by the camera, or by height.
        """
        rr, some = self._rr, thinned(world, MAX_MAP_POINTS)
        self._stream.log("world/odometry", _line(rr, odometry[:, :3, 3], ODOMETRY))
        self._stream.log("world/corrected", _line(rr, poses[:, :3, 3], TRAJECTORY))
        self._stream.log("world/loops", _lines(rr, [poses[list(loop), :3, 3] for loop in loops], LOOP))
        colours = some.colour if some.colour is not None else by_height(some.xyz[:, 2])
        self._stream.log("world/map", rr.Points3D(some.xyz, colors=colours, radii=0.05))
        self._stream.flush()

    def _log_scan(self, cloud: PointCloud, record: FrameRecord) -> None:
        rr, stream = self._rr, self._stream
        stream.log("world/lidar", rr.Transform3D(translation=record.pose[:3, 3], mat3x3=record.pose[:3, :3]))
        measured = thinned(cloud.select(cloud.measured), MAX_POINTS)
        stream.log("world/lidar/measured", rr.Points3D(measured.xyz, colors=MEASURED, radii=0.03))
        if not cloud.measured.all():
            enriched = thinned(cloud.select(~cloud.measured), MAX_POINTS)
            share = np.clip(enriched.sigma / MAX_SIGMA, 0, 1)
            colours = self._colours[(255 * share).astype(int)]
            stream.log("world/lidar/enriched", rr.Points3D(enriched.xyz, colors=colours, radii=0.03))

    def _log_local_map(self, cloud: PointCloud, record: FrameRecord) -> None:
        """The last scans in the world frame; registration matches them, as cells."""
        some = thinned(cloud.select(cloud.measured), LOCAL_POINTS).transformed(record.pose).xyz
        self._local = [*self._local[1 - LOCAL_SCANS :], some]
        if len(self._positions) % LINE_EVERY == 0:
            points = self._rr.Points3D(np.concatenate(self._local), colors=LOCAL, radii=0.02)
            self._stream.log("world/local_map", points)

    def _log_trajectory(self, positions: Array) -> None:
        step = max(1, len(positions) // MAX_LINE)
        self._stream.log("world/odometry", _line(self._rr, positions[::step], ODOMETRY))

    def _log_figures(self, record: FrameRecord) -> None:
        rr = self._rr
        for stage in ("front_end", "odometry"):
            self._stream.log(f"milliseconds/{stage}", rr.Scalars(record.milliseconds[stage]))
        if np.isfinite(record.inlier_ratio):
            self._stream.log("inlier_ratio", rr.Scalars(record.inlier_ratio))
        if record.status != "registered":
            self._stream.log(
                "status", rr.TextLog(f"frame {record.index}: {record.status}", level=LEVELS[record.status])
            )


def require_display() -> None:
    """Check that a window can open.

    Raises:
        InputError: There is no display.
    """
    if sys.platform == "linux" and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        raise InputError(
            "no display for the viewer (neither DISPLAY nor WAYLAND_DISPLAY is set); write a file with --record "
            "FILE.rrd and open it elsewhere (rerun FILE.rrd), or watch a run in a browser: lidarlift run --serve 8080"
        )


def _open_viewer(rr: Any, stream: Any) -> None:
    """Start the viewer, which is installed beside the interpreter, also where the environment is not activated."""
    beside = str(Path(sys.executable).parent)
    executable = shutil.which("rerun", path=f"{beside}{os.pathsep}{os.environ.get('PATH', '')}")
    try:
        rr.spawn(connect=False, recording=stream, **({"executable_path": executable} if executable else {}))
    except (RuntimeError, OSError) as error:
        reason = str(error).partition("\n")[0]
        raise InputError(f"the viewer cannot be started ({reason}); write a file with --record FILE.rrd") from error


def image_of(frame: Frame) -> Array | None:
    """Read the image of a frame without adding problems to a run that reads it as well."""
    reader = frame.read_image
    return ImageFile(reader.path, reader.bits)() if isinstance(reader, ImageFile) else reader()


def thinned(cloud: PointCloud, count: int) -> PointCloud:
    """Return at most `count` points of a cloud, evenly."""
    if len(cloud) <= count:
        return cloud
    return cloud.select(np.linspace(0, len(cloud) - 1, count).astype(np.int64))


def by_height(z: Array) -> Array:
    """Return colours (N, 3) uint8 of heights (N,) [m], from the 2nd to the 98th percentile."""
    from matplotlib import colormaps

    low, high = np.percentile(z, [2, 98]) if len(z) else (0.0, 1.0)
    return np.asarray(colormaps["viridis"](np.clip((z - low) / max(high - low, 1e-3), 0, 1), bytes=True)[:, :3])


def _sigma_colours() -> Array:
    """(256, 3) uint8, from sure to unsure; told apart by colour-blind people."""
    from matplotlib import colormaps

    return np.asarray(colormaps["plasma"](np.arange(256), bytes=True)[:, :3])


def _smaller(picture: Array) -> Array:
    """The image at no more than IMAGE_WIDTH pixels."""
    import cv2

    height, width = picture.shape[:2]
    if width <= IMAGE_WIDTH:
        return picture
    return np.asarray(
        cv2.resize(picture, (IMAGE_WIDTH, round(height * IMAGE_WIDTH / width)), interpolation=cv2.INTER_AREA)
    )


def _rerun() -> Any:
    try:
        import rerun
    except ImportError as error:
        raise InputError(
            "the viewer needs the package rerun-sdk (0.7 GB with pyarrow): pip install 'lidarlift[view]', in a clone "
            "pip install '.[view]'"
        ) from error
    return rerun


def _require_writable(file: Path) -> None:
    """Check that a file can be written, since rerun reports it too late."""
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        file.open("wb").close()
    except OSError as error:
        raise InputError(f"{file}: cannot be written ({error.strerror or error}); choose another file") from error


def _line(rr: Any, positions: Array, colour: tuple[int, int, int]) -> Any:
    return _lines(rr, [positions], colour)


def _lines(rr: Any, strips: list[Array], colour: tuple[int, int, int]) -> Any:
    return rr.LineStrips3D(strips, colors=colour, radii=0.08)


def _blueprint() -> Any:
    """The world at the left; image, figures and log at the right."""
    import rerun.blueprint as rrb

    figures = rrb.Vertical(
        rrb.Spatial2DView(origin="camera/image", name="camera"),
        rrb.TimeSeriesView(origin="milliseconds", name="milliseconds per frame"),
        rrb.TextLogView(origin="status", name="status"),
    )
    world = rrb.Spatial3DView(origin="world", name="world")
    return rrb.Blueprint(rrb.Horizontal(world, figures, column_shares=[3, 1]), collapse_panels=True)
