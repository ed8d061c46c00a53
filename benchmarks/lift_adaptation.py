"""Does Lift learn from a user's own LiDAR, without any truth? In a tunnel, which none of its training drives has.

    python benchmarks/lift_adaptation.py OUT

simulates, for a LiDAR of 16 channels and one of 64, a tunnel to learn from and another one to be judged on; adapts the
shipped weights by `lidarlift train lift --self-supervised` (some of the LiDAR's 16 rings predict the others); writes
the lift-adaptation section of benchmarks/RESULTS.md and benchmarks/lift_adaptation.json.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from depth_methods import HEADER, VIEWS, rows
from lift_weights import lift_of
from report import surroundings, table, write_section
from train_networks import learn, lidarlift

from enrichment.geometry.sparse_scan import Method
from enrichment.interpolation.ray_segment import RaySegment
from eval.evaluation import write_json
from lidarlift.cli.depth_benchmark import report_of_drive
from slam.data.dataset import open_dataset

HERE = Path(__file__).parent
LIDARS = "vlp16", "hdl64"
LEARNED, JUDGED, FRAMES = 5, 6, 40  # seeds of the tunnels
STEPS, EVERY = 200, 4


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, metavar="OUT")
    parser.add_argument("--out", type=Path, default=HERE / "RESULTS.md", metavar="FILE")
    parser.add_argument("--json", type=Path, default=HERE / "lift_adaptation.json", metavar="FILE")
    arguments = parser.parse_args()
    reports = {lidar: measured(arguments.folder / lidar, lidar) for lidar in LIDARS}
    about = surroundings(("torch", "onnxruntime"))
    write_json(arguments.json, {"about": about, "steps": STEPS, "lidars": reports})
    write_section(arguments.out, "lift-adaptation", section(reports, about))


def measured(folder: Path, lidar: str) -> dict[str, Any]:
    learned, judged = (tunnel(folder, lidar, seed) for seed in (LEARNED, JUDGED))
    adapted = folder / "adapted"
    learn("lift", [learned], adapted, "--self-supervised", "--steps", STEPS, "--bf16")
    methods: dict[str, Method] = {"ray-segment": RaySegment(), "lift": lift_of(), "lift, adapted": lift_of(adapted)}
    return report_of_drive(open_dataset(judged), methods, slice(None, None, EVERY))


def tunnel(folder: Path, lidar: str, seed: int) -> Path:
    path = folder / f"tunnel-{seed}"
    lidarlift("simulate", path, "--drive", "tunnel", "--sensor", lidar, "--seed", seed, "--frames", FRAMES)
    return path


def section(reports: Mapping[str, Any], about: Mapping[str, Any]) -> str:
    tables = "\n".join(
        f"### {lidar}, {report['about']['title']}\n\n"
        + "\n".join(f"{title}:\n\n{table(HEADER, rows(report, view))}" for view, title in VIEWS.items())
        for lidar, report in reports.items()
    )
    return f"""## Lift adapted to a LiDAR and a place of its own

{about["date"]}, {about["cpu"]}. `python benchmarks/lift_adaptation.py OUT`

* The shipped weights know a LiDAR of 64 lines in streets, most often every 4th of these. Here they learn {STEPS} steps
  from {FRAMES} scans of a simulated tunnel, self-supervised: up to a third of the LiDAR's own 16 rings (of 64, every
  4th are taken to be its own) are answers, the others the input.
* Judged on another tunnel, by rings held out there: every 2nd of 16, or three of four of 64.
* What is learned has gaps between its rings like those that vlp16 is judged on, and twice as wide as those of hdl64.

{tables}"""


if __name__ == "__main__":
    main()
