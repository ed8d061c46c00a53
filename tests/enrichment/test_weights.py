"""The weights that are shipped: whole, small, with their cards, and the same in both of their files."""

from __future__ import annotations

import numpy as np
import onnxruntime
import pytest
import torch

from enrichment.lift.channels import CANDIDATES, RAYS, RINGS
from enrichment.methods.onnx_network import WEIGHTS
from enrichment.methods.registry import LIFT, NETWORK_METHODS, runnable
from enrichment.networks.export import load_lift, load_weights
from enrichment.networks.registry import NETWORKS

MOST = 25e6  # bytes, all networks together


def test_each_network_has_both_files_and_a_card() -> None:
    names = [LIFT, *NETWORK_METHODS]
    assert set(names) <= set(runnable())
    for name in names:
        assert (WEIGHTS / f"{name}.safetensors").is_file()
        card = (WEIGHTS / f"{name}.md").read_text()
        for heading in ("## Data", "## Training", "## Figures", "## Licence"):
            assert heading in card
        assert f"lidarlift train {name if name == LIFT else f'depth {name}'} " in card
        assert "non-commercial use only" in card
        assert "KITTI odometry 04" not in card  # the drives for tests
        assert name == LIFT or "drive_0005" not in card


def test_weight_files_are_small() -> None:
    assert sum(len(file.read_bytes()) for file in WEIGHTS.iterdir()) < MOST


@pytest.mark.parametrize("name", NETWORK_METHODS)
def test_onnx_agrees_with_torch(name: str) -> None:
    """To a millimetre, of a scene with sparse depths of up to 60 m."""
    generator = torch.Generator().manual_seed(0)
    image, depth = (torch.rand(1, channels, 96, 160, generator=generator) for channels in (3, 1))
    given = {"image": image, "depth": torch.where(depth < 0.05, 1200 * depth, 0)}
    network = NETWORKS.load(name)().eval()
    load_weights(network, WEIGHTS / f"{name}.safetensors")  # type: ignore[arg-type]  # a path, installed unpacked
    with torch.no_grad():
        expected = network(**given).numpy()
    session = onnxruntime.InferenceSession((WEIGHTS / f"{name}.onnx").read_bytes())
    inputs = [entry.name for entry in session.get_inputs()]
    (dense,) = session.run(None, {key: given[key].numpy() for key in inputs})
    assert expected.std() > 1
    np.testing.assert_allclose(dense, expected, rtol=0, atol=1e-3)


def test_lift_onnx_agrees_with_torch() -> None:
    """Candidates of ray segments, in place of a scan."""
    generator = torch.Generator().manual_seed(0)
    rays = torch.rand(1, RAYS, 45, 96, generator=generator)
    candidates = 5 + 40 * torch.rand(1, CANDIDATES, 45, 96, generator=generator)
    rings, upper = torch.rand(1, RINGS, 16, 96, generator=generator), torch.arange(45) // 3
    network = load_lift(WEIGHTS / "lift.safetensors")  # type: ignore[arg-type]
    with torch.no_grad():
        expected = network(rings, upper, rays, candidates)
    over_rings, along_rays = (
        onnxruntime.InferenceSession((WEIGHTS / f"{name}.onnx").read_bytes()) for name in ("lift", "lift_rays")
    )
    (between,) = over_rings.run(None, {"rings": rings.numpy()})
    given = {"upper": upper, "rays": rays, "candidates": candidates}
    known = {"between": between} | {name: values.numpy() for name, values in given.items()}
    ranges, scale, _ = along_rays.run(None, known)
    np.testing.assert_allclose(ranges, expected.ranges.numpy(), rtol=0, atol=1e-3)
    np.testing.assert_allclose(scale, expected.scale.numpy(), rtol=1e-3, atol=1e-3)
