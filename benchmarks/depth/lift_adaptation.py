"""Does Lift learn from a user's own LiDAR, without any truth? In a tunnel, which none of its training drives has.

    python -m benchmarks.depth.lift_adaptation OUT

simulates, for a LiDAR of 16 channels and one of 64, a tunnel to learn from and another one to be judged on; adapts the
shipped weights by `lidarlift train lift --self-supervised` (some of the LiDAR's 16 rings predict the others); writes
lift_adaptation.md and .json in benchmarks/results.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from benchmarks.common.page import surroundings, write_results
from benchmarks.common.script import add_results, parser, run_script
from benchmarks.depth.tables import of_views
from benchmarks.weights.lift_weights import lift_of
from benchmarks.weights.trainings import learn, lidarlift
from enrichment.geometry.sparse_scan import Method
from enrichment.interpolation.ray_segment import RaySegment
from lidarlift.depth_benchmark import sequence_report
from slam.data.dataset import open_dataset

LIDARS = "vlp16", "hdl64"
LEARNED, JUDGED, FRAMES = 5, 6, 40  # seeds of the tunnels
STEPS, EVERY = 200, 4


def main() -> None:
    arguments = parser(__doc__)
    arguments.add_argument("folder", type=Path, metavar="OUT")
    add_results(arguments)
    options = arguments.parse_args()
    reports = {lidar: measured(options.folder / lidar, lidar) for lidar in LIDARS}
    about = surroundings(("torch", "onnxruntime"))
    write_results(options.results, "lift_adaptation", {"about": about, "steps": STEPS, "lidars": reports}, page)


def measured(folder: Path, lidar: str) -> dict[str, Any]:
    learned, judged = (tunnel(folder, lidar, seed) for seed in (LEARNED, JUDGED))
    adapted = folder / "adapted"
    learn("lift", [learned], adapted, "--self-supervised", "--steps", STEPS, "--bf16")
    methods: dict[str, Method] = {"ray-segment": RaySegment(), "lift": lift_of(), "lift, adapted": lift_of(adapted)}
    return sequence_report(open_dataset(judged), methods, slice(None, None, EVERY)).as_dict()


def tunnel(folder: Path, lidar: str, seed: int) -> Path:
    path = folder / f"tunnel-{seed}"
    lidarlift("simulate", path, "--drive", "tunnel", "--sensor", lidar, "--seed", seed, "--frames", FRAMES)
    return path


def page(found: Mapping[str, Any]) -> str:
    about = found["about"]
    tables = "\n".join(
        f"## {lidar}, {report['about']['title']}\n\n{of_views(report)}" for lidar, report in found["lidars"].items()
    )
    return f"""# Lift adapted to another LiDAR and place

{about["date"]}, {about["cpu"]}.
`{about["command"]}`

* The shipped weights were trained on a LiDAR of 64 lines in streets, mostly with every 4th line as input. Here they are
  fine-tuned for {found["steps"]} steps on {FRAMES} scans of a simulated tunnel, self-supervised: up to a third of the
  LiDAR's own 16 rings (of 64 rings, every 4th) are held out as targets, the others are the input.
* Evaluated in another tunnel, on held-out rings: every 2nd of 16, or three of four of 64.
* The gaps between the rings in training are as wide as those of the evaluation on vlp16, and twice as wide as those on
  hdl64.

{tables}"""


if __name__ == "__main__":
    run_script(main)
