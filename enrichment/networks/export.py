"""A trained network to files: ONNX to run it, safetensors to train it further."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import onnx
import torch
from safetensors import SafetensorError
from safetensors.torch import load_file, save_file
from torch import Tensor, nn

from enrichment.lift import channels
from enrichment.lift.network import Lift
from enrichment.networks.depth_network import DepthNetwork
from slam.data.atomic import written_beside
from slam.data.errors import InputError

OPSET = 18
EXAMPLE = 37, 50  # height and width while it is traced; both stay free
FREE = {2: "height", 3: "width"}
LIFT_EXAMPLE = 5, 7, 96  # rings, rows and columns of Lift while it is traced; all stay free


def export(network: DepthNetwork, folder: Path, name: str, scale: float = 1.0) -> None:
    """Write NAME.onnx and NAME.safetensors, for images of `scale` cells a pixel. Raises InputError where it cannot.

    The ONNX file maps `image` (1, 3, H, W) and `depth` (1, 1, H, W) to `dense` (1, 1, H, W) as `DepthNetwork.forward`
    does, for any H and W. A network that does not look at the image has no such input. `scale` is in the metadata of
    both, beside what `write` puts there.
    """
    given = {"image": torch.rand(1, 3, *EXAMPLE), "depth": torch.rand(1, 1, *EXAMPLE)}
    write(network, folder, name, {"scale": repr(scale)}, given, ["dense"], dict.fromkeys([*given, "dense"], FREE))


def export_lift(network: Lift, folder: Path, name: str = "lift") -> None:
    """The same for Lift: `rings`, `upper`, `rays` and `candidates` to `ranges`, `scale` and `valid`, as its `forward`
    has them, for any number of rings, rows and columns (inside 8)."""
    rings, rows, columns = LIFT_EXAMPLE
    given = {
        "rings": torch.rand(1, channels.RINGS, rings, columns),
        "upper": torch.arange(rows) % (rings - 1),
        "rays": torch.rand(1, channels.RAYS, rows, columns),
        "candidates": torch.rand(1, channels.CANDIDATES, rows, columns),
    }
    free = {2: "rows", 3: "columns"}
    answers = ["ranges", "scale", "valid"]
    axes = {"rings": {2: "rings", 3: "columns"}, "upper": {0: "rows"}, "rays": free, "candidates": free}
    axes |= {name: {1: "rows", 2: "columns"} for name in answers}
    write(_Answers(network).train(network.training), folder, name, {}, given, answers, axes)


class _Answers(nn.Module):
    """Lift without the weights of its candidates, which only training needs."""

    def __init__(self, network: Lift) -> None:
        super().__init__()
        self.network = network

    def forward(self, rings: Tensor, upper: Tensor, rays: Tensor, candidates: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        ranges, scale, valid, _ = self.network(rings, upper, rays, candidates)
        return ranges, scale, valid


def write(
    network: nn.Module,
    folder: Path,
    name: str,
    about: dict[str, str],
    given: dict[str, Tensor],
    answers: list[str],
    axes: dict[str, dict[int, str]],
) -> None:
    """NAME.onnx and NAME.safetensors, without dropout and with batch normalisation's own means.

    given    an example of the inputs, by name
    answers  names of the outputs
    axes     those of inputs and outputs that stay free

    The metadata of both are `about`, the network's name and the number of its parameters. Convolutions' weights are
    stored in half precision, and the network is rounded to what is stored: both files and the network itself give the
    same depth. All computing is in single precision.
    """
    _round(network)
    parameters = sum(values.numel() for values in network.parameters())
    about = {"network": name, "parameters": str(parameters), **about}
    state = {key.removeprefix("network."): value.detach().cpu() for key, value in network.state_dict().items()}
    with written_beside(folder / f"{name}.safetensors") as temporary:
        save_file({key: _stored(value.contiguous()) for key, value in state.items()}, temporary, about)
    with written_beside(folder / f"{name}.onnx") as temporary:
        _write_onnx(network, temporary, given, answers, axes)
        model = onnx.load(temporary)
        _halve(model.graph)
        onnx.helper.set_model_props(model, about)
        onnx.save(model, temporary)


def _round(network: nn.Module) -> None:
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


def _write_onnx(
    network: nn.Module, path: Path, given: dict[str, Tensor], answers: list[str], axes: dict[str, dict[int, str]]
) -> None:
    """By tracing: the exporter behind `dynamo=True` takes 20 s for what this does in one, and gives the same graph."""
    training, device = network.training, next(network.parameters()).device
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)
            torch.onnx.export(
                network.eval(), tuple(values.to(device) for values in given.values()), str(path), dynamo=False,
                opset_version=OPSET, do_constant_folding=False,
                training=torch.onnx.TrainingMode.PRESERVE,  # batch normalisation stays apart from rounded weights
                input_names=list(given), output_names=answers, dynamic_axes=axes,
            )  # fmt: skip
    finally:
        network.train(training)


def load_weights(network: nn.Module, path: Path) -> None:
    """Weights from a .safetensors file into the network of the same kind. Raises InputError where they do not fit."""
    try:
        network.load_state_dict(load_file(path))
    except (OSError, SafetensorError, RuntimeError) as error:
        raise InputError(f"{path}: no weights of {type(network).__name__} ({' '.join(str(error).split())})") from error
