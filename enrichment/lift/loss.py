"""Training loss of Lift."""

from __future__ import annotations

import torch
from torch import Tensor
from torch.nn import functional

from enrichment.lift.channels import Candidate, Ray
from enrichment.lift.network import Answer

ABSOLUTE, SQUARED, CHOICE, VALID = 1.0, 0.05, 0.1, 0.2  # weights relative to the likelihood
LIKE_RANGE, LIKE_SCALE, LIKE_CHOICE, LIKE_VALID = 0.5, 0.2, 0.1, 0.2  # weights of the differences from a teacher
LONG = 20.0  # m: larger errors count linearly
SOFT, SOFT_SHARE = 0.1, 0.01  # m, and share of the range: candidates whose errors differ by less are equally good
WEIGHT_LIMITS = 0.05, 5.0  # m: limits of the weight of a choice


def lift_loss(answer: Answer, rays: Tensor, candidates: Tensor, truth: Tensor) -> Tensor:
    """Compute the loss over the rays with candidates.

    The sum of the negative log likelihood of a Laplace distribution (trains sigma), the absolute error (MAE), a squared
    error (RMSE; without it large errors would be neglected), the choice of a candidate, and the presence of a return.
    Means over rays are computed without synchronising with the GPU.

    Args:
        answer: Output of the network.
        rays: (B, RAYS, Q, W).
        candidates: (B, CANDIDATES, Q, W).
        truth: (B, Q, W) metres along rho, 0 without a return.
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


def teaching_loss(answer: Answer, taught: Answer, rays: Tensor, candidates: Tensor) -> Tensor:
    """Compute the difference from a teacher's answer over the rays with candidates, with a return or without.

    The sum of the absolute difference of the ranges, that of the logarithms of the scales, the relative entropy of the
    candidates' weights, times the distance of the farthest candidate from the segment, and the cross entropy of
    validity.
    """
    known = rays[:, Ray.KNOWN] > 0
    apart = (candidates - candidates[:, Candidate.SEGMENT, None]).abs().masked_fill(candidates <= 0, 0).amax(dim=1)
    theirs = torch.log_softmax(taught.logits, dim=1)
    choice = (theirs.exp() * (theirs - torch.log_softmax(answer.logits, dim=1))).sum(dim=1)
    scale = (answer.scale.log() - taught.scale.log()).abs()
    valid = functional.binary_cross_entropy_with_logits(answer.valid, taught.valid.sigmoid(), reduction="none")
    off = (answer.ranges - taught.ranges).abs()
    weight = apart.clamp(*WEIGHT_LIMITS) * known
    alike = LIKE_CHOICE * (weight * choice).sum() / weight.sum().clamp(min=1e-6)
    return alike + _mean(LIKE_RANGE * off + LIKE_SCALE * scale + LIKE_VALID * valid, known)


def _mean(values: Tensor, where: Tensor) -> Tensor:
    return (values * where).sum() / where.sum().clamp(min=1)


def _choice(logits: Tensor, candidates: Tensor, truth: Tensor) -> tuple[Tensor, Tensor]:
    """Cross entropy of the candidates' weights against targets from their errors, and its weight, (B, Q, W) each.

    The weight is the distance of the measured neighbours from the truth, since the choice matters there.
    """
    error = (candidates - truth[:, None]).abs().masked_fill(candidates <= 0, 1e3)
    deserved = torch.softmax(-error / (SOFT + SOFT_SHARE * truth[:, None]), dim=1)
    entropy = -(deserved * torch.log_softmax(logits, dim=1)).sum(dim=1)
    return entropy, error[:, Candidate.SEGMENT : Candidate.FROM_ABOVE].amax(dim=1).clamp(*WEIGHT_LIMITS)
