"""Packs: what goes in comes out, once packed they stay, and damaged ones are told."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from enrichment.training.pack import Pack, packed
from enrichment.training.samples import Source
from slam.data.errors import InputError


def test_samples_are_packed_and_unpacked(sequence: Any, tmp_path: Path) -> None:
    samples = [sample for sample in Source(sequence, sequence.ground_truth) if sample is not None]
    packed(tmp_path / "a.npz", [Source(sequence, sequence.ground_truth)])
    pack = Pack(tmp_path / "a.npz")
    assert len(pack) == len(samples) == 3
    for index, sample in enumerate(samples):
        again = pack[index]
        np.testing.assert_array_equal(again.returns, sample.returns)
        np.testing.assert_array_equal(again.target, sample.target)
        assert np.abs(again.image.astype(int) - sample.image).mean() < 6  # colours alone lose anything
        assert (again.scale, again.ring_step) == (0.5, 4)


def test_a_pack_holds_several_sequences(sequence: Any, tmp_path: Path) -> None:
    class Another(type(sequence)):  # type: ignore[misc]
        name = "another"

    other = Another(tmp_path, sequence.clouds[:2], without_image=frozenset({0}), name="another")
    seen: list[None] = []
    pack = packed(tmp_path / "a.npz", [Source(sequence), Source(other)], lambda: seen.append(None))
    assert [(entry.name, entry.frames) for entry in pack.sequences] == [("street", (10, 11, 12)), ("another", (11,))]
    assert pack.sequences[0].target == "returns of the scan"
    assert len(pack) == 4
    assert len(seen) == 5
    np.testing.assert_array_equal(pack[3].returns, pack[1].returns)


def test_a_pack_is_written_once(sequence: Any, tmp_path: Path) -> None:
    path, seen = tmp_path / "a.npz", list[None]()
    packed(path, [Source(sequence)])
    assert len(packed(path, [Source(sequence)], lambda: seen.append(None))) == 3
    assert not seen
    with pytest.raises(InputError, match=r"a\.npz: packed from other sequences or settings"):
        packed(path, [Source(sequence, scale=1.0)])


def test_a_sequence_without_images_is_an_error(sequence: Any, tmp_path: Path) -> None:
    sequence.without_image = frozenset({0, 1, 2})
    with pytest.raises(InputError, match="no frame has both an image"):
        packed(tmp_path / "a.npz", [Source(sequence)])
    assert not (tmp_path / "a.npz").exists()


@pytest.mark.parametrize("content", [b"", b"no pack", "cut", "pickle", "plain"])
def test_other_files_are_an_error(pack: Pack, tmp_path: Path, content: bytes | str) -> None:
    path = tmp_path / "other.npz"
    if isinstance(content, bytes):
        path.write_bytes(content)
    elif content == "cut":
        path.write_bytes(pack.path.read_bytes()[:-3000])
    else:
        array = np.array([{}], object) if content == "pickle" else np.zeros(3)
        np.savez(path, about=array)
    with pytest.raises(InputError, match=r"other\.npz: not a pack of version"):
        Pack(path)


def test_a_missing_pack_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such file"):
        Pack(tmp_path / "none.npz")
