"""What Lift is trained to make small."""

from __future__ import annotations

import torch
from torch import Tensor
from torch.nn import functional

from enrichment.lift.channels import Candidate, Ray
from enrichment.lift.network import Answer

ABSOLUTE, SQUARED, CHOICE, VALID = 1.0, 0.05, 0.1, 0.2  # weights beside the likelihood
LONG = 20.0  # m: from there errors count linearly
SOFT, SOFT_SHARE = 0.1, 0.01  # m, and of the range: candidates whose errors differ by less are as good
MATTERS = 0.05, 5.0  # m: bounds of what a choice may weigh


def lift_loss(answer: Answer, rays: Tensor, candidates: Tensor, truth: Tensor) -> Tensor:
    """Of the rays with candidates, (B, Q, W) truth in metres along rho, 0 = no return.

    The negative log likelihood of a Laplace distribution (sigma learns from it), the absolute error (MAE), a squared
    one (RMSE: without it long errors would be given up), the choice of a candidate, and whether there is a return.
    Means over rays: nothing here waits for a GPU to tell how many they are.
    """
    known = rays[:, Ray.KNOWN] > 0
    asked = known & (truth > 0)
    error = (answer.ranges - truth).abs()
    likelihood = error / answer.scale + answer.scale.log()
    absolute = functional.smooth_l1_loss(answer.ranges, truth, reduction="none")
    squared = functional.huber_loss(answer.ranges, truth, reduction="none", delta=LONG)
    valid = functional.binary_cross_entropy_with_logits(answer.valid, asked.float(), reduction="none")
    entropy, weight = _choice(answer.logits, candidates, truth)
    weight = weight * asked
    choice = (weight * entropy).sum() / weight.sum().clamp(min=1e-6)
    of_ranges = _mean(likelihood + ABSOLUTE * absolute + SQUARED * squared, asked)
    return of_ranges + CHOICE * choice + VALID * _mean(valid, known) * asked.any()


def _mean(values: Tensor, where: Tensor) -> Tensor:
    return (values * where).sum() / where.sum().clamp(min=1)


def _choice(logits: Tensor, candidates: Tensor, truth: Tensor) -> tuple[Tensor, Tensor]:
    """(B, Q, W) each: cross entropy of the candidates' weights against those that their errors deserve, and where it
    matters: by how far the measured neighbours are from the truth."""
    error = (candidates - truth[:, None]).abs().masked_fill(candidates <= 0, 1e3)
    deserved = torch.softmax(-error / (SOFT + SOFT_SHARE * truth[:, None]), dim=1)
    entropy = -(deserved * torch.log_softmax(logits, dim=1)).sum(dim=1)
    return entropy, error[:, Candidate.SEGMENT : Candidate.FROM_ABOVE].amax(dim=1).clamp(*MATTERS)
