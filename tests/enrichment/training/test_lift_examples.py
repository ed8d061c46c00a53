"""Lift's examples: which rings are given and which are asked for, and that everything follows from the seed."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import torch

from enrichment.geometry.held_out import past_of
from enrichment.lift.channels import Candidate, Ray
from enrichment.lift.network import Lift
from enrichment.training.lift_examples import (
    CROP,
    MARGIN,
    TrainingScans,
    ValidationScans,
    crop_columns,
    example,
    random_rings,
)
from enrichment.training.lift_task import LiftTask
from enrichment.training.plan import Plan
from slam.data.errors import InputError
from slam.data.sensor import Sensor, load_sensor

HDL64, VLP16 = load_sensor("hdl64"), load_sensor("vlp16")


@pytest.mark.parametrize("seed", range(20))
def test_rings_of_64_are_split_into_input_and_target(seed: int) -> None:
    kept, asked = random_rings(HDL64, own_rings=False, rng=np.random.default_rng(seed))
    assert sorted([*kept, *asked]) == list(range(64))
    assert len(set(np.diff(kept))) == 1
    assert len(kept) in (8, 16, 32)


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize("sensor", [HDL64, VLP16])
def test_held_out_rings_of_a_sparse_lidar_are_not_adjacent(seed: int, sensor: Sensor) -> None:
    kept, asked = random_rings(sensor, own_rings=True, rng=np.random.default_rng(seed))
    all_of_them = np.sort(np.concatenate([kept, asked]))
    assert len(all_of_them) == 16
    place = np.searchsorted(all_of_them, asked)
    assert 2 <= len(asked) <= 5
    assert (np.diff(np.sort(place)) > 1).all()
    assert place.min() > 0
    assert place.max() < 15


def test_targets_are_on_their_rays(sequence: Any) -> None:
    given = ValidationScans([sequence])[0]
    known = (given.truth > 0) & (given.rays[:, Ray.KNOWN] > 0)
    assert known.sum() > 10_000
    segment = given.candidates[:, Candidate.SEGMENT]
    assert (segment - given.truth)[known].abs().median() < 0.05  # ground and a wall: planes nearly everywhere


def test_mirroring_reverses_columns(sequence: Any) -> None:
    frame, rings = sequence[1], np.arange(64)
    kept, asked = rings[::4], rings[rings % 4 > 0]
    one, other = (example(frame, HDL64, kept, asked, None, mirrored=mirrored) for mirrored in (False, True))
    for name in ("rings", "rays", "candidates", "truth"):
        torch.testing.assert_close(getattr(one, name), getattr(other, name).flip(-1), rtol=1e-4, atol=1e-4)


def test_examples_depend_on_seed_and_number_only(sequence: Any) -> None:
    first, later = TrainingScans([sequence], False, 3, 0, 4), TrainingScans([sequence], False, 3, 2, 2)
    for one, other in zip(first[2], later[0], strict=True):
        assert torch.equal(one, other)
    assert not all(
        one.shape == other.shape and torch.equal(one, other) for one, other in zip(first[2], first[3], strict=True)
    )


def test_every_epoch_has_all_scans(sequence: Any) -> None:
    looked_at = []

    class Watched(type(sequence)):  # type: ignore[misc]
        ground_truth = None  # the poses of the scans before are unknown, so that these are not used

        def __getitem__(self, position: int) -> Any:
            looked_at.append(position)
            return super().__getitem__(position)

    watched = Watched(**vars(sequence))
    scans = TrainingScans([watched], False, 0, 0, 6)
    for number in range(6):
        scans[number]
    assert sorted(looked_at[:3]) == sorted(looked_at[3:]) == [0, 1, 2]


def test_an_unknown_sensor_model_is_an_error(sequence: Any) -> None:
    with pytest.raises(InputError, match=r"the sensor model is unknown; add a sensor\.yaml to the folder"):
        LiftTask([replace(sequence, sensor=None)], [])


def test_history_holds_the_scans_before(sequence: Any) -> None:
    """The street has a wall ahead, and the LiDAR moves a metre towards it with each scan."""
    moved = replace(sequence, clouds=[cloud.with_xyz(cloud.xyz - [k, 0, 0]) for k, cloud in enumerate(sequence.clouds)])
    found = past_of(moved, 2)
    assert len(found) == 2
    for k, (cloud, T_now_then) in enumerate(found):
        assert cloud is moved.clouds[k]
        np.testing.assert_allclose(T_now_then[:3, 3], [k - 2.0, 0, 0], atol=1e-9)
    assert past_of(moved, 0) == []
    assert len(past_of(moved, 2, 1)) == 1
    has_past = ValidationScans([moved])[2].candidates[0, Candidate.PAST] > 0
    assert has_past.float().mean() > 0.05


def test_crops_have_no_targets_near_their_edges(sequence: Any) -> None:
    whole = ValidationScans([sequence])[0]
    part = crop_columns(whole, 10)
    assert part.rays.shape[-1] == part.rings.shape[-1] == CROP
    torch.testing.assert_close(part.rays[..., CROP // 2], whole.rays[..., 10])
    assert not part.truth[..., :MARGIN].any()
    assert not part.truth[..., -MARGIN:].any()
    inside = part.truth[..., MARGIN:-MARGIN]
    torch.testing.assert_close(inside[..., CROP // 2 - MARGIN], whole.truth[..., 10])


def test_scans_with_the_same_rings_are_batched(sequence: Any) -> None:
    """The loss does not depend on the order, and scans of other rings may be among them."""
    torch.manual_seed(0)
    task, network = LiftTask([sequence], []), Lift().eval()
    batch = [TrainingScans([sequence], False, seed, 0, 1)[0] for seed in (2, 3, 4)]
    assert [scan.rays.shape[2] for scan in batch] == [45, 49, 45]
    plan = Plan("lift", 1)
    with torch.no_grad():
        one, other = task.loss(network, batch, plan), task.loss(network, batch[::-1], plan)
    torch.testing.assert_close(one, other, rtol=1e-4, atol=1e-4)
