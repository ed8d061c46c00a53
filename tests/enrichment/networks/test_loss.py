"""Equation 2 on numbers."""

from __future__ import annotations

import pytest
import torch

from enrichment.networks.loss import depth_loss


def test_the_loss_covers_pixels_with_ground_truth() -> None:
    depth = torch.tensor([[[[3.0, 10.0], [7.0, -50.0]]]])
    truth = torch.tensor([[[[5.0, 9.5], [7.0, 0.0]]]])
    assert depth_loss(depth, truth).item() == pytest.approx((4 + 0.25 + 0.0002 * (2 + 0.5)) / 3)


def test_images_have_equal_weight() -> None:
    depth, truth = torch.zeros(3, 1, 2, 2), torch.zeros(3, 1, 2, 2)
    truth[0], truth[1, 0, 0, 0] = 2.0, 4.0  # the third has none
    assert depth_loss(depth, truth, absolute=1.0).item() == pytest.approx(((4 + 2) + (16 + 4)) / 2)


def test_without_ground_truth_the_loss_is_zero() -> None:
    depth = torch.ones(1, 1, 2, 2, requires_grad=True)
    loss = depth_loss(depth, torch.zeros(1, 1, 2, 2))
    loss.backward()
    assert loss.item() == 0
    assert depth.grad is not None
    assert not depth.grad.any()
