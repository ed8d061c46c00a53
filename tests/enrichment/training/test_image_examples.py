"""Examples: the input has the kept rings' returns and no others, and all that is changed is changed alike."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from enrichment.geometry.image_rays import project_scan
from enrichment.geometry.sparse_scan import SparseScan
from enrichment.methods.onnx_network import downsampled
from enrichment.training.image_examples import (
    Example,
    TrainingImages,
    ValidationImages,
    Window,
    random_example,
    require_crop,
    sparse,
)
from enrichment.training.pack import Pack
from slam.data.depth_map import DEPTH_SCALE
from slam.data.errors import InputError

CROP = (16, 32)
WHOLE = Window(0, 0, 40, 120)


@pytest.mark.parametrize("phase", [0, 3])
def test_the_input_equals_that_of_a_run(sequence: Any, pack: Pack, phase: int) -> None:
    frame = sequence[0]
    rings = np.arange(64)
    scan = SparseScan(frame.cloud, sequence.sensor, rings, frame.read_image, frame.calibration)
    expected = downsampled(project_scan(scan.without(rings[rings % 4 != phase])).image, 0.5)
    found = sparse(pack[0], WHOLE, 4, phase)
    assert (found > 0).sum() > 500
    np.testing.assert_allclose(found, expected, atol=0.51 / DEPTH_SCALE)


@given(seed=st.integers(0, 2**32 - 1))
@settings(max_examples=25, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
def test_an_example_has_every_nth_ring_only(pack: Pack, seed: int) -> None:
    sample = pack[0]
    # depth tells the ring now: 1 m for ring 0, 2 m for ring 1, ...; the target tells the cell
    returns = sample.returns.copy()
    returns["depth"] = (returns["ring"].astype(int) + 1) * 256
    cells = np.arange(1, sample.target.size + 1, dtype=np.float32).reshape(sample.target.shape)
    sample = replace(sample, returns=returns, target=cells)
    _, depth, target = random_example(sample, CROP, np.random.default_rng(seed))
    rings = np.unique(depth[depth > 0].numpy()) - 1
    assert any(len(np.unique(rings % step)) <= 1 for step in (2, 4, 8))
    # each is where that ring has a return; in a mirrored crop, too
    row, column = np.divmod(target[0].numpy().astype(int) - 1, 120)
    own = {(r["row"] // 2, r["column"] // 2, r["ring"]) for r in returns}
    asked = zip(row.ravel(), column.ravel(), depth.numpy().ravel(), strict=True)
    assert all((v, u, d - 1) in own for v, u, d in asked if d > 0)


@given(seed=st.integers(0, 2**32 - 1))
@settings(max_examples=25, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
def test_image_and_target_are_aligned(pack: Pack, seed: int) -> None:
    sample = pack[0]
    target = np.arange(1, sample.target.size + 1, dtype=np.float32).reshape(sample.target.shape)
    grey = np.repeat(np.arange(120, dtype=np.uint8)[None, :, None] + 60, 40, axis=0) * np.ones(3, np.uint8)
    image, _, cells = random_example(replace(sample, image=grey, target=target), CROP, np.random.default_rng(seed))
    assert image.shape == (3, *CROP)
    known = (cells[0] > 0).all(dim=1).numpy()  # rows near returns
    assert known.any()
    column = (cells[0].numpy()[known].astype(int) - 1) % 120
    steps = np.diff(column, axis=1)
    assert (steps == steps[0, 0]).all()
    assert abs(steps[0, 0]) == 1
    brighter = np.diff(image[0].numpy()[known], axis=1)  # to the right in the image, whatever the light
    assert (brighter * steps >= 0).all()
    assert (brighter != 0).any()


def test_examples_depend_on_seed_and_number_only(pack: Pack) -> None:
    whole, rest = TrainingImages([pack], CROP, 7, 0, 8), TrainingImages([pack], CROP, 7, 5, 3)
    for number in range(3):
        for one, other in zip(whole[5 + number], rest[number], strict=True):
            np.testing.assert_array_equal(one, other)
    other_seed = TrainingImages([pack], CROP, 8, 0, 8)
    assert any((one.image != other.image).any() for one, other in zip(whole, other_seed, strict=True))


def test_every_epoch_has_all_frames(pack: Pack, monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[int] = []
    monkeypatch.setattr(Pack, "__getitem__", lambda _, k: seen.append(k) or k)
    monkeypatch.setattr("enrichment.training.image_examples.random_example", lambda *_: Example(*(3 * [None])))  # type: ignore[list-item]
    examples = TrainingImages([pack], CROP, 0, 0, 9)
    for index in range(9):
        examples[index]
    assert [sorted(seen[turn : turn + 3]) for turn in (0, 3, 6)] == [[0, 1, 2]] * 3
    assert len({tuple(seen[turn : turn + 3]) for turn in (0, 3, 6)}) > 1


def test_validation_keeps_every_fourth_ring_of_the_whole_image(pack: Pack) -> None:
    image, depth, target = ValidationImages([pack])[1]
    assert image.shape == (3, 40, 120)
    np.testing.assert_array_equal(depth[0], sparse(pack[1], WHOLE, 4, 0))
    np.testing.assert_array_equal(target[0], pack[1].target)


def test_crops_larger_than_images_are_an_error(pack: Pack) -> None:
    require_crop([pack], (40, 120))
    with pytest.raises(InputError, match=r"images of 40x120 at scale 0\.5; choose a --crop"):
        require_crop([pack], (41, 120))
