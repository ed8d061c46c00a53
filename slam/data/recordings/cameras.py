"""The cameras of a recording: their images' topics, their calibration, and the image of each scan."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from slam.data.calibration_file import Camera, coefficients_fault, is_fisheye_model, read_cameras
from slam.data.cloud import Array, Calibration
from slam.data.files import SCAN_PERIOD
from slam.data.problem import Problem
from slam.data.recordings.choice import camera_topics, info_topic, is_rectified
from slam.data.recordings.clock import Stamped, stamped
from slam.data.recordings.images import RecordedImage
from slam.data.recordings.recording import Recording, Topic
from slam.data.recordings.transforms import Mounting
from slam.data.stamps import usual_step

MARGIN = 2.0  # s of images before and after the scans that are used
TRIED = 5  # images that are read for their size, until one can be
ALIKE = 0.01  # relative difference between the scales of width and height of images that were resized
REMEDY = "this camera is not used; give calib.yaml (K, T_camera_lidar) beside the recording"


@dataclass(frozen=True, eq=False)
class RecordedCamera:
    """A camera of a recording.

    Attributes:
        topic: Topic of its images.
        calibration: Its calibration.
        images: (N,) int64, number of the image of each scan in the topic, -1 for none.
    """

    topic: Topic
    calibration: Calibration
    images: Array


@dataclass(frozen=True, eq=False)
class Scans:
    """The scans that images are assigned to.

    Attributes:
        found: The scans, with clock and frame.
        middles: (N,) [s], when half of the points of each were measured: an image of then shows most of them.
        recorded: When the first and the last were recorded [ns].
    """

    found: Stamped
    middles: Array
    recorded: tuple[int, int]


def find_cameras(
    recording: Recording, said: str | None, scans: Scans, mounting: Mounting, folder: Path
) -> tuple[list[RecordedCamera], tuple[Problem, ...]]:
    """Find the cameras whose calibration is known, the one that looks most along the LiDAR's x first.

    A calib.yaml in `folder` comes before CameraInfo and transforms. Its cameras are assigned to topics by `images:
    TOPIC`, else by their names, which are a part of the topic's name; a single camera without a name to the topic with
    most images.

    Args:
        recording: The recording.
        said: Topic of the only camera that is used, None for all.
        scans: The scans.
        mounting: How the frames are mounted to each other.
        folder: Folder of the recording.

    Returns:
        The cameras, and what is wrong with them and with those that are not used.

    Raises:
        InputError: There is no topic with images of the name `said`, or calib.yaml cannot be read.
    """
    topics, problems = camera_topics(recording, said)
    file = folder / "calib.yaml"
    calibrated: list[tuple[Topic, Calibration]] = []
    if topics and file.is_file():
        calibrated, odd = _by_file(file, topics)
        problems += odd
    else:
        for topic in topics:
            found = _by_messages(recording, topic, scans.found.frame, mounting, only=len(topics) == 1)
            if isinstance(found, str):
                problems += (Problem("no calibration", f"{recording.path}: {topic.name}: {found}; {REMEDY}"),)
                continue
            resized, odd = _of_size(recording, topic, found)
            problems += odd
            if resized is not None:
                calibrated.append((topic, resized.calibration))
    ahead = sorted(calibrated, key=lambda each: -each[1].T_camera_lidar[2, 0])
    return [RecordedCamera(topic, camera, _matched(recording, topic, scans)) for topic, camera in ahead], problems


def _by_file(file: Path, topics: list[Topic]) -> tuple[list[tuple[Topic, Calibration]], tuple[Problem, ...]]:
    """The cameras of a calib.yaml, each with its topic."""
    calibrated, problems = [], list[Problem]()
    for camera in read_cameras(file):
        topic = _topic_of(camera, topics)
        if topic is not None:
            calibrated.append((topic, camera.calibration))
            continue
        known = ", ".join(map(str, topics))
        text = f"{file}: no topic with images of camera {camera.name}, of {known}; name it with images: TOPIC"
        problems.append(Problem("no images", text))
    return calibrated, tuple(problems)


def _topic_of(camera: Camera, topics: list[Topic]) -> Topic | None:
    if not camera.name:
        return topics[0]
    for topic in topics:
        if topic.name.strip("/") == camera.said.strip("/") or (
            not camera.said and camera.name in topic.name.strip("/").split("/")
        ):
            return topic
    return None


@dataclass(frozen=True, eq=False)
class _Informed:
    """A calibration, and the size of the images that it is of: width and height, 0 if it does not say."""

    calibration: Calibration
    size: tuple[int, int]


def _by_messages(recording: Recording, topic: Topic, lidar: str, mounting: Mounting, only: bool) -> _Informed | str:
    """The calibration by CameraInfo and transforms, or why there is none."""
    info = info_topic(recording, topic, only)
    message = None if info is None else next(recording.messages(info.name), None)
    if message is None:
        return "images, but no CameraInfo"
    header = recording.header(topic.name, 0)
    camera = "" if header is None else header.frame
    T = mounting.between(camera, lidar)
    if T is None:
        return f"no transform between its frame '{camera}' and the LiDAR's '{lidar}'"
    return calibration_of(message, is_rectified(topic.name), T)


def calibration_of(message: Any, rectified: bool, T_camera_lidar: Array) -> _Informed | str:
    """Return the calibration of a CameraInfo, or why it cannot be used.

    Args:
        message: The CameraInfo, of ROS 1 or 2.
        rectified: Whether the images have been rectified, so that its P applies.
        T_camera_lidar: (4, 4) transform of the LiDAR's points into the camera's frame.
    """
    K, D, P = (np.array(_either(message, name), np.float64) for name in ("K", "D", "P"))
    model = str(message.distortion_model)
    fisheye = is_fisheye_model(model)
    if rectified and P.size == 12 and P[0] > 0:
        K, D, fisheye = P.reshape(3, 4)[:, :3].copy(), np.zeros(0), False
    if K.size != 9 or not K.flat[0] > 0 or not K.flat[4] > 0:
        return "it is not calibrated, its K is 0"
    if fisheye is None and D.any():
        return f"its distortion model '{model}' is unknown; rectify the images"
    D = D if D.any() else np.zeros(0)
    if fault := coefficients_fault(len(D), bool(fisheye)):
        return f"{fault}, and its model is {model}"
    K, size = _as_published(K.reshape(3, 3), message)
    return _Informed(Calibration(K, T_camera_lidar, tuple(D.tolist()), fisheye=bool(fisheye)), size)


def _as_published(K: Array, message: Any) -> tuple[Array, tuple[int, int]]:
    """K and size of the images: of the full resolution, `message` says which part is published, and at what step."""
    step = np.maximum([int(message.binning_x), int(message.binning_y)], 1)
    roi = message.roi
    begin = np.array([int(roi.x_offset), int(roi.y_offset)])
    size = np.array([int(roi.width) or int(message.width), int(roi.height) or int(message.height)])
    K = K.copy()
    K[:2, 2] -= begin
    K[:2] /= step[:, None]
    return K, (int(size[0] // step[0]), int(size[1] // step[1]))


def _either(message: Any, name: str) -> Any:
    """A field that ROS 2 has in lower case."""
    return getattr(message, name) if hasattr(message, name) else getattr(message, name.lower())


def _of_size(recording: Recording, topic: Topic, found: _Informed) -> tuple[_Informed | None, tuple[Problem, ...]]:
    """The calibration of images that were resized after their CameraInfo was written; None if they were cropped."""
    readers = (RecordedImage(recording, topic, number) for number in range(min(topic.count, TRIED)))
    image = next((image for reader in readers if (image := reader()) is not None), None)
    if image is None or 0 in found.size or (image.shape[1], image.shape[0]) == found.size:
        return found, ()
    width, height = found.size
    scale = np.array([image.shape[1] / width, image.shape[0] / height])
    text = f"{recording.path}: {topic.name}: images of {image.shape[1]} x {image.shape[0]} pixels, and a CameraInfo"
    text += f" for {width} x {height}"
    if abs(scale[0] / scale[1] - 1) > ALIKE:
        return None, (Problem("no calibration", f"{text}; {REMEDY}"),)
    K = found.calibration.K.copy()
    K[:2, 2] = scale * (K[:2, 2] + 0.5) - 0.5  # whole numbers are pixel centres
    K[:2, :2] *= scale[:, None]
    scaled = replace(found, calibration=replace(found.calibration, K=K))
    return scaled, (Problem("resized images", f"{text}; its K is scaled"),)


def _matched(recording: Recording, topic: Topic, scans: Scans) -> Array:
    """(N,) int64: the number of the image of each scan, the nearest to its middle; -1 beyond half a scan's period."""
    times, margin = recording.times(topic.name), int(MARGIN * 1e9)
    numbers = np.flatnonzero((times >= scans.recorded[0] - margin) & (times <= scans.recorded[1] + margin))
    if len(numbers) == 0:
        return np.full(len(scans.middles), -1)
    taken = stamped(recording, topic.name, numbers).on(scans.found)
    nearest = _nearest(taken, scans.middles, usual_step(scans.middles) or SCAN_PERIOD)
    return np.where(nearest < 0, -1, numbers[nearest])


def _nearest(taken: Array, wanted: Array, period: float) -> Array:
    """(N,) int64: of images at times (M,) the nearest to each time (N,), -1 beyond half a `period`."""
    known = np.flatnonzero(np.isfinite(taken))
    if len(known) == 0:
        return np.full(len(wanted), -1)
    known = known[np.argsort(taken[known], kind="stable")]
    times = taken[known]
    after = np.searchsorted(times, wanted).clip(max=len(times) - 1)
    before = np.maximum(after - 1, 0)
    nearest = np.where(np.abs(times[before] - wanted) <= np.abs(times[after] - wanted), before, after)
    near = np.abs(times[nearest] - wanted) <= period / 2
    return np.where(near, known[nearest], -1)
