"""Numbers of cases, by which docs/inputs.md refers to them."""

from __future__ import annotations

from tests.inputs.test_images import IMAGES
from tests.inputs.test_interrupted_runs import LOST
from tests.inputs.test_poses_and_graphs import POSES_AND_GRAPHS
from tests.inputs.test_truth import TRUTH


def test_case_numbers_are_unique() -> None:
    cases = [*TRUTH, *POSES_AND_GRAPHS, *IMAGES, *LOST]
    assert len({case.number for case in cases}) == len(cases)
