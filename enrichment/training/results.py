"""Results of a training: weights and model card."""

from __future__ import annotations

from enrichment.training.checkpoint import BEST, Figures, read_checkpoint
from enrichment.training.loop import Training
from slam.data.atomic import write_text


def write_results(training: Training, command: str) -> Figures | None:
    """Write the best weights as MODEL*.onnx and MODEL.safetensors, and the model card MODEL.md with the command.

    Returns:
        The validation of these weights, None without one.
    """
    plan, task, out = training.plan, training.task, training.out
    best = read_checkpoint(out / BEST)
    network = training.network.cpu()
    network.load_state_dict(best.weights)
    task.export(network, out, plan.model)
    parameters = sum(values.numel() for values in network.parameters())
    write_text(out / f"{plan.model}.md", task.card(plan, best.step, best.best, parameters, command))
    return best.best
