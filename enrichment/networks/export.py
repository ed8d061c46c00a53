"""A trained network to files: ONNX to run it, safetensors to train it further."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import onnx
import torch
from safetensors import SafetensorError
from safetensors.torch import load_file, save_file
from torch import Tensor

from enrichment.networks.depth_network import DepthNetwork
from slam.data.atomic import written_beside
from slam.data.errors import InputError

OPSET = 18
EXAMPLE = 37, 50  # height and width while it is traced; both stay free
FREE = {2: "height", 3: "width"}


def export(network: DepthNetwork, folder: Path, name: str, scale: float = 1.0) -> None:
    """Write NAME.onnx and NAME.safetensors, for images of `scale` cells a pixel. Raises InputError where it cannot.

    The ONNX file maps `image` (1, 3, H, W) and `depth` (1, 1, H, W) to `dense` (1, 1, H, W) as `DepthNetwork.forward`
    does, for any H and W, without dropout and with batch normalisation's own means. A network that does not look at the
    image has no such input. `scale` is in the metadata of both, and so is the number of parameters.

    Convolutions' weights are stored in half precision, and the network is rounded to what is stored: both files and
    the network itself give the same depth. All computing is in single precision.
    """
    _round(network)
    parameters = sum(values.numel() for values in network.parameters())
    about = {"network": name, "scale": repr(scale), "parameters": str(parameters)}
    weights = {key: _stored(value.detach().cpu().contiguous()) for key, value in network.state_dict().items()}
    with written_beside(folder / f"{name}.safetensors") as temporary:
        save_file(weights, temporary, about)
    with written_beside(folder / f"{name}.onnx") as temporary:
        _write_onnx(network, temporary)
        model = onnx.load(temporary)
        _halve(model.graph)
        onnx.helper.set_model_props(model, about)
        onnx.save(model, temporary)


def _round(network: DepthNetwork) -> None:
    with torch.no_grad():
        for value in network.state_dict().values():
            value.copy_(_stored(value))


def _stored(values: Tensor) -> Tensor:
    """Biases, and what batch normalisation has, stay as they are: they are few."""
    return values.half() if values.is_floating_point() and values.dim() > 1 else values


def _halve(graph: onnx.GraphProto) -> None:
    """Let convolutions' weights be stored in half precision, each with a cast that ONNX Runtime does once."""
    casts = []
    for weights in graph.initializer:
        if weights.data_type == onnx.TensorProto.FLOAT and len(weights.dims) > 1:
            values, name = onnx.numpy_helper.to_array(weights), weights.name
            weights.CopyFrom(onnx.numpy_helper.from_array(values.astype(np.float16), f"{name}.half"))
            casts.append(onnx.helper.make_node("Cast", [f"{name}.half"], [name], to=onnx.TensorProto.FLOAT))
    nodes = [*casts, *graph.node]
    graph.ClearField("node")
    graph.node.extend(nodes)


def _write_onnx(network: DepthNetwork, path: Path) -> None:
    """By tracing: the exporter behind `dynamo=True` takes 20 s for what this does in one, and gives the same graph."""
    training = network.training
    example = tuple(torch.rand(1, channels, *EXAMPLE, device=next(network.parameters()).device) for channels in (3, 1))
    names = ["image", "depth"]
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)
            torch.onnx.export(
                network.eval(), example, str(path), dynamo=False, opset_version=OPSET, do_constant_folding=False,
                training=torch.onnx.TrainingMode.PRESERVE,  # batch normalisation stays apart from rounded weights
                input_names=names, output_names=["dense"], dynamic_axes=dict.fromkeys([*names, "dense"], FREE),
            )  # fmt: skip
    finally:
        network.train(training)


def load_weights(network: DepthNetwork, path: Path) -> None:
    """Weights from a .safetensors file into the network of the same kind. Raises InputError where they do not fit."""
    try:
        network.load_state_dict(load_file(path))
    except (OSError, SafetensorError, RuntimeError) as error:
        raise InputError(f"{path}: no weights of {type(network).__name__} ({' '.join(str(error).split())})") from error
