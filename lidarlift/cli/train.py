"""`lidarlift train`: Lift, or a network for depth images, learns from drives."""

from __future__ import annotations

import os
import shlex
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from enrichment.methods.registry import LIFT
from enrichment.networks.registry import NETWORKS
from lidarlift.cli.console import messages, progress
from lidarlift.training import (
    ADAPTING_RATE,
    EPOCHS,
    TrainingOptions,
    depth_task,
    is_first_process,
    lift_task,
    packs_of,
    prepared,
    require_torch,
    shipped_weights,
)
from slam.data.atomic import require_writable
from slam.data.errors import InputError

if TYPE_CHECKING:
    from enrichment.training.checkpoint import Figures
    from enrichment.training.plan import Plan
    from enrichment.training.task import Task


class Device(StrEnum):
    AUTO = "auto"
    CPU = "cpu"
    GPU = "gpu"


train = typer.Typer(
    no_args_is_help=True,
    help="""Train a network on drives: it sees some rings of a scan, and the returns of the others are the answers.

    Example: `lidarlift train lift my_drive --self-supervised`

    The best weights come as ONNX and safetensors, with a model card. Training needs the extra: `pip install
    'lidarlift[train]'`.
    """,
)
Out = Annotated[Path | None, typer.Option(help="The folder for weights and logs. Default: runs/train-MODEL.")]
Resume = Annotated[bool, typer.Option("--resume", help="Go on where --out was broken off.")]
Start = Annotated[
    Path | None, typer.Option(help="The .safetensors of this network to start from, instead of random weights.")
]
DeviceOption = Annotated[Device, typer.Option(help="gpu takes all that there are.")]
Epochs = Annotated[int | None, typer.Option(min=1, help=f"Times through all frames. Default: {EPOCHS}.")]
Steps = Annotated[int | None, typer.Option(min=1, help="Instead: so many steps.")]
Batch = Annotated[int, typer.Option(min=1, help="Examples a step (on each GPU).")]
Seed = Annotated[int, typer.Option(min=0, help="Of the first weights, the examples and dropout.")]
Rate = Annotated[float | None, typer.Option(min=0, help="Highest learning rate. Default: the network's own.")]
Bf16 = Annotated[bool, typer.Option("--bf16", help="Half precision: faster where the processor has it.")]


@train.command()
def lift(
    datasets: Annotated[list[Path], typer.Argument(metavar="DATASET...", help="Drives whose scans have rings.")],
    validate: Annotated[
        list[Path] | None, typer.Option(help="A drive to validate on; may be given several times.")
    ] = None,
    self_supervised: Annotated[
        bool,
        typer.Option("--self-supervised", help="Adapt the shipped weights to your LiDAR by its own rings alone."),
    ] = False,
    out: Out = None,
    resume: Resume = False,
    start: Start = None,
    device: DeviceOption = Device.AUTO,
    epochs: Epochs = None,
    steps: Steps = None,
    batch: Batch = 4,
    seed: Seed = 0,
    rate: Rate = None,
    bf16: Bf16 = False,
) -> None:
    """Train Lift, or adapt it to your LiDAR without any ground truth.

    Example: `lidarlift train lift my_drive other_drive --validate third --epochs 10`

    A drive is read as it was recorded; a camera and poses help where it has them.
    """
    folder = out or _folder(LIFT)
    options = TrainingOptions(folder, resume, start, device.value, epochs, steps, batch, seed, rate, bf16)
    _require(options)
    task = lift_task(datasets, validate or [], self_supervised)
    if self_supervised:
        options = replace(options, start=start or shipped_weights(LIFT), rate=rate or ADAPTING_RATE)
    _train(options.plan(LIFT, sum(len(drive) for drive in task.drives)), task, options)


@train.command()
def depth(
    model: Annotated[str, typer.Argument(help=f"{', '.join(NETWORKS.names())}.")],
    datasets: Annotated[list[Path], typer.Argument(metavar="DATASET...", help="Drives with a camera, or packs.")],
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
    crop: Annotated[str, typer.Option(help="Height and width of an example, at --scale.")] = "160x304",
    scale: Annotated[float, typer.Option(min=0.1, max=1.0, help="Of the images.")] = 0.5,
    absolute: Annotated[
        float | None,
        typer.Option(min=0, help="Weight of the absolute error against the squared one. Default: the paper's, 0.0002."),
    ] = None,
    out: Out = None,
    resume: Resume = False,
    start: Start = None,
    device: DeviceOption = Device.AUTO,
    epochs: Epochs = None,
    steps: Steps = None,
    batch: Batch = 4,
    seed: Seed = 0,
    rate: Rate = None,
    bf16: Bf16 = False,
) -> None:
    """Train one of the paper's networks, which complete depth images.

    Example: `lidarlift train depth f2l-light drives/0005 drives/0013 --validate drives/0009 --epochs 10`

    Targets are completed by neighbouring scans where poses are known (ground truth or --poses); a drive simulated
    --with-depth gives exact ones, KITTI's stereo 2015 its disparity. Drives are packed once, into a file that serves as
    a data set too.
    """
    NETWORKS.require(model)
    size = _size(crop)
    folder = out or _folder(model)
    options = TrainingOptions(folder, resume, start, device.value, epochs, steps, batch, seed, rate, bf16)
    _require(options)
    from enrichment.networks.loss import LAMBDA

    packs = packs_of(datasets, poses or [], pack or folder / "train.npz", scale, progress)
    held_out = packs_of(validate or [], [], folder / "validation.npz", scale, progress, neighbours=0)
    task = depth_task(packs, held_out, size)
    weight = LAMBDA if absolute is None else absolute
    plan = options.plan(model, sum(len(pack) for pack in packs), crop=size, absolute=weight)
    _train(plan, task, options)


def _folder(model: str) -> Path:
    return Path("runs") / f"train-{model}"


def _require(options: TrainingOptions) -> None:
    """Raise what is wrong with the options before any work begins."""
    if options.epochs and options.steps:
        raise typer.BadParameter("is another way to say how long; leave --epochs out", param_hint="--steps")
    require_writable(options.out)
    require_torch()
    options.require_folder()


def _train(plan: Plan, task: Task, options: TrainingOptions) -> None:
    from enrichment.training.loop import train
    from enrichment.training.results import write_results

    with _bar(plan.model, plan.steps) as (begin, on_step):
        training = prepared(plan, task, options, on_step)
        begin(training.step)
        train(training, options.device)
    if is_first_process():
        best = write_results(training, _command())
        print(_summary(plan, best))
        print(f"Written to {options.out}: {plan.model}.onnx, {plan.model}.safetensors, {plan.model}.md")


def _command() -> str:
    """As it was typed, but of paths the last names alone: what folders are called here is nobody's business."""
    return shlex.join(["lidarlift", *(Path(word).name if os.sep in word else word for word in sys.argv[1:])])


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
        console=messages, disable=not is_first_process(),
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
