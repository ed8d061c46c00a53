"""Training loss of the depth completion networks."""

from __future__ import annotations

from torch import Tensor

LAMBDA = 0.0002  # weight of the absolute error relative to the squared one, equation 2


def depth_loss(depth: Tensor, truth: Tensor, absolute: float = LAMBDA) -> Tensor:
    """Compute equation 2 of Yue et al., (d - d*)^2 + absolute |d - d*| in metres, over the pixels with ground truth.

    With the paper's LAMBDA it is a squared error that few pixels at edges dominate, and predictions there are means of
    foreground and background. With `absolute` = 10, errors of up to 10 m count linearly, as in the MAE.

    The equation's sum over pixels is replaced by the mean per image, averaged over the images with ground truth: the
    learning rate does not depend on the number of pixels, and a simulated image, which has ground truth everywhere,
    counts no more than a recorded one.

    Args:
        depth: Predicted depth (B, 1, H, W) [m].
        truth: True depth (B, 1, H, W) [m], 0 = none.
        absolute: Weight of the absolute error.

    Returns:
        The loss; 0 without any ground truth.
    """
    known = truth > 0
    error = (depth - truth) * known
    count = known.sum(dim=(1, 2, 3))
    each = (error.square() + absolute * error.abs()).sum(dim=(1, 2, 3)) / count.clamp(min=1)
    return each.sum() / (count > 0).sum().clamp(min=1)
