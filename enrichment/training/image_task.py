"""Training task of the paper's networks: depth completion on packs of frames with a camera."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from torch import Tensor, nn

from enrichment.networks.depth_network import DepthNetwork
from enrichment.networks.export import export
from enrichment.networks.loss import depth_loss
from enrichment.networks.registry import NETWORKS
from enrichment.training.checkpoint import Figures
from enrichment.training.image_examples import Example, TrainingImages, ValidationImages
from enrichment.training.model_card import model_card
from enrichment.training.pack import Pack
from enrichment.training.plan import Plan


@dataclass(frozen=True)
class ImageTask:
    """A `Task` for depth completion networks.

    Attributes:
        packs: Packs for training, all of the same scale.
        validation: Packs for validation, of the same scale.
    """

    packs: Sequence[Pack]
    validation: Sequence[Pack]
    clip = None
    collate = None

    @property
    def digest(self) -> str:
        """Digest of the data."""
        return " ".join(pack.digest for pack in (*self.packs, *self.validation))

    @property
    def validated(self) -> bool:
        """Whether there are validation data."""
        return bool(self.validation)

    def network(self, model: str) -> DepthNetwork:
        """Create an untrained network."""
        return NETWORKS.load(model)()

    def training_examples(self, plan: Plan, first: int, count: int) -> TrainingImages:
        """Return `count` training examples from number `first` on."""
        return TrainingImages(self.packs, plan.crop, plan.seed, first, count)

    def validation_examples(self) -> ValidationImages:
        """Return the validation examples."""
        return ValidationImages(self.validation)

    def loss(self, network: nn.Module, batch: Example, plan: Plan) -> Tensor:
        """Compute the loss of a batch."""
        return depth_loss(network(batch.image, batch.depth).float(), batch.target, plan.absolute)

    def errors(self, network: nn.Module, batch: Example) -> tuple[Tensor, Tensor]:
        """Compute MAE and RMSE [m] of a batch of one example."""
        return errors(network(batch.image, batch.depth).float(), batch)

    def export(self, network: nn.Module, folder: Path, name: str) -> None:
        """Write NAME.onnx and NAME.safetensors."""
        assert isinstance(network, DepthNetwork)
        export(network, folder, name, self.packs[0].scale)

    def card(self, plan: Plan, step: int, best: Figures | None, parameters: int, command: str) -> str:
        """Return the model card in Markdown."""
        return model_card(plan, step, best, parameters, self.packs, self.validation, command)


def errors(depth: Tensor, batch: Example) -> tuple[Tensor, Tensor]:
    """Compute MAE and RMSE [m] over the cells with a target, except where the input has a return."""
    asked = (batch.target > 0) & (batch.depth == 0)
    error = (depth - batch.target)[asked]
    return error.abs().mean(), error.square().mean().sqrt()
