"""A drive run with its settings, and the run folder that is left."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from lidarlift.folders import require_apart
from lidarlift.front_ends import front_end_maker, input_name, opened, settings_for
from lidarlift.reporting import Quiet, Reporter, note_problems
from slam.data.atomic import require_writable

if TYPE_CHECKING:
    from eval.metrics import RunMetrics
    from slam.data.dataset import Dataset
    from slam.run import Run
    from slam.settings import Config


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
) -> Run:
    """Run SLAM over a data set.

    Args:
        dataset: An open data set; or a path that `open_dataset` takes, with `sequence` and `sensor`.
        sequence: Which sequence or drive, where the folder has several.
        sensor: The LiDAR's name or a YAML file with its beams, where the folder does not say.
        input: '64', the scans as recorded; '16', rings dropped; or 'enriched', 16 with the rest filled in. By default
            as recorded.
        enricher: The method of enrichment: 'ray-segment', which needs no training; 'lift', our network, the default.
        config: A preset's name, a YAML file, or the result of `load_config`.
        overrides: Single settings, as in 'odometry.voxel_size=1.0'.
        frames: Positions in the data set, as in a list's slice.
        odometry: A file with LiDAR poses of another odometry, one a scan, in place of ours.
        out: The folder for trajectory, map, metrics and the rest of a run folder; by default nothing is written.
        strict: Stop at the first damage in the data instead of going on.
        reporter: Where progress and notes go.

    Returns:
        The poses before and after loops, (N, 4, 4) T_world_lidar each, the map, and what was wrong with the data.

    Raises:
        InputError: The data set cannot be read, lacks what is asked for, or `out` cannot be written.
        ValueError: Arguments are given that would be ignored: of a data set or settings that are complete already.

    Example:
        >>> run = lidarlift.run("2011_09_26_drive_0013_sync", input="enriched", enricher="ray-segment", out="runs/13")
        >>> run.poses.shape
        (144, 4, 4)
    """
    data = opened(dataset, sequence, sensor)
    settings = settings_for(data.sensor, input, enricher, config, overrides)
    poses = None if odometry is None else Path(odometry)
    task = _Task(data, settings, frames, poses, strict, reporter or Quiet())
    return task.run() if out is None else task.run_into(Path(out))[0]


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
) -> tuple[Run, RunMetrics | None]:
    """Write all files of a run folder, by settings that are complete. See `run`.

    `name` replaces the data set's in progress and plot. The metrics are None without ground truth.
    """
    return _Task(data, settings, frames, odometry, strict, reporter, name).run_into(folder)


@dataclass(frozen=True)
class _Task:
    data: Dataset
    settings: Config
    frames: slice
    odometry: Path | None
    strict: bool
    reporter: Reporter
    name: str | None = None

    @property
    def title(self) -> str:
        return f"{self.name or self.data.name}, {input_name(self.settings)}"

    def run(
        self, on_odometry: Callable[[Run], None] | None = None, on_stop: Callable[[Run], None] | None = None
    ) -> Run:
        from slam.compilation import compile_kernels
        from slam.pipeline import Pipeline
        from slam.recorded_odometry import RecordedOdometry

        make_front_end = front_end_maker(self.settings.front_end, self.data.sensor, self.data.path)
        recorded = RecordedOdometry(self.odometry, len(self.data), self.data.calibration) if self.odometry else None
        compile_kernels(self.settings, lambda: self.reporter.note("compiling kernels, once: about 20 seconds ..."))
        with self.reporter.progress(self.title, len(range(len(self.data))[self.frames])) as advance:
            result = Pipeline(self.settings, make_front_end).run(
                self.data,
                self.frames,
                recorded=recorded,
                strict=self.strict,
                on_frame=lambda _: advance(),
                on_odometry=on_odometry,
                on_stop=on_stop,
            )
        note_problems(result.problems, self.reporter)
        return result

    def run_into(self, folder: Path) -> tuple[Run, RunMetrics | None]:
        from eval.evaluation import evaluate_run
        from eval.plot import plot_run
        from slam.session import save_odometry, save_run, save_stopped

        require_apart(folder, self.data)
        require_writable(folder)

        def keep(run: Run) -> None:
            if place := save_stopped(run, folder):
                self.reporter.note(f"stopped after {len(run.records)} frames; their poses are in {place}")

        # an hour's work is not lost where the rest is stopped
        result = self.run(on_odometry=lambda run: save_odometry(run, folder), on_stop=keep)
        save_run(result, folder)
        metrics = evaluate_run(folder)
        plot_run(folder, self.title)
        return result, metrics
