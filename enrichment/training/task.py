"""Interface between the training loop and a kind of network: examples, loss, figures, export."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, Protocol

from torch import Tensor, nn
from torch.utils.data import Dataset

from enrichment.training.checkpoint import Figures
from enrichment.training.plan import Plan


class Task(Protocol):
    """One kind of network and the data it is trained on."""

    @property
    def clip(self) -> float | None:
        """Maximum norm of the gradient; None: no limit."""

    @property
    def collate(self) -> Callable[[list[Any]], Any] | None:
        """Function that builds a batch of examples; None: that of PyTorch."""

    @property
    def digest(self) -> str:
        """Digest of the data; a training can be resumed on the same data only."""

    @property
    def validated(self) -> bool:
        """Whether there are validation data."""

    def network(self, model: str) -> nn.Module:
        """Create an untrained network, with random weights from torch's global generator."""

    def training_examples(self, plan: Plan, first: int, count: int) -> Dataset[Any]:
        """Return `count` training examples from number `first` on; each depends on the plan's seed and its number."""

    def validation_examples(self) -> Dataset[Any]:
        """Return the validation examples."""

    def loss(self, network: nn.Module, batch: Any, plan: Plan) -> Tensor:
        """Compute the loss of a batch."""

    def errors(self, network: nn.Module, batch: Any) -> tuple[Tensor, Tensor]:
        """Compute MAE and RMSE [m] of a batch of one example, where the input does not contain the target."""

    def export(self, network: nn.Module, folder: Path, name: str) -> None:
        """Write NAME.onnx, with more such files if the network has several parts, and NAME.safetensors.

        Raises:
            InputError: The files cannot be written.
        """

    def card(self, plan: Plan, step: int, best: Figures | None, parameters: int, command: str) -> str:
        """Return the model card of the weights after `step` steps, in Markdown."""
