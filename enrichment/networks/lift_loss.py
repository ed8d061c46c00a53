"""What Lift is trained to make small."""

from __future__ import annotations

import torch
from torch import Tensor
from torch.nn import functional

from enrichment.networks.lift import Answer

ABSOLUTE, SQUARED, CHOICE, VALID = 0.3, 0.02, 0.3, 0.2  # weights beside the likelihood
LONG = 20.0  # m: from there errors count linearly
SOFT, SOFT_SHARE = 0.1, 0.01  # m, and of the range: candidates whose errors differ by less are as good
MATTERS = 0.05, 5.0  # m: bounds of what a choice may weigh


def lift_loss(answer: Answer, rays: Tensor, candidates: Tensor, truth: Tensor) -> Tensor:
    """Of the rays with candidates, (B, Q, W) truth in metres along rho, 0 = no return.

    The negative log likelihood of a Laplace distribution (sigma learns from it), the absolute error (MAE), a squared
    one (RMSE: without it long errors would be given up), the choice of a candidate, and whether there is a return.
    """
    known = rays[:, 0] > 0
    asked = known & (truth > 0)
    if not asked.any():
        return 0.0 * answer.ranges.sum()
    ranges, scale, real = answer.ranges[asked], answer.scale[asked], truth[asked]
    likelihood = ((ranges - real).abs() / scale + scale.log()).mean()
    absolute = functional.smooth_l1_loss(ranges, real)
    squared = functional.huber_loss(ranges, real, delta=LONG)
    valid = functional.binary_cross_entropy_with_logits(answer.valid[known], asked[known].float())
    choice = _choice(answer.logits.transpose(0, 1)[:, asked], candidates.transpose(0, 1)[:, asked], real)
    return likelihood + ABSOLUTE * absolute + SQUARED * squared + CHOICE * choice + VALID * valid


def _choice(logits: Tensor, candidates: Tensor, truth: Tensor) -> Tensor:
    """Cross entropy of the candidates' weights (C, N) against those that their errors deserve, where it matters: by how
    far the measured neighbours are from the truth."""
    error = (candidates - truth).abs().masked_fill(candidates <= 0, 1e3)
    deserved = torch.softmax(-error / (SOFT + SOFT_SHARE * truth), dim=0)
    entropy = -(deserved * torch.log_softmax(logits, dim=0)).sum(dim=0)
    weight = error[:3].amax(dim=0).clamp(*MATTERS)
    return (weight * entropy).sum() / weight.sum()
