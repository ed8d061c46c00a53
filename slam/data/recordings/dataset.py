"""A recording as a data set."""

from __future__ import annotations

import logging
from collections.abc import Callable
from pathlib import Path

import numpy as np

from slam.data.calibration_file import read_cameras
from slam.data.cloud import Array, Calibration, Frame
from slam.data.errors import InputError
from slam.data.files import SCAN_PERIOD
from slam.data.packets.decoders import metadata_file
from slam.data.point_blocks import UnreadableError
from slam.data.point_files import Points
from slam.data.problem import Problem
from slam.data.recordings.choice import cloud_topic, image_topic, info_topic, is_rectified, mounting_of, truth_topic
from slam.data.recordings.clock import Stamped, clock_problems, seconds, stamped
from slam.data.recordings.images import calibration_of, image_of
from slam.data.recordings.packets import PACKETS
from slam.data.recordings.recording import Recording, Topic, recordings_at
from slam.data.recordings.scans import MessageScans, PacketTopicScans, TopicScans
from slam.data.recordings.transforms import Mounting
from slam.data.recordings.truth import read_truth
from slam.data.scan_columns import SAMPLES, find_columns
from slam.data.scan_names import named_scans
from slam.data.sensor import conventions_of_folder, nominal_lines, sensor_of_folder
from slam.data.sound_points import NONE, Offset, map_frame
from slam.data.stamps import mended, usual_step

LOOKED_AT = 3 * SAMPLES  # scans at most, for as many as are needed with points
MARGIN = 2.0  # s of images before and after the scans that are used

log = logging.getLogger(__name__)


