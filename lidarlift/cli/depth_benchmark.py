"""`lidarlift depth-benchmark`: how well methods predict what a sparse scan does not show."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from statistics import median
from time import perf_counter
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

import typer

from lidarlift.cli.arguments import frame_slice, require_writable
from lidarlift.cli.console import progress
from slam.data.errors import InputError

if TYPE_CHECKING:
    from enrichment.geometry.sparse_scan import Method
    from slam.data.dataset import Dataset

T = TypeVar("T")
Report = dict[str, Any]


def depth_benchmark(
    dataset: Annotated[
        Path, typer.Argument(help="A drive whose scans have rings, or KITTI's depth completion images with truth.")
    ],
    sequence: Annotated[str | None, typer.Option(help="Which sequence or drive, where the folder has several.")] = None,
    frames: Annotated[str, typer.Option(help="A slice of the drive, FROM:TO or FROM:TO:STEP.")] = ":",
    sensor: Annotated[str | None, typer.Option(help="hdl64, vlp16 or a YAML file with the beams.")] = None,
    phase: Annotated[int, typer.Option(min=0, max=3, help="The first ring that is kept; then every fourth.")] = 0,
    method: Annotated[list[str] | None, typer.Option(help="Only this one; may be given several times.")] = None,
    out: Annotated[Path, typer.Option(help="The folder for the figures.")] = Path("runs/depth"),
) -> None:
    """Measure how well methods predict depth: they see 16 of 64 rings, and the other rings' returns are the answers.

    Example: `lidarlift depth-benchmark kitti/sequences/04 --frames ::5 --out runs/depth-04`

    Of sensors with fewer rings, every second is held out. A folder like KITTI's val_selection_cropped (velodyne_raw,
    groundtruth_depth, image) is recognised and measured by that benchmark's own rules.
    """
    from eval.depth.maps import is_depth_map_folder
    from eval.depth.plot import plot_risk_coverage
    from eval.depth.tables import format_depth
    from eval.evaluation import write_json

    require_writable(out)
    chosen = frame_slice(frames)
    if is_depth_map_folder(dataset):
        report = _of_depth_maps(dataset, chosen, method)
    else:
        from enrichment.methods.registry import make_methods, runnable
        from slam.data.dataset import open_dataset

        report = report_of_drive(
            open_dataset(dataset, sequence, sensor), make_methods(method or runnable()), chosen, phase
        )
    write_json(out / "depth.json", report)
    written = ["depth.json"]
    if any("full" in entry for entry in report.values()):
        plot_risk_coverage(report, out / "risk_coverage.png")
        written.append("risk_coverage.png")
    print(report["about"]["title"] + "\n\n" + format_depth(report))
    print(f"Written to {out}: {', '.join(written)}")


def report_of_drive(
    data: Dataset, methods: Mapping[str, Method], chosen: slice = slice(None), phase: int = 0
) -> Report:
    """What depth.json holds: every method on every frame, over the returns that the camera sees ("image") and over all
    ("full"). Raises InputError where the drive has no rings that could be held out."""
    from enrichment.calibration import Calibrated
    from enrichment.geometry.held_out import hold_out, past_of, ring_step
    from enrichment.geometry.rays import RayGrid
    from eval.depth.metrics import PROTOCOL, Answers

    if data.sensor is None:
        raise InputError(f"{data.path}: nobody knows which LiDAR this was; name it: --sensor")
    step = ring_step(data.sensor)
    if phase >= step:
        raise InputError(f"--phase {phase}: every second ring of {data.sensor.name} is kept; 0 and 1 exist")
    grid, positions = RayGrid(data.sensor), _chosen(range(len(data)), chosen, data.path)
    clocks = {name: _Clock(Calibrated(method)) for name, method in methods.items()}
    views = {view: Answers(len(positions)) for view in ("image", "full")}
    left_out = []
    with progress(data.name, len(positions)) as advance:
        for position in positions:
            frame = data[position]
            if frame.cloud.ring is None or len(frame.cloud) == 0:
                left_out.append(frame.index)
            else:
                held = hold_out(frame, grid, phase, past_of(data, position))
                # a scan of its own for each method: what one works out and keeps there, the next must not find
                answers = {name: held.answers(clock(replace(held.scan), grid)) for name, clock in clocks.items()}
                views["full"].add(held.ranges, answers)
                if held.seen is not None:
                    views["image"].add(held.ranges, answers, held.seen)
            advance()
    if len(left_out) == len(positions):
        raise InputError(f"{data.path}: no scan whose points have rings; name the right LiDAR: --sensor")
    figures = {view: answers.figures() for view, answers in views.items()}
    count = f"{len(positions)} frames, every {'4th' if step == 4 else '2nd'} of {data.sensor.ring_count} rings kept"
    return {
        **{
            name: {**_views(figures, name), "ms": clock.milliseconds, **_size(methods[name])}
            for name, clock in clocks.items()
        },
        "about": {
            "title": f"{data.name}: {count}, from ring {phase}",
            "dataset": data.name,
            "frames": [int(data.numbers[position]) for position in positions],
            "frames_left_out": left_out,
            "sensor": data.sensor.name,
            "ring_step": step,
            "phase": phase,
            "columns": grid.columns,
            "protocol": PROTOCOL,
        },
    }


def _of_depth_maps(folder: Path, chosen: slice, names: Collection[str] | None) -> Report:
    """Every method of the image on KITTI's depth maps, each with the LiDAR's own 64 lines as input."""
    from enrichment.methods.registry import COMPLETIONS
    from eval.depth.maps import PROTOCOL, depth_map_triples, evaluate_map, mean_figures

    triples = _chosen(depth_map_triples(folder), chosen, folder)
    COMPLETIONS.require(*names or ())
    clocks = {name: _Clock(COMPLETIONS.load(name)().complete) for name in names or COMPLETIONS.names()}
    figures: dict[str, list[dict[str, Any]]] = {name: [] for name in clocks}
    with progress(folder.name, len(triples)) as advance:
        for triple in triples:
            sparse, truth, image = triple.read()
            for name, clock in clocks.items():
                figures[name].append(evaluate_map(truth, clock(sparse, image)))
            advance()
    return {
        **{name: {"image": mean_figures(figures[name]), "ms": clock.milliseconds} for name, clock in clocks.items()},
        "about": {
            "title": f"{folder.resolve().name}: {len(triples)} depth maps of KITTI's depth completion benchmark",
            "images": [triple.sparse.name for triple in triples],
            "protocol": PROTOCOL,
        },
    }


class _Clock:
    """A function, and the median of the milliseconds that its calls take, but for a first one that compiles."""

    def __init__(self, function: Callable[..., Any]) -> None:
        self._function, self._seconds = function, list[float]()

    def __call__(self, *arguments: Any) -> Any:
        if not self._seconds:
            self._function(*arguments)
        start = perf_counter()
        result = self._function(*arguments)
        self._seconds.append(perf_counter() - start)
        return result

    @property
    def milliseconds(self) -> float:
        return 1000 * median(self._seconds)


def _chosen(all_of_them: Sequence[T], chosen: slice, path: Path) -> Sequence[T]:
    """Raises InputError where nothing is left."""
    if not all_of_them[chosen]:
        raise InputError(f"{path}: no frames in that range; it has {len(all_of_them)}, from 0")
    return all_of_them[chosen]


def _size(method: Method) -> dict[str, int]:
    """How many parameters it learned, if any."""
    parameters = getattr(method, "parameters", None)
    return {"parameters": parameters} if parameters else {}


def _views(figures: dict[str, dict[str, Any]], name: str) -> dict[str, Any]:
    """One method's figures by view, without the view that the drive does not have."""
    return {view: methods[name] for view, methods in figures.items() if name in methods}
