"""Model cards: training data, training, figures and licence of weights."""

from __future__ import annotations

from collections.abc import Sequence

from enrichment.training.checkpoint import Figures
from enrichment.training.licence import KITTI, licence_of
from enrichment.training.pack import Pack, PackedSequence
from enrichment.training.plan import Plan
from slam.data.dataset import Dataset

TEMPLATE = """# {model}

Dense depth from a camera image and the few rings of a LiDAR: the network `{model}` of lidarlift, {parameters:,}
parameters. Input: RGB in 0..1 and depth along the camera's axis in metres, 0 = none, both at {scale:g} times the
image's resolution. Output: depth in metres at the same pixels.

## Data

| sequence | used for | frames | target depth | licence |
|---|---|---|---|---|
{sequences}

The input rings are drawn at random for each example: most often every 4th of 64, with a random first one. The target
has the returns of all rings.

## Training

    {command}

Step {step} of {steps}, {batch} crops of {height}x{width} a step, AdamW, learning rate up to {rate:g}, seed {seed},
{precision}. Loss: the squared error, and {absolute:g} times the absolute one, in metres.

## Figures

{figures}

## Licence

{licence}
"""
LIFT = """# lift

Ranges, with their uncertainty, on rays between the rings of a LiDAR, over all 360 degrees: the network `lift` of
lidarlift, {parameters:,} parameters. Input and output: `enrichment.lift.features` and `enrichment.lift.network`.

## Data

| sequence | used for | scans | licence |
|---|---|---|---|
{sequences}

{rings}

## Training

    {command}

Step {step} of {steps}, parts of {batch} scans per step, AdamW, learning rate up to {rate:g}, seed {seed}, {precision}.
{teacher}
## Figures

{figures}

## Licence

{licence}
"""
TAUGHT = """
The loss has the differences from the answers of a teacher in addition: `{teacher}`.
"""
ALL_RINGS = """\
The input rings are drawn at random for each example: most often every 4th of 64, with a random first one; so is the
number of earlier scans, placed by ground-truth poses with a small error. The returns of all other rings are the
reference."""
OWN_RINGS = "The input was some rings of the sparse LiDAR itself, the target its other rings: no ground truth was used."
NON_COMMERCIAL = """Trained on KITTI (Geiger, Lenz, Stiller, Urtasun, "Vision meets Robotics: The KITTI Dataset", IJRR
2013), which is under CC BY-NC-SA 3.0: these weights are for non-commercial use only."""
OTHER = "That of the recordings, as the table has it."


def model_card(
    plan: Plan,
    step: int,
    best: Figures | None,
    parameters: int,
    packs: Sequence[Pack],
    validation: Sequence[Pack],
    command: str,
) -> str:
    """Format the model card of a depth completion network in Markdown.

    Args:
        plan: Settings of the training.
        step: Number of steps after which the weights were taken.
        best: Validation of the weights, None without one.
        parameters: Number of learned parameters.
        packs: Packs for training.
        validation: Packs for validation.
        command: The command that trained them.
    """
    uses = (("training", packs), ("validation", validation))
    used = [(sequence, use) for use, some in uses for sequence in _sequences(some)]
    return TEMPLATE.format(
        model=plan.model,
        parameters=parameters,
        scale=packs[0].scale,
        sequences="\n".join(_row(sequence, use) for sequence, use in used),
        command=command,
        step=step,
        steps=plan.steps,
        batch=plan.batch,
        height=plan.crop[0],
        width=plan.crop[1],
        rate=plan.highest_rate,
        seed=plan.seed,
        absolute=plan.absolute,
        precision="convolutions in bfloat16" if plan.bf16 else "float32",
        figures=_figures(best, sum(len(sequence.frames) for sequence in _sequences(validation)), "frames"),
        licence=NON_COMMERCIAL if any(sequence.licence == KITTI for sequence, _ in used) else OTHER,
    )


def lift_card(
    plan: Plan,
    step: int,
    best: Figures | None,
    parameters: int,
    sequences: Sequence[Dataset],
    validation: Sequence[Dataset],
    own_rings: bool,
    command: str,
    teacher: str = "",
) -> str:
    """Format the model card of Lift, as `model_card`.

    `own_rings`: trained on the rings of a sparse LiDAR only; `teacher`: name of the weights that taught it, or ''.
    """
    uses = (("training", sequences), ("validation", validation))
    used = [(sequence, use) for use, some in uses for sequence in some]
    return LIFT.format(
        parameters=parameters,
        sequences="\n".join(f"| {data.name} | {use} | {len(data)} | {licence_of(data)} |" for data, use in used),
        rings=OWN_RINGS if own_rings else ALL_RINGS,
        command=command,
        step=step,
        steps=plan.steps,
        batch=plan.batch,
        rate=plan.highest_rate,
        seed=plan.seed,
        precision="convolutions in bfloat16" if plan.bf16 else "float32",
        teacher=TAUGHT.format(teacher=teacher) if teacher else "",
        figures=_figures(best, sum(len(sequence) for sequence in validation), "scans"),
        licence=NON_COMMERCIAL if any(licence_of(sequence) == KITTI for sequence, _ in used) else OTHER,
    )


def _sequences(packs: Sequence[Pack]) -> list[PackedSequence]:
    return [sequence for pack in packs for sequence in pack.sequences]


def _row(sequence: PackedSequence, use: str) -> str:
    return f"| {sequence.name} | {use} | {len(sequence.frames)} | {sequence.target} | {sequence.licence} |"


def _figures(best: Figures | None, count: int, what: str) -> str:
    if best is None:
        return "There was no validation: the accuracy of these weights is unknown."
    return (
        f"On the {count} {what} for validation, at returns off the rings that are the input, means over {what}: "
        f"MAE {1000 * best.mae:.0f} mm, RMSE {1000 * best.rmse:.0f} mm. These weights were chosen by that "
        "MAE, so it is a little lower than on other sequences."
    )
