"""Rays in packets: the hit of a ray does not depend on the other rays."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from slam.data.cloud import Array
from slam.data.errors import InputError
from slam.simulation.casting import embree, open3d_rays
from slam.simulation.casting.embree import TriangleScene

if not embree.has_packets():
    pytest.skip("embreex is not installed, or this CPU has no AVX", allow_module_level=True)
caster = import_module("slam.simulation.casting.caster")  # which cannot be imported without embreex
EYE = np.array([0.0, 0.0, 1.0])


def sheets(count: int, seed: int) -> tuple[Array, Array]:
    """Triangles that overlap in one slanted plane: wherever a ray meets one of them, it meets others there."""
    rng = np.random.default_rng(seed)
    places = rng.uniform(-20, 20, (count, 3, 2))
    vertices = np.concatenate([places[..., :1], places[..., 1:], 5 + 0.3 * places[..., :1]], axis=-1)
    return vertices.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3)


def fan_of_rays(count: int) -> Array:
    angle = np.linspace(-1, 1, count)
    return np.column_stack([angle, 0.4 * np.sin(7 * angle), np.ones(count)]).astype(np.float32)


def test_rays_meet_alone_what_they_meet_beside_others() -> None:
    casting, rays = caster.RayCaster([TriangleScene(*sheets(60, 1))], np.zeros(3)), fan_of_rays(403)
    together = casting.cast(EYE, rays)
    alone = [casting.cast(EYE, ray[None]) for ray in rays]
    shuffled = casting.cast(EYE, rays, np.random.default_rng(2).permutation(len(rays)).astype(np.int32))
    assert (together[1] >= 0).mean() > 0.9
    assert len(set(together[1])) > 10
    one_by_one = [np.concatenate([found[field] for found in alone]) for field in range(3)]
    for other in (one_by_one, shuffled):
        same = together[1] == other[1]
        assert same.mean() > 0.99  # rounding may take one in many to the next sheet; in packets alone a third would go
        for field in (0, 2):
            np.testing.assert_allclose(together[field][same], other[field][same], rtol=1e-5, atol=1e-5)


@pytest.mark.parametrize("rays", [caster, open3d_rays])
def test_the_nearest_of_several_scenes_is_met_and_triangles_are_numbered_through(rays: ModuleType) -> None:
    low, high = (np.array([(-9, -9, z), (9, -9, z), (0, 20, z)], float) for z in (3.0, 7.0))
    triangle = np.array([[0, 1, 2]])
    for scenes, met in (((low, high), 0), ((high, low), 1)):
        found = rays.RayCaster([rays.TriangleScene(vertices, triangle) for vertices in scenes], np.zeros(3))
        reach, number, normal = found.cast(EYE, np.array([(0, 0, 1), (0, 0, -1)], np.float32))
        np.testing.assert_allclose(reach, [2, np.inf], rtol=1e-5)
        assert number.tolist() == [met, -1]
        np.testing.assert_allclose(np.abs(normal), [(0, 0, 1), (0, 0, 0)], atol=1e-6)
        assert found.hidden(EYE, np.array([(0, 0, 1), (0, 0, -1)], np.float32)).tolist() == [True, False]


def test_open3d_meets_the_same() -> None:
    vertices, triangles = sheets(60, 1)
    vertices[:, 2] += np.repeat(0.05 * np.arange(60), 3)  # none equally far
    found = [rays.RayCaster([rays.TriangleScene(vertices, triangles)], np.zeros(3)) for rays in (caster, open3d_rays)]
    (reach, number, normal), other = (each.cast(EYE, fan_of_rays(400)) for each in found)
    assert (number != other[1]).mean() < 0.01  # rays along an edge
    same = number == other[1]
    np.testing.assert_allclose(reach[same], other[0][same], rtol=1e-5)
    np.testing.assert_allclose(normal[same], other[2][same], atol=1e-5)
    hidden = [each.hidden(EYE, fan_of_rays(400)) for each in found]
    assert (hidden[0] != hidden[1]).mean() < 0.01


@pytest.mark.parametrize("rays", [caster, open3d_rays])
def test_a_scene_is_cast_around_its_centre(rays: ModuleType) -> None:
    centre = np.array([4.0e5, 5.0e6, 100.0])  # as far as UTM is from its origin: float32 would be off by decimetres
    vertices = np.array([(-9, -9, 3), (9, -9, 3), (0, 20, 3.0)])
    found = rays.RayCaster([rays.TriangleScene(vertices, np.array([[0, 1, 2]]))], centre)
    reach, _, _ = found.cast(centre + EYE, np.array([(0, 0, 1)], np.float32))
    np.testing.assert_allclose(reach, [2], atol=1e-5)


@pytest.mark.parametrize("rays", [caster, open3d_rays])
def test_without_rays_nothing_is_met(rays: ModuleType) -> None:
    found = rays.RayCaster([rays.TriangleScene(*sheets(3, 0))], np.zeros(3))
    assert [len(part) for part in found.cast(EYE, np.zeros((0, 3), np.float32))] == [0, 0, 0]
    assert len(found.hidden(EYE, np.zeros((0, 3), np.float32))) == 0


def test_without_embreex_or_avx_there_are_no_packets(monkeypatch: pytest.MonkeyPatch) -> None:
    assert embree.has_packets()
    old = type("Device", (), {"rtcGetDeviceProperty": staticmethod(lambda _, asked: int(asked != embree.NATIVE_RAY8))})
    monkeypatch.setattr(embree, "_embree", lambda: (old, 0))
    assert not embree.has_packets()
    monkeypatch.setattr(embree, "find_spec", lambda _: None)
    assert not embree.has_packets()


def test_where_embree_is_missing_the_error_says_what_to_do(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(embree, "find_spec", lambda _: None)
    with pytest.raises(InputError, match="pip install --force-reinstall embreex"):
        embree.library()


def test_the_library_is_found_beside_its_package() -> None:
    assert isinstance(embree.library(), Path)
    assert embree.library().is_file()
