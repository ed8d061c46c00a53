"""How well do methods of enrichment predict what sixteen of 64 rings do not show? The paper's Table II, and more.

    python -m benchmarks.depth.depth_methods kitti_odometry_04 kitti_raw_0005 kitti_raw_0013

measures every method on every frame of the drives; writes depth_methods.md and .json in benchmarks/results.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from benchmarks.common.cores import pin_to_one_core
from benchmarks.common.page import surroundings, table, verdict, without_about, write_results
from benchmarks.common.script import add_results, parser, run_script
from benchmarks.depth.tables import of_views
from enrichment.methods.registry import LIFT, NETWORK_METHODS, make_methods, runnable
from eval.depth.tables import PAPER, VIEWS
from eval.text import number
from lidarlift.depth_benchmark import sequence_report
from slam.data.dataset import open_dataset

RAW, TRAINED_ON = "KITTI raw", "0013"  # the shipped networks have seen 0013


def main() -> None:
    arguments = parser(__doc__)
    arguments.add_argument("datasets", nargs="+", type=Path, metavar="DATASET")
    add_results(arguments)
    options = arguments.parse_args()
    pin_to_one_core()
    reports: dict[str, Any] = {}
    for data in map(open_dataset, options.datasets):
        reports[data.name] = sequence_report(
            data, make_methods([name for name in runnable() if name != LIFT])
        ).as_dict()
    about = surroundings(("numpy", "opencv-python-headless", "onnxruntime"))
    write_results(options.results, "depth_methods", {"about": about, "drives": reports}, page)


def targets(reports: Mapping[str, Any]) -> Iterable[tuple[str, ...]]:
    """Targets by drive: figure, limit, verdict."""
    for drive, report in reports.items():
        image, full = (
            {name: entry[view] for name, entry in without_about(report).items() if view in entry} for view in VIEWS
        )
        if image:
            best = min(image[name]["mae_mm"] for name in ("ray-segment", "delaunay"))
            yield _target(
                drive, "joint in the image, MAE [mm]: below ray-segment and Delaunay", image["joint"]["mae_mm"], best
            )
            if "f2l" in image and not drive.endswith(TRAINED_ON):
                yield _target(drive, "f2l in the image, MAE [mm]", image["f2l"]["mae_mm"], 600)
                yield _target(drive, "f2l in the image, RMSE [mm]", image["f2l"]["rmse_mm"], PAPER["f2l"]["rmse_mm"])
        if drive.startswith(RAW):
            plain = full["ray-segment"]
            yield _target(
                drive, "ray-segment all around, MAE of the best 80 % by sigma [mm]", plain["at_80"]["mae_mm"], 180
            )
            share = 100 * plain["calibration"]
            verdict = "met" if 60 <= share <= 76 else "missed"
            yield drive, "ray-segment, all azimuths, errors within sigma [%]", number(share, 1), "60 to 76", verdict


def _target(drive: str, name: str, value: float, limit: float) -> tuple[str, ...]:
    return drive, name, number(value, 0), f"< {limit:.0f}", verdict(value, "<", limit)


def networks(reports: Mapping[str, Any]) -> str:
    """A paragraph on the paper's networks, if they were measured."""
    ran = [name for name in NETWORK_METHODS if any(name in report for report in reports.values())]
    if not ran:
        return ""
    sizes = {name: report[name]["parameters"] for report in reports.values() for name in ran if name in report}
    lines = [(name, f"{sizes[name]:,}", *(str(PAPER[name][key]) for key in ("rmse_mm", "mae_mm"))) for name in ran]
    return f"""The paper's networks, l2l, li2l and f2l, were trained at half the resolution, in at most 3 hours each on
one CPU core. 04 and 0005 are in no training set; 0013 is, so that the rows of these networks there are no test. Their
depths are corrected by the returns above and below each ray. Outside of the image they use ray-segment's ranges.
The paper's Table II, on other frames and after training on 1730:

{table(("network", "parameters here", "RMSE mm", "MAE mm"), lines)}
"""


def page(found: Mapping[str, Any]) -> str:
    about, reports = found["about"], found["drives"]
    tables = "\n".join(f"## {report['about']['title']}\n\n{of_views(report)}" for report in reports.values())
    return f"""# Depth

{about["date"]}, {about["cpu"]}, one core.
`{about["command"]}`

* The input is every 4th ring, from ring 0. The returns of the other 48 rings are the reference. A prediction is made on
  the calibrated line of the ring at the centre of the azimuth column, never in the direction of the return.
* Camera field of view: returns that the camera sees. All returns: 360 deg. Figures are over the returns that a method
  predicts (coverage); methods that complete depth images predict nothing outside of the image.
* AUSE and "80 %": how well sigma ranks the errors; "80 %" is 80 % coverage, the 80 % of predictions with the lowest
  sigma. "In sigma": the share of errors below sigma, 68 % if sigma is right. Sigma is calibrated on held-out rings of
  the sixteen, as in a run.
* nearest, ip-basic, delaunay, mrf: depth images completed without training. ray-segment: intersection of the ray with
  the straight segment between the returns above and below. joint: ray-segment, guided by the image where it is
  uncertain. lift, which was trained on two of these sequences, has a [page of its own](lift_depth.md).
* The scans of 04 are motion-compensated, so that their points are off the lasers' lines. The raw sequences are the
  clean test.
* ms: median time per frame.

{table(("target", "", "figure", "limit", "verdict"), targets(reports), words=2)}
{networks(reports)}{tables}"""


if __name__ == "__main__":
    run_script(main)
