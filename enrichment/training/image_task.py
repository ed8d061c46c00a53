"""The paper's networks as a task: dense depth images, on packs of frames with a camera."""

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
    """A `Task`, of packs to train on and packs to validate on, all of one scale."""

    packs: Sequence[Pack]
    validation: Sequence[Pack]
    clip = None
    collate = None

    @property
    def digest(self) -> str:
        return " ".join(pack.digest for pack in (*self.packs, *self.validation))

    @property
    def validated(self) -> bool:
        return bool(self.validation)

    def network(self, model: str) -> DepthNetwork:
        return NETWORKS.load(model)()

    def training_examples(self, plan: Plan, first: int, count: int) -> TrainingImages:
        return TrainingImages(self.packs, plan.crop, plan.seed, first, count)

    def validation_examples(self) -> ValidationImages:
        return ValidationImages(self.validation)

    def loss(self, network: nn.Module, batch: Example, plan: Plan) -> Tensor:
        return depth_loss(network(batch.image, batch.depth).float(), batch.target, plan.absolute)

    def errors(self, network: nn.Module, batch: Example) -> tuple[Tensor, Tensor]:
        return errors(network(batch.image, batch.depth).float(), batch)

    def export(self, network: nn.Module, folder: Path, name: str) -> None:
        assert isinstance(network, DepthNetwork)
        export(network, folder, name, self.packs[0].scale)

    def card(self, plan: Plan, step: int, best: Figures | None, parameters: int, command: str) -> str:
        return model_card(plan, step, best, parameters, self.packs, self.validation, command)


def errors(depth: Tensor, batch: Example) -> tuple[Tensor, Tensor]:
    """MAE and RMSE [m] over the cells with a target but without a kept return, where the input has the answer."""
    asked = (batch.target > 0) & (batch.depth == 0)
    error = (depth - batch.target)[asked]
    return error.abs().mean(), error.square().mean().sqrt()
