"""Is F2L better than L2L and LI2L, as the paper has it? Each with the same small budget, from three seeds.

    python -m benchmarks.weights.network_seeds OUT

trains on what train_networks.py has packed in OUT, but for drive 0005, and validates on the same frames; writes
network_seeds.md and .json in benchmarks/results.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.common.page import surroundings, table, write_results
from benchmarks.common.script import add_results, parser, run_script
from benchmarks.weights.train_networks import HALF
from benchmarks.weights.trainings import learn
from enrichment.training.checkpoint import BEST, read_checkpoint
from eval.text import number

PACKS = ("0013.npz", "single.npz", "towns.npz")
VALIDATION = "validation.npz"
SEEDS, STEPS = (0, 1, 2), 150
HEADER = (
    "network", *(f"MAE mm, seed {seed}" for seed in SEEDS), "mean", "spread",
    *(f"RMSE mm, seed {seed}" for seed in SEEDS), "mean", "spread",
)  # fmt: skip


def main() -> None:
    arguments = parser(__doc__)
    arguments.add_argument("folder", type=Path, metavar="OUT")
    add_results(arguments)
    options = arguments.parse_args()
    figures = {model: [trained(options.folder, model, seed) for seed in SEEDS] for model in HALF.stages}
    about = surroundings(("torch", "lightning"))
    write_results(options.results, "network_seeds", {"about": about, "steps": STEPS, "networks": figures}, page)


def trained(folder: Path, model: str, seed: int) -> dict[str, float]:
    """MAE and RMSE [m] on the validation's frames after STEPS steps."""
    out = folder / "seeds" / f"{model}-{seed}"
    learn(
        model, (folder / name for name in PACKS), out, "--validate", folder / VALIDATION,
        "--scale", HALF.scale, *HALF.options, "--steps", STEPS, "--seed", seed,
    )  # fmt: skip
    best = read_checkpoint(out / BEST).best
    assert best is not None
    return {"mae": best.mae, "rmse": best.rmse}


def page(found: Mapping[str, Any]) -> str:
    about, figures = found["about"], found["networks"]
    lines = []
    for model, runs in figures.items():
        cells = []
        for name in ("mae", "rmse"):
            values = 1000 * np.array([run[name] for run in runs])
            cells += [*(number(value, 0) for value in values), number(values.mean(), 0), number(np.ptp(values), 0)]
        lines.append((model, *cells))
    options = " ".join(HALF.options)
    return f"""# The paper's networks, from three seeds

{about["date"]}, {about["cpu"]}.
`{about["command"]}`

* Each network was trained for {found["steps"]} steps ({options}, at scale {HALF.scale:g})
  on sequence 0013, single frames of KITTI odometry and stereo 2015, and three simulated towns; the figures are of 12
  frames of KITTI odometry 07, 08 and 10, at returns off the kept rings. The seed determines the initial weights, the
  order of examples, crops and dropout. Spread: maximum minus minimum.
* The loss is the paper's, almost entirely the squared error. The budget of two passes over the frames is small: it
  shows how fast each network learns, not its final accuracy. F2L and L2L start as a mean of the depths around, LI2L
  from random weights.
* In the paper, after training on 1730 frames, F2L is far better than L2L and LI2L. Here F2L has a lower MAE than L2L
  for {before(figures, "l2l")} of {len(SEEDS)} seeds, and than LI2L for {before(figures, "li2l")}.

{table(HEADER, lines)}"""


def before(figures: Mapping[str, Sequence[Mapping[str, float]]], other: str) -> int:
    """Number of seeds for which F2L has a lower MAE than another network."""
    pairs = zip(figures["f2l"], figures[other], strict=True)
    return sum(ours["mae"] < theirs["mae"] for ours, theirs in pairs)


if __name__ == "__main__":
    run_script(main)
