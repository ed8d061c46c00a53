"""`lidarlift config`: the settings in force."""

from __future__ import annotations

from lidarlift.cli.arguments import ConfigOption, EnricherOption, InputOption, SetOption
from slam.config import load_config, yaml_text


def config(
    input: InputOption = None,
    enricher: EnricherOption = None,
    config: ConfigOption = None,
    set_: SetOption = None,
) -> None:
    """Print the settings in force as YAML, which `--config` takes.

    Example: `lidarlift config --input 16 --set odometry.voxel_size=0.6 > mine.yaml`

    They are the defaults, then those of a preset or file, then single ones. Cells and voxels that are null follow from
    the first scan.
    """
    settings = load_config(config, set_ or (), input=input and input.value, enricher=enricher)
    print(yaml_text(settings), end="")
