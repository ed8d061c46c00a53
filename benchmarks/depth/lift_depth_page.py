"""The page lift_depth.md: targets and tables from the results of lift_depth.py."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from benchmarks.common.page import table, target
from benchmarks.depth.flying_pixels import COVERAGE, FRAMES, IN_THE_AIR, TOWN
from benchmarks.depth.image_gain import JUMP, JUMP_SHARE, JUMPS, ROAD
from benchmarks.depth.lift_time import BOTH, NETWORK, REPEATS, SCANS, WITH, WITHOUT
from benchmarks.depth.tables import of_views
from enrichment.methods.registry import LIFT
from eval.text import number
from slam.data.cloud import HISTORY

CLASSICAL, SINGLE = ("ray-segment", "joint"), "lift, single scans"
#: What was aimed at, the figure, how it has to be to the limit, and how many decimals are shown.
Aim = tuple[str, float, str, float, int]


def targets(found: Mapping[str, Any]) -> list[tuple[str, str, str, str]]:
    """Targets: name, figure, limit, and whether it is met."""
    aims: list[Aim] = []
    for report in found["drives"]:
        aims += _of_04(report) if report["about"]["dataset"].endswith("04") else _of_raw(report)
    aims.append((f"{TOWN}, 80 % coverage: in the air [%]", 100 * found["flying_pixels"][LIFT]["surest"], "<=", 1, 2))
    for view, limit in ((WITHOUT, 60), (WITH, 100)):
        for part, name in ((NETWORK, "the network in ONNX Runtime"), (BOTH, "input and network")):
            aims.append((f"{view}, {name} [ms]", found["ms"][view][part][0], "<=", limit, 0))
    return [target(*aim) for aim in aims]


def _of_04(report: Mapping[str, Any]) -> list[Aim]:
    drive, lift = report["about"]["dataset"], report[LIFT]["image"]
    surest = lift["at_80"]
    aims = []
    for figure, limit in (("mae_mm", 380), ("rmse_mm", 1700)):
        best = min(report[name]["image"][figure] for name in CLASSICAL)
        name = f"{drive}, field of view: {figure.split('_')[0].upper()}"
        aims.append((f"{name} [mm]", lift[figure], "<=", limit, 0))
        aims.append((f"{name}, by the better of {' and '.join(CLASSICAL)}", lift[figure] / best, "<=", 1, 2))
    return [
        *aims,
        (f"{drive}, field of view, 80 %: MAE [mm]", surest["mae_mm"], "<=", 95, 0),
        (f"{drive}, field of view, 80 %: RMSE [mm]", surest["rmse_mm"], "<=", 220, 0),
        (f"{drive}, field of view, 80 %: worse than 1 m [%]", 100 * surest["worse_1m"], "<=", 0.5, 2),
    ]


def _of_raw(report: Mapping[str, Any]) -> list[Aim]:
    drive, lift = report["about"]["dataset"], report[LIFT]["full"]
    within = f"{drive}, all azimuths: errors within sigma [%]"
    return [
        (f"{drive}, all azimuths: MAE [mm]", lift["mae_mm"], "<=", 450, 0),
        (f"{drive}, all azimuths, 80 %: MAE [mm]", lift["at_80"]["mae_mm"], "<=", 60, 0),
        (within, 100 * lift["calibration"], ">=", 60, 1),
        (within, 100 * lift["calibration"], "<=", 76, 1),
    ]


def page(found: Mapping[str, Any]) -> str:
    about = found["about"]
    drives = "\n".join(
        f"## {report['about']['title']}; weights: {report['about']['weights']}\n\n{of_views(report)}"
        for report in found["drives"]
    )
    return f"""# Depth with Lift

{about["date"]}, {about["cpu"]}, load average {about["load_average"]}; frames: one in {about["step"]}.
`{about["command"]}`

{table(("target", "figure", "limit", "verdict"), targets(found))}
Protocol and figures are those of [Depth](depth_methods.md). The input is every 4th ring from ring 0, also of the
{HISTORY} scans before, which are placed by the true poses; "{SINGLE}" does without these. One core.

{drives}
## Effect of the image

On {found["image_of"]}, returns in the camera's field of view: MAE in mm of networks from the same training, with images
and without any image in training and evaluation, by seed; the step half way to the guess is part of the effect. Spread:
maximum minus minimum. {JUMPS.capitalize()}: one of the adjacent returns above and below on kept rings is more than
{JUMP:g} m and {100 * JUMP_SHARE:.0f} % farther than the other, and not both are {-ROAD} m or more below the sensor,
where rings on an empty road are as far apart.

{_image_table(found["image"])}
## Flying pixels

Town, sequence {TOWN}, {len(FRAMES)} frames: share of the predicted points farther than {IN_THE_AIR} m from all
surfaces of the town at that moment, including hidden ones; of all trusted points, and at {100 * COVERAGE:.0f} %
coverage, that is of those with the lowest sigma relative to their range. A few measured points are as far: pulses that
hit two surfaces.

{_flying_table(found["flying_pixels"])}
## Time

Milliseconds per scan of {found["time_of"]}; cores: {found["cores_of_time"]}. Median over {SCANS} scans of the median of
{REPEATS} runs each, and of the minimum, which other processes on the machine affect less. Reading the image does not
count.

{_time_table(found["ms"])}"""


def _image_table(image: Mapping[str, Mapping[str, Sequence[float]]]) -> str:
    lines = []
    for kind, views in image.items():
        for view, of_seeds in views.items():
            figures = (*of_seeds, float(np.mean(of_seeds)), float(np.ptp(of_seeds)))
            lines.append((kind, view, *(number(figure, 0) for figure in figures)))
    seeds = len(lines[0]) - 4
    return table(("returns", "", *(f"seed {seed + 1}" for seed in range(seeds)), "mean", "spread"), lines, words=2)


def _flying_table(methods: Mapping[str, Mapping[str, Any]]) -> str:
    lines = [
        (name, f"{figures['points']:,}", number(figures["in_the_air"], 2, 100), number(figures["surest"], 2, 100))
        for name, figures in methods.items()
    ]
    return table(("points", "trusted", "in the air %", f"at {100 * COVERAGE:.0f} % coverage"), lines)


def _time_table(views: Mapping[str, Mapping[str, Sequence[float]]]) -> str:
    lines = [
        (view, *(number(figure, 0) for part in parts.values() for figure in part[:2])) for view, parts in views.items()
    ]
    header = [f"{part}{least}" for part in ("input", "network", "both") for least in ("", ", least")]
    return table(("", *header), lines)
