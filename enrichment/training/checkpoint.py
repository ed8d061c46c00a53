"""Checkpoint of a training, as safetensors: data only, nothing that could be executed."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, replace
from pathlib import Path

from safetensors import SafetensorError, safe_open
from safetensors.torch import save_file
from torch import Tensor, nn
from torch.optim import Optimizer

from enrichment.training.plan import Plan
from slam.data.atomic import written_beside
from slam.data.errors import InputError

CHECKPOINT, BEST = "checkpoint.safetensors", "best.safetensors"  # files in the folder of a training
NETWORK, OPTIMIZER = "network.", "optimizer."  # prefixes of the names of tensors


@dataclass(frozen=True)
class Figures:
    """Figures of a validation, averaged over images.

    Attributes:
        step: Number of steps trained.
        mae: Mean absolute error [m].
        rmse: Root mean square error [m].
    """

    step: int
    mae: float
    rmse: float


@dataclass(frozen=True, eq=False)
class Checkpoint:
    """State of a training.

    Attributes:
        plan: Settings of the training.
        data: Digest of the training data.
        step: Number of steps trained.
        best: Validation with the smallest MAE so far; None without any.
        tensors: Tensors of the network, NETWORK + name, and of the optimiser, OPTIMIZER + NUMBER.NAME.
    """

    plan: Plan
    data: str
    step: int
    best: Figures | None
    tensors: dict[str, Tensor]

    @property
    def weights(self) -> dict[str, Tensor]:
        """State of the network."""
        return {name.removeprefix(NETWORK): value for name, value in self.tensors.items() if name.startswith(NETWORK)}

    def write(self, path: Path) -> None:
        """Write the checkpoint atomically."""
        about = {"plan": asdict(self.plan), "data": self.data, "step": self.step}
        about["best"] = None if self.best is None else asdict(self.best)
        tensors = {name: tensor.contiguous() for name, tensor in self.tensors.items()}
        with written_beside(path) as temporary:
            save_file(tensors, temporary, {"about": json.dumps(about)})

    def require(self, plan: Plan, data: str, path: Path) -> None:
        """Check that this is a checkpoint of the same training; only the number of steps may differ.

        Raises:
            InputError: The plan or the data differ.
        """
        if replace(self.plan, steps=plan.steps) != plan:
            differing = [name for name, value in asdict(plan).items() if asdict(self.plan)[name] != value]
            names = " and ".join(name for name in differing if name != "steps")
            raise InputError(f"{path}: of a training with another {names}; use the same, or choose another --out")
        if self.data != data:
            raise InputError(f"{path}: of a training on other data; use the same, or choose another --out")

    def restore(self, network: nn.Module, optimizer: Optimizer) -> None:
        """Load the weights and the state of the optimiser into those of the same network."""
        network.load_state_dict(self.weights)
        state: dict[int, dict[str, Tensor]] = {}
        for name, value in self.tensors.items():
            if name.startswith(OPTIMIZER):
                number, key = name.removeprefix(OPTIMIZER).split(".")
                state.setdefault(int(number), {})[key] = value
        optimizer.load_state_dict({**optimizer.state_dict(), "state": state})


def tensors_of(network: nn.Module, optimizer: Optimizer) -> dict[str, Tensor]:
    """Return the tensors that `Checkpoint.restore` needs."""
    tensors = {NETWORK + name: value.detach() for name, value in network.state_dict().items()}
    for number, values in optimizer.state_dict()["state"].items():
        tensors.update({f"{OPTIMIZER}{number}.{key}": value for key, value in values.items()})
    return tensors


def read_checkpoint(path: Path) -> Checkpoint:
    """Read a checkpoint.

    Raises:
        InputError: The file is not a checkpoint.
    """
    try:
        with safe_open(path, "pt") as file:
            about = json.loads(file.metadata()["about"])
            tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118  # it is no dict
        plan = Plan(**{**about["plan"], "crop": tuple(about["plan"]["crop"])})
        best = None if about["best"] is None else Figures(**about["best"])
        return Checkpoint(plan, about["data"], about["step"], best, tensors)
    except (OSError, SafetensorError, KeyError, TypeError, ValueError) as error:
        fault = " ".join(str(error).split())
        raise InputError(f"{path}: not a checkpoint ({fault}); start a new training in another --out") from error
