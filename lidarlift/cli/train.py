"""`lidarlift train`: train Lift, or a depth completion network, on recorded sequences."""

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
    lift_sizes,
    lift_task,
    open_packs,
    prepare,
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
    """Processors that train."""

    AUTO = "auto"
    CPU = "cpu"
    GPU = "gpu"


train = typer.Typer(
    no_args_is_help=True,
    help="""Train a network on sequences: its input is some rings of a scan, its target the returns of the other rings.

    Example: `lidarlift train lift my_sequence --self-supervised`

    The best weights are written as ONNX and safetensors, with a model card. Training requires the extra `train`:
    `pip install 'lidarlift[train]'`.
    """,
)
Out = Annotated[Path | None, typer.Option(help="Folder for weights and logs. Default: runs/train-MODEL.")]
Resume = Annotated[bool, typer.Option("--resume", help="Continue the interrupted training in --out.")]
Start = Annotated[
    Path | None, typer.Option(help="A .safetensors file of this network with initial weights. Default: random weights.")
]
DeviceOption = Annotated[Device, typer.Option(help="auto: GPUs if there are any; gpu: all GPUs; cpu.")]
Epochs = Annotated[int | None, typer.Option(min=1, help=f"Number of epochs. Default: {EPOCHS}.")]
Steps = Annotated[int | None, typer.Option(min=1, help="Number of steps, instead of --epochs.")]
Batch = Annotated[int, typer.Option(min=1, help="Examples per step, on each GPU.")]
Seed = Annotated[int, typer.Option(min=0, help="Random seed of initial weights, examples and dropout.")]
Rate = Annotated[float | None, typer.Option(min=0, help="Maximum learning rate. Default: the network's own.")]
Bf16 = Annotated[bool, typer.Option("--bf16", help="Train in bfloat16: faster if the processor supports it.")]


@train.command()
def lift(
    datasets: Annotated[list[Path], typer.Argument(metavar="DATASET...", help="Sequences with ring indices.")],
    validate: Annotated[
        list[Path] | None, typer.Option(help="A sequence to validate on; may be given several times.")
    ] = None,
    self_supervised: Annotated[
        bool,
        typer.Option("--self-supervised", help="Fine-tune the shipped weights on your LiDAR's own rings."),
    ] = False,
    small: Annotated[
        bool, typer.Option("--small", help="Train a smaller network, which takes less than half of the run time.")
    ] = False,
    teacher: Annotated[
        Path | None,
        typer.Option(help="A .safetensors file of Lift, usually larger, whose answers are learned too. Default: none."),
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
    """Train Lift, or fine-tune it to your LiDAR without ground truth.

    Example: `lidarlift train lift my_sequence other_sequence --validate third --epochs 10`

    Images and poses are used if the sequence has them. A --small network learns faster from a --teacher that was
    trained before.
    """
    folder = out or _folder(LIFT)
    options = TrainingOptions(folder, resume, start, device.value, epochs, steps, batch, seed, rate, bf16)
    _require(options)
    if self_supervised:
        options = replace(options, start=start or shipped_weights(LIFT), rate=rate or ADAPTING_RATE)
    task = lift_task(datasets, validate or [], self_supervised, teacher, lift_sizes(options, small))
    _train(options.plan(LIFT, sum(len(sequence) for sequence in task.sequences)), task, options)


@train.command()
def depth(
    model: Annotated[str, typer.Argument(help=f"The network: {', '.join(NETWORKS.names())}.")],
    datasets: Annotated[list[Path], typer.Argument(metavar="DATASET...", help="Sequences with a camera, or packs.")],
    validate: Annotated[
        list[Path] | None, typer.Option(help="A sequence or pack to validate on; may be given several times.")
    ] = None,
    poses: Annotated[
        list[Path] | None,
        typer.Option(help="A file of LiDAR poses from a run, one for each sequence, in the same order."),
    ] = None,
    pack: Annotated[
        Path | None, typer.Option(help="The file that the sequences are packed into. Default: train.npz in --out.")
    ] = None,
    crop: Annotated[str, typer.Option(help="HEIGHTxWIDTH of a training example, at --scale.")] = "160x304",
    scale: Annotated[float, typer.Option(min=0.1, max=1.0, help="Scale of the images.")] = 0.5,
    absolute: Annotated[
        float | None,
        typer.Option(
            min=0, help="Weight of the absolute error relative to the squared one. Default: the paper's, 0.0002."
        ),
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
    """Train one of the paper's depth completion networks.

    Example: `lidarlift train depth f2l-light sequences/0005 sequences/0013 --validate sequences/0009 --epochs 10`

    Neighbouring scans densify the targets if poses are known (ground truth or --poses). A sequence that was simulated
    --with-depth has exact targets, KITTI's stereo 2015 has its disparity. Sequences are packed once; the pack can be
    given as a data set later.
    """
    NETWORKS.require(model)
    size = _size(crop)
    folder = out or _folder(model)
    options = TrainingOptions(folder, resume, start, device.value, epochs, steps, batch, seed, rate, bf16)
    _require(options)
    from enrichment.networks.loss import LAMBDA

    packs = open_packs(datasets, poses or [], pack or folder / "train.npz", scale, progress)
    held_out = open_packs(validate or [], [], folder / "validation.npz", scale, progress, neighbours=0)
    task = depth_task(packs, held_out, size)
    weight = LAMBDA if absolute is None else absolute
    plan = options.plan(model, sum(len(pack) for pack in packs), crop=size, absolute=weight)
    _train(plan, task, options)


def _folder(model: str) -> Path:
    return Path("runs") / f"train-{model}"


def _require(options: TrainingOptions) -> None:
    """Check the options before any work begins."""
    if options.epochs and options.steps:
        raise typer.BadParameter("replaces --epochs; leave one of the two out", param_hint="--steps")
    require_writable(options.out)
    require_torch()
    options.require_folder()


def _train(plan: Plan, task: Task, options: TrainingOptions) -> None:
    from enrichment.training.loop import train
    from enrichment.training.results import write_results

    with _bar(plan.model, plan.steps) as (begin, on_step):
        training = prepare(plan, task, options, on_step)
        begin(training.step)
        train(training, options.device)
    if is_first_process():
        best = write_results(training, _command())
        print(_summary(plan, best))
        graphs = sorted(path.name for path in options.out.glob(f"{plan.model}*.onnx"))
        print(f"Written to {options.out}: {', '.join(graphs)}, {plan.model}.safetensors, {plan.model}.md")


def _command() -> str:
    """The command as typed, with paths reduced to their last names: a model card must not reveal private folders."""
    return shlex.join(["lidarlift", *(Path(word).name if os.sep in word else word for word in sys.argv[1:])])


def _summary(plan: Plan, best: Figures | None) -> str:
    if best is None:
        return f"{plan.model}: {plan.steps} steps, not validated; the last weights are kept"
    figures = f"MAE {1000 * best.mae:.0f} mm, RMSE {1000 * best.rmse:.0f} mm"
    return f"{plan.model}: {plan.steps} steps, best validation after {best.step}: {figures}"


@contextmanager
def _bar(title: str, steps: int) -> Iterator[tuple[Callable[[int], None], Callable[[float], None]]]:
    """A progress bar of `steps`: yields a function for the steps taken before, and one for each step's loss."""
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
