"""Numbers of cases, by which docs/inputs.md refers to them."""

from __future__ import annotations

from tests.inputs import test_images, test_interrupted_runs, test_poses_and_graphs, test_truth

MODULES = (test_truth, test_poses_and_graphs, test_images, test_interrupted_runs)


def test_case_numbers_are_unique() -> None:
    numbers = [case.number for module in MODULES for case in module.CASES]
    assert len(set(numbers)) == len(numbers)
