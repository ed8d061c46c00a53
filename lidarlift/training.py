"""A network learns from drives: options that all trainings share, and what Lift and the depth networks learn from.

Torch is imported when a training begins; `require_torch` says beforehand which extra is missing.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

from slam.data.errors import InputError
from slam.data.machine import usable_cores

if TYPE_CHECKING:
    from enrichment.training.image_task import ImageTask
    from enrichment.training.lift_task import LiftTask
    from enrichment.training.loop import Training
    from enrichment.training.pack import Pack
    from enrichment.training.plan import Plan
    from enrichment.training.samples import Source
    from enrichment.training.task import Task
    from lidarlift.reporting import Progress
    from slam.data.dataset import Dataset

EPOCHS = 20
ADAPTING_RATE = 3e-4  # highest learning rate: what was learned before is not to be lost
NEIGHBOURS = 5  # scans before and after that complete a training frame's target; validation frames have their own alone
MOST_WORKERS = 4


@dataclass(frozen=True)
class TrainingOptions:
    """What every training is told.

    Attributes:
        out: The folder for weights, checkpoint and logs.
        resume: Go on where the training in `out` was broken off.
        start: The .safetensors of the same network to start from; None: random weights.
        device: "auto", "cpu" or "gpu" (all that there are).
        epochs: Times through all frames; None: EPOCHS.
        steps: How many steps, whatever `epochs` says; None: as many as the epochs have.
        batch: Examples a step, on each GPU.
        seed: Of the first weights, the examples and dropout.
        rate: Highest learning rate; None: the network's own.
        bf16: Convolutions in bfloat16.
    """

    out: Path
    resume: bool = False
    start: Path | None = None
    device: str = "auto"
    epochs: int | None = None
    steps: int | None = None
    batch: int = 4
    seed: int = 0
    rate: float | None = None
    bf16: bool = False

    def require_folder(self) -> None:
        """Raise InputError where `out` holds a training that is not resumed, or none that could be."""
        from enrichment.training.checkpoint import CHECKPOINT

        checkpoint = self.out / CHECKPOINT
        if checkpoint.exists() and not self.resume:
            raise InputError(f"{self.out}: a training is here already; go on with --resume, or name another --out")
        if self.resume and not checkpoint.exists():
            raise InputError(f"{checkpoint}: no such file, so there is nothing to --resume; leave that out")
        if self.resume and self.start is not None:
            raise InputError(
                f"--start {self.start}: a training that is resumed has weights; leave one of --start and --resume out"
            )

    def plan(self, model: str, examples: int, **own: Any) -> Plan:
        """The plan of a training on so many examples; `own` are fields of `Plan` that this model alone has."""
        from enrichment.training.plan import Plan

        steps = self.steps or -(-examples * (self.epochs or EPOCHS) // self.batch)
        return Plan(model, steps, batch=self.batch, seed=self.seed, rate=self.rate, bf16=self.bf16, **own)


def lift_task(paths: Sequence[Path], validate: Sequence[Path], own_rings: bool) -> LiftTask:
    """Lift's task on the drives in these folders.

    Raises:
        InputError: A folder is no drive, or its LiDAR's rings are unknown.
    """
    from enrichment.training.lift_task import LiftTask

    drives, held_out = ([_opened(path) for path in some] for some in (paths, validate))
    return LiftTask(drives, held_out, own_rings)


def depth_task(training: Sequence[Pack], validation: Sequence[Pack], crop: tuple[int, int]) -> ImageTask:
    """The depth networks' task on packs, in crops of (height, width) cells.

    Raises:
        InputError: A pack has images smaller than the crop.
    """
    from enrichment.training.image_examples import require_crop
    from enrichment.training.image_task import ImageTask

    require_crop(training, crop)
    return ImageTask(training, validation)


def packs_of(
    paths: Sequence[Path],
    poses: Sequence[Path],
    file: Path,
    scale: float,
    progress: Progress,
    neighbours: int = NEIGHBOURS,
) -> list[Pack]:
    """The packs among the paths, and one, in `file`, of the drives among them.

    Args:
        paths: Packs (.npz) and folders of drives.
        poses: A file of LiDAR poses for each drive, in their order; or none.
        file: Written unless it is there already.
        scale: Cells a pixel.
        progress: Shows how far the packing is.
        neighbours: So many scans before and after complete a frame's target.

    Raises:
        InputError: The poses are not one file a drive, a pack has another scale, or as `packed` and `source` do.
    """
    from enrichment.training.pack import Pack

    packs = [Pack(path) for path in paths if path.suffix == ".npz"]
    drives = [path for path in paths if path.suffix != ".npz"]
    if poses and len(poses) != len(drives):
        raise InputError(f"--poses: {len(poses)} files for {len(drives)} drives; one for each is needed, or none")
    for pack in packs:
        if pack.scale != scale:
            raise InputError(f"{pack.path}: packed at scale {pack.scale:g}; give --scale {pack.scale:g}")
    if drives:
        files: Sequence[Path | None] = poses or [None] * len(drives)
        sources = [_source(drive, of_it, scale, neighbours) for drive, of_it in zip(drives, files, strict=True)]
        packs.append(_packed(file, sources, progress))
    return packs


def _packed(file: Path, sources: Sequence[Source], progress: Progress) -> Pack:
    from enrichment.training.pack import packed

    if file.exists():
        return packed(file, sources)
    with progress(f"Packing {file.name}", sum(len(source.data) for source in sources)) as advance:
        return packed(file, sources, advance)


def _source(drive: Path, poses: Path | None, scale: float, neighbours: int) -> Source:
    from enrichment.training.samples import source

    return source(_opened(drive), poses, scale, neighbours)


def _opened(drive: Path) -> Dataset:
    from slam.data.dataset import open_dataset

    try:
        return open_dataset(drive)
    except InputError as error:
        raise InputError(str(error).replace("name one with --sequence", "give the folder of each")) from error


def prepared(plan: Plan, task: Task, options: TrainingOptions, on_step: Callable[[float], None]) -> Training:
    """A training that is ready to go on, with weights from where the options say; `on_step` gets each step's loss.

    Raises:
        InputError: The weights or the checkpoint are not of this training.
    """
    from enrichment.networks.export import load_weights
    from enrichment.training.loop import Training

    training = Training(plan, task, options.out, min(usable_cores() - 1, MOST_WORKERS), on_step)
    if options.resume:
        training.resume()
    elif options.start is not None:
        load_weights(training.network, options.start)
    return training


def shipped_weights(model: str) -> Path:
    """The .safetensors of a network that comes with lidarlift.

    Raises:
        InputError: There are none.
    """
    from enrichment.methods.onnx_network import WEIGHTS

    path = Path(str(WEIGHTS / f"{model}.safetensors"))
    if not path.is_file():
        raise InputError(f"no weights of {model} are shipped to start from; name some with --start")
    return path


def is_first_process() -> bool:
    """Of several GPUs each has a process of its own, started with the same command line."""
    return os.environ.get("LOCAL_RANK", "0") == "0"


def require_torch() -> None:
    """Raise InputError where what trains is not installed."""
    missing = [name for name in ("torch", "lightning", "onnx", "safetensors", "tensorboard") if find_spec(name) is None]
    if missing:
        raise InputError(f"training needs {', '.join(missing)}; install them: pip install 'lidarlift[train]'")
