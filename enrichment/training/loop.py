"""The training loop with Lightning, on a CPU or on one or several GPUs; reproducible from the seed on one CPU.

A Lightning epoch is `Plan.validate_every` steps here: after each, the network is validated and a checkpoint is written.
"""

from __future__ import annotations

import logging
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import lightning
import numpy as np
import torch
from lightning.fabric.utilities.warnings import PossibleUserWarning
from lightning.pytorch.loggers import CSVLogger, TensorBoardLogger
from lightning.pytorch.utilities.exceptions import MisconfigurationException
from torch import Tensor
from torch.optim import AdamW
from torch.utils.data import DataLoader

from enrichment.training.checkpoint import BEST, CHECKPOINT, NETWORK, Checkpoint, Figures, read_checkpoint, tensors_of
from enrichment.training.plan import Plan
from enrichment.training.task import Task
from slam.data.errors import InputError

LOG_EVERY = 10  # steps


def train(training: Training, device: str) -> None:
    """Run the remaining steps, and write CHECKPOINT, BEST and logs/ (TensorBoard and CSV) into the training's folder.

    Args:
        training: The training.
        device: 'auto', 'cpu' or 'gpu' (all GPUs).

    Raises:
        InputError: There is no such device.
    """
    if training.step >= training.plan.steps:
        return
    logging.getLogger("lightning.pytorch").setLevel(logging.ERROR)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", PossibleUserWarning)  # advice on workers
        warnings.simplefilter("ignore", FutureWarning)  # Lightning's use of PyTorch
        try:
            _trainer(training, device).fit(training)
        except SystemExit as stop:
            raise KeyboardInterrupt from stop  # Lightning turns Ctrl-C into SystemExit


def _trainer(training: Training, device: str) -> lightning.Trainer:
    logs = training.out / "logs"
    try:
        return lightning.Trainer(
            accelerator=device,
            precision="bf16-mixed" if training.plan.bf16 else "32-true",
            max_epochs=-(-(training.plan.steps - training.step) // training.plan.validate_every),
            reload_dataloaders_every_n_epochs=1,
            num_sanity_val_steps=0,
            limit_val_batches=None if training.task.validated else 0,
            gradient_clip_val=training.task.clip,
            logger=[TensorBoardLogger(logs, name="tensorboard"), CSVLogger(logs, name="csv")],
            log_every_n_steps=LOG_EVERY,
            enable_progress_bar=False,
            enable_checkpointing=False,
            enable_model_summary=False,
        )
    except MisconfigurationException as error:
        raise InputError(f"--device {device}: PyTorch finds no such device ({error}); use cpu") from error


class Training(lightning.LightningModule):
    """A network with the state of its training, and the hooks of Lightning.

    Args:
        plan: Settings of the training.
        task: The kind of network and its data.
        out: Folder for weights, checkpoint and logs.
        workers: Processes that prepare examples; 0: the main process.
        on_step: Called after each step with its loss.
    """

    def __init__(
        self,
        plan: Plan,
        task: Task,
        out: Path,
        workers: int = 0,
        on_step: Callable[[float], None] | None = None,
    ) -> None:
        super().__init__()
        torch.manual_seed(plan.seed)
        self.network = task.network(plan.model)
        self.network.to(memory_format=torch.channels_last)  # type: ignore[call-overload]  # a tenth faster on a CPU
        self.plan, self.task, self.out = plan, task, out
        self.workers, self.on_step = workers, on_step
        self.step = 0
        self.best: Figures | None = None
        self._optimizer = AdamW(self.network.parameters())

    def resume(self) -> None:
        """Load the checkpoint in the folder.

        Raises:
            InputError: There is none, or it is of another training.
        """
        path = self.out / CHECKPOINT
        checkpoint = read_checkpoint(path)
        checkpoint.require(self.plan, self.task.digest, path)
        checkpoint.restore(self.network, self._optimizer)
        self.step, self.best = checkpoint.step, checkpoint.best

    def configure_optimizers(self) -> AdamW:
        """Return the optimiser."""
        return self._optimizer

    def train_dataloader(self) -> DataLoader[Any]:
        """Return the examples up to the next validation."""
        batch, gpus = self.plan.batch, self.trainer.world_size
        count = min(self.plan.validate_every, self.plan.steps - self.step) * batch * gpus
        examples = self.task.training_examples(self.plan, self.step * batch * gpus, count)
        return DataLoader(examples, batch, num_workers=self.workers, collate_fn=self.task.collate)

    def val_dataloader(self) -> DataLoader[Any]:
        """Return the validation examples."""
        return DataLoader(self.task.validation_examples(), 1, num_workers=self.workers, collate_fn=self.task.collate)

    def on_train_batch_start(self, batch: Any, batch_idx: int) -> None:
        """Set dropout's seed and the learning rate from seed and step, so that a resumed training is reproducible."""
        state = np.random.SeedSequence((self.plan.seed, self.step, self.global_rank)).generate_state(1)
        torch.manual_seed(int(state[0]))
        for group in self._optimizer.param_groups:
            group["lr"] = self.plan.rate_at(self.step)

    def training_step(self, batch: Any, batch_idx: int) -> Tensor:
        """Compute and log the loss."""
        loss = self.task.loss(self.network, batch, self.plan)
        self.log("loss", loss, batch_size=self.plan.batch)
        # x-axis of the loggers: Lightning's own step starts at 0 after a resume
        self.log("step", float(self.step), batch_size=self.plan.batch)
        return loss

    def on_train_batch_end(self, outputs: object, batch: Any, batch_idx: int) -> None:
        """Count the step and report its loss."""
        self.step += 1
        if self.on_step is not None and self.trainer.is_global_zero:
            self.on_step(float(self.trainer.callback_metrics["loss"]))

    def validation_step(self, batch: Any, batch_idx: int) -> None:
        """Compute and log the errors of one example."""
        mae, rmse = self.task.errors(self.network, batch)
        self.log_dict({"mae": mae, "rmse": rmse, "step": float(self.step)}, sync_dist=True, batch_size=1)

    def on_train_epoch_end(self) -> None:
        """Record the validation, and write the checkpoint and the best weights."""
        found = self.trainer.callback_metrics
        figures = Figures(self.step, float(found["mae"]), float(found["rmse"])) if self.task.validated else None
        better = figures is None or self.best is None or figures.mae < self.best.mae
        self.best = figures if better else self.best
        if self.trainer.is_global_zero:
            tensors = tensors_of(self.network, self._optimizer)
            if better:
                weights = {name: value for name, value in tensors.items() if name.startswith(NETWORK)}
                self._checkpoint(weights).write(self.out / BEST)
            self._checkpoint(tensors).write(self.out / CHECKPOINT)

    def _checkpoint(self, tensors: dict[str, Tensor]) -> Checkpoint:
        return Checkpoint(self.plan, self.task.digest, self.step, self.best, tensors)
