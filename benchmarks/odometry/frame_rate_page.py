"""The page frame_rate.md, made of the figures in the JSON file and nothing else."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from benchmarks.common.page import table, verdict, without_about
from benchmarks.odometry.names import CHANNELS, REFERENCE, SYSTEMS
from eval.text import number

Results = dict[str, Any]  # [dataset][system][channels] -> figures, see figures.py

PROTOCOL = """\
* All systems get the same scans, read in advance: 64 channels as recorded, or 16, every 4th ring. If scans have times,
  each system deskews them with its own constant-velocity prediction and the same kernel; all get the vertical
  correction of the sensor. `ndt` has the default settings for its input, `ndt-scan-to-scan` those of the preset; the
  peers have their authors' settings (benchmarks/odometry/peers.py), the same at 64 and at 16 channels.
* The systems alternate scan by scan in one process, pinned to one core, with one thread each; the order changes from
  scan to scan. Repeats, with new instances: {repeats}. The time is from point cloud to pose, including deskewing and
  the update of the map, without reading from disk; compilation and the first {uncounted} frames do not count. Peers get
  the deskewed scan, ours deskews the points that it registers or keeps; a run deskews the whole scan for its map later.
* Median and 95th percentile are over all counted scans; frames/s is their number divided by their total time. "x
  KISS-ICP" is KISS-ICP's median divided by the system's (in brackets: minimum and maximum of the repeats): above 1 is
  faster.
* ATE: rmse of positions after SE(3) alignment to the ground truth. "to dense": the same relative to a slow dense
  trajectory, small_gicp's GICP at 64 channels against the last 20 scans at 0.25 m; since it is GICP, it may favour gicp
  and vgicp. Both are of the first repeat. `ndt` uses points up to 80 m, the peers up to 100 m: their defaults.
* Drift: KITTI's metric, at lengths that fit the sequence; "unrotated": after the best constant rotation of the body
  frame is removed. On short sequences it measures the ground truth as much as the odometry.
* Memory: peak of a separate process that reads 64-channel scans one by one, including libraries (in brackets: before
  the first scan). "lost": frames for which our odometry kept the prediction; the peers do not report this.
"""


def page(found: Mapping[str, Any]) -> str:
    """`found` is the JSON file: the data sets by name, and "about"."""
    about, results = found["about"], without_about(found)
    versions = ", ".join(f"{name} {text}" for name, text in about["versions"].items())
    parts = [
        "# Odometry\n",
        f"{about['date']}, {about['cpu']}, {about['cores']} cores, {about['memory_gib']} GiB; {versions}.\n",
        f"```\n{about['command']}\n```\n",
        "![Milliseconds per frame over distance to a dense trajectory, one panel per sequence](frame_rate.png)\n",
        PROTOCOL.format(**about),
        "## Targets\n",
        table(("sequence", "target", "ndt", "limit", "verdict"), targets(results), words=2),
    ]
    for name, systems in results.items():
        facts = about["datasets"][name]
        parts += [f"## {name}\n", _caption(facts, systems), _table(systems), *_errors(systems)]
    return "\n".join(parts)


def targets(results: Results) -> list[tuple[str, ...]]:
    """Rows of the table of targets: drive, target, value, limit, met or missed."""
    return [
        (drive, what, number(value, digits), f"{relation} {number(limit, digits)}", verdict(value, relation, limit))
        for drive, systems in results.items()
        for what, value, relation, limit, digits in _goals(drive, systems)
    ]


def _goals(drive: str, systems: Results) -> Iterator[tuple[str, float | None, str, float | None, int]]:
    """Targets: name, figure, relation, limit, and decimals."""
    ours, kiss = systems["ndt"], systems[REFERENCE]
    if drive.endswith("0013"):
        yield "times KISS-ICP's speed, 64 channels", ours["64"].get("ratio_to_kiss"), "≥", 5.0, 2
    dense = kiss["64"].get("dense_m")
    yield (
        "distance to dense, 64 channels [m]: KISS-ICP's or 2 cm",
        ours["64"].get("dense_m"),
        "≤",
        None if dense is None else max(dense, 0.02),
        4,
    )
    for channels, percent in (("64", 5), ("16", 10)):
        ate = kiss[channels].get("ate_m")
        limit = None if ate is None else max(ate * (1 + percent / 100), ate + 0.01)
        what = f"ATE, {channels} channels [m]: KISS-ICP's + {percent} % or 1 cm"
        yield what, ours[channels].get("ate_m"), "≤", limit, 4


def _caption(facts: dict[str, Any], systems: Results) -> str:
    text = f"{facts['frames']} frames"
    if facts["truth_path_length_m"] is not None:
        text += f", {facts['truth_path_length_m']:.1f} m by the ground truth"
    drift = next((entry["drift"] for s in systems.values() for entry in s.values() if entry.get("drift")), None)
    if drift:
        text += f"; drift: {drift['name']}" + (f", segments: {drift['segments']}" if drift["segments"] else "")
    return text + ("" if facts["dense"] else "; the dense reference failed") + ".\n"


def _table(systems: Results) -> str:
    header = (
        "channels", "system", "median ms", "p95 ms", "frames/s", "x KISS-ICP", "ATE m", "to dense m", "path m",
        "drift %", "unrotated %", "memory MB", "lost",
    )  # fmt: skip
    rows = [_row(channels, name, systems[name][channels]) for channels in CHANNELS for name in SYSTEMS]
    return table(header, rows, words=2)


def _row(channels: str, system: str, entry: dict[str, Any]) -> tuple[str, ...]:
    if entry["error"]:
        return (channels, system, "failed", *["-"] * 8, _memory(entry), "-")
    drift = entry["drift"] or {}
    unrotated = drift.get("body_rotation_removed") or {}
    return (
        channels,
        system,
        number(entry["median_ms"], 1),
        number(entry["p95_ms"], 1),
        number(entry["fps"], 1),
        _ratio(entry),
        number(entry["ate_m"], 3),
        number(entry["dense_m"], 3),
        number(entry["path_length_m"], 1),
        number(drift.get("translation_percent"), 3),
        number(unrotated.get("translation_percent"), 3),
        _memory(entry),
        number(entry["failed_frames"], 0),
    )


def _ratio(entry: dict[str, Any]) -> str:
    repeats = entry["ratio_to_kiss_repeats"]
    spread = f" ({min(repeats):.2f}-{max(repeats):.2f})" if repeats and len(repeats) > 1 else ""
    return number(entry["ratio_to_kiss"], 2) + spread


def _memory(entry: dict[str, Any]) -> str:
    if entry.get("memory_mb") is None:
        return "-"
    return f"{entry['memory_mb']:.0f} ({entry['memory_before_first_scan_mb']:.0f})"


def _errors(systems: Results) -> list[str]:
    """A line for each system that failed."""
    return [
        f"`{name}` failed at {channels} channels: {entry['error']}\n"
        for name, by_channels in systems.items()
        for channels, entry in by_channels.items()
        if entry["error"]
    ]
