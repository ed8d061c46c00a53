"""KISS-SLAM (Guadagnino et al., 2025) compared with lidarlift on simulated drives: ATE before and after loops, time.

    python -m benchmarks.loops.kiss_slam TRAJECTORIES [PYTHON]

KISS-SLAM has an environment of its own, which `make peers` makes; PYTHON is the interpreter of another. Its pipeline
runs there, in a process of its own, on the scans that ours gets. The drives are those of simulated_loops.py, simulated
into the user's cache where it has them not yet. Writes kiss_slam.md and .json in benchmarks/results.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.common.page import surroundings, table, write_results
from benchmarks.common.script import add_results, parser, run_script
from benchmarks.loops.drives import SPACING, add_drives, drive
from benchmarks.loops.revisits import WRONG
from eval.evaluation import evaluate_poses
from eval.text import number
from slam.compilation import compile_kernels
from slam.config import load_config
from slam.data import se3
from slam.data.cloud import Array
from slam.data.dataset import Dataset
from slam.data.errors import InputError
from slam.data.machine import usable_cores
from slam.front_end import RingFrontEnd
from slam.pipeline import Pipeline

HEADER = (
    "sequence", "channels", "frames", "system", "odometry m", "after loops m", "times less", "loops", "wrong",
    "seconds", "x lidarlift",
)  # fmt: skip

PYTHON = Path(__file__).parents[2] / ".peers" / "kiss-slam" / "bin" / "python"  # of `make peers`

#: What runs in KISS-SLAM's environment: its pipeline with its defaults on folder of scans argv[1], into file argv[2].
#: A factor of a loop maps points of its source, an earlier local map, into its query. Without the times of its points a
#: scan is not deskewed.
DRIVER = """
import sys, time
from importlib.metadata import version
from pathlib import Path
import numpy as np
from kiss_slam.pipeline import SlamPipeline

class Scans:
    sequence_id = "scans"
    files = sorted(Path(sys.argv[1]).glob("*.npy"))
    def __len__(self):
        return len(self.files)
    def __getitem__(self, number):
        return np.load(self.files[number]).astype(np.float64), np.array([])

pipeline = SlamPipeline(Scans())
slam, loops = pipeline.kiss_slam, []
compute = slam.closer.compute
def recorded(*arguments):
    good, source, query, pose = found = compute(*arguments)
    if good:
        loops.append((source, query, pose))
    return found
slam.closer.compute = recorded
begin, processor = time.perf_counter(), time.process_time()
pipeline._run_pipeline()
seconds, processor = time.perf_counter() - begin, time.process_time() - processor

start, odometry, first = np.eye(4), [], []
for part in slam.local_map_graph.local_maps():
    first.append(max(len(odometry) - 1, 0))
    odometry += [start @ pose for pose in part.local_trajectory[1 if odometry else 0:]]
    start = start @ part.local_trajectory[-1]
