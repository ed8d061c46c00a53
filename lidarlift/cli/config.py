"""`lidarlift config`: the effective settings."""

from __future__ import annotations

from lidarlift.cli.arguments import ConfigOption, EnricherOption, InputOption, SetOption


def config(
    input: InputOption = None,
    enricher: EnricherOption = None,
    config: ConfigOption = None,
    set_: SetOption = None,
) -> None:
    """Print the effective settings as YAML, in the format that `--config` reads.

    Example: `lidarlift config --input 16 --set odometry.voxel_size=0.6 > mine.yaml`

    A preset or file overrides the defaults, and single settings override both. Cell and voxel sizes that are null are
    chosen from the first scan.
    """
    from slam.config import load_config, yaml_text

    settings = load_config(config, set_ or (), input=input, enricher=enricher)
    print(yaml_text(settings), end="")
