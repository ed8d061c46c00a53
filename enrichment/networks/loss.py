"""What the networks are trained to make small."""

from __future__ import annotations

from torch import Tensor

LAMBDA = 0.0002  # of equation 2: weight of the absolute error against the squared one


def depth_loss(depth: Tensor, truth: Tensor) -> Tensor:
    """Equation 2 of Yue et al., (d - d*)^2 + LAMBDA |d - d*| in metres, over the pixels that have truth.

    The mean over these pixels where the equation has the sum, so that neither the learning rate nor the figure depends
    on how many of them a batch has; 0 where there are none. Both are (B, 1, H, W), truth 0 = none.
    """
    known = truth > 0
    error = (depth - truth) * known
    return (error.square() + LAMBDA * error.abs()).sum() / known.sum().clamp(min=1)
