"""Objects as plain data, and the file that holds them."""

from __future__ import annotations

import io
import json
import math
import zipfile
from collections import deque
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial import cKDTree

from slam.data.cloud import PointCloud
from slam.data.errors import InputError
from slam.data.problem import Problem
from slam.journal.state import Frozen, StateError, freeze, thaw
from slam.journal.state_file import read_state, write_state
from slam.settings import OdometrySettings

plain = st.recursive(
    st.none() | st.booleans() | st.integers(-(1 << 40), 1 << 40) | st.floats(allow_nan=False) | st.text(),
    lambda inner: st.lists(inner) | st.tuples(inner, inner) | st.dictionaries(st.text() | st.integers(), inner),
    max_leaves=20,
)


@given(value=plain)
def test_plain_values_survive(value: Any) -> None:
    frozen = freeze(value)
    text = json.dumps([frozen.root, frozen.nodes])
    assert thaw(Frozen(*json.loads(text), frozen.arrays)) == value


def test_objects_share_what_they_shared(tmp_path: Path) -> None:
    centre = np.arange(3.0)
    cloud = PointCloud(np.ones((4, 3)), np.zeros(4))
    value = {"both": (centre, centre), "recent": deque([(cloud, centre)], maxlen=5), "nan": math.nan}
    write_state(tmp_path / "state.npz", {"frames": 4}, {"all": freeze(value)})
    centre[:] = 7  # a frozen value does not change any more
    about, parts = read_state(tmp_path / "state.npz")
    found = thaw(parts["all"])
    assert about == {"frames": 4}
    first, second = found["both"]
    assert first is second is found["recent"][0][1]
    assert first.tolist() == [0, 1, 2]
    assert found["recent"].maxlen == 5
    assert isinstance(found["recent"][0][0], PointCloud)
    assert found["recent"][0][0].xyz.tobytes() == cloud.xyz.tobytes()
    assert math.isnan(found["nan"])


def test_settings_and_trees() -> None:
    settings = OdometrySettings(cell_sizes=(1.2, 0.1))
    points = np.random.default_rng(1).normal(size=(50, 3))
    found = thaw(freeze([settings, cKDTree(points), Problem("kind", "message")]))
    assert found[0] == settings
    assert found[1].query(points[7])[1] == 7
    assert found[2] == Problem("kind", "message")


def test_arrays_keep_their_layout_and_scalars_their_type() -> None:
    base = np.arange(24.0).reshape(4, 6)
    fixed = np.arange(3)
    fixed.flags.writeable = False
    values = [base, base.T, base[:, 1:5:2], fixed, np.zeros((0, 3), np.float32), np.float32(0.1), np.array(2.0)]
    for value, found in zip(values, thaw(freeze(values)), strict=True):
        np.testing.assert_array_equal(found, value)
        assert type(found) is type(value)
        assert found.dtype == value.dtype
        if isinstance(value, np.ndarray):
            assert found.strides == value.strides
            assert found.flags.writeable == value.flags.writeable


@pytest.mark.parametrize("value", [object(), {1}, lambda: 0, Path(), np.array(["a"]), np.array([None]), io.BytesIO()])
def test_other_values_are_refused(value: Any) -> None:
    with pytest.raises(StateError, match="cannot be part of a snapshot"):
        freeze([value])


@pytest.mark.parametrize(
    "node",
    [
        ["object", "os:system", []],
        ["object", "slam.data.se3:np", []],
        ["object", "slam.data.cloud:PointCloud.__init__", []],
        ["object", "slam.nowhere:Thing", []],
        ["settings", "slam.data.cloud:PointCloud", "{}"],
        ["array", 3, True, None],
        ["list", [{"at": 99}]],
        ["__class__", 1],
        ["tuple", [{"at": 0}]],
        [],
    ],
)
def test_structures_that_lie_are_refused(node: list[Any]) -> None:
    with pytest.raises(StateError):
        thaw(Frozen({"at": 0}, [node], []))


def archive(path: Path, **entries: bytes) -> Path:
    with zipfile.ZipFile(path, "w") as file:
        for name, content in entries.items():
            file.writestr(f"{name}.npy", content)
    return path


def npy(values: Any, shape: tuple[int, ...] | None = None) -> bytes:
    file = io.BytesIO()
    np.lib.format.write_array_header_1_0(
        file, {"descr": values.dtype.str, "fortran_order": False, "shape": shape or values.shape}
    )
    return file.getvalue() + values.tobytes()


def test_state_files_that_lie_are_refused(tmp_path: Path) -> None:
    text = np.frombuffer(json.dumps({"about": {}, "parts": {}}).encode(), np.uint8)
    assert read_state(archive(tmp_path / "good.npz", structure=npy(text))) == ({}, {})
    big = npy(np.zeros(4), (1 << 40,))
    pickled = io.BytesIO()
    np.save(pickled, np.array([{}]), allow_pickle=True)
    for number, entries in enumerate(
        ({"structure": npy(text), "a.0": big}, {"structure": npy(text), "a.0": pickled.getvalue()}, {"a": npy(text)})
    ):
        with pytest.raises(InputError, match="missing or damaged"):
            read_state(archive(tmp_path / f"{number}.npz", **entries))
    with pytest.raises(InputError, match="missing or damaged"):
        read_state(tmp_path / "nothing.npz")


@given(place=st.floats(0, 1), byte=st.integers(0, 255), cut=st.booleans())
def test_damaged_state_files_are_errors(
    tmp_path_factory: pytest.TempPathFactory, place: float, byte: int, cut: bool
) -> None:
    path = tmp_path_factory.mktemp("state") / "state.npz"
    write_state(path, {"frames": 1}, {"all": freeze([np.arange(100.0), "text"])})
    content = bytearray(path.read_bytes())
    at = int(place * (len(content) - 1))
    if cut:
        del content[at:]
    else:
        content[at] = byte
    path.write_bytes(content)
    try:
        found = thaw(read_state(path)[1]["all"])
    except (InputError, StateError, KeyError):
        return
    assert found[0].tolist() == list(range(100))  # CRC-32 finds every changed byte of a value
    assert found[1] == "text"
