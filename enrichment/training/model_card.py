"""What goes with weights: what they were trained on, how, how good they are, and what one may do with them."""

from __future__ import annotations

from collections.abc import Sequence

from enrichment.training.checkpoint import Figures
from enrichment.training.licence import KITTI
from enrichment.training.pack import Drive, Pack
from enrichment.training.plan import Plan

TEMPLATE = """# {model}

Dense depth from a camera image and the few rings of a LiDAR: the network `{model}` of lidarlift, {parameters:,}
parameters. Input: RGB in 0..1 and depth along the camera's axis in metres, 0 = none, both at {scale:g} times the
image's resolution. Output: depth in metres at the same pixels.

## Data

| drive | used for | frames | target depth | licence |
|---|---|---|---|---|
{drives}

Which rings are the input is drawn anew for each example: most often every 4th of 64, with a random first one. The
target has the returns of all rings.

## Training

    {command}

Step {step} of {steps}, {batch} crops of {height}x{width} a step, AdamW, learning rate up to {rate:g}, seed {seed},
{precision}.

## Figures

{figures}

## Licence

{licence}
"""
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
    """Markdown, of the weights after `step` steps; `best`, their validation, is None where there was none."""
    used = [(drive, use) for use, some in (("training", packs), ("validation", validation)) for drive in _drives(some)]
    return TEMPLATE.format(
        model=plan.model,
        parameters=parameters,
        scale=packs[0].scale,
        drives="\n".join(_row(drive, use) for drive, use in used),
        command=command,
        step=step,
        steps=plan.steps,
        batch=plan.batch,
        height=plan.crop[0],
        width=plan.crop[1],
        rate=plan.highest_rate,
        seed=plan.seed,
        precision="convolutions in bfloat16" if plan.bf16 else "float32",
        figures=_figures(best, _drives(validation)),
        licence=NON_COMMERCIAL if any(drive.licence == KITTI for drive, _ in used) else OTHER,
    )


def _drives(packs: Sequence[Pack]) -> list[Drive]:
    return [drive for pack in packs for drive in pack.drives]


def _row(drive: Drive, use: str) -> str:
    return f"| {drive.name} | {use} | {len(drive.frames)} | {drive.target} | {drive.licence} |"


def _figures(best: Figures | None, drives: list[Drive]) -> str:
    if best is None:
        return "There was no validation: nobody knows how good these weights are."
    count = sum(len(drive.frames) for drive in drives)
    return (
        f"On the {count} frames for validation, at target depths off the rings that are the input, means over images: "
        f"MAE {1000 * best.mae:.0f} mm, RMSE {1000 * best.rmse:.0f} mm. These weights were chosen by that "
        "MAE, so it is a little lower than on other drives."
    )
