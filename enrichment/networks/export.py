"""Export of a trained network: ONNX for running it, safetensors for further training."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
import onnx
import torch
from safetensors import SafetensorError
from safetensors.torch import load_file, save_file
from torch import Tensor, nn

from enrichment.lift import channels
from enrichment.lift.network import ASIDE, Lift, sizes_of
from enrichment.networks.depth_network import DepthNetwork
from slam.data.atomic import written_beside
from slam.data.errors import InputError

OPSET = 18
EXAMPLE = 37, 50  # height and width for tracing; both stay dynamic
FREE = {2: "height", 3: "width"}
LIFT_EXAMPLE = 5, 7, 96  # rings, rows and columns of Lift for tracing; all stay dynamic
RAY_INPUTS, ANSWERS = ("between", "upper", "rays", "candidates"), ["ranges", "scale", "valid"]


def export(network: DepthNetwork, folder: Path, name: str, scale: float = 1.0) -> None:
    """Write a depth completion network as NAME.onnx and NAME.safetensors.

    The ONNX file maps `image` (1, 3, H, W) and `depth` (1, 1, H, W) to `dense` (1, 1, H, W) as `DepthNetwork.forward`,
    for any H and W. A network that does not use the image has no such input. The metadata of both files are `scale`
    and those of `write_weights`.

    Args:
        network: The trained network.
        folder: Folder of the files.
        name: Name of the files.
        scale: Cells per pixel of the network's images.

    Raises:
        InputError: The files cannot be written.
    """
    given = {"image": torch.rand(1, 3, *EXAMPLE), "depth": torch.rand(1, 1, *EXAMPLE)}
    about = write_weights(network, folder, name, {"scale": repr(scale)})
    axes = dict.fromkeys([*given, "dense"], FREE)
    write_graph(network, folder / f"{name}.onnx", about, given, ["dense"], axes)


def export_lift(network: Lift, folder: Path, name: str = "lift") -> None:
    """Write Lift as NAME.onnx, NAME_rays.onnx and NAME.safetensors.

    NAME.onnx maps `rings` to `between` as `Lift.between`, and NAME_rays.onnx maps `between`, `upper`, `rays` and
    `candidates` to `ranges`, `scale` and `valid` as `Lift.along_rays`, for any number of rings, rows and columns (a
    multiple of 8). The second can thus run on a few rows at a time.

    Raises:
        InputError: The files cannot be written.
    """
    rings, rows, columns = LIFT_EXAMPLE
    hidden = network.sizes.hidden
    images = {"rings": (channels.RINGS, rings, columns), "between": (hidden, rings - 1, columns + 2 * ASIDE)}
    images |= {"rays": (channels.RAYS, rows, columns), "candidates": (channels.CANDIDATES, rows, columns)}
    given = {key: torch.rand(1, *shape) for key, shape in images.items()}
    given["upper"] = torch.arange(rows) % (rings - 1)
    free = {2: "rows", 3: "columns"}
    axes = {"rings": {2: "rings", 3: "columns"}, "between": {2: "gaps", 3: "more columns"}, "upper": {0: "rows"}}
    axes |= {"rays": free, "candidates": free}
    axes |= {answer: {1: "rows", 2: "columns"} for answer in ANSWERS}
    about = write_weights(network, folder, name, {})

    def along_rays(*given: Tensor) -> tuple[Tensor, ...]:
        return network.along_rays(*given)[: len(ANSWERS)]  # without the logits, which only training needs

    parts = (("", network.between, ("rings",), ["between"]), ("_rays", along_rays, RAY_INPUTS, ANSWERS))
    for suffix, part, inputs, answers in parts:
        own = {key: axes[key] for key in (*inputs, *answers)}
        path, examples = folder / f"{name}{suffix}.onnx", {key: given[key] for key in inputs}
        write_graph(_Part(network, part).train(network.training), path, about, examples, answers, own)


class _Part(nn.Module):
    """A part of Lift as a network of its own."""

    def __init__(self, network: Lift, part: Callable[..., Tensor | tuple[Tensor, ...]]) -> None:
        super().__init__()
        self.network, self.part = network, part

    def forward(self, *given: Tensor) -> Tensor | tuple[Tensor, ...]:
        return self.part(*given)


def write_weights(network: nn.Module, folder: Path, name: str, about: dict[str, str]) -> dict[str, str]:
    """Write NAME.safetensors, and return its metadata: `about`, the network's name and the number of its parameters.

    Weights of convolutions are stored in half precision, and the network is rounded to the stored values, so that all
    files and the network itself give the same depth. Computations are in single precision.
    """
    _round(network)
    about = {"network": name, "parameters": str(sum(values.numel() for values in network.parameters())), **about}
    state = {key: value.detach().cpu() for key, value in network.state_dict().items()}
    with written_beside(folder / f"{name}.safetensors") as temporary:
        save_file({key: _stored(value.contiguous()) for key, value in state.items()}, temporary, about)
    return about


def write_graph(
    network: nn.Module,
    path: Path,
    about: dict[str, str],
    given: dict[str, Tensor],
    answers: list[str],
    axes: dict[str, dict[int, str]],
) -> None:
    """Write a network whose weights are rounded as ONNX, in evaluation mode, without dropout.

    Args:
        network: The network.
        path: The file.
        about: Metadata.
        given: Example inputs by name.
        answers: Names of the outputs.
        axes: Dynamic axes of inputs and outputs.
    """
    with written_beside(path) as temporary:
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
    """The values as stored; biases and batch normalisation, which are few, keep single precision."""
    return values.half() if values.is_floating_point() and values.dim() > 1 else values


def _halve(graph: onnx.GraphProto) -> None:
    """Store weights of convolutions in half precision, each with a cast that ONNX Runtime runs once."""
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
    """Write ONNX by tracing: the exporter of `dynamo=True` takes 20 s instead of one, and gives the same graph."""
    training, device = network.training, next(network.parameters()).device
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)
            torch.onnx.export(
                network.eval(), tuple(values.to(device) for values in given.values()), str(path), dynamo=False,
                opset_version=OPSET, do_constant_folding=False,
                training=torch.onnx.TrainingMode.PRESERVE,  # batch normalisation is not fused with rounded weights
                input_names=list(given), output_names=answers, dynamic_axes=axes,
            )  # fmt: skip
    finally:
        network.train(training)


def load_lift(path: Path) -> Lift:
    """Return Lift, of whatever sizes, with the weights of a .safetensors file, in evaluation mode.

    Raises:
        InputError: They are not weights of Lift.
    """
    try:
        network = Lift(sizes_of(load_file(path)))
    except (OSError, SafetensorError, KeyError, ValueError, RuntimeError) as error:
        raise InputError(
            f"{path}: not the weights of Lift ({' '.join(str(error).split())}); give another file"
        ) from error
    load_weights(network, path)
    return network.eval()


def load_weights(network: nn.Module, path: Path) -> None:
    """Load weights from a .safetensors file into a network of the same kind.

    Raises:
        InputError: The weights do not fit.
    """
    try:
        network.load_state_dict(load_file(path))
    except (OSError, SafetensorError, RuntimeError) as error:
        raise InputError(
            f"{path}: not the weights of {type(network).__name__} ({' '.join(str(error).split())}); give another file"
        ) from error