np.savez(
    sys.argv[2], odometry=odometry, poses=pipeline.poses, seconds=seconds, processor=processor,
    version=version("kiss-slam"),
    pairs=np.array([(first[source], first[query]) for source, query, _ in loops], int).reshape(-1, 2),
    measured=np.array([pose for *_, pose in loops]).reshape(-1, 4, 4),
)
"""


def main() -> None:
    arguments = parser(__doc__)
    add_drives(arguments)
    arguments.add_argument("python", nargs="?", type=Path, default=PYTHON, help="the interpreter that has kiss-slam")
    add_results(arguments)
    options = arguments.parse_args()
    rows: list[dict[str, Any]] = []
    systems: list[Callable[[Dataset, str], dict[str, Any]]] = [
        ours,
        lambda data, channels: theirs(data, channels, options.python),
    ]
    for name in options.drives:
        data = drive(name, options.trajectories)
        for channels in ("64", "16"):
            case = {"drive": name, "channels": channels, "frames": len(data)}
            rows += sorted((case | system(data, channels) for system in systems), key=lambda row: str(row["system"]))
            systems.reverse()  # who begins changes from case to case
            print(*rows[-2:], sep="\n", file=sys.stderr)
    about = surroundings(("numpy", "numba", "gtsam")) | {"usable_cores": usable_cores()}
    write_results(options.results, "kiss_slam", {"about": about, "drives": rows}, page)


def ours(data: Dataset, channels: str) -> dict[str, Any]:
    """The whole run, reading and map included."""
    config = load_config(input=channels)
    compile_kernels(config, lambda: None)
    begin = time.perf_counter()
    run = Pipeline(config).run(data)
    seconds = time.perf_counter() - begin
    assert run.mapping is not None
    loops = [record.candidate for record in run.mapping.ledger if record.status == "accepted"]
    frames = run.mapping.keyframes.indices
    pairs = np.array([(frames[loop.i], frames[loop.j]) for loop in loops], dtype=int).reshape(-1, 2)
    motions = np.array([loop.pose for loop in loops]).reshape(-1, 4, 4)
    return {"system": "lidarlift", "seconds": seconds} | figures(data, run.odometry_poses, run.poses, pairs, motions)


def theirs(data: Dataset, channels: str, python: Path) -> dict[str, Any]:
    """From its first scan to its last optimisation, reading included; what it writes afterwards is not."""
    front_end = RingFrontEnd(load_config(input=channels).front_end, data.sensor)
    with tempfile.TemporaryDirectory() as folder:
        for position in range(len(data)):
            np.save(Path(folder) / f"{position:06d}.npy", front_end(data[position], ()).xyz)
        command = [str(python.absolute()), "-c", DRIVER, folder, f"{folder}/result.npz"]
        try:
            subprocess.run(command, cwd=folder, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
        except (OSError, subprocess.CalledProcessError) as error:
            last = (getattr(error, "stderr", None) or str(error).encode()).decode(errors="replace").split("\n")[-2:]
            raise InputError(
                f"{python}: KISS-SLAM did not run ({' '.join(last).strip()}); `make peers` installs it"
            ) from error
        with np.load(f"{folder}/result.npz") as result:
            found = figures(data, result["odometry"], result["poses"], result["pairs"], se3.inverse(result["measured"]))
            times = {"seconds": float(result["seconds"]), "processor_s": float(result["processor"])}
            return {"system": f"KISS-SLAM {result['version']}"} | times | found


def figures(data: Dataset, odometry: Array, poses: Array, pairs: Array, motions: Array) -> dict[str, Any]:
    """Aligned ATE of all frames, and loops: `pairs` (L, 2) of frames i, j with `motions` (L, 4, 4), T_i_j."""
    truth = data.ground_truth
    assert truth is not None
    before, after = (evaluate_poses(each, truth).ate.aligned.rmse for each in (odometry, poses))
    true = se3.inverse(truth[pairs[:, 0]]) @ truth[pairs[:, 1]]
    errors = np.linalg.norm((se3.inverse(motions) @ true)[:, :3, 3], axis=1)
    return {
        "ate_before": before, "ate_after": after, "loops": len(pairs), "wrong": int((errors > WRONG).sum()),
        "worst": float(errors.max(initial=0.0)),
    }  # fmt: skip


def page(found: Mapping[str, Any]) -> str:
    """A note of `found` says what else there is to know of these figures."""
    about, rows = found["about"], found["drives"]
    note = f"\n* {about['note']}" if "note" in about else ""
    cores = "one core" if about["usable_cores"] == 1 else f"{about['usable_cores']} cores"
    own = {(row["drive"], row["channels"]): row["seconds"] for row in rows if row["system"] == "lidarlift"}
    lines = [
        (
            str(row["drive"]), str(row["channels"]), str(row["frames"]), str(row["system"]),
            number(row["ate_before"], 3), number(row["ate_after"], 3), number(row["ate_before"] / row["ate_after"], 1),
            str(row["loops"]), str(row["wrong"]), number(row["seconds"], 0),
            number(row["seconds"] / own[row["drive"], row["channels"]], 1),
        )
        for row in rows
    ]  # fmt: skip
    return f"""# KISS-SLAM

{about["date"]}, {about["cpu"]}, {about["cores"]} cores.
`{about["command"]}`

* The simulated sequences of [Loops](simulated_loops.md), {SPACING} m between frames, with exact ground truth; each
  system has its own odometry, and no drift is added. Both get the same scans: 64 channels, or 16, every 4th ring.
* KISS-SLAM has its defaults: range 0 to 100 m, voxels of 1 m, local maps of 100 m, loops by MapClosures. lidarlift has
  its own: range 2.5 to 80 m. The scans are motion-compensated and their points have no times, so that neither system
  deskews; the vertical correction of the sensor is 0 for both.
* ATE: rmse after SE(3) alignment, over all frames, of the odometry and after loop closure. KISS-SLAM's odometry is the
  chain of its local trajectories.
* Loops: KISS-SLAM searches one per local map, lidarlift one per keyframe, so that the numbers are not comparable.
  Wrong: loops with an error above {WRONG:g} m.
* Seconds: a whole run, including the reading of scans; lidarlift also builds the map. The systems alternate on the same
  machine, one run each, bound to {cores}; the machine is shared with other programs, so that only ratios count, and
  these roughly: "x lidarlift" is the time relative to lidarlift's.{note}

{table(HEADER, lines, words=2)}"""


if __name__ == "__main__":
    run_script(main)
