"""Cost of a session: time per frame on the odometry's thread, and time to resume a long run.

    python -m benchmarks.faults.session_cost town

`town` is a simulated data set, see `benchmarks.faults.faults`. The run's session is written as always; the time that
the odometry's thread spends on it is measured frame by frame. Resuming is measured on a session of 5,000 keyframes with
20,000 frames and a loop for every tenth keyframe, made up from random poses and descriptors, with the snapshot of the
run over the town. Writes session_cost.md and .json in benchmarks/results.
"""

from __future__ import annotations

import shutil
import tempfile
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.common.page import surroundings, table, target, write_results
from benchmarks.common.script import add_results, parser, run_script
from slam.data import se3
from slam.journal import journal as journals
from slam.journal.journal import Journal
from slam.journal.session_file import SessionFile
from slam.journal.state import Frozen, freeze, thaw
from slam.journal.state_file import read_state, write_state
from slam.journal.tables import EDGE, FRAME, KEYFRAME, LOOP, PLACE, TABLES, text_of
from slam.pipeline import Pipeline
from slam.run_record import RunRecord
from slam.settings import Config
from slam.slam import Slam

PACKAGES = ("numpy", "gtsam")
KEYFRAMES, FRAMES_PER_KEYFRAME, LOOP_EVERY = 5000, 4, 10
CLOUD = bytes(50_000)  # they are not read when a run is resumed


def main() -> None:
    arguments = parser(__doc__)
    arguments.add_argument("drive", type=Path, help="the simulated data set")
    arguments.add_argument("--frames", type=int, default=120, metavar="N", help="of the drive (default: 120)")
    add_results(arguments)
    options = arguments.parse_args()
    write_results(options.results, "session_cost", measure(options.drive, options.frames), page)


def measure(drive: Path, frames: int) -> dict[str, Any]:
    from slam.compilation import compile_kernels

    found: dict[str, Any] = {"about": surroundings(PACKAGES), "frames": frames, "keyframes": KEYFRAMES}
    compile_kernels(Config(), lambda: print("compiling kernels ..."))
    with tempfile.TemporaryDirectory() as folder:
        found |= _journal_times(drive, frames, Path(folder) / "town")
        _lengthened(Path(folder) / "town", Path(folder) / "long")
        begin, work = time.perf_counter(), time.process_time()
        with Journal.resume(Path(folder) / "long") as journal, Slam(Config(), journal=journal) as slam:
            found["resume_s"] = time.process_time() - work
            found["resume_wall_s"] = time.perf_counter() - begin
            assert len(slam.result.records) == KEYFRAMES * FRAMES_PER_KEYFRAME
        found["session_mb_without_clouds"] = (
            (Path(folder) / "long" / journals.SESSION).stat().st_size - KEYFRAMES * len(CLOUD)
        ) / 1e6
    return found


def _journal_times(drive: Path, frames: int, folder: Path) -> dict[str, Any]:
    """Run with a session, and measure what the odometry's thread spends on it."""
    from slam.data.dataset import open_dataset

    spent: list[float] = []
    snapshots: list[float] = []

    def timed(method: Callable[..., Any], into: list[float], add: bool) -> Callable[..., Any]:
        def run(*arguments: Any) -> Any:
            begin = time.perf_counter()
            result = method(*arguments)
            elapsed = 1e3 * (time.perf_counter() - begin)
            if add and into:
                into[-1] += elapsed
            else:
                into.append(elapsed)
            return result

        return run

    record: Any = RunRecord
    kept = record.write_frames, record.write_problems, record.snapshot
    record.write_frames = timed(kept[0], spent, False)
    record.write_problems = timed(kept[1], spent, True)
    record.snapshot = timed(kept[2], snapshots, False)
    try:
        with Journal.begin(folder, {}) as journal:
            Pipeline(Config()).run(open_dataset(drive), slice(frames), journal=journal)
            size = (folder / journals.STATE).stat().st_size
    finally:
        record.write_frames, record.write_problems, record.snapshot = kept
    return {
        "journal_ms": float(np.median(spent)),
        "journal_p95_ms": float(np.percentile(spent, 95)),
        "snapshot_ms": float(np.median(snapshots)),
        "snapshot_mb": size / 1e6,
    }


