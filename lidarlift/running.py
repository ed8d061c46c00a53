"""SLAM over a data set, and its run folder."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lidarlift.folders import require_apart
from lidarlift.front_ends import front_end_maker, front_end_notes, input_name, opened, settings_for
from lidarlift.reporting import COMPILING, Quiet, Reporter, note_problems
from lidarlift.reports import report_run
from lidarlift.watching.choice import Views, watched
from slam.data.atomic import require_no_links, require_writable
from slam.data.errors import InputError

if TYPE_CHECKING:
    from eval.metrics import RunMetrics
    from lidarlift.kept_scan import KeptScan
    from slam.data.dataset import Dataset
    from slam.journal.journal import Journal
    from slam.recorded_odometry import RecordedOdometry
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
    resume: bool = False,
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
        resume: Continue the run in `out` that was stopped or killed; the results are those of a run that was not.
        strict: Raise an error at the first problem of the data.
        reporter: Receives progress and notes.
        observer: Watches the run frame by frame, see `slam.run.Observer`.

    Returns:
        The poses T_world_lidar (N, 4, 4) before and after loop closure, the map, and the problems of the data.

    Raises:
        InputError: The data set cannot be read, lacks what the settings require, or `out` cannot be written; another
            run writes into `out`; `out` has an unfinished run, and `resume` is not set; or `resume` is set, and code,
            input or settings have changed.
        ValueError: Arguments would be ignored: `sequence` or `sensor` with an open data set, settings with a complete
            configuration, or `resume` without `out`.

    Example:
        >>> run = lidarlift.run("2011_09_26_drive_0013_sync", input="enriched", enricher="ray-segment", out="runs/13")
        >>> run.poses.shape
        (144, 4, 4)
    """
    from slam.data.dataset import ring_count

    if resume and out is None:
        raise ValueError("resume continues the run in a folder; give it as out")
    data = opened(dataset, sequence, sensor)
    settings = settings_for(ring_count(data), input, enricher, config, overrides)
    poses = None if odometry is None else Path(odometry)
    task = _Task(data, settings, frames, poses, strict, reporter or Quiet(), observer=observer)
    if out is not None:
        return task.run_into(Path(out), resume)[0]
    recorded = task.recorded()
    task.compile()
    return task.run(recorded)


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
    resume: bool | None = None,
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
        resume: Continue the unfinished run in the folder: True, and refuse if it has another identity; False, refuse if
            there is one; None, continue it if it is the same run, else replace it.

    Returns:
        The run, and its metrics; None without ground truth.

    Raises:
        InputError: As `run`.
    """
    task = _Task(data, settings, frames, odometry, strict, reporter, name)
    if views.record is not None:
        require_apart(views.record.parent, data)
    with watched(views, task.title, task.total, reporter) as observer:
        return replace(task, observer=observer).run_into(folder, resume, report, command)


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

    def recorded(self) -> RecordedOdometry | None:
        """The poses of another odometry."""
        from slam.recorded_odometry import RecordedOdometry

        return RecordedOdometry(self.odometry, len(self.data), self.data.calibration) if self.odometry else None

    def compile(self) -> None:
        """Load the kernels of the odometry or compile them; in two processes, so those of the reading come later."""
        from slam.compilation import compile_odometry

        compile_odometry(self.settings, lambda: self.reporter.note(COMPILING))

    def run(
        self,
        recorded: RecordedOdometry | None,
        journal: Journal | None = None,
        on_odometry: Callable[[Run], None] | None = None,
        on_stop: Callable[[Run], None] | None = None,
        kept: KeptScan | None = None,
    ) -> Run:
        from lidarlift.camera_check import camera_problems
        from slam.compilation import compiling_mapping
        from slam.data.dataset import ring_count
        from slam.pipeline import Pipeline

        make_front_end = front_end_maker(
            self.settings.front_end, self.data.sensor, self.data.path, ring_count(self.data)
        )
        with compiling_mapping(self.settings), self.reporter.progress(self.title, self.total) as advance:
            around = kept.around if kept else lambda front_end: front_end
            result = Pipeline(self.settings, lambda: around(make_front_end())).run(
                self.data,
                self.frames,
                recorded=recorded,
                strict=self.strict,
                journal=journal,
                observer=self.observer,
                on_frame=lambda _: advance(),
                on_odometry=on_odometry,
                on_stop=on_stop,
            )
        result.remarks = front_end_notes(self.settings.front_end, self.data.sensor, ring_count(self.data))
        result.problems.extend(camera_problems(self.data, result))
        note_problems(result.problems, self.reporter)
        return result

    def run_into(
        self, folder: Path, resume: bool | None, report: bool = True, command: str | None = None
    ) -> tuple[Run, RunMetrics | None]:
        from eval.evaluation import evaluate_run
        from eval.plot import plot_run
        from eval.report.scan import save_scan
        from eval.report.writing import FIGURES
        from lidarlift.kept_scan import KeptScan
        from slam.data.dataset import chosen_positions
        from slam.identity import identity
        from slam.journal.lock import locked
        from slam.refusal import RefusedError
        from slam.session import SESSION, UNFINISHED, drop_session, save_odometry, save_run, save_stopped

        require_apart(folder, self.data)
        require_writable(folder)
        require_no_links(folder, (FIGURES, SESSION, UNFINISHED))
        recorded = self.recorded()
        self.compile()
        about = identity(self.data, chosen_positions(self.data, self.frames), self.settings, recorded)

        def save_partial(run: Run) -> None:
            if written := save_stopped(run, folder):
                frames = f"stopped after {len(run.records)} frames"
                self.reporter.note(f"{frames}; the poses are written to {written}, and --resume continues the run")

        kept = KeptScan(len(range(len(self.data))[self.frames]))
        with locked(folder):
            journal = self._journal(folder, about, resume)
            try:
                with journal:
                    # the odometry is saved first, so that it is kept if loops or map fail or are interrupted
                    result = self.run(recorded, journal, lambda run: save_odometry(run, folder), save_partial, kept)
                    save_run(result, folder, journal)
            except BaseException as error:
                if isinstance(error, RefusedError) or not journal.counts()["frame"]:
                    drop_session(folder)
                raise
            if scan := kept.scan():
                save_scan(folder, scan)
            metrics = evaluate_run(folder)
            plot_run(folder, self.title)
            if report:
                report_run(folder, self.report_title, command)
        return result, metrics

    def _journal(self, folder: Path, about: dict[str, Any], resume: bool | None) -> Journal:
        """The session of this run in a folder: a new one, or that of the run that is continued."""
        from slam.session import UNFINISHED, begin_session, resume_session, session_differences, unfinished_frames

        if resume is False and (found := unfinished_frames(folder)):
            raise InputError(
                f"{folder}: holds an unfinished run of {found} frames; add --resume to continue it, choose another "
                f"folder, or remove {folder / UNFINISHED}"
            )
        if resume or (resume is None and unfinished_frames(folder) and not session_differences(folder, about)):
            if journal := resume_session(folder, about):
                self.reporter.note(f"{folder}: the run continues after {journal.counts()['frame']} frames")
                return journal
            self.reporter.note(f"{folder}: nothing to continue; the run begins with the first frame")
        return begin_session(folder, about)
