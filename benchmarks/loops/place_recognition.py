"""Place recognition alone on drives with real revisits: recall, precision, yaw, time.

    python -m benchmarks.loops.place_recognition FOLDER/kitti_00_keyframes FOLDER/nclt_20130110

writes place_recognition.md, .json and .png in benchmarks/results. The JSON is [dataset][variant].{recall_top_1, ...},
with "about" beside the data sets. One core.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from benchmarks.common.cores import ONE_THREAD, pin_to_one_core

os.environ.update(ONE_THREAD)

from matplotlib.figure import Figure

from benchmarks.common.page import surroundings, table, without_about, write_results
from benchmarks.common.script import add_results, parser, run_script
from benchmarks.loops.places import FAR, THINNED, Figures, RecordedKeyframes, cost, read_drive, recognise
from slam.data.plot_style import save_png, tidy
from slam.loops.scan_context import DEFAULT

PACKAGES = ("numpy", "scipy", "numba")
#: What is known of each data set: the radius of its revisits [m], and how its clouds are thinned.
DATASETS = {
    "kitti_00_keyframes": (4.0, "every fourth elevation band"),
    "nclt_20130110": (5.0, "random half of the points"),
}
#: Variants on the clouds as they are: what differs from the default.
VARIANTS: dict[str, dict[str, Any]] = {
    "default": {},
    "exhaustive search": {"exhaustive": True},
    "no lateral shifts": {"lateral_shifts": (0.0,)},
    "one keyframe, levelled": {"submap_length": 0.0},
    "one keyframe, as recorded": {"raw": True},
}
COUNTS = (2000, 10000)


def main() -> None:
    arguments = parser(__doc__)
    arguments.add_argument("folders", nargs="+", type=_folder, metavar="FOLDER", help=" or ".join(DATASETS))
    add_results(arguments)
    options = arguments.parse_args()
    pin_to_one_core()
    about = surroundings(PACKAGES) | {"settings": DEFAULT.model_dump()}
    results: dict[str, dict[str, Figures]] = {}
    for folder in options.folders:
        radius, thinning = DATASETS[folder.name]
        drive = read_drive(folder, radius)
        results[folder.name] = _measure(drive, thinning)
    about["cost"] = cost(drive.clouds, DEFAULT, COUNTS)
    write_results(options.results, "place_recognition", {"about": about, **results}, page)
    _draw(results, options.results / "place_recognition.png")


def _measure(drive: RecordedKeyframes, thinning: str) -> dict[str, Figures]:
    inputs = {name: (drive.clouds, changes) for name, changes in VARIANTS.items()}
    thinned = THINNED[thinning](drive.clouds)
    inputs[thinning] = (thinned, {})
    inputs[f"{thinning}, one keyframe, levelled"] = (thinned, {"submap_length": 0.0})
    results = {}
    for name, (clouds, changes) in inputs.items():
        print(f"{len(clouds)} keyframes: {name}", file=sys.stderr)
        flags = {key: value for key, value in changes.items() if key in ("exhaustive", "raw")}
        settings = DEFAULT.model_copy(update={key: value for key, value in changes.items() if key not in flags})
        results[name] = recognise(drive, clouds, settings, **flags)
    return results


def page(found: Mapping[str, Any]) -> str:
    """`found` is the JSON file: the data sets by name, and "about"."""
    about, results = found["about"], without_about(found)
    parts = [
        "# Place recognition\n",
        f"Scan context alone, before any geometric verification. {about['cpu']}, one core, {about['date']}: "
        f"`{about['command']}`. A revisit is a keyframe that comes within 4 m (KITTI) or 5 m (NCLT) of one at least "
        f"{DEFAULT.min_travelled_distance:.0f} m of travelled distance earlier; recall counts the revisits with such a "
        f"place among their first 1, 5 or 10 candidates. Near: the first candidate lies within {FAR:.0f} m. The other "
        "recalls accept "
        "first candidates below a threshold on the distance, asked of all keyframes, and take the largest threshold at "
        f"which all of them are right (P100), none is more than {FAR:.0f} m away (without far), 95 % are right (P95). "
        "The clouds have no rings: every fourth band of 0.43 deg of elevation represents 16 channels. Submaps are "
        "built from the odometry; times are medians over the last 200 keyframes. "
        "Curves: [the picture](place_recognition.png).\n",
    ]
    header = (
        "variant",
        "top 1",
        "top 5",
        "top 10",
        "near",
        "P100",
        "without far",
        "P95",
        "yaw error deg, median (p95)",
    )
    times = ("ms submap", "query", "add")
    for name, variants in results.items():
        revisits = variants["default"]["revisits"]
        parts.append(f"\n## {name}, {revisits} revisits\n")
        parts.append(table((*header, *times), [_row(variant, figures) for variant, figures in variants.items()]))
    rows = [
        (count, *(f"{of[name]:.1f}" for name in ("query_ms", "add_ms")), f"{of['recall']:.3f}",
         f"{of['recall_exhaustive']:.3f}")
        for count, of in about["cost"].items()
    ]  # fmt: skip
    parts.append(
        "\nCost over the number of places. Each place is half of one cloud and half of another, with a random yaw. "
        "Recall: share of 200 places, seen again with half of their points from up to 2 m to the side, that are the "
        "first candidate; `exhaustive`: the same without preselection.\n"
    )
    parts.append(table(("places", "ms query", "ms add", "recall", "exhaustive"), rows))
    return "\n".join(parts)


def _row(name: str, figures: Figures) -> tuple[str, ...]:
    recalls = ("top_1", "top_5", "top_10", "near", "at_full_precision", "without_far", "at_95_percent_precision")
    yaw = figures["yaw_error_deg"]
    return (
        name,
        *(f"{figures[f'recall_{recall}']:.3f}" for recall in recalls),
        f"{yaw['median']:.1f} ({yaw['p95']:.1f})",
        *(f"{figures[f'{step}_ms']:.1f}" for step in ("submap", "query", "add")),
    )


def _draw(results: dict[str, dict[str, Figures]], file: Path) -> None:
    """Precision over recall of the first candidate, as the distance threshold rises."""
    figure = Figure(figsize=(6 * len(results), 4.5), layout="constrained")
    panels = figure.subplots(1, len(results), squeeze=False)[0]
    for axis, (name, variants) in zip(panels, results.items(), strict=True):
        for variant, figures in variants.items():
            axis.plot(figures["curve"]["recall"], figures["curve"]["precision"], label=variant)
        axis.set(title=name, xlabel="recall", ylabel="precision", xlim=(0, 1), ylim=(0, 1.02))
        tidy(axis)
        axis.legend(loc="lower left", fontsize="small")
    save_png(figure, file, dpi=120)


def _folder(text: str) -> Path:
    if Path(text).name not in DATASETS or not Path(text).is_dir():
        raise argparse.ArgumentTypeError(f"{text}: no such folder, or its name is not {' or '.join(DATASETS)}")
    return Path(text)


if __name__ == "__main__":
    run_script(main)
