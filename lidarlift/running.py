"""SLAM over a data set, and its run folder."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from lidarlift.folders import require_apart
from lidarlift.front_ends import front_end_maker, front_end_notes, input_name, opened, settings_for
from lidarlift.kept_scan import KeptScan
from lidarlift.reporting import Quiet, Reporter, note_problems
from lidarlift.reports import report_run
from lidarlift.watching.choice import Views, watched
from slam.data.atomic import require_writable

if TYPE_CHECKING:
    from eval.metrics import RunMetrics
    from slam.data.dataset import Dataset
    from slam.run import Observer, Run
    from slam.settings import Config

NO_VIEWS = Views()


def run(
    dataset: Dataset | str | Path,
    *,
    sequence: str | None = None,
    sensor: str | Path | None = None,
    input: str | None = None,
    enricher: str | None = None,
    config: Config | str | Path | None = None,
    overrides: Sequence[str] = (),
    frames: slice = slice(None),
    odometry: str | Path | None = None,
    out: str | Path | None = None,
    strict: bool = False,
    reporter: Reporter | None = None,
    observer: Observer | None = None,
) -> Run:
    """Run SLAM over a data set.

    Args:
        dataset: An open data set; or a path that `open_dataset` takes, with `sequence` and `sensor`.
        sequence: Name of the sequence, if the folder has several.
        sensor: Name of the LiDAR or a YAML file with its beams, if the folder does not say.
        input: 'full': scans as recorded (of 64 rings also '64'); '16' or another number: so many rings; 'enriched': 16
            of 64 rings, or all rings of a sparser LiDAR, with virtual beams between them. Default: as recorded.
        enricher: The enrichment method: 'ray-segment', the default, needs no training; 'lift' is our network.
        config: A preset's name, a YAML file, or the result of `load_config`.
        overrides: Single settings, as in 'odometry.voxel_size=1.0'.
        frames: Positions in the data set, as a slice of a list.
        odometry: A file with LiDAR poses of another odometry, one per scan, in place of ours.
        out: The run folder, for trajectory, map and metrics. Default: nothing is written.
        strict: Raise an error at the first problem of the data.
        reporter: Receives progress and notes.
        observer: Watches the run frame by frame, see `slam.run.Observer`.

    Returns:
        The poses T_world_lidar (N, 4, 4) before and after loop closure, the map, and the problems of the data.

    Raises:
        InputError: The data set cannot be read, lacks what the settings require, or `out` cannot be written.
        ValueError: Arguments would be ignored: `sequence` or `sensor` with an open data set, or settings with a
            complete configuration.

    Example:
        >>> run = lidarlift.run("2011_09_26_drive_0013_sync", input="enriched", enricher="ray-segment", out="runs/13")
        >>> run.poses.shape
        (144, 4, 4)
    """
    from slam.data.dataset import ring_count

    data = opened(dataset, sequence, sensor)
    settings = settings_for(ring_count(data), input, enricher, config, overrides)
    poses = None if odometry is None else Path(odometry)
    task = _Task(data, settings, frames, poses, strict, reporter or Quiet(), observer=observer)
    if out is None:
        return task.run()
    result, _ = task.run_into(Path(out))
    report_run(Path(out), task.report_title)
    return result


def run_into(
    folder: Path,
    data: Dataset,
    settings: Config,
    frames: slice,
    reporter: Reporter,
    *,
    odometry: Path | None = None,
    name: str | None = None,
    strict: bool = False,
    views: Views = NO_VIEWS,
    report: bool = True,
    command: str | None = None,
) -> tuple[Run, RunMetrics | None]:
    """Run SLAM with complete settings, and write the run folder. See `run`.

    Args:
        folder: The run folder.
        data: The data set.
        settings: The settings.
        frames: Positions in the data set, as a slice of a list.
        reporter: Receives progress and notes.
        odometry: A file with LiDAR poses of another odometry, in place of ours.
        name: Name in progress and plot. Default: that of the data set.
        strict: Raise an error at the first problem of the data.
        views: Views in which the run can be watched.
        report: Write the report, too.
        command: The command line that makes the run again, for the report.

    Returns:
        The run, and its metrics; None without ground truth.

    Raises:
        InputError: As `run`.
    """
    task = _Task(data, settings, frames, odometry, strict, reporter, name)
    if views.record is not None:
        require_apart(views.record.parent, data)
    with watched(views, task.title, task.total, reporter) as observer:
        result = replace(task, observer=observer).run_into(folder)
        if report:
            report_run(folder, task.report_title, command)
    return result


@dataclass(frozen=True)
class _Task:
    """A data set with the settings to run it."""

    data: Dataset
    settings: Config
    frames: slice
    odometry: Path | None
    strict: bool
    reporter: Reporter
    name: str | None = None
    observer: Observer | None = None

    @property
    def total(self) -> int:
        return len(range(len(self.data))[self.frames])

    @property
    def title(self) -> str:
        return f"{self.name or self.data.name}, {input_name(self.settings)}"

    @property
    def report_title(self) -> str:
        return f"{self.title}, {len(range(len(self.data))[self.frames])} frames"

    def run(
        self,
        on_odometry: Callable[[Run], None] | None = None,
        on_stop: Callable[[Run], None] | None = None,
        kept: KeptScan | None = None,
    ) -> Run:
        from slam.compilation import compile_kernels
        from slam.data.dataset import ring_count
        from slam.pipeline import Pipeline
        from slam.recorded_odometry import RecordedOdometry

        make_front_end = front_end_maker(
            self.settings.front_end, self.data.sensor, self.data.path, ring_count(self.data)
        )
        recorded = RecordedOdometry(self.odometry, len(self.data), self.data.calibration) if self.odometry else None
        compile_kernels(
            self.settings, lambda: self.reporter.note("compiling kernels, only at the first run: about 20 s ...")
        )
        with self.reporter.progress(self.title, self.total) as advance:
            around = kept.around if kept else lambda front_end: front_end
            result = Pipeline(self.settings, lambda: around(make_front_end())).run(
                self.data,
                self.frames,
                recorded=recorded,
                strict=self.strict,
                observer=self.observer,
                on_frame=lambda _: advance(),
                on_odometry=on_odometry,
                on_stop=on_stop,
            )
        result.remarks = front_end_notes(self.settings.front_end, self.data.sensor, ring_count(self.data))
        note_problems(result.problems, self.reporter)
        return result

    def run_into(self, folder: Path) -> tuple[Run, RunMetrics | None]:
        from eval.evaluation import evaluate_run
        from eval.plot import plot_run
        from eval.report.scan import save_scan
        from slam.session import save_odometry, save_run, save_stopped

        require_apart(folder, self.data)
        require_writable(folder)

        def save_partial(run: Run) -> None:
            if written := save_stopped(run, folder):
                self.reporter.note(f"stopped after {len(run.records)} frames; the poses are written to {written}")

        # the odometry is saved first, so that it is kept if loops or map fail or are interrupted
        kept = KeptScan(len(range(len(self.data))[self.frames]))
        result = self.run(lambda run: save_odometry(run, folder), save_partial, kept)
        save_run(result, folder)
        if scan := kept.scan():
            save_scan(folder, scan)
        metrics = evaluate_run(folder)
        plot_run(folder, self.title)
        return result, metrics
