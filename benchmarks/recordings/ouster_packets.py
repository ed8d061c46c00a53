"""Our decoder of Ouster's packets held to ouster-sdk, on recordings and on packets that the SDK makes in every profile.

    python -m benchmarks.recordings.ouster_packets SDK_PYTHON CAPTURE [CAPTURE ...]

SDK_PYTHON is the python of an environment of its own with ouster-sdk, whose requirements clash with ours; CAPTURE a
.pcap file with its metadata (.json) beside it.
"""

from __future__ import annotations

import json
import subprocess
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.common.page import surroundings, write_results
from benchmarks.common.script import add_results, parser, run_script
from slam.data.cloud import Array
from slam.data.errors import InputError
from slam.data.packets.dataset import PacketSequence
from slam.data.packets.ouster import decode
from slam.data.packets.ouster_metadata import PROFILES, Metadata, parse_metadata

SDK_SCRIPT = Path(__file__).with_name("ouster_sdk_points.py")
NAME = "ouster_packets"


def main() -> None:
    arguments = parser(__doc__)
    arguments.add_argument("sdk_python", type=Path, help="python of the environment with ouster-sdk")
    arguments.add_argument("captures", type=Path, nargs="+", metavar="CAPTURE")
    add_results(arguments)
    options = arguments.parse_args()
    found: dict[str, Any] = {"recordings": {}, "profiles": {}}
    for capture in options.captures:
        found["recordings"][capture.name] = _recording(options.sdk_python, capture)
    metadata = _beside(options.captures[0])
    for profile in PROFILES:
        found["profiles"][profile] = _profile(options.sdk_python, metadata, profile)
    found["about"] = surroundings(("numpy",)) | {"ouster-sdk": _sdk_version(options.sdk_python)}
    write_results(options.results, NAME, found, page)


def _beside(capture: Path) -> Path:
    files = sorted(capture.parent.glob(f"{capture.stem}*.json"))
    if not files:
        raise InputError(f"{capture}: no metadata beside it; place the .json file there that was recorded with it")
    return files[0]


def _by_sdk(python: Path, source: object, metadata: Path) -> dict[str, Array]:
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "points.npz"
        command = [str(python), str(SDK_SCRIPT), str(source), str(metadata), str(out)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode:
            raise InputError(f"{python}: ouster-sdk failed on {source}: {done.stderr.strip().splitlines()[-1]}")
        with np.load(out) as file:
            return dict(file)


def _recording(python: Path, capture: Path) -> dict[str, Any]:
    theirs = _by_sdk(python, capture, _beside(capture))
    drive = PacketSequence(capture)
    ours = [drive.recorded(position) for position in range(len(drive))]
    starts = theirs["time"][np.cumsum([0, *theirs["count"][:-1]])]
    times = [points["t"] - points["t"][0] + start for points, start in zip(ours, starts, strict=True)]
    rings = np.concatenate([points["ring"] for points in ours])
    result = _compared(np.concatenate(ours), np.concatenate(times), theirs)
    result["same_rings"] = bool(np.array_equal(rings, drive_metadata(capture).ring[theirs["row"]]))
    return result | {"sweeps": len(drive)}


def drive_metadata(capture: Path) -> Metadata:
    """Of the sensor of a recording."""
    path = _beside(capture)
    return parse_metadata(path.read_text(encoding="utf-8"), path)


def _profile(python: Path, path: Path, profile: str) -> dict[str, Any]:
    theirs = _by_sdk(python, profile, path)
    content = json.loads(path.read_text(encoding="utf-8"))
    content["udp_profile_lidar"] = profile
    for group in ("config_params", "lidar_data_format"):
        if group in content:
            content[group]["udp_profile_lidar"] = profile
    metadata = parse_metadata(json.dumps(content), path)
    ours = decode([packet.tobytes() for packet in theirs["packets"]], metadata)
    return _compared(ours, ours["t"] + theirs["time"].min(), theirs)


def _compared(ours: Array, times: Array, theirs: Mapping[str, Array]) -> dict[str, Any]:
    """Where the same points are there, how far apart they are."""
    result: dict[str, Any] = {"points": len(ours), "points_of_sdk": len(theirs["time"])}
    if len(ours) != len(theirs["time"]):
        return result
    xyz = np.column_stack([ours[axis] for axis in "xyz"]).astype(np.float64)
    apart = np.linalg.norm(xyz - theirs["xyz"], axis=1)
    return result | {
        "farthest_apart_mm": round(float(apart.max()) * 1e3, 4),
        "same_times": bool(np.array_equal(times, theirs["time"])),
        "same_reflectivity": bool(np.array_equal(ours["reflectivity"], theirs["reflectivity"])),
    }


def _sdk_version(python: Path) -> str:
    code = "from importlib.metadata import version; print(version('ouster-sdk'))"
    return subprocess.run([str(python), "-c", code], capture_output=True, text=True, check=True).stdout.strip()


def page(found: Mapping[str, Any]) -> str:
    """The Markdown page."""
    about = found["about"]
    lines = [
        "# Ouster's packets",
        "",
        f"Our decoder compared with ouster-sdk {about['ouster-sdk']}, {about['date']}: the points of the same packets,",
        "matched by time. Recordings are real; packets of each profile were written by the SDK from random pixels. The",
        "target is a distance of at most 1 mm from the SDK's points.",
        "",
        "| | points | by the SDK | maximum distance [mm] | times, reflectivities |",
        "| --- | --- | --- | --- | --- |",
    ]
    for name, row in (*found["recordings"].items(), *found["profiles"].items()):
        same = row.get("same_times") and row.get("same_reflectivity")
        cells = (
            row["points"],
            row["points_of_sdk"],
            row.get("farthest_apart_mm", "-"),
            "the same" if same else "differ",
        )
        lines.append(f"| {name} | {' | '.join(map(str, cells))} |")
    lines += ["", f"`{about['command']}`, {about['cpu']}."]
    return "\n".join(lines)


if __name__ == "__main__":
    run_script(main)
