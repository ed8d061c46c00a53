"""The decoder of a LiDAR's packets, chosen by their first bytes, and the metadata that an Ouster's need."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path

from slam.data.errors import InputError
from slam.data.packets.ouster import OusterDecoder
from slam.data.packets.ouster_metadata import Metadata, read_metadata
from slam.data.packets.sweeps import Decoder
from slam.data.packets.velodyne import VelodyneDecoder, is_velodyne

#: First bytes of packets that are not read, their maker, and the tool that converts them to points.
OTHERS = {
    b"\xee\xff": ("Hesai", "PandarView or Hesai's driver for ROS"),
    b"\x55\xaa\x05\x0a": ("RoboSense", "RSView or rslidar_sdk"),
    b"\x55\xaa\x05\x5a": ("RoboSense", "RSView or rslidar_sdk"),
}


def decoder_for(payloads: Callable[[], Iterable[bytes]], metadata: Callable[[bytes], Metadata], where: Path) -> Decoder:
    """Return the decoder of a LiDAR.

    Args:
        payloads: Iterates over the LiDAR's packets from the first on.
        metadata: Finds an Ouster's metadata that fit a packet, or raises InputError.
        where: The recording, for messages.

    Raises:
        InputError: The packets are of a LiDAR that is not read, or the metadata are missing.
    """
    first = next(iter(payloads()))
    if is_velodyne(first):
        return VelodyneDecoder(payloads(), where)
    for head, (maker, tool) in OTHERS.items():
        if first.startswith(head):
            raise InputError(
                f"{where}: packets of a LiDAR by {maker}, which are not read; save points as .pcd files or in "
                f"a ROS bag with {tool}"
            )
    return OusterDecoder(metadata(first))


def metadata_beside(folder: Path, name: str, payload: bytes, where: Path, said: Path | None = None) -> Metadata:
    """Return the metadata of an Ouster that the user names, or that lie beside a recording and fit a packet of it.

    Args:
        folder: Folder of the recording, whose .json files are tried, those that begin with its name first.
        name: Name of the recording without suffix.
        payload: A packet with points.
        where: The recording, for messages.
        said: The file that the user names.

    Raises:
        InputError: No metadata fit.
    """
    if said is not None:
        metadata = read_metadata(said)
        if fault := metadata.misfit(payload):
            raise InputError(f"{said}: {fault} in {where}; name the metadata of this recording")
        return metadata
    faults = []
    for file in sorted(folder.glob("*.json"), key=lambda file: (not file.stem.startswith(name), file)):
        try:
            metadata = read_metadata(file)
        except InputError as error:
            if file.stem.startswith(name):
                faults.append(str(error))
            continue
        fault = metadata.misfit(payload)
        if not fault:
            return metadata
        faults.append(f"{file}: {fault}")
    why = f" ({'; '.join(faults)})" if faults else ""
    raise InputError(
        f"{where}: packets of {len(payload)} bytes that only an Ouster's metadata explain{why}; place the "
        f".json file that was recorded with it beside it as {name}.json, or name it with --sensor FILE.json"
    )


def metadata_file(sensor: str | Path | None) -> Path | None:
    """Return the Ouster metadata that a user gives as the sensor, None for any other sensor."""
    return Path(sensor) if sensor is not None and Path(sensor).suffix.lower() == ".json" else None
