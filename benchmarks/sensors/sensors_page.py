"""The page of sensors.py."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from statistics import median
from typing import Any

from benchmarks.common.page import table
from eval.text import number

SLACK_M, SLACK = 0.002, 0.02  # an error is worse if it is larger by more than both
ALL, HALF = "ray-segment", "ray-segment 0.5"  # all trusted predictions; the half with the smallest relative sigma
SPARSE = 32  # rings of the LiDARs that the default input is about


def page(found: Mapping[str, Any]) -> str:
    """Return the page's Markdown text."""
    about, rows = found["about"], found["rows"]
    counts = [_count(rows, name) for name in (ALL, HALF)]
    sparse = [row for row in rows if row["rings"] <= SPARSE]
    return f"""
# Sparse LiDARs, plain and enriched

{about["date"]}, {about["cpu"]}, one core. `{about["command"]}`

* Odometry alone, up to {about["frames"]} frames. `full`: all rings. `plain`: the rings in the column *rings*. Enriched:
  these by ray segments, all trusted predictions, or half of them, with the smallest sigma relative to their range
  (`front_end.coverage=0.5`).
* ATE against the exact ground truth of simulated sequences; on KITTI odometry 04 against KITTI's, whose own error is a
  centimetre or two. Distance to `full`: rmse of positions after alignment; for a LiDAR whose rings are all used there
  is none. KITTI raw has no ground truth of this accuracy.
* Worse: by more than {1000 * SLACK_M:.0f} mm and by more than {100 * SLACK:.0f} % of plain's figure, in the ATE or in
  the distance. Some sequences begin 0, 2 and 4 frames later: how far a figure depends on the start.
* The lasers of an OS1 look 3.2 and 1.1 deg to the right, and 1.1 and 3.2 deg to the left, in turn: every second ring
  is staggered by 4.2 deg, every fourth is not.

## Should sparse LiDARs be enriched by default?

No. The rule was: if enriched scans are nowhere worse than plain ones. All trusted predictions are worse in {counts[0]},
half of them in {counts[1]}; for LiDARs that are sold with {SPARSE} rings or fewer, in {_count(sparse, ALL)} and in
{_count(sparse, HALF)}. So the default input stays the scan as recorded, for every LiDAR; `--input enriched` asks for
ray segments.

* With half of the predictions no LiDAR of {SPARSE} rings or fewer is worse by this rule: 2.8 mm nearer to the ground
  truth to 0.9 mm farther. All of these sequences are simulated. The recorded ones, rings of an HDL-64E, contradict:
  with 16 of 64, half of the predictions are farther from the ground truth on KITTI odometry 04, and from all rings on
  KITTI raw 0013; with 32 of 64, all predictions are farther from all rings on 0013 and 0005. Rings of an OS1-64 and of
  an OS1-128 are worse on streets.
* On foot enrichment helps: with 16 and 32 of an OS1-64 the distance to all rings is 2 to 4 times smaller.
* Not in the table: the stairs that the building's sequence leads to. There a VLP-16 is chaotic with any input: an ATE
  of 0.1 to 8 m in runs of nearly the same code ([scenes](scenes.md)).

## Errors

{_errors(rows)}
## Depth and time

Error of added points at the returns of withheld rings: the dropped ones, or every second ring if none is dropped, so
that gaps are twice as wide as in use. Share: of the withheld returns between two rings, how many get a point. Run times
are medians over the frames of one run, on a machine that other programs used, so that single ratios mean little: their
median over the rows is {number(_median_ratio(rows), 1)}.

{_depths(rows)}"""


def _count(rows: Sequence[Mapping[str, Any]], name: str) -> str:
    judged = [worse for row in rows if (worse := _worse(row, name)) is not None]
    return f"{sum(judged)} of {len(judged)} rows"


def _worse(row: Mapping[str, Any], name: str) -> bool | None:
    """Whether an input is worse than plain in any figure of a row; None if it was not measured."""
    pairs = [(figures["plain"], figures.get(name)) for figures in (row["ate_m"], row["to_full_m"]) if figures]
    known = [(plain, value) for plain, value in pairs if value is not None]
    return any(value > plain + max(SLACK_M, SLACK * plain) for plain, value in known) if known else None


def _errors(rows: Sequence[Mapping[str, Any]]) -> str:
    header = (
        *(
            "sequence",
            "rings",
            "ATE, full [mm]",
            "plain",
            "enriched",
            "half",
            "to full, plain [mm]",
            "enriched",
            "half",
        ),
        "worse",
    )
    cells = []
    for row in rows:
        ate, to_full = row["ate_m"] or {}, row["to_full_m"] or {}
        worse = [title for name, title in ((ALL, "enriched"), (HALF, "half")) if _worse(row, name)]
        figures = [*(ate.get(name) for name in ("full", "plain", ALL, HALF)), *map(to_full.get, ("plain", ALL, HALF))]
        cells.append([*_name(row), *(number(value, 1, 1000) for value in figures), ", ".join(worse) or "-"])
    return table(header, cells, words=2)


def _depths(rows: Sequence[Mapping[str, Any]]) -> str:
    header = (
        *("sequence", "rings", "predicted from", "MAE [mm]", "median [mm]", "share [%]"),
        *("odometry, plain [ms]", "enriched", "enrichment [ms]", "ratio of both to plain"),
    )
    cells = []
    for row in rows:
        if row["start"]:
            continue
        deep, times = row["depth"], row["odometry_ms"]
        cells.append(
            [
                *_name(row),
                str(deep["kept"]),
                number(deep["mae_mm"], 0),
                number(deep["median_mm"], 0),
                number(deep["share"], 0, 100),
                number(times["plain"], 1),
                number(times[ALL], 1),
                number(row["enrichment_ms"], 1),
                number(_ratio(row), 1),
            ]
        )
    return table(header, cells, words=2)


def _ratio(row: Mapping[str, Any]) -> float:
    """Time of enrichment and odometry on all predictions, relative to the odometry on plain scans."""
    times = row["odometry_ms"]
    return float((times[ALL] + row["enrichment_ms"]) / times["plain"])


def _median_ratio(rows: Sequence[Mapping[str, Any]]) -> float:
    return median(map(_ratio, rows))


def _name(row: Mapping[str, Any]) -> tuple[str, str]:
    later = f", from frame {row['start']}" if row["start"] else ""
    return f"{row['name']}{later}", f"{row['kept']} of {row['rings']}"
