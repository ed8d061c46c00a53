"""Does our odometry say where a scene does not hold it, and how sure it is elsewhere? On simulated drives.

    python -m benchmarks.odometry.observability [SEQUENCE ...]

SEQUENCE is one of the simulated drives of benchmarks/common/simulated.py, or 05, 06, 07, simulated once into the user's
cache; by default all but the latter. Writes observability.md and .json in benchmarks/results.
"""

from __future__ import annotations

import argparse
import sys
from time import perf_counter
from typing import Any

import numpy as np

from benchmarks.common.cores import pin_to_one_core
from benchmarks.common.page import surroundings, write_results
from benchmarks.common.script import add_results, parser, run_script
from benchmarks.common.simulated import SCENES, course
from benchmarks.odometry import inputs
from benchmarks.odometry.chosen_drives import ChosenDrive, add_drives, chosen_drives
from benchmarks.odometry.nees import nees, nees_by_axis, nees_over_keyframes
from benchmarks.odometry.observability_page import ELSEWHERE, ENDS, NEAR, NOTHING, OFF, REPEATS, page
from benchmarks.odometry.own_run import OwnRun, own_run, settings_of
from benchmarks.odometry.path_errors import along_track_error, directions, errors_ahead
from eval.trajectory import ate, path_length
from slam.data.cloud import Array
from slam.simulation.drives import Drive


def main() -> None:
    options = _arguments()
    pin_to_one_core()
    results: dict[str, Any] = {}
    about = surroundings(("numpy", "numba"))
    for drive in chosen_drives(options, images=not set(options.inputs) <= set(inputs.IMAGELESS)):
        results[drive.name] = {name: entry(drive, name) for name in options.inputs}
        write_results(options.results, "observability", {"about": about, **results}, page)  # after each: it takes long


def entry(drive: ChosenDrive, name: str) -> dict[str, Any]:
    """Measure the entry of a drive and an input for the JSON; only `reason` if the drive does not have this input."""
    reason = inputs.why_not(name, drive.data)
    if reason:
        return {"reason": reason}
    truth, start = drive.exact_truth, perf_counter()
    run = own_run(drive.data, drive.frames(), name)
    print(f"{drive.name}: {name}, {len(truth)} frames: {perf_counter() - start:.0f} s", file=sys.stderr)
    reach = settings_of(name, drive.data).max_range
    kinds = what_holds(course(drive.name) if drive.name in SCENES else None, drive.numbers, reach)
    return {"reason": None, "frames": len(truth), "reach_m": reach} | figures(run, truth, kinds)


def what_holds(drive: Drive | None, numbers: Array, reach: float) -> Array:
    """(N,) what there is along the road, of the frames with these numbers: NOTHING, ENDS, REPEATS or ELSEWHERE.

    `reach` [m] is how far the odometry looks. Of no built-in drive: ELSEWHERE.
    """
    kinds = np.full(len(numbers), ELSEWHERE, dtype="<U16")
    if drive is None:
        return kinds
    if drive.period is not None:
        kinds[:] = REPEATS
    way = drive.way[numbers]
    for kind, stretch in ((ENDS, drive.tunnel), (NOTHING, drive.unobservable(reach))):
        if stretch is not None:
            kinds[(stretch[0] <= way) & (way <= stretch[1])] = kind
    return kinds


def figures(run: OwnRun, truth: Array, kinds: Array) -> dict[str, Any]:
    """Figures of a run: status by kind of frame, reported directions, consistency of its covariances."""
    wrong = abs(errors_ahead(run.poses, truth)) > OFF
    told = np.isin(run.statuses, ("degenerate", "failed"))
    angles = named_angles(run, directions(truth), kinds != ELSEWHERE)
    return {
        "kinds": {
            str(kind): {
                "frames": int((kinds == kind).sum()),
                "degenerate": run.share("degenerate", kinds == kind),
                "lost": run.share("failed", kinds == kind),
                "off": int((wrong & (kinds == kind)).sum()),
                "off_untold": int((wrong & ~told & (kinds == kind)).sum()),
            }
            for kind in np.unique(kinds)
        },
        "named": len(angles),
        "angle_deg": float(np.rad2deg(np.median(angles))) if len(angles) else None,
        "near": float((angles <= np.deg2rad(NEAR)).mean()) if len(angles) else None,
        "nees": nees(run.poses, run.motion_covariances, truth),
        "nees_by_axis": nees_by_axis(run.poses, run.motion_covariances, truth),
        "nees_over_keyframes": nees_over_keyframes(run.poses, run.errors, truth),
        "ate_m": ate(run.poses, truth).rmse,
        "along_track_m": along_track_error(run.poses, truth),
        "path_length_m": path_length(run.poses),
        "truth_path_length_m": path_length(truth),
    }


def named_angles(run: OwnRun, axes: Array, where: Array) -> Array:
    """(M,) [rad] between the axes (N, 3) and the directions named in those degenerate frames that a mask (N,) picks.

    A frame names one for each row of `unobserved`; the one that has most of the axis in it counts. A frame that names
    rotations alone is off by 90 deg.
    """
    angles = []
    for frame in np.flatnonzero((run.statuses == "degenerate") & where & np.isfinite(axes[:, 0])):
        translations = run.unobserved[frame][:, 3:]
        along = abs(translations @ axes[frame])
        best = int(along.argmax()) if len(along) else None
        length = 0.0 if best is None else float(np.linalg.norm(translations[best]))
        angles.append(np.pi / 2 if best is None or length == 0 else np.arccos(min(along[best] / length, 1.0)))
    return np.array(angles)


def _arguments() -> argparse.Namespace:
    arguments = parser(__doc__)
    add_drives(arguments, *SCENES)
    inputs.add_inputs(arguments, inputs.IMAGELESS)
    add_results(arguments)
    return arguments.parse_args()


if __name__ == "__main__":
    run_script(main)
