"""Depth benchmark of enrichment methods: on held-out rings of a sequence, and on KITTI's depth maps."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from statistics import median
from time import perf_counter
from typing import TYPE_CHECKING, Any

from slam.data.errors import InputError

if TYPE_CHECKING:
    from enrichment.geometry.sparse_scan import Method
    from eval.depth.maps import DepthMapTriple
    from eval.depth.report import DepthReport
    from slam.data.cloud import Array
    from slam.data.dataset import Dataset

#: Completes a sparse depth map (H, W) [m], guided by the image (H, W, 3).
Completion = Callable[["Array", "Array"], "Array"]


def frames_to_measure(data: Dataset, frames: slice = slice(None), phase: int = 0) -> range:
    """Return the positions of the frames that `sequence_report` measures.

    Args:
        data: A sequence.
        frames: Slice of its frames.
        phase: Index of the first ring that is kept.

    Raises:
        InputError: The sensor model is unknown, no ring is kept from `phase` on, or the slice selects no frames.
    """
    from enrichment.geometry.held_out import ring_step
    from slam.data.dataset import chosen_positions

    if data.sensor is None:
        raise InputError(f"{data.path}: the sensor model is unknown; name the LiDAR with --sensor")
    if phase >= ring_step(data.sensor):
        raise InputError(f"--phase {phase}: every second ring of {data.sensor.name} is kept; use 0 or 1")
    return chosen_positions(data, frames)


def sequence_report(
    data: Dataset,
    methods: Mapping[str, Method],
    frames: slice = slice(None),
    phase: int = 0,
    on_frame: Callable[[], None] = lambda: None,
) -> DepthReport:
    """Measure how well each method predicts the returns of held-out rings.

    Of 64 rings every 4th is kept, of fewer every 2nd; the returns of the other rings are the reference.

    Args:
        data: A sequence whose scans have rings.
        methods: The methods by name.
        frames: Slice of its frames.
        phase: Index of the first ring that is kept.
        on_frame: Called after each frame.

    Returns:
        The figures of each method over all returns and, if there is a camera, over those in its field of view.

    Raises:
        InputError: As `frames_to_measure`, or no scan has rings.
    """
    from enrichment.calibration import Calibrated
    from enrichment.geometry.held_out import hold_out, past_of, ring_step
    from enrichment.geometry.rays import RayGrid
    from eval.depth.metrics import PROTOCOL, Predictions
    from eval.depth.report import VIEWS, AboutSequence, DepthReport, MethodReport

    positions = frames_to_measure(data, frames, phase)
    assert data.sensor is not None
    grid, step = RayGrid(data.sensor), ring_step(data.sensor)
    clocks = {name: _Clock(Calibrated(method)) for name, method in methods.items()}
    views = {view: Predictions(len(positions)) for view in VIEWS}
    left_out = []
    for position in positions:
        frame = data[position]
        if frame.cloud.ring is None or len(frame.cloud) == 0:
            left_out.append(frame.index)
        else:
            held = hold_out(frame, grid, phase, past_of(data, position))
            # each method gets its own copy of the scan: results cached in one must not help the next
            answers = {name: held.answers(clock(replace(held.scan), grid)) for name, clock in clocks.items()}
            views["full"].add(held.ranges, answers)
            if held.seen is not None:
                views["image"].add(held.ranges, answers, held.seen)
        on_frame()
    if len(left_out) == len(positions):
        raise InputError(f"{data.path}: no scan has ring indices; name the right LiDAR with --sensor")
    figures = {view: answers.figures() for view, answers in views.items()}
    count = f"{len(positions)} frames, every {'4th' if step == 4 else '2nd'} of {data.sensor.ring_count} rings kept"
    return DepthReport(
        methods={
            name: MethodReport(
                ms=clock.milliseconds,
                parameters=getattr(methods[name], "parameters", None),
                **{view: of_view.get(name) for view, of_view in figures.items()},
            )
            for name, clock in clocks.items()
        },
        about=AboutSequence(
            title=f"{data.name}: {count}, from ring {phase}",
            dataset=data.name,
            frames=tuple(int(data.numbers[position]) for position in positions),
            frames_left_out=tuple(left_out),
            sensor=data.sensor.name,
            ring_step=step,
            phase=phase,
            columns=grid.columns,
            protocol=PROTOCOL,
        ),
    )


def completions(names: Collection[str] = ()) -> dict[str, Completion]:
    """Return the depth completion methods by name.

    Raises:
        InputError: As `Registry.require`.
    """
    from enrichment.methods.registry import COMPLETIONS

    COMPLETIONS.require(*names)
    return {name: COMPLETIONS.load(name)().complete for name in names or COMPLETIONS.names()}


def depth_maps_to_measure(folder: Path, images: slice = slice(None)) -> Sequence[DepthMapTriple]:
    """Return the depth maps that `depth_map_report` measures.

    Args:
        folder: A folder in the layout of KITTI's val_selection_cropped.
        images: Slice of its depth maps.

    Raises:
        InputError: The slice selects no depth maps.
    """
    from eval.depth.maps import depth_map_triples

    triples = depth_map_triples(folder)
    if not triples[images]:
        raise InputError(f"{folder}: no depth maps in that range; it has {len(triples)}, from 0")
    return triples[images]


def depth_map_report(
    folder: Path,
    methods: Mapping[str, Completion],
    images: slice = slice(None),
    on_image: Callable[[], None] = lambda: None,
) -> DepthReport:
    """Measure depth completion on KITTI's depth maps by that benchmark's rules; the input is all 64 LiDAR rings.

    Args:
        folder: A folder in the layout of KITTI's val_selection_cropped.
        methods: The methods by name, see `completions`.
        images: Slice of the folder's images.
        on_image: Called after each image.

    Returns:
        The figures of each method, averaged over the images.

    Raises:
        InputError: As `depth_maps_to_measure`, or a file is missing or damaged.
    """
    from eval.depth.maps import PROTOCOL, DepthMapFigures, depth_map_figures, mean_over_images
    from eval.depth.report import AboutDepthMaps, DepthReport, MethodReport

    triples = depth_maps_to_measure(folder, images)
    clocks = {name: _Clock(method) for name, method in methods.items()}
    figures: dict[str, list[DepthMapFigures]] = {name: [] for name in clocks}
    for triple in triples:
        sparse, truth, image = triple.read()
        for name, clock in clocks.items():
            figures[name].append(depth_map_figures(truth, clock(sparse, image)))
        on_image()
    return DepthReport(
        methods={
            name: MethodReport(ms=clock.milliseconds, image=mean_over_images(figures[name]))
            for name, clock in clocks.items()
        },
        about=AboutDepthMaps(
            title=f"{folder.resolve().name}: {len(triples)} depth maps of KITTI's depth completion benchmark",
            images=tuple(triple.sparse.name for triple in triples),
            protocol=PROTOCOL,
        ),
    )


class _Clock:
    """Times the calls of a function: the median in milliseconds, without a first call that compiles."""

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
