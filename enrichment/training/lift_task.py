"""Training task of Lift: ranges on rays between rings, on recorded sequences."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import torch
from torch import Tensor, nn

from enrichment.lift.channels import Ray
from enrichment.lift.loss import lift_loss, teaching_loss
from enrichment.lift.network import LARGE, Lift, Sizes
from enrichment.networks.export import export_lift
from enrichment.training.checkpoint import Figures
from enrichment.training.lift_examples import LiftExample, TrainingScans, ValidationScans
from enrichment.training.model_card import lift_card
from enrichment.training.plan import Plan
from slam.data.dataset import Dataset
from slam.data.errors import InputError

CLIP = 5.0  # maximum norm of the gradient


def _as_they_are(examples: list[LiftExample]) -> list[LiftExample]:
    """Keep examples as a list, since scans have different numbers of rings."""
    return examples


def _loss(network: nn.Module, teacher: Lift | None, scans: list[LiftExample]) -> Tensor:
    """Loss of scans with the same ring above each row."""
    rings, rays, candidates, truth = (
        torch.cat([getattr(scan, name) for scan in scans]) for name in ("rings", "rays", "candidates", "truth")
    )
    given = rings, scans[0].upper, rays, candidates
    answer = network(*given)
    loss = lift_loss(answer, rays, candidates, truth)
    if teacher is None:
        return loss
    with torch.no_grad():
        taught = teacher.to(rings.device)(*given)
    return loss + teaching_loss(answer, taught, rays, candidates)


@dataclass(frozen=True)
class LiftTask:
    """A `Task` for Lift.

    Attributes:
        sequences: Sequences for training.
        validation: Sequences for validation.
        own_rings: Use only the rings of a sparse LiDAR itself: some of its rings predict the others.
        sizes: Sizes of the network.
        teacher: A trained network, usually a larger one, whose answers the network learns in addition to the returns.
        teacher_name: Name of its weights, for the model card.

    Raises:
        InputError: The sensor model of a sequence is unknown.
    """

    sequences: Sequence[Dataset]
    validation: Sequence[Dataset]
    own_rings: bool = False
    sizes: Sizes = LARGE
    teacher: Lift | None = None
    teacher_name: str = ""
    clip = CLIP
    collate = staticmethod(_as_they_are)

    def __post_init__(self) -> None:
        for sequence in (*self.sequences, *self.validation):
            if sequence.sensor is None or sequence[0].cloud.ring is None:
                raise InputError(f"{sequence.path}: the sensor model is unknown; add a sensor.yaml to the folder")

    @property
    def digest(self) -> str:
        """Digest of the data."""
        digest = hashlib.sha256(repr(self.own_rings).encode())
        if self.teacher is not None:
            for values in self.teacher.state_dict().values():
                digest.update(values.cpu().numpy().tobytes())
        for use, sequences in (("training", self.sequences), ("validation", self.validation)):
            for sequence in sequences:
                digest.update(repr((use, sequence.name)).encode() + sequence.numbers.tobytes())
        return digest.hexdigest()[:16]

    @property
    def validated(self) -> bool:
        """Whether there are validation data."""
        return bool(self.validation)

    def network(self, model: str) -> Lift:
        """Create an untrained network."""
        return Lift(self.sizes)

    def training_examples(self, plan: Plan, first: int, count: int) -> TrainingScans:
        """Return `count` training examples from number `first` on."""
        return TrainingScans(self.sequences, self.own_rings, plan.seed, first, count)

    def validation_examples(self) -> ValidationScans:
        """Return the validation examples."""
        return ValidationScans(self.validation)

    def loss(self, network: nn.Module, batch: list[LiftExample], plan: Plan) -> Tensor:
        """Compute the loss of a batch."""
        alike: dict[tuple[object, ...], list[LiftExample]] = {}
        for scan in batch:
            alike.setdefault((scan.rays.shape, *scan.upper.tolist()), []).append(scan)
        losses = [len(scans) * _loss(network, self.teacher, scans) for scans in alike.values()]
        return torch.stack(losses).sum() / len(batch)

    def errors(self, network: nn.Module, batch: list[LiftExample]) -> tuple[Tensor, Tensor]:
        """Compute MAE and RMSE [m] of a batch of one example."""
        (scan,) = batch
        asked = (scan.truth > 0) & (scan.rays[:, Ray.KNOWN] > 0)
        error = (network(*scan[:-1]).ranges - scan.truth)[asked]
        return error.abs().mean(), error.square().mean().sqrt()

    def export(self, network: nn.Module, folder: Path, name: str) -> None:
        """Write NAME.onnx, NAME_rays.onnx and NAME.safetensors."""
        assert isinstance(network, Lift)
        export_lift(network, folder, name)

    def card(self, plan: Plan, step: int, best: Figures | None, parameters: int, command: str) -> str:
        """Return the model card in Markdown."""
        return lift_card(
            plan, step, best, parameters, self.sequences, self.validation, self.own_rings, command, self.teacher_name
        )
