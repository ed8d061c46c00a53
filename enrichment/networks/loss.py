"""What the networks are trained to make small."""

from __future__ import annotations

from torch import Tensor

LAMBDA = 0.0002  # of equation 2: weight of the absolute error against the squared one


def depth_loss(depth: Tensor, truth: Tensor, absolute: float = LAMBDA) -> Tensor:
    """Equation 2 of Yue et al., (d - d*)^2 + absolute |d - d*| in metres, over the pixels that have truth.

    With LAMBDA, the paper's, it is a squared error, which few pixels at edges rule: it makes means of what is before
    and behind. An `absolute` of 10 lets errors of up to 10 m count by their size, as the MAE does.
    The mean over these pixels of an image where the equation has the sum, and of these the mean over the images that
    have any: neither the learning rate nor the figure depends on how many there are, and a simulated image, which has
    truth everywhere, counts no more than a recorded one. 0 without any. Both are (B, 1, H, W), truth 0 = none.
    """
    known = truth > 0
    error = (depth - truth) * known
    count = known.sum(dim=(1, 2, 3))
    each = (error.square() + absolute * error.abs()).sum(dim=(1, 2, 3)) / count.clamp(min=1)
    return each.sum() / (count > 0).sum().clamp(min=1)
