"""Training of networks on recorded sequences: shared options, and the tasks of Lift and of the depth networks.

Torch is imported when a training begins; `require_torch` reports a missing extra beforehand.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

from enrichment.methods.registry import LIFT
from slam.data.errors import InputError
from slam.data.machine import usable_cores

if TYPE_CHECKING:
    from enrichment.lift.network import Sizes
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
ADAPTING_RATE = 3e-4  # maximum learning rate of fine-tuning: a higher one would forget what the weights learned before
NEIGHBOURS = 5  # scans before and after that densify a training target; validation targets use their own scan alone
MAX_WORKERS = 4


@dataclass(frozen=True)
class TrainingOptions:
    """Options shared by all trainings.

    Attributes:
        out: Folder for weights, checkpoint and logs.
        resume: Continue the interrupted training in `out`.
        start: A .safetensors file of the same network with initial weights; None: random weights.
        device: "auto", "cpu" or "gpu" (all available GPUs).
        epochs: Number of epochs; None: EPOCHS.
        steps: Number of steps, overrides `epochs`; None: computed from the epochs.
        batch: Examples per step, on each GPU.
        seed: Random seed of the initial weights, the examples and dropout.
        rate: Maximum learning rate; None: the network's default.
        bf16: Compute convolutions in bfloat16.
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
        """Check that `out` holds a training if and only if one is resumed.

        Raises:
            InputError: `out` holds a training that is not resumed, none to resume, or `start` is given with `resume`.
        """
        from enrichment.training.checkpoint import CHECKPOINT

        checkpoint = self.out / CHECKPOINT
        if checkpoint.exists() and not self.resume:
            raise InputError(f"{self.out}: already contains a training; add --resume, or choose another --out")
        if self.resume and not checkpoint.exists():
            raise InputError(f"{checkpoint}: no such file, there is no training to resume; leave --resume out")
        if self.resume and self.start is not None:
            raise InputError(
                f"--start {self.start}: a resumed training has weights already; leave out --start or --resume"
            )

    def plan(self, model: str, examples: int, **own: Any) -> Plan:
        """Return the plan of a training on `examples` examples; `own` are fields of `Plan` for this model alone."""
        from enrichment.training.plan import Plan

        steps = self.steps or -(-examples * (self.epochs or EPOCHS) // self.batch)
        return Plan(model, steps, batch=self.batch, seed=self.seed, rate=self.rate, bf16=self.bf16, **own)


def lift_task(
    paths: Sequence[Path],
    validate: Sequence[Path],
    own_rings: bool = False,
    teacher: Path | None = None,
    sizes: Sizes | None = None,
) -> LiftTask:
    """Return Lift's training task.

    Args:
        paths: Folders of the sequences for training.
        validate: Folders of the sequences for validation.
        own_rings: Use only the rings of a sparse LiDAR itself.
        teacher: A .safetensors file of Lift, of any sizes, whose answers are learned too.
        sizes: Sizes of the network; None: those of the shipped weights.

    Raises:
        InputError: A folder is not a data set, its sensor model is unknown, or a file has no weights of Lift.
    """
    from enrichment.lift.network import LARGE
    from enrichment.networks.export import load_lift
    from enrichment.training.lift_task import LiftTask

    sequences, held_out = ([_opened(path) for path in some] for some in (paths, validate))
    network = None if teacher is None else load_lift(teacher)
    name = "" if teacher is None else teacher.name
    return LiftTask(sequences, held_out, own_rings, sizes or LARGE, network, name)


def lift_sizes(options: TrainingOptions, small: bool) -> Sizes:
    """Return the sizes of Lift: those of the training that is resumed, of the weights it starts from, or as asked for.

    Raises:
        InputError: The file has no weights of Lift, or not those of the small network that is asked for.
    """
    from enrichment.lift.network import LARGE, SMALL, sizes_of
    from enrichment.networks.export import load_lift
    from enrichment.training.checkpoint import CHECKPOINT, read_checkpoint

    if options.resume:
        file = options.out / CHECKPOINT
        checkpoint = read_checkpoint(file)
        found = sizes_of(checkpoint.weights) if checkpoint.plan.model == LIFT else LARGE  # `prepare` refuses others
    elif options.start is not None:
        file, found = options.start, load_lift(options.start).sizes
    else:
        return SMALL if small else LARGE
    if small and found != SMALL:
        raise InputError(
            f"--small: {file} has the weights of a larger network; leave --small out, or use other weights"
        )
    return found


def depth_task(training: Sequence[Pack], validation: Sequence[Pack], crop: tuple[int, int]) -> ImageTask:
    """Return the training task of the depth networks on packs, with crops of (height, width) cells.

    Raises:
        InputError: The images of a pack are smaller than the crop.
    """
    from enrichment.training.image_examples import require_crop
    from enrichment.training.image_task import ImageTask

    require_crop(training, crop)
    return ImageTask(training, validation)


def open_packs(
    paths: Sequence[Path],
    poses: Sequence[Path],
    file: Path,
    scale: float,
    progress: Progress,
    neighbours: int = NEIGHBOURS,
) -> list[Pack]:
    """Open the packs among the paths, and pack the sequences among them into `file`.

    Args:
        paths: Packs (.npz) and folders of sequences.
        poses: A file of LiDAR poses for each sequence, in the same order; or none.
        file: The pack of the sequences; it is written unless it exists.
        scale: Cells per pixel.
        progress: Shows the progress of the packing.
        neighbours: Number of scans before and after that densify the target of a frame.

    Raises:
        InputError: The number of pose files differs from the number of sequences, a pack has another scale, or as
            `packed` and `source`.
    """
    from enrichment.training.pack import Pack

    packs = [Pack(path) for path in paths if path.suffix == ".npz"]
    folders = [path for path in paths if path.suffix != ".npz"]
    if poses and len(poses) != len(folders):
        raise InputError(f"--poses: {len(poses)} files for {len(folders)} sequences; give one for each, or none")
    for pack in packs:
        if pack.scale != scale:
            raise InputError(f"{pack.path}: packed at scale {pack.scale:g}; use --scale {pack.scale:g}")
    if folders:
        files: Sequence[Path | None] = poses or [None] * len(folders)
        sources = [_source(path, of_it, scale, neighbours) for path, of_it in zip(folders, files, strict=True)]
        packs.append(_packed(file, sources, progress))
    return packs


def _packed(file: Path, sources: Sequence[Source], progress: Progress) -> Pack:
    from enrichment.training.pack import packed

    if file.exists():
        return packed(file, sources)
    with progress(f"Packing {file.name}", sum(len(source.data) for source in sources)) as advance:
        return packed(file, sources, advance)


def _source(sequence: Path, poses: Path | None, scale: float, neighbours: int) -> Source:
    from enrichment.training.samples import source

    return source(_opened(sequence), poses, scale, neighbours)


def _opened(sequence: Path) -> Dataset:
    from slam.data.dataset import open_dataset

    try:
        return open_dataset(sequence)
    except InputError as error:
        raise InputError(str(error).replace("name one with --sequence", "give the folder of each")) from error


def prepare(plan: Plan, task: Task, options: TrainingOptions, on_step: Callable[[float], None]) -> Training:
    """Return a training that is ready to run, with initial or resumed weights; `on_step` receives each step's loss.

    Raises:
        InputError: The weights or the checkpoint do not belong to this training.
    """
    from enrichment.networks.export import load_weights
    from enrichment.training.loop import Training

    training = Training(plan, task, options.out, min(usable_cores() - 1, MAX_WORKERS), on_step)
    if options.resume:
        training.resume()
    elif options.start is not None:
        load_weights(training.network, options.start)
    return training


def shipped_weights(model: str) -> Path:
    """Return the path of the .safetensors of a network that is shipped with lidarlift.

    Raises:
        InputError: No weights of this network are shipped.
    """
    from enrichment.methods.onnx_network import WEIGHTS

    path = Path(str(WEIGHTS / f"{model}.safetensors"))
    if not path.is_file():
        raise InputError(f"no weights of {model} are shipped; give a file with --start")
    return path


def is_first_process() -> bool:
    """Tell whether this is the first of the training processes: each GPU has its own, with the same command line."""
    return os.environ.get("LOCAL_RANK", "0") == "0"


def require_torch() -> None:
    """Check that the training packages are installed.

    Raises:
        InputError: Some are missing.
    """
    missing = [name for name in ("torch", "lightning", "onnx", "safetensors", "tensorboard") if find_spec(name) is None]
    if missing:
        raise InputError(f"training requires {', '.join(missing)}; install them: pip install 'lidarlift[train]'")