def _lengthened(short: Path, long: Path) -> None:
    """Write a session of KEYFRAMES keyframes with the snapshot of a short one."""
    rng = np.random.default_rng(0)
    step = se3.exp(np.array([0, 0, 0.01, 2.0, 0, 0]))
    covariance, pose = text_of(np.diag([1e-5] * 3 + [5e-3] * 3)), np.eye(4)
    with SessionFile.open(short / journals.SESSION) as file:
        frame = next(file.rows(FRAME))
        about = file.about
    with Journal.begin(long, about) as journal:
        for number in range(KEYFRAMES):
            for _ in range(FRAMES_PER_KEYFRAME):
                journal.append(FRAME, *frame[:5], text_of(pose), *frame[6:])
            journal.append(KEYFRAME, FRAMES_PER_KEYFRAME * number, 2.0 * number, text_of(pose), CLOUD)
            if number:
                journal.append(EDGE, number - 1, number, text_of(step), covariance)
            journal.append(PLACE, 2.0 * number, rng.random((20, 60)).astype("<f4").tobytes())
            if number % LOOP_EVERY == LOOP_EVERY - 1 and number >= 2 * 314:  # a circle of 314 keyframes
                seen = text_of(se3.exp(np.array([0, 0, 0.01 * 628 - 2 * np.pi, 0, 0, 0])))
                journal.append(LOOP, number - 628, number, 0.1, 0.0, 0.9, 0.5, "", seen, covariance)
            pose = se3.normalized(pose @ step)
    counts, parts = read_state(short / journals.STATE)
    mapper = thaw(parts["mapper"])
    mapper["_travelled"] = 2.0 * KEYFRAMES
    with SessionFile.open(long / journals.SESSION) as file:
        counts = {name: file.count(table) for name, table in TABLES.items()}
    shutil.copy(short / journals.STATE, long / journals.STATE)
    changed: dict[str, Frozen] = {**parts, "mapper": freeze(mapper)}
    write_state(long / journals.STATE, counts, changed)


def page(found: Mapping[str, Any]) -> str:
    about = found["about"]
    targets = table(
        ("target", "measured", "limit", "verdict"),
        [
            target("journal, ms per frame on the odometry's thread, median", found["journal_ms"], "<", 1.0, 3),
            target("resuming a run of 5,000 keyframes, s of processor time", found["resume_s"], "<", 5.0, 2),
        ],
    )
    figures = table(
        ("figure", "measured"),
        [
            ("journal, 95th percentile of the frames", f"{found['journal_p95_ms']:.3f} ms"),
            ("copying the state for a snapshot, every 10 s", f"{found['snapshot_ms']:.1f} ms"),
            ("size of a snapshot", f"{found['snapshot_mb']:.1f} MB"),
            ("resuming, by the clock, next to other programs", f"{found['resume_wall_s']:.2f} s"),
            ("that session, without clouds", f"{found['session_mb_without_clouds']:.0f} MB"),
        ],
    )
    return f"""
# Cost of a session

`{about["command"]}` on {about["date"]}: {about["cpu"]}, {about["cores"]} cores, load {about["load_average"]}.

{found["frames"]} scans of a VLP-16 in a simulated town; a session of {found["keyframes"]} keyframes, 20,000 frames and
437 loops, made up from random poses and descriptors.

{targets}
{figures}
A thread of its own writes rows and snapshots; the odometry's thread formats and queues them, and copies the state for a
snapshot. Clouds are read later, when a loop search or the map needs them.
"""


if __name__ == "__main__":
    run_script(main)
