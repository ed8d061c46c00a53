"""Unobservable directions of degenerate scans, in words."""

from __future__ import annotations

import numpy as np
import pytest

from slam.data.cloud import Array
from slam.degeneracy import directions, rotations, summary, translations

STANDING, AHEAD = np.zeros(3), np.array([1.2, 0, 0])
X, YAW = np.array([0, 0, 0, 1.0, 0, 0]), np.array([0, 0, 1.0, 0, 0, 0])


def unit(*components: float) -> Array:
    return np.array(components) / np.linalg.norm(components)


def test_parts_are_unit_vectors_with_a_fixed_sign() -> None:
    unobserved = np.array([-X, unit(0, 0, 0.5, 0, -2, 1)])
    np.testing.assert_allclose(translations(unobserved), [[1, 0, 0], unit(0, 2, -1)], atol=1e-12)
    np.testing.assert_allclose(rotations(unobserved), [[0, 0, 1]], atol=1e-12)


def test_small_parts_are_not_reported() -> None:
    assert rotations(unit(0, 0, 0.05, 1, 0, 0)[None]).shape == (0, 3)
    assert translations(unit(0, 0, 1, 0.05, 0, 0)[None]).shape == (0, 3)


def test_no_unobservable_directions_have_no_names() -> None:
    nothing = np.zeros((0, 6))
    assert translations(nothing).shape == rotations(nothing).shape == (0, 3)
    assert directions(nothing, AHEAD) == set()


@pytest.mark.parametrize(
    ("unobserved", "motion", "names"),
    [
        (X, AHEAD, {"along the direction of travel"}),
        (-X, -AHEAD, {"along the direction of travel"}),
        (X, STANDING, {"along x (forward)"}),
        (unit(0, 0, 0, 0, 1, 0.2), AHEAD, {"along y (sideways)"}),
        (unit(0, 0, 0, 0, 0, 1), AHEAD, {"along z (up)"}),
        (YAW, AHEAD, {"about z (heading)"}),
        (unit(0, 0, 0.3, 0, 1, 0), AHEAD, {"along y (sideways)", "about z (heading)"}),
    ],
)
def test_names_of_directions(unobserved: Array, motion: Array, names: set[str]) -> None:
    assert directions(unobserved[None], motion) == names


TRAVEL, HEADING = {"along the direction of travel"}, {"about z (heading)"}


@pytest.mark.parametrize(
    ("found", "where"),
    [
        ([TRAVEL] * 3, "along the direction of travel"),
        ([TRAVEL, TRAVEL, HEADING], "along the direction of travel in 2, about z (heading) in 1"),
        ([TRAVEL | HEADING] * 3, "about z (heading), along the direction of travel"),
        ([set()] * 3, "in every direction"),
    ],
)
def test_the_summary_is_one_sentence(found: list[set[str]], where: str) -> None:
    assert summary(found, 240) == (
        f"3 of 240 frames degenerate: the scan did not constrain the pose {where}; the prediction was kept there"
    )
