"""How well methods predict what a sparse scan does not show: on a drive, and on KITTI's depth maps."""

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

#: Completes a sparse depth map (H, W) [m] with the help of the image (H, W, 3).
Completion = Callable[["Array", "Array"], "Array"]


def frames_to_measure(data: Dataset, frames: slice = slice(None), phase: int = 0) -> range:
    """The positions of the frames that `report_of_drive` measures.

    Args:
        data: A drive.
        frames: Which of its frames.
        phase: The first ring that is kept.

    Raises:
        InputError: Nobody knows which LiDAR it was, it keeps no such ring, or no frames are in that range.
    """
    from enrichment.geometry.held_out import ring_step
    from slam.data.dataset import chosen_positions

    if data.sensor is None:
        raise InputError(f"{data.path}: nobody knows which LiDAR this was; name it: --sensor")
    if phase >= ring_step(data.sensor):
        raise InputError(f"--phase {phase}: every second ring of {data.sensor.name} is kept; 0 and 1 exist")
    return chosen_positions(data, frames)


def report_of_drive(
    data: Dataset,
    methods: Mapping[str, Method],
    frames: slice = slice(None),
    phase: int = 0,
    on_frame: Callable[[], None] = lambda: None,
) -> DepthReport:
    """Ask every method for the returns of rings that are held out: every 4th ring of 64 is kept, of fewer every 2nd.

    Args:
        data: A drive whose scans have rings.
        methods: By name.
        frames: Which of its frames.
        phase: The first ring that is kept.
        on_frame: Called after each frame.

    Returns:
        Of each method, figures over the returns that the camera sees, where there is one, and over all.

    Raises:
        InputError: As `frames_to_measure`, and where no scan has rings.
    """
    from enrichment.calibration import Calibrated
    from enrichment.geometry.held_out import hold_out, past_of, ring_step
    from enrichment.geometry.rays import RayGrid
    from eval.depth.metrics import PROTOCOL, Answers
    from eval.depth.report import VIEWS, AboutDrive, DepthReport, MethodReport

    positions = frames_to_measure(data, frames, phase)
    assert data.sensor is not None
    grid, step = RayGrid(data.sensor), ring_step(data.sensor)
    clocks = {name: _Clock(Calibrated(method)) for name, method in methods.items()}
    views = {view: Answers(len(positions)) for view in VIEWS}
    left_out = []
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
        on_frame()
    if len(left_out) == len(positions):
        raise InputError(f"{data.path}: no scan whose points have rings; name the right LiDAR: --sensor")
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
        about=AboutDrive(
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
    """What completes depth images, by name. Raises InputError as `Registry.require`."""
    from enrichment.methods.registry import COMPLETIONS

    COMPLETIONS.require(*names)
    return {name: COMPLETIONS.load(name)().complete for name in names or COMPLETIONS.names()}


def depth_maps_to_measure(folder: Path, images: slice = slice(None)) -> Sequence[DepthMapTriple]:
    """The depth maps that `report_of_depth_maps` measures.

    Args:
        folder: Laid out as KITTI's val_selection_cropped.
        images: Which of them.

    Raises:
        InputError: There are none in that range.
    """
    from eval.depth.maps import depth_map_triples

    triples = depth_map_triples(folder)
    if not triples[images]:
        raise InputError(f"{folder}: no depth maps in that range; it has {len(triples)}, from 0")
    return triples[images]


def report_of_depth_maps(
    folder: Path,
    methods: Mapping[str, Completion],
    images: slice = slice(None),
    on_image: Callable[[], None] = lambda: None,
) -> DepthReport:
    """Let every method complete KITTI's depth maps, by that benchmark's rules; the LiDAR's 64 lines are the input.

    Args:
        folder: Laid out as KITTI's val_selection_cropped.
        methods: By name, see `completions`.
        images: Which of the folder's images.
        on_image: Called after each image.

    Returns:
        Of each method, the means of its figures over the images.

    Raises:
        InputError: As `depth_maps_to_measure`, and where a file is missing or damaged.
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
