"""The page scenes.md, made of the figures in the JSON file and nothing else."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from benchmarks.common.page import table, without_about
from benchmarks.odometry.names import OURS, REFERENCE
from eval.text import number

Results = dict[str, Any]  # [drive][input] -> {"reason", "front_end_ms", "systems": {system: figures}}

DEFAULT = next(iter(OURS))
OFF = 0.05  # share of the true path: larger errors of its length or its end are wrong positions
HEADER = (
    "input", "system", "ATE m", "to dense m", "along m", "path m", "path %", "worst frame m", "at", "degenerate",
    "lost", "median ms", "x KISS-ICP",
)  # fmt: skip

PROTOCOL = """\
* Inputs: `full`, as recorded; `16`, sixteen evenly spaced rings from the top (every 4th of 64, every 8th of 128; a
  sensor with no more rings has `full` only); or these enriched to about 64 by the method named, with a history that our
  odometry places. All systems get the same clouds, each deskewed with its own constant-velocity prediction and the same
  kernel if points have times, and with the vertical correction of the sensor. Predicted points have a sigma, which only
  our odometry uses.
* `ndt` is lidarlift's odometry with the default settings for the input, `ndt-scan-to-scan` with the preset; both
  without loops. The peers have their authors' settings (benchmarks/odometry/peers.py). GenZ-ICP's wheel has several:
  `genz-icp` is outdoor.yaml, `genz-icp-indoor` is indoor.yaml, its default.
* ATE: rmse of positions after SE(3) alignment. Along: how far the last position is ahead of the ground truth (negative:
  behind it), along the true direction of travel, with the first poses aligned. Path: its length, and by how much it is
  longer than the true one. Worst frame: the largest translation error of the motion between frames, and the number of
  the later frame. KITTI's ground truth errs by more than the odometry, except on 04.
* To dense: as ATE, relative to a slow dense trajectory instead of the ground truth, small_gicp's GICP at all channels
  against the last 20 scans at 0.25 m; for recorded sequences only. Since it is GICP, it may favour gicp and vgicp.
* Degenerate: frames that our odometry reports as unobservable in some directions, along which it keeps the prediction.
  Lost: frames with the status `failed`, for which it keeps all of the prediction. The peers do not report this.
* The systems alternate scan by scan in one process, pinned to one core, with one thread each; the order changes from
  scan to scan. The time is from point cloud to pose; compilation and the first {uncounted} frames do not count. "x
  KISS-ICP" is KISS-ICP's median divided by the system's: above 1 is faster. The machine is shared, so that only ratios
  count.
"""


def page(found: Mapping[str, Any]) -> str:
    """`found` is the JSON file: the drives by name, and "about"."""
    about, results = found["about"], without_about(found)
    versions = ", ".join(f"{name} {text}" for name, text in about["versions"].items())
    parts = [
        "# Odometry by scenes\n",
        f"{about['date']}, {about['cpu']}, {about['cores']} cores, {about['memory_gib']} GiB; {versions}.\n",
        f"```\n{about['command']}\n```\n",
        *([f"{about['note']}\n"] if "note" in about else []),
        PROTOCOL.format(**about),
        "## Ranking by ATE\n",
        _nearest(results, about),
        *_nearest_to_dense(results),
        "## Cases in which a peer is better\n",
        bullets(where_we_lose(results)),
        "## Unreported errors\n",
        f"The error of our path's length or of its end exceeds {OFF:.0%} of the path, even after the frames that it "
        "reported as\ndegenerate or lost are corrected.\n",
        bullets(wrong_without_knowing(results, about["datasets"])),
    ]
    for name, drive in results.items():
        parts += [f"## {name}\n", _caption(about["datasets"][name], drive), _table(about["datasets"][name], drive)]
        parts += _errors(drive)
    return "\n".join(parts)


def ranking(systems: Mapping[str, Any], figure: str = "ate_m") -> list[tuple[str, float]]:
    """Systems and their ATE [m], or another figure, least first; those without are not in it."""
    known = [(name, entry[figure]) for name, entry in systems.items() if entry.get(figure) is not None]
    return sorted(known, key=lambda each: each[1])


def where_we_lose(results: Results) -> list[str]:
    """Cases in which other systems are better, by drive and input: a lower ATE than our default's, or less time."""
    lines = []
    for drive, name, systems in _measured(results):
        ours = systems[DEFAULT]
        if ours["error"]:
            lines.append(f"{drive}, {name}: {DEFAULT} failed.")
            continue
        better = [(other, ate) for other, ate in ranking(systems) if other not in OURS and ate < ours["ate_m"]]
        if better:
            others = ", ".join(f"{other} {number(ate, 3)}" for other, ate in better)
            lines.append(f"{drive}, {name}: ATE {number(ours['ate_m'], 3)} m; {others}.")
        faster = ours["ratio_to_kiss"]
        if faster is not None and faster < 1:
            lines.append(f"{drive}, {name}: {number(1 / faster, 2)} times the time of {REFERENCE}.")
    return lines


