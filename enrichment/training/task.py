"""What the training loop has to know of a network: where its examples are from, and what it shall make small."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, Protocol

from torch import Tensor, nn
from torch.utils.data import Dataset

from enrichment.training.checkpoint import Figures
from enrichment.training.plan import Plan


class Task(Protocol):
    """One kind of network and the data it is trained on.

    digest     what the data are, in a word: a training is resumed on the same alone
    validated  whether there is anything to validate on
    clip       most that the gradient's norm may be; None for whatever it is
    collate    makes a batch of examples; None for PyTorch's own way
    """

    @property
    def clip(self) -> float | None: ...
    @property
    def collate(self) -> Callable[[list[Any]], Any] | None: ...
    @property
    def digest(self) -> str: ...
    @property
    def validated(self) -> bool: ...

    def network(self, model: str) -> nn.Module:
        """An untrained one, with weights drawn from torch's own generator."""

    def training_examples(self, plan: Plan, first: int, count: int) -> Dataset[Any]:
        """`count` examples to train on, from number `first` on; each follows from the plan's seed and its number."""

    def validation_examples(self) -> Dataset[Any]:
        """The examples to validate on."""

    def loss(self, network: nn.Module, batch: Any, plan: Plan) -> Tensor: ...

    def errors(self, network: nn.Module, batch: Any) -> tuple[Tensor, Tensor]:
        """MAE and RMSE [m] of a batch of one, where the input does not have the answer."""

    def export(self, network: nn.Module, folder: Path, name: str) -> None:
        """Write NAME.onnx and NAME.safetensors. Raises InputError where it cannot."""

    def card(self, plan: Plan, step: int, best: Figures | None, parameters: int, command: str) -> str:
        """The model card, Markdown, of the weights after `step` steps."""
