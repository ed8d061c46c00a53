"""Training without its extra, and options that all trainings share."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path

import pytest

from lidarlift.training import EPOCHS, TrainingOptions, require_torch
from slam.data.errors import InputError


def test_missing_training_packages_are_named_in_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    missing = ("torch", "lightning")
    monkeypatch.setattr("lidarlift.training.find_spec", lambda name: None if name in missing else find_spec("sys"))
    with pytest.raises(InputError) as raised:
        require_torch()
    assert str(raised.value) == "training requires torch, lightning; install them: pip install 'lidarlift[train]'"


def test_the_number_of_steps_follows_from_the_epochs() -> None:
    pytest.importorskip("torch")
    assert TrainingOptions(Path("o"), batch=4).plan("l2l", 10).steps == -(-10 * EPOCHS // 4)
    assert TrainingOptions(Path("o"), epochs=3, batch=4).plan("l2l", 10).steps == 8
    plan = TrainingOptions(Path("o"), steps=7, epochs=3, seed=2, rate=1e-4).plan("l2l", 10, crop=(8, 16))
    assert (plan.steps, plan.seed, plan.highest_rate, plan.crop) == (7, 2, 1e-4, (8, 16))
