"""Extrinsics are found again from a wrong guess, and what is not determined is said."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest

from slam.calibration.estimate import estimate
from slam.calibration.observations import Observations, Parameters, View
from slam.data.cloud import Array
from slam.data.errors import InputError

K = np.array([[300.0, 0.0, 240.0], [0.0, 300.0, 75.0], [0.0, 0.0, 1.0]])
T = np.array([[0, -1, 0, 0.1], [0, 0, -1, -0.15], [1, 0, 0, -0.25], [0, 0, 0, 1.0]])
CHANGE = np.array([*np.deg2rad([1.5, -2.5, 1.0]), 0.09, -0.11, 0.14, 0.0, 0.0, 0.0])


def test_a_change_leads_back() -> None:
    start = Parameters(T)
    np.testing.assert_allclose(start.change_to(start.changed(CHANGE).T), CHANGE[:6], atol=1e-12)


def test_the_score_is_highest_at_the_truth(views: Sequence[View]) -> None:
    observed = Observations(views, K, T, 1.0)
    best = observed.score(Parameters(T))
    assert best > 0.3
    for axis, size in enumerate([*np.deg2rad([1, 1, 2]), 0.2, 0.2, 0.4]):
        for sign in (-1, 1):
            change = np.zeros(Parameters.SIZE)
            change[axis] = sign * size
            assert observed.score(Parameters(T).changed(change)) < 0.9 * best


def test_extrinsics_are_found_from_a_wrong_guess(
    views: Sequence[View], off: Callable[[Array, Array], tuple[float, float]]
) -> None:
    guess = Parameters(T).changed(CHANGE).T
    found = estimate(views, K, guess, delay=0.0)
    assert off(found.T_camera_lidar, T)[0] < 0.8  # 3 before; the vertical translation, 11 cm off, is held
    error = found.T_camera_lidar[:3, 3] - T[:3, 3]
    assert np.abs(error[found.determined]).max() < 0.05  # 0.09 to 0.14 before; a pixel is 3 cm at 10 m
    assert found.score > 0.3 > found.score_of_guess
    assert found.determined[[0, 2]].all()


def test_a_translation_that_is_not_determined_stays_that_of_the_guess(views: Sequence[View]) -> None:
    """Straight ahead at one speed, a delay of the images looks like a shift of the camera."""
    straight = [replace(view, velocity=np.array([0.0, 0.0, 0.0, 7.0, 0.0, 0.0])) for view in views]
    found = estimate(straight, K, T)
    assert not found.determined[2]
    assert found.T_camera_lidar[2, 3] == T[2, 3]
    assert found.sigma[5] == 0


def test_a_delay_lowers_the_score(views: Sequence[View]) -> None:
    observed = Observations(views, K, T, 1.0)
    scores = [observed.score(Parameters(T, delay)) for delay in (0.0, 0.05, -0.05)]
    assert scores[0] > 1.3 * max(scores[1:])


def test_a_guess_that_looks_elsewhere(views: Sequence[View]) -> None:
    backwards = Parameters(T).changed(np.array([0.0, np.pi, *np.zeros(7)])).T
    with pytest.raises(InputError, match="in the image by the guess"):
        estimate(views, K, backwards)


def test_images_of_another_place(views: Sequence[View]) -> None:
    rng = np.random.default_rng(0)
    other = [replace(view, grey=rng.integers(0, 255, view.grey.shape, np.uint8)) for view in views]
    with pytest.raises(InputError, match="no alignment"):
        estimate(other, K, T)
