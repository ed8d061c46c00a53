"""How a network is trained: all that its weights follow from, besides the data."""

from __future__ import annotations

import math
from dataclasses import dataclass

from enrichment.networks.loss import LAMBDA

WARM_UP = 100  # steps until the learning rate is whole, at most a tenth of all
#: Highest learning rates: the best of 1e-3, 3e-3 and, for L2L, 1e-2 after 50 to 200 steps on KITTI.
RATE, RATES = 3e-3, {"l2l": 1e-2}


@dataclass(frozen=True)
class Plan:
    """Settings of a training.

    model   name in `enrichment.networks.registry`
    steps   in all, each on a batch (of every GPU)
    crop    (height, width) of an example, in cells of the packs' scale
    batch   examples a step
    validate_every  steps from one validation and checkpoint to the next (after each the best weights so far are kept)
    seed    of the first weights, the examples and dropout
    rate    highest learning rate; None: the model's own
    absolute  weight of the absolute error against the squared one, of the paper's networks
    bf16    convolutions in bfloat16, weights and loss in float32: up to three times as fast where the processor has it
    """

    model: str
    steps: int
    crop: tuple[int, int] = (160, 304)
    batch: int = 4
    validate_every: int = 200
    seed: int = 0
    rate: float | None = None
    absolute: float = LAMBDA
    bf16: bool = False

    @property
    def highest_rate(self) -> float:
        return RATES.get(self.model, RATE) if self.rate is None else self.rate

    def rate_at(self, step: int) -> float:
        """AdamW's learning rate at step 0, 1, ...: it rises for WARM_UP steps and falls to 0 along a cosine."""
        rate = self.highest_rate
        warm_up = max(min(WARM_UP, self.steps // 10), 1)
        if step < warm_up:
            return rate * (step + 1) / warm_up
        return rate * (0.5 + 0.5 * math.cos(math.pi * (step - warm_up) / max(self.steps - warm_up, 1)))
