"""nuScenes (Caesar et al., CVPR 2020): a Velodyne HDL-32E and cameras on cars in Boston and Singapore."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from slam.data import se3
from slam.data.bin_layout import parsed_columns
from slam.data.cloud import Array, Calibration
from slam.data.conventions import Conventions
from slam.data.errors import InputError
from slam.data.first_scans import first_of
from slam.data.images import ImageFile, nearest_images
from slam.data.loaders.common import HERE, pose
from slam.data.point_files import Reading
from slam.data.scan_names import ScanNames
from slam.data.scan_sequence import ScanSequence
from slam.data.sensor import conventions_of_folder, load_sensor, sensor_of_folder

#: From the axes of the files, x to the right and y forward, into ours; and our frame in that of the files.
AXES = ((0.0, 1.0, 0.0, 0.0), (-1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0))
T_LIDAR_OURS = np.array([[0.0, -1, 0, 0], [1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
LIDAR, CAMERA = "/LIDAR_TOP/", "/CAM_FRONT/"
Record = dict[str, Any]


class NuScenes(ScanSequence):
    """All scans of LIDAR_TOP of a scene, sweeps and samples, by the tables in `v1.0-*/` of its root.

    A point is x y z intensity ring, float32. Stamps refer to the end of the sweep, and the data set's makers
    compensated the motion (github.com/nutonomy/nuscenes-devkit, docs and issue 293): there are no times. The ground
    truth is the ego pose of each scan, moved into the LiDAR and turned into our axes, x forward. The camera is
    CAM_FRONT, rectified, matched by time. Other cameras, RADAR and annotations are not read.
    """

    LAYOUT = "nuScenes (v1.0-*/scene.json)"

    @staticmethod
    def sequences(path: Path) -> dict[str, Path]:
        """Find the scenes of a root by their names. See `Loader`."""
        found = {}
        for file in sorted(path.glob("v1.0-*/scene.json")):
            found.update({scene["name"]: file.parent / scene["name"] for scene in _table(file)})
        return dict(sorted(found.items()))

    def __init__(self, path: Path, sensor: str | Path | None = None, *, stamp: str | None = None) -> None:
        root = path.parent.parent
        try:
            scene = _Scene(path.parent, path.name)
        except (KeyError, TypeError, ValueError) as error:
            raise InputError(f"{path.parent}: a table lacks {error}; unpack nuScenes's metadata afresh") from error
        files = [root / name for name in scene.scans]
        reading = Reading(parsed_columns("x,y,z,intensity,ring"), HERE, AXES)
        first_of(files, reading)
        lasers = replace(load_sensor("hdl32"), motion_compensated=True)
        super().__init__(
            root,
            f"nuScenes {path.name}",
            ScanNames(files, np.arange(len(files)), scene.stamps),
            "sample_data.json, us",
            reading,
            sensor_of_folder(root, sensor, lasers),
            Conventions(stamp="end").over(conventions_of_folder(root, sensor)).said(stamp),
            compensated=True,
        )
        self.ground_truth, self.calibration = se3.from_first(scene.poses), scene.calibration
        if scene.images:
            found = nearest_images([root / name for name in scene.images], scene.image_stamps, scene.stamps)
            self._images = [None if image is None else ImageFile(image) for image in found]
            self._image_folder = (root / scene.images[0]).parent


class _Scene:
    """Content of the tables for a scene with N scans and M images, ordered by time.

    Attributes:
        scans: Names of the scans' files.
        stamps: (N,) stamps of the scans [s].
        poses: (N, 4, 4) T_world_lidar in our axes, NaN where the ego pose is missing.
        images: Names of the images' files.
        image_stamps: (M,) stamps of the images [s].
        calibration: The camera, None without images.
    """

    def __init__(self, tables: Path, name: str) -> None:
        scans, images = _recorded(tables, name)
        if not scans:
            raise InputError(f"{tables}: {name} has no scans of LIDAR_TOP; are its tables whole?")
        self.scans, self.images = ([record["filename"] for record in records] for records in (scans, images))
        self.stamps, self.image_stamps = (
            np.array([record["timestamp"] / 10**6 for record in records]) for records in (scans, images)
        )
        placed = {record["token"]: record for record in _table(tables / "calibrated_sensor.json")}
        T_ego_lidar = _pose(placed[scans[0]["calibrated_sensor_token"]]) @ T_LIDAR_OURS
        tokens = [scan["ego_pose_token"] for scan in scans]
        wanted = set(tokens)
        egos = _table(tables / "ego_pose.json", lambda ego: ego.get("token") in wanted)
        known = {ego["token"]: _pose(ego) for ego in egos}
        self.poses = np.array([known.get(token, np.full((4, 4), np.nan)) for token in tokens]) @ T_ego_lidar
        self.calibration: Calibration | None = None
        if images:
            camera = placed[images[0]["calibrated_sensor_token"]]
            K, T_camera_ego = np.array(camera["camera_intrinsic"]), se3.inverse(_pose(camera))
            self.calibration = Calibration(K, T_camera_ego @ T_ego_lidar)


def _recorded(tables: Path, scene: str) -> tuple[list[Record], list[Record]]:
    """Return the records of LIDAR_TOP and CAM_FRONT in a scene, ordered by time."""
    tokens = {record["token"] for record in _table(tables / "scene.json") if record["name"] == scene}
    samples = _table(tables / "sample.json", lambda sample: sample.get("scene_token") in tokens)
    wanted = {sample["token"] for sample in samples}

    def is_wanted(record: Record) -> bool:
        name = record.get("filename", "")
        return record.get("sample_token") in wanted and (LIDAR in name or CAMERA in name)

    found = sorted(_table(tables / "sample_data.json", is_wanted), key=lambda record: record["timestamp"])
    scans, images = ([record for record in found if name in record["filename"]] for name in (LIDAR, CAMERA))
    return scans, images


def _table(file: Path, wanted: Callable[[Record], bool] = lambda _: True) -> list[Record]:
    """Read the wanted rows of a table of possibly millions."""
    try:
        with file.open(encoding="utf-8") as text:
            rows = json.load(text, object_hook=lambda row: row if wanted(row) else None)
    except OSError as error:
        raise InputError(f"{file}: cannot be read ({error.strerror or error}); unpack nuScenes's metadata") from error
    except ValueError as error:
        raise InputError(f"{file}: damaged ({error}); unpack nuScenes's metadata afresh") from error
    return [row for row in rows if row is not None]


def _pose(record: Mapping[str, Any]) -> Array:
    """Return the pose (4, 4) of a record's translation and rotation, w first."""
    x, y, z = record["translation"]
    return pose(x, y, z, Rotation.from_quat(record["rotation"], scalar_first=True))
