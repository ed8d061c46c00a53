"""A network's files: ONNX that computes the same, and weights that come back."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch
from onnxruntime import InferenceSession

from enrichment.networks.export import export, load_weights
from enrichment.networks.registry import NETWORKS
from slam.data.errors import InputError


@pytest.mark.parametrize("name", NETWORKS.names())
def test_onnx_agrees_with_torch_at_any_size(name: str, tmp_path: Path) -> None:
    torch.manual_seed(0)
    network = NETWORKS.load(name)()
    export(network, tmp_path, name, scale=0.5)
    assert network.training  # as it was before
    session = InferenceSession(tmp_path / f"{name}.onnx")
    assert session.get_modelmeta().custom_metadata_map == {
        "network": name,
        "scale": "0.5",
        "parameters": str(sum(values.numel() for values in network.parameters())),
    }
    for height, width in ((32, 48), (29, 61)):
        image, depth = torch.rand(1, 3, height, width), torch.rand(1, 1, height, width)
        given = {"image": image, "depth": torch.where(depth < 0.1, 500 * depth, 0)}
        with torch.no_grad():
            expected = network.eval()(**given).numpy()
        names = [entry.name for entry in session.get_inputs()]
        (dense,) = session.run(None, {name: given[name].numpy() for name in names})
        np.testing.assert_allclose(dense, expected, rtol=0, atol=1e-3)
    assert {path.name for path in tmp_path.iterdir()} == {f"{name}.onnx", f"{name}.safetensors"}


def test_weights_are_written_and_loaded(tmp_path: Path) -> None:
    one, other = NETWORKS.load("l2l")(), NETWORKS.load("l2l")()
    export(one, tmp_path, "mine")
    load_weights(other, tmp_path / "mine.safetensors")
    for name, value in one.state_dict().items():
        assert torch.equal(other.state_dict()[name], value)


def test_weights_of_another_network_are_an_error(tmp_path: Path) -> None:
    export(NETWORKS.load("l2l")(), tmp_path, "mine")
    with pytest.raises(InputError, match=r"mine\.safetensors: not the weights of F2L"):
        load_weights(NETWORKS.load("f2l")(), tmp_path / "mine.safetensors")


@pytest.mark.parametrize("content", [None, b"nothing of the kind"])
def test_invalid_weight_files_are_an_error(content: bytes | None, tmp_path: Path) -> None:
    path = tmp_path / "weights.safetensors"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(InputError, match=r"weights\.safetensors: not the weights of L2L"):
        load_weights(NETWORKS.load("l2l")(), path)
