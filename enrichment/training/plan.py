"""Settings of a training: everything that the weights depend on, except for the data."""

from __future__ import annotations

import math
from dataclasses import dataclass

from enrichment.networks.loss import LAMBDA

WARM_UP = 100  # steps until the maximum learning rate, at most a tenth of all steps
#: Maximum learning rates: the best of 1e-3, 3e-3 and, for L2L, 1e-2 after 50 to 200 steps on KITTI.
RATE, RATES = 3e-3, {"l2l": 1e-2}


@dataclass(frozen=True)
class Plan:
    """Settings of a training.

    Attributes:
        model: Name in `enrichment.networks.registry`, or 'lift'.
        steps: Total number of steps.
        crop: Height and width of an example, in cells of the packs' scale.
        batch: Examples per step, on each GPU.
        validate_every: Steps between validations; after each one a checkpoint and the best weights are kept.
        seed: Random seed of initial weights, examples and dropout.
        rate: Maximum learning rate; None: that of the model.
        absolute: Weight of the absolute error relative to the squared one, for the paper's networks.
        bf16: Compute convolutions in bfloat16, weights and loss in float32: up to three times as fast if the processor
            supports it.
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
        """Maximum learning rate."""
        return RATES.get(self.model, RATE) if self.rate is None else self.rate

    def rate_at(self, step: int) -> float:
        """Return AdamW's learning rate at a step, from 0: linear warm-up for WARM_UP steps, then a cosine to 0."""
        rate = self.highest_rate
        warm_up = max(min(WARM_UP, self.steps // 10), 1)
        if step < warm_up:
            return rate * (step + 1) / warm_up
        return rate * (0.5 + 0.5 * math.cos(math.pi * (step - warm_up) / max(self.steps - warm_up, 1)))
