"""A drive run with its settings into a run folder: what `run` does once, and a comparison for each input."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from lidarlift.cli.arguments import require_writable
from lidarlift.cli.console import messages, progress
from lidarlift.front_ends import front_end_for

if TYPE_CHECKING:
    from eval.metrics import RunMetrics
    from slam.data.dataset import Dataset
    from slam.data.problem import Problem
    from slam.settings import Config


def run_into(
    folder: Path,
    data: Dataset,
    settings: Config,
    frames: slice = slice(None),
    *,
    odometry: Path | None = None,
    name: str | None = None,
    strict: bool = False,
) -> RunMetrics | None:
    """Write all files of a run folder, metrics.json and trajectory.png too; progress and problems go to stderr.

    `odometry` is a file of poses to take instead of our own. `name` of the drive is for progress and plot, by default
    the data set's. Returns what metrics.json holds, None without ground truth. Raises InputError as `RecordedOdometry`,
    `Pipeline.run` and `save_run` do.
    """
    from eval.evaluation import evaluate_run
    from eval.plot import plot_run
    from slam.pipeline import Pipeline, compile_kernels
    from slam.recorded_odometry import RecordedOdometry
    from slam.session import save_odometry, save_run

    require_writable(folder)
    front_end = front_end_for(settings.front_end, data)
    recorded = RecordedOdometry(odometry, len(data)) if odometry else None
    title = f"{name or data.name}, {input_name(settings)}"
    compile_kernels(settings, lambda: messages.print("Compiling kernels, once: about 20 seconds ..."))
    with progress(title, len(range(len(data))[frames])) as advance:
        result = Pipeline(settings, front_end).run(
            data,
            frames,
            recorded=recorded,
            strict=strict,
            on_frame=lambda _: advance(),
            on_odometry=lambda run: save_odometry(run, folder),  # an hour's work is not lost where the rest is stopped
        )
    save_run(result, folder)
    _report(result.problems)
    metrics = evaluate_run(folder)
    plot_run(folder, title)
    return metrics


def input_name(settings: Config) -> str:
    """Of a configuration, for people."""
    front_end = settings.front_end
    return f"enriched by {front_end.enricher}" if front_end.input == "enriched" else f"{front_end.input} channels"


def _report(problems: Sequence[Problem]) -> None:
    """The first problem of each kind, and how many there were, on stderr; run.json has them all."""
    kinds: dict[str, list[str]] = {}
    for problem in problems:
        kinds.setdefault(problem.kind, []).append(problem.message)
    for kind, found in kinds.items():
        more = f" (and {len(found) - 1} more, see run.json)" if len(found) > 1 else ""
        messages.print(f"Note: {kind}: {found[0]}{more}", style="yellow", markup=False)
