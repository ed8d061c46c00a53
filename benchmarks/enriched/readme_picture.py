"""The picture of the README: a simulated scan at 16 channels, enriched and at 64, from above, as reports draw it.

python -m benchmarks.enriched.readme_picture [docs/enriched.png]
"""

from __future__ import annotations

from pathlib import Path

from benchmarks.common.script import parser, run_script
from benchmarks.common.simulated import scene
from eval.report.pictures import scan_from_above
from eval.report.scan import Scan
from lidarlift.comparing import INPUTS
from lidarlift.front_ends import front_end_for
from slam.config import load_config
from slam.data.plot_style import save_png

FRAME = 100


def main() -> None:
    arguments = parser(__doc__)
    arguments.add_argument("file", nargs="?", type=Path, default=Path("docs/enriched.png"))
    options = arguments.parse_args()
    data = scene("loop")
    frame, scans = data[FRAME], {}
    for name in INPUTS:
        settings = load_config(input=name, enricher="ray-segment").front_end
        scans[name] = Scan(FRAME, front_end_for(settings, data.sensor, data.path)(frame, ()))
    save_png(scan_from_above(scans).figure, options.file, dpi=110)


if __name__ == "__main__":
    run_script(main)