class RecordedSequence:
    """A ROS 1 bag, or a recording of ROS 2 in SQLite or MCAP: PointCloud2 or Livox' messages as scans.

    Used with them, where there are any: images with CameraInfo and the transform between the two frames; true poses.
    In the folder of the recording, or beside its file, may lie `sensor.yaml` (see `load_sensor`, `Conventions`) and
    `calib.yaml` (see `read_cameras`), which holds before CameraInfo and transforms. See `Dataset` for the fields;
    `numbers` count the scans of the topic, from 0. Raises InputError where there are no scans.

    Args:
        path: The file, or the folder that rosbag2 has written.
        sensor: Overrides what sensor.yaml says of the LiDAR.
        stamp: The instant of a sweep that stamps belong to, 'start', 'middle' or 'end'. By default the points' times
            tell.
        point_time: The field with the points' times, FIELD or FIELD:UNIT. By default the first that can have them.
        topic: The scans'. By default the one with times, rings and most points.
        image_topic: The images'. By default one with a CameraInfo.
        truth_topic: The true poses'. By default one that is called so.
        start: Seconds after the start of the recording that are left out, and
        duration: of those that are used. By default all.

    Attributes:
        recording: All that there is: topics, their types, counts and rates.
        topics: Those in use, by 'points', 'images' and 'truth'.
    """

    LAYOUT = "a recording (.bag, .db3, .mcap)"

    @staticmethod
    def sequences(path: Path) -> dict[str, Path]:
        """The recordings at the path, unless there are scans beside them. See `Loader`."""
        found = recordings_at(path)
        if path.is_dir() and found and not (path / "metadata.yaml").is_file() and named_scans(path).files:
            return {}
        return {"": path} if "" in found else {name: files[0] for name, files in found.items()}

    def __init__(
        self,
        path: Path,
        sensor: str | Path | None = None,
        *,
        stamp: str | None = None,
        point_time: str | None = None,
        topic: str | None = None,
        image_topic: str | None = None,
        truth_topic: str | None = None,
        start: float | None = None,
        duration: float | None = None,
    ) -> None:
        self.path = path
        self.name = path.resolve().stem if path.is_file() else path.resolve().name
        self.recording = Recording(path, recordings_at(path)[""])
        self._topic, several = cloud_topic(self.recording, topic)
        self.topics = {"points": self._topic.name}
        chosen = self._in_window(self._topic, start, duration)
        folder = path if path.is_dir() else path.parent
        mounting = mounting_of(self.recording)
        metadata = metadata_file(sensor) if self._topic.type in PACKETS else None
        override = None if metadata else sensor
        self._scans: TopicScans = (
            PacketTopicScans(self.recording, self._topic, chosen, folder, metadata, mounting.frames)
            if self._topic.type in PACKETS
            else MessageScans(self.recording, self._topic, chosen)
        )
        clouds, self.stamps_from = self._scans.found, self._scans.stamps_from
        self.numbers = clouds.numbers
        self.stamps, repaired = mended(clouds.stamps, self._where)
        self._recorded = self.recording.times(self._topic.name)[[chosen[0], chosen[-1]]]

        self.sensor = sensor_of_folder(folder, override, self._scans.sensor)
        self._offset: Offset | None = None
        first, odd = self._first_scans()
        said = conventions_of_folder(folder, override).said(stamp, point_time)
        columns = find_columns(first, self.sensor, said, usual_step(self.stamps), self._where)
        self._columns = self._scans.with_known_rings(columns, self.sensor)
        self.point_times, self.rings = self._columns.times, self._columns.rings

        self.calibration, self._images, blind = self._camera(image_topic, clouds, mounting, folder)
        self.ground_truth, untrue = self._truth(truth_topic, clouds, mounting)
        told = (
            *self.recording.problems,
            *several,
            *self._scans.problems,
            *clock_problems(clouds, str(self._where)),
            *repaired,
            *odd,
        )
        nominal = nominal_lines(self.sensor, path)
        self.problems = (*told, *nominal, *self._columns.problems, *blind, *untrue)

    def __len__(self) -> int:
        return len(self.numbers)

    def __getitem__(self, position: int) -> Frame:
        number, stamp = int(self.numbers[position]), float(self.stamps[position])
        points = self.points(position)
        cloud, odd = self._columns.cloud(points, stamp, self._name(number))
        problems, read = points.problems + odd, _no_image
        if self.calibration is not None and "images" in self.topics:
            read = self._image_reader(int(self._images[position]))
            if self._images[position] < 0:
                text = f"{self.path}: {self.topics['images']} has no image for scan {number}"
                problems += (Problem("missing image", f"{text}; its points stay without colour"),)
        return Frame(number, stamp, cloud, self.calibration, read, problems)

    @property
    def _where(self) -> Path:
        return Path(f"{self.path}: {self._topic.name}")

    def _name(self, number: int) -> Path:
        """Of a scan, for messages."""
        return Path(f"{self._where}, message {number}")

    def _in_window(self, topic: Topic, start: float | None, duration: float | None) -> Array:
        """The numbers of the messages that are asked for, by when they were recorded."""
        times = seconds(self.recording.times(topic.name))
        begin = min(other.first for other in self.recording.topics.values()) + (start or 0.0)
        chosen = np.flatnonzero((times >= begin) & (times < begin + (np.inf if duration is None else duration)))
        if len(chosen) == 0:
            lasts = f"its scans were recorded {times[0] - begin + (start or 0):.1f} s to "
            lasts += f"{times[-1] - begin + (start or 0):.1f} s after its start"
            raise InputError(f"{self.path}: no scans there; {lasts}")
        return chosen

    def points(self, position: int) -> Points:
        """A scan as the recording has it."""
        return self._scans.points(position, self._offset)

    def _first_scans(self) -> tuple[list[tuple[Points, float | None]], tuple[Problem, ...]]:
        """The first with points, and their stamps; where these are in a map's frame, it is moved for all scans."""
        found: list[tuple[Points, float | None]] = []
        faults: list[str] = []
        for position in range(min(len(self), LOOKED_AT)):
            points = self.points(position)
            faults += [problem.message for problem in points.problems if problem.kind == "missing scan"]
            if len(points.xyz):
                found.append((points, float(self.stamps[position])))
                self._offset = points.offset
            if len(found) == SAMPLES:
                break
        if not found and len(faults) == min(len(self), LOOKED_AT):
            raise InputError(faults[0].replace("; no points used", ""))
        moved = self._offset is not None and self._offset != NONE
        odd = (Problem("map coordinates", f"{self._where}: {map_frame(self._offset or NONE)}"),) if moved else ()
        return found, odd

    def _camera(
        self, said: str | None, clouds: Stamped, mounting: Mounting, folder: Path
    ) -> tuple[Calibration | None, Array, tuple[Problem, ...]]:
        """The camera, the number of the image of each scan (N,), -1 for none, and what is wrong with them."""
        none = np.full(len(self), -1)
        topic, several = image_topic(self.recording, said)
        if topic is None:
            return None, none, ()
        numbers = self._around(topic.name)
        images = stamped(self.recording, topic.name, numbers)
        found = self._calibration(topic, clouds.frame, images.frame, mounting, folder)
        if isinstance(found, str):
            return None, none, (Problem("no calibration", f"{self.path}: {topic.name}: {found}"),)
        self.topics["images"] = topic.name
        matched = _nearest(images.on(clouds), self.stamps + self._middle, usual_step(self.stamps) or SCAN_PERIOD)
        return found, np.where(matched < 0, -1, numbers[matched]) if len(numbers) else none, several

    def _calibration(
        self, topic: Topic, lidar: str, camera: str, mounting: Mounting, folder: Path
    ) -> Calibration | str:
        """The camera, or why it is not used."""
        if (folder / "calib.yaml").is_file():
            return read_cameras(folder / "calib.yaml")[0].calibration
        info = info_topic(self.recording, topic.name)
        message = None if info is None else next(self.recording.messages(info.name), None)
        remedy = "the camera is not used; give calib.yaml (K, T_camera_lidar) beside the recording"
        if message is None:
            return f"images, but no CameraInfo; {remedy}"
        T = mounting.between(camera, lidar)
        if T is None:
            return f"no transform between its frame '{camera}' and the LiDAR's '{lidar}'; {remedy}"
        found = calibration_of(message, is_rectified(topic.name), T)
        return f"{found}; {remedy}" if isinstance(found, str) else found

    def _truth(self, said: str | None, clouds: Stamped, mounting: Mounting) -> tuple[Array | None, tuple[Problem, ...]]:
        topic, odd = truth_topic(self.recording, said)
        if topic is None:
            return None, odd
        truth, problems = read_truth(self.recording, topic, clouds, self.stamps, mounting)
        if truth is not None:
            self.topics["truth"] = topic.name
        return truth, (*odd, *problems)

    @property
    def _middle(self) -> float:
        """Seconds from the stamp to when half of a scan's points were seen: an image of then shows most of them."""
        times = self.point_times
        return (times.first + times.last) / 2 if times.field else 0.0

    def _around(self, topic: str) -> Array:
        """The numbers of a topic's messages that were recorded while the scans were."""
        times, margin = self.recording.times(topic), int(MARGIN * 1e9)
        return np.flatnonzero((times >= self._recorded.min() - margin) & (times <= self._recorded.max() + margin))

    def _image_reader(self, number: int) -> Callable[[], Array | None]:
        """A function that reads an image (H, W, 3) uint8 RGB; it gives None without a number or for a damaged one."""
        if number < 0:
            return _no_image
        topic = self.recording.topics[self.topics["images"]]

        def read() -> Array | None:
            try:
                content, encoding = self.recording.read(topic.name, number)
                return image_of(content, topic.type, encoding)
            except UnreadableError as error:
                log.warning("%s: %s, message %d: %s; this frame has none", self.path, topic.name, number, error)
                return None

        return read


def _no_image() -> Array | None:
    return None


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
