"""The paper's two studies of depth images, on any sequence with a camera."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from slam.data.errors import InputError

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

    from enrichment.studies.depth_image import DepthImage
    from enrichment.studies.figures import Figures
    from slam.data.dataset import Dataset

F = TypeVar("F", bound="DataclassInstance")

SCAN, EXACT = "returns, interpolated", "exact depth"


@dataclass(frozen=True, eq=False)
class StudyReport(Generic[F]):
    """Results of a study.

    Attributes:
        title: Title for display.
        sources: Mean figures by source of the depth: SCAN, and EXACT for a simulated sequence.
        frames: Numbers of the frames used.
        left_out: Reasons why other frames were left out, one sentence each.
        shown: Depth image of one frame, for the figure.
        protocol: Definition of each figure.
    """

    title: str
    sources: Mapping[str, Figures[F]]
    frames: tuple[int, ...]
    left_out: tuple[str, ...]
    shown: DepthImage
    protocol: Mapping[str, str]

    def as_dict(self) -> dict[str, Any]:
        """Return the report for JSON: "about", and the sources by name."""
        about = {
            "title": self.title,
            "frames": list(self.frames),
            "shown": self.shown.number,
            "protocol": dict(self.protocol),
        }
        return {"about": about, **{source: _as_dict(figures) for source, figures in self.sources.items()}}


def study_sequence(
    data: Dataset,
    study: Callable[[DepthImage], Figures[F]],
    protocol: Mapping[str, str],
    frames: slice = slice(None),
    on_frame: Callable[[], None] = lambda: None,
) -> StudyReport[F]:
    """Average a study's figures over the depth images of a sequence.

    Depth images are interpolated from the returns; for a simulated sequence the exact ones are studied as well.

    Args:
        data: A sequence with a camera.
        study: `enrichment.studies.sparsity.sparsity` or `enrichment.studies.edges.edges`.
        protocol: Definition of the study's figures.
        frames: Slice of the frames.
        on_frame: Called after each frame.

    Raises:
        InputError: The slice selects no frames, or none of them has a depth image.
    """
    from enrichment.studies.depth_image import exact, of_scan
    from enrichment.studies.figures import mean_figures
    from slam.data.dataset import chosen_positions

    positions = chosen_positions(data, frames)
    found: dict[str, list[Figures[F]]] = {SCAN: [], EXACT: []}
    shown: DepthImage | None = None
    numbers, faults = list[int](), list[str]()
    for position in positions:
        try:
            image, window = of_scan(data[position])
        except InputError as error:
            faults.append(str(error))
        else:
            truth = exact(data.path, image, window)
            found[SCAN].append(study(image))
            found[EXACT] += [study(truth)] if truth else []
            numbers.append(image.number)
            shown = image if position <= positions[len(positions) // 2] or shown is None else shown
        on_frame()
    if shown is None:
        raise InputError(f"{data.path}: {faults[0]}")
    return StudyReport(
        title=f"{data.name}, {len(numbers)} frames",
        sources={source: mean_figures(images) for source, images in found.items() if images},
        frames=tuple(numbers),
        left_out=tuple(faults),
        shown=shown,
        protocol=protocol,
    )


def _as_dict(figures: Figures[F]) -> dict[str, Any]:
    return {
        tried: {str(amount): asdict(entry) for amount, entry in amounts.items()} for tried, amounts in figures.items()
    }
