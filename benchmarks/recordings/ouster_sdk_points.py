"""Points by ouster-sdk, as .npz, for ouster_packets.py, which starts this in ouster-sdk's own environment.

    python -m benchmarks.recordings.ouster_sdk_points CAPTURE METADATA OUT.npz

`time` (N,) uint64 [ns], `row` (N,), `xyz` (N, 3) float64 [m] and `reflectivity` (N,) of all points, sweep by sweep,
column by column; `count` (S,) points a sweep. With a PROFILE in place of CAPTURE, packets of random pixels are made by
the SDK in that profile and are in the file as `packets` (P, bytes), with the points that it reads from them.

Outside of lidarlift's environment: imports nothing of ours, and no more than numpy and the SDK.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

SEED, SWEEPS = 11, 1


def main() -> None:
    arguments = argparse.ArgumentParser(
        prog="python -m benchmarks.recordings.ouster_sdk_points",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    for name in ("capture", "metadata", "out"):
        arguments.add_argument(name)
    options = arguments.parse_args()
    from ouster.sdk import core

    text = Path(options.metadata).read_text(encoding="utf-8")
    made: dict[str, Any] = {}
    if Path(options.capture).is_file():
        info, frames = core.SensorInfo(text), _recorded(options.capture, options.metadata)
    else:
        info = core.SensorInfo(json.dumps(json.loads(text) | {"udp_profile_lidar": options.capture}))
        info.format.udp_profile_lidar = getattr(core.UDPProfileLidar, options.capture)
        made["packets"], frames = _made(core, info)
    found = [_points(core, info, frame) for frame in frames]
    made |= {name: np.concatenate([each[name] for each in found]) for name in found[0]}
    np.savez(options.out, count=[len(each["time"]) for each in found], **made)


def _recorded(capture: str, metadata: str) -> Iterator[Any]:
    from ouster.sdk import open_source

    for frames in open_source(capture, meta=[metadata]):
        yield frames[0]


def _made(core: Any, info: Any) -> tuple[np.ndarray, Iterator[Any]]:
    """Packets of one sweep of random pixels, and the sweep that the SDK makes of them."""
    random = np.random.default_rng(SEED)
    frame = core.LidarFrame(info)
    frame.frame_id = 5
    frame.timestamp[:] = 1_700_000_000_000_000_000 + np.arange(frame.w) * 97_000
    frame.measurement_id[:] = np.arange(frame.w)
    frame.status[:] = 0xFFFFFFFF
    pixels = core.PacketFormat.from_info(info)
    for name in frame.fields:
        field = frame.field(name)
        if field.shape == (frame.h, frame.w):
            most = min(int(pixels.field_value_mask(name)), int(np.iinfo(field.dtype).max))
            field[:] = random.integers(0, most, field.shape, endpoint=True) & most
    packets = [np.array(each.buf) for each in core.frame_to_packets(frame, pixels, 0, 0) if _has_points(core, each)]
    batcher, again = core.FrameBatcher(info), core.LidarFrame(info)
    for packet in core.frame_to_packets(frame, pixels, 0, 0):
        batcher(packet, again)
    return np.array(packets), iter([again])


def _has_points(core: Any, packet: Any) -> bool:
    return isinstance(packet, core.LidarPacket)


def _points(core: Any, info: Any, frame: Any) -> dict[str, np.ndarray]:
    reach = np.array(frame.field("RANGE"))
    xyz = np.asarray(core.XYZLut(info, use_extrinsics=False)(reach)).reshape(*reach.shape, 3)
    seen = (reach > 0) & (np.array(frame.status) & 1 > 0)
    order = np.argsort(np.array(frame.timestamp), kind="stable")
    columns, rows = np.nonzero(seen.T[order])
    at = rows, order[columns]
    return {
        "time": np.array(frame.timestamp)[at[1]],
        "row": rows,
        "xyz": xyz[at],
        "reflectivity": np.array(frame.field("REFLECTIVITY"))[at],
    }


if __name__ == "__main__":
    main()
