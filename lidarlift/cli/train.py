"""`lidarlift train`: a network for depth learns from drives."""

from __future__ import annotations

import os
import shlex
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from enum import StrEnum
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from lidarlift.cli.arguments import require_writable
from lidarlift.cli.console import messages, progress
from slam.data.errors import InputError

if TYPE_CHECKING:
    from enrichment.training.checkpoint import Figures
    from enrichment.training.pack import Pack
    from enrichment.training.plan import Plan
    from enrichment.training.samples import Source
    from enrichment.training.task import Task
    from slam.data.dataset import Dataset

EPOCHS = 20
LIFT = "lift"
ADAPTING_RATE = 3e-4  # highest learning rate: what was learned before is not to be lost
MOST_WORKERS = 4


class Device(StrEnum):
    AUTO = "auto"
    CPU = "cpu"
    GPU = "gpu"


def train(
    model: Annotated[str, typer.Argument(help="lift, l2l, li2l, f2l or f2l-light.")],
    datasets: Annotated[list[Path], typer.Argument(metavar="DATASET...", help="Drives with a camera, or packs.")],
    out: Annotated[
        Path | None, typer.Option(help="The folder for weights and logs. Default: runs/train-MODEL.")
    ] = None,
    validate: Annotated[
        list[Path] | None, typer.Option(help="A drive or pack to validate on; may be given several times.")
    ] = None,
    poses: Annotated[
        list[Path] | None,
        typer.Option(help="LiDAR poses of a drive's scans, from a run. One for each drive, in their order."),
    ] = None,
    pack: Annotated[
        Path | None, typer.Option(help="The file to pack the drives into. Default: train.npz in --out.")
    ] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Go on where --out was broken off.")] = False,
    start: Annotated[
        Path | None, typer.Option(help="The .safetensors of this network to start from, instead of random weights.")
    ] = None,
    device: Annotated[Device, typer.Option(help="gpu takes all that there are.")] = Device.AUTO,
    epochs: Annotated[int | None, typer.Option(min=1, help=f"Times through all frames. Default: {EPOCHS}.")] = None,
    steps: Annotated[int | None, typer.Option(min=1, help="Instead: so many steps.")] = None,
    batch: Annotated[int, typer.Option(min=1, help="Examples a step (on each GPU).")] = 4,
    crop: Annotated[
        str, typer.Option(help="Height and width of an example, at --scale; lift has its own.")
    ] = "160x304",
    scale: Annotated[float, typer.Option(min=0.1, max=1.0, help="Of the images; lift takes them as they are.")] = 0.5,
    seed: Annotated[int, typer.Option(min=0, help="Of the first weights, the examples and dropout.")] = 0,
    rate: Annotated[float | None, typer.Option(min=0, help="Highest learning rate. Default: the model's own.")] = None,
    absolute: Annotated[
        float | None,
        typer.Option(min=0, help="Weight of the absolute error against the squared one. Default: the paper's, 0.0002."),
    ] = None,
    self_supervised: Annotated[
        bool,
        typer.Option(
            "--self-supervised", help="Adapt the shipped lift to drives of your LiDAR by its own rings alone."
        ),
    ] = False,
    bf16: Annotated[bool, typer.Option("--bf16", help="Half precision: faster where the processor has it.")] = False,
) -> None:
    """Train a network for depth on drives: it sees some rings of a scan, and the others' returns are the answers.

    Example: `lidarlift train f2l-light drives/0005 drives/0013 --validate drives/0009 --epochs 10`

    Targets are completed by neighbouring scans where poses are known (ground truth or --poses); a drive simulated
    --with-depth gives exact ones, KITTI's stereo 2015 its disparity. Drives are packed once, into a file that serves as
    a data set too. The best weights come as ONNX and safetensors, with a model card.
    """
    if epochs and steps:
        raise typer.BadParameter("is another way to say how long; leave --epochs out", param_hint="--steps")
    out = out or Path("runs") / f"train-{model}"
    require_writable(out)
    size = _size(crop)
    _require_torch()
    from enrichment.networks.loss import LAMBDA
    from enrichment.networks.registry import NETWORKS
    from enrichment.training.checkpoint import CHECKPOINT
    from enrichment.training.plan import Plan

    if model != LIFT:
        NETWORKS.require(model)
    if self_supervised and model != LIFT:
        raise InputError(f"--self-supervised: {model} learns from other rings than the LiDAR's own; choose {LIFT}")
    if (out / CHECKPOINT).exists() and not resume:
        raise InputError(f"{out}: a training is here already; go on with --resume, or name another --out")
    if resume and not (out / CHECKPOINT).exists():
        raise InputError(f"{out / CHECKPOINT}: no such file, so there is nothing to --resume; leave that out")
    if resume and start is not None:
        raise InputError(
            f"--start {start}: a training that is resumed has weights; leave one of --start and --resume out"
        )
    if model == LIFT:
        if poses or pack:
            raise InputError(
                f"{LIFT} needs neither --poses nor --pack: it learns from scans as they are recorded; leave these out"
            )
        task, count = _lift_task(datasets, validate or [], self_supervised)
    else:
        packs = _packs(datasets, poses or [], pack or out / "train.npz", scale)
        held_out = _packs(validate or [], [], out / "validation.npz", scale, neighbours=0)
        task, count = _image_task(packs, held_out, size)
    if self_supervised:
        start, rate = start or _shipped(LIFT), rate or ADAPTING_RATE
    steps = steps or -(-count * (epochs or EPOCHS) // batch)
    weight = LAMBDA if absolute is None else absolute
    plan = Plan(model, steps, size, batch, seed=seed, rate=rate, absolute=weight, bf16=bf16)
    _train(plan, task, out, None if resume else start, device.value, resume)


def _image_task(packs: list[Pack], held_out: list[Pack], size: tuple[int, int]) -> tuple[Task, int]:
    """The task, and how many frames there are."""
    from enrichment.training.drawing import require_crop
    from enrichment.training.image_task import ImageTask

    require_crop(packs, size)
    return ImageTask(packs, held_out), sum(len(pack) for pack in packs)


def _lift_task(paths: Sequence[Path], validate: Sequence[Path], own_rings: bool) -> tuple[Task, int]:
    from enrichment.training.lift_task import LiftTask

    for path in (*paths, *validate):
        if path.suffix == ".npz":
            raise InputError(f"{path}: {LIFT} learns from drives, not from packs of images; give their folders")
    drives, held_out = ([_opened(path) for path in some] for some in (paths, validate))
    return LiftTask(drives, held_out, own_rings), sum(len(drive) for drive in drives)


def _shipped(model: str) -> Path:
    """Weights to start from. Raises InputError where there are none."""
    from enrichment.methods.onnx_network import WEIGHTS

    path = Path(str(WEIGHTS / f"{model}.safetensors"))
    if not path.is_file():
        raise InputError(f"--self-supervised: no weights of {model} are shipped; name some with --start")
    return path


def _train(plan: Plan, task: Task, out: Path, start: Path | None, device: str, resume: bool) -> None:
    from enrichment.networks.export import load_weights
    from enrichment.training.loop import Training, train
    from enrichment.training.results import write_results

    with _bar(plan.model, plan.steps) as (begin, on_step):
        training = Training(plan, task, out, min(_cores() - 1, MOST_WORKERS), on_step)
        if resume:
            training.resume()
        elif start is not None:
            load_weights(training.network, start)
        begin(training.step)
        train(training, device)
    if not _first_process():
        return
    best = write_results(training, _command())
    print(_summary(plan, best))
    print(f"Written to {out}: {plan.model}.onnx, {plan.model}.safetensors, {plan.model}.md")


def _command() -> str:
    """As it was typed, but of paths the last names alone: what folders are called here is nobody's business."""
    return shlex.join(["lidarlift", *(Path(word).name if os.sep in word else word for word in sys.argv[1:])])


def _packs(paths: Sequence[Path], poses: Sequence[Path], file: Path, scale: float, neighbours: int = 5) -> list[Pack]:
    """The packs among the paths, and one of the drives."""
    from enrichment.training.pack import Pack

    packs = [Pack(path) for path in paths if path.suffix == ".npz"]
    drives = [path for path in paths if path.suffix != ".npz"]
    if poses and len(poses) != len(drives):
        raise InputError(f"--poses: {len(poses)} files for {len(drives)} drives; one for each is needed, or none")
    for pack in packs:
        if pack.scale != scale:
            raise InputError(f"{pack.path}: packed at scale {pack.scale:g}; give --scale {pack.scale:g}")
    if drives:
        packs.append(_packed(drives, poses, file, scale, neighbours))
    return packs


def _packed(drives: Sequence[Path], poses: Sequence[Path], file: Path, scale: float, neighbours: int) -> Pack:
    from enrichment.training.pack import packed

    files: Sequence[Path | None] = poses or [None] * len(drives)
    sources = [_source(drive, of_it, scale, neighbours) for drive, of_it in zip(drives, files, strict=True)]
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


def _summary(plan: Plan, best: Figures | None) -> str:
    if best is None:
        return f"{plan.model}: {plan.steps} steps, not validated; its last weights are kept"
    figures = f"MAE {1000 * best.mae:.0f} mm, RMSE {1000 * best.rmse:.0f} mm"
    return f"{plan.model}: {plan.steps} steps, validated best after {best.step}: {figures}"


@contextmanager
def _bar(title: str, steps: int) -> Iterator[tuple[Callable[[int], None], Callable[[float], None]]]:
    """A bar of `steps`; what it yields is called once with those that were taken before, and with each step's loss."""
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    loss = TextColumn("steps, loss {task.fields[loss]} m²")
    with Progress(
        TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), loss, TimeRemainingColumn(),
        console=messages, disable=not _first_process(),
    ) as bar:  # fmt: skip
        task = bar.add_task(title, total=steps, loss="-")
        yield (
            lambda done: bar.update(task, completed=done),
            lambda loss: bar.update(task, advance=1, loss=f"{loss:.2f}"),
        )


def _size(text: str) -> tuple[int, int]:
    height, _, width = text.partition("x")
    if not (height.isdecimal() and width.isdecimal() and int(height) and int(width)):
        raise InputError(f"--crop {text}: write HEIGHTxWIDTH, as in 160x304")
    return int(height), int(width)


def _first_process() -> bool:
    """Of several GPUs each has a process of its own, started with the same command line."""
    return os.environ.get("LOCAL_RANK", "0") == "0"


def _cores() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _require_torch() -> None:
    """Raises InputError where what trains is not installed."""
    missing = [name for name in ("torch", "lightning", "onnx", "safetensors", "tensorboard") if find_spec(name) is None]
    if missing:
        raise InputError(f"training needs {', '.join(missing)}; install them: pip install 'lidarlift[train]'")