def wrong_without_knowing(results: Results, facts: Mapping[str, Any]) -> list[str]:
    """List unreported errors of our odometry: path length or end position off by more than OFF, with registered frames.

    Errors in frames that it reported as uncertain do not count, see `corrected`.
    """
    lines = []
    for drive, name, systems in _measured(results):
        true = facts[drive]["truth_path_length_m"]
        for ours in OURS:
            untold = systems[ours].get("untold") or systems[ours]
            length, along = (untold.get(figure) for figure in ("path_length_m", "along_track_m"))
            if not true or length is None:
                continue
            if max(abs(length - true), abs(along or 0.0)) > OFF * true:
                frames = facts[drive]["frames"]
                said = frames - systems[ours]["failed_frames"] - systems[ours].get("degenerate_frames", 0)
                lines.append(
                    f"{drive}, {name}, {ours}: {number(length, 1)} m for {number(true, 1)}, "
                    f"{_signed(along, 1)} m at the end; {said} of {frames} frames are `registered`."
                )
    return lines


def bullets(lines: list[str]) -> str:
    return "".join(f"* {line}\n" for line in lines) or "None.\n"


def _measured(results: Results) -> Iterator[tuple[str, str, Mapping[str, Any]]]:
    """Sequence, input and figures by system, for the inputs that the sequence has."""
    for drive, by_input in results.items():
        for name, entry in by_input.items():
            if entry["reason"] is None:
                yield drive, name, entry["systems"]


def _nearest(results: Results, about: Mapping[str, Any]) -> str:
    """Table by ATE, with that of an earlier run of ours on the same number of frames, if it is known."""
    header: tuple[str, ...] = ("sequence", "input", "nearest", "ATE m", f"{DEFAULT} m", "times", "rank")
    if "before" not in about:
        return table(header, _ranks(results, "ate_m"), words=3)
    date, drives = about["before"]["date"], about["before"]["drives"]
    rows = []
    for drive, name, *rank in _ranks(results, "ate_m"):
        same = drives.get(drive, {}).get("frames") == about["datasets"][drive]["frames"]
        earlier = number(drives[drive]["ate_m"].get(name), 3) if same else "-"
        rows.append((drive, name, *rank[:3], earlier, *rank[3:]))
    header = (*header[:5], "before m", *header[5:])
    return f"Before: `{DEFAULT}` as it was on {date}, on the same number of frames.\n\n" + table(header, rows, words=3)


def _nearest_to_dense(results: Results) -> list[str]:
    """The same by the distance to the dense trajectory, where there is one."""
    rows = list(_ranks(results, "dense_m"))
    header = ("sequence", "input", "nearest", "to dense m", f"{DEFAULT} m", "times", "rank")
    return [table(header, rows, words=3)] if rows else []


def _ranks(results: Results, figure: str) -> Iterator[tuple[str, ...]]:
    """Our rank is that among the peers: our other presets do not count."""
    for drive, name, systems in _measured(results):
        compared = {other: entry for other, entry in systems.items() if other == DEFAULT or other not in OURS}
        order = ranking(compared, figure)
        if order:
            best, least = order[0]
            ours = dict(order).get(DEFAULT)
            rank = f"{[other for other, _ in order].index(DEFAULT) + 1} of {len(order)}" if ours is not None else "-"
            times = number(ours / least, 2) if ours is not None and least > 0 else "-"
            yield drive, name, best, number(least, 3), number(ours, 3), times, rank


def _caption(facts: Mapping[str, Any], drive: Mapping[str, Any]) -> str:
    text = f"{facts['frames']} frames, {facts['first']} to {facts['last']}"
    text += f"; {facts['sensor']}, {facts['rings']} rings" if facts["rings"] else "; rings unknown"
    if facts["truth_path_length_m"] is not None:
        text += f"; {facts['truth_path_length_m']:.1f} m by the ground truth"
    took = [(name, entry["front_end_ms"]) for name, entry in drive.items() if entry.get("front_end_ms") is not None]
    if took:
        text += "; enrichment takes " + ", ".join(f"{number(each, 0)} ms ({name})" for name, each in took)
    return text + ("; the dense reference failed" if facts.get("dense_failed") else "") + ".\n"


def _table(facts: Mapping[str, Any], drive: Mapping[str, Any]) -> str:
    rows: list[tuple[str, ...]] = []
    for name, entry in drive.items():
        if entry["reason"] is not None:
            rows.append((name, f"- ({entry['reason']})", *["-"] * (len(HEADER) - 2)))
        else:
            rows += [_row(name, system, found, facts) for system, found in entry["systems"].items()]
    return table(HEADER, rows, words=2)


def _row(name: str, system: str, found: Mapping[str, Any], facts: Mapping[str, Any]) -> tuple[str, ...]:
    if found["error"]:
        return (name, system, "failed", *["-"] * (len(HEADER) - 3))
    true = facts["truth_path_length_m"]
    return (
        name,
        system,
        number(found["ate_m"], 3),
        number(found["dense_m"], 3),
        _signed(found["along_track_m"], 3),
        number(found["path_length_m"], 1),
        _signed(100 * (found["path_length_m"] / true - 1) if true else None, 1),
        number(found["worst_m"], 3),
        number(found["worst_frame"], 0),
        number(found.get("degenerate_frames"), 0),
        number(found["failed_frames"], 0),
        number(found["median_ms"], 1),
        number(found["ratio_to_kiss"], 2),
    )


def _signed(value: float | None, decimals: int) -> str:
    return "-" if value is None else f"{value:+.{decimals}f}"


def _errors(drive: Mapping[str, Any]) -> list[str]:
    """A line for each system that failed."""
    return [
        f"`{system}` failed on {name}: {found['error']}\n"
        for name, entry in drive.items()
        if entry["reason"] is None
        for system, found in entry["systems"].items()
        if found["error"]
    ]
