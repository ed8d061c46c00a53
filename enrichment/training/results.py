"""What a training leaves behind for those who use the network."""

from __future__ import annotations

from enrichment.networks.export import export
from enrichment.training.checkpoint import BEST, Figures, read_checkpoint
from enrichment.training.loop import Training
from enrichment.training.model_card import model_card
from slam.data.atomic import write_text


def write_results(training: Training, command: str) -> Figures | None:
    """The best weights as MODEL.onnx and MODEL.safetensors, with a model card, MODEL.md, that names the command.

    Returns their validation, None where there was none.
    """
    plan, out, packs = training.plan, training.out, training.packs
    best = read_checkpoint(out / BEST)
    network = training.network.cpu()
    network.load_state_dict(best.weights)
    export(network, out, plan.model, packs[0].scale)
    parameters = sum(values.numel() for values in network.parameters())
    card = model_card(plan, best.step, best.best, parameters, packs, training.validation, command)
    write_text(out / f"{plan.model}.md", card)
    return best.best
