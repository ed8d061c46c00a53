"""A recording as a data set."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from slam.data.cloud import Array, Frame, ImageReader, View
from slam.data.errors import InputError
from slam.data.images import no_image
from slam.data.packets.decoders import metadata_file
from slam.data.point_files import Points
from slam.data.problem import Problem
from slam.data.recordings.cameras import RecordedCamera, Scans, find_cameras
from slam.data.recordings.choice import cloud_topic, mounting_of, truth_topic
from slam.data.recordings.clock import clock_problems, seconds
from slam.data.recordings.images import RecordedImage
from slam.data.recordings.packets import PACKETS
from slam.data.recordings.recording import Recording, Topic, recordings_at
from slam.data.recordings.scans import MessageScans, PacketTopicScans, TopicScans
from slam.data.recordings.transforms import Mounting
from slam.data.recordings.truth import RecordedTruth, TruthOf, read_truth
from slam.data.scan_columns import SAMPLES, find_columns
from slam.data.scan_names import named_scans
from slam.data.sensor import conventions_of_folder, sensor_of_folder
from slam.data.sound_points import NONE, Offset, map_frame
from slam.data.stamps import mended, usual_step

LOOKED_AT = 3 * SAMPLES  # scans that are read at most to find those with points


class RecordedSequence:
    """A ROS 1 bag, or a recording of ROS 2 in SQLite or MCAP: point clouds or a LiDAR's packets as scans.

    Images with CameraInfo and a transform to the LiDAR, and ground truth, are used if they are there. In the folder of
    the recording, or beside its file, may be `sensor.yaml` (see `load_sensor`, `Conventions`) and `calib.yaml` (see
    `read_cameras`), which comes before CameraInfo and transforms. See `Dataset` for the attributes; `numbers` count the
    scans of the topic, from 0.

    Args:
        path: The file, or the folder that rosbag2 has written.
        sensor: Overrides the LiDAR of sensor.yaml; for Ouster's packets, its metadata (.json).
        stamp: Instant of the sweep that the stamps refer to, 'start', 'middle' or 'end'. Default: from the points'
            times.
        point_time: Field with the points' times, FIELD or FIELD:UNIT. Default: the first that can be times.
        topic: Topic of the scans. Default: see `cloud_topic`.
        image_topic: Topic of the only camera that is used. Default: all cameras whose calibration is known.
        truth_topic: Topic of the ground truth. Default: see `truth_topic`.
        start: Seconds after the start of the recording that are left out.
        duration: Seconds that are used. Default: all.

    Attributes:
        recording: The recording with all its topics.
        topics: The topics in use, by 'points', 'images' and 'truth'.
        true_positions: (N, 3) positions [m], if the ground truth has no rotations; else None.

    Raises:
        InputError: There are no scans, a topic is not there, or a file beside the recording cannot be read.
    """

    LAYOUT = "a recording (.bag, .db3, .mcap)"

    @staticmethod
    def sequences(path: Path) -> dict[str, Path]:
        """Return the recordings at the path, unless there are scans beside them. See `Loader`."""
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

        scans = Scans(clouds, self.stamps + self._middle, (int(self._recorded[0]), int(self._recorded[1])))
        self._cameras, blind = find_cameras(self.recording, image_topic, scans, mounting, folder)
        self.calibration = self._cameras[0].calibration if self._cameras else None
        for at, camera in enumerate(self._cameras, 1):
            self.topics["images" if at == 1 else f"images {at}"] = camera.topic.name
        truth = self._truth(truth_topic, TruthOf(clouds, self.stamps, self.numbers, scans.recorded), mounting)
        self.ground_truth, self.true_positions = truth.poses, truth.positions
        told = (
            *self.recording.problems,
            *several,
            *self._scans.problems,
            *clock_problems(clouds, str(self._where)),
            *repaired,
            *odd,
        )
        self.problems = (*told, *self._columns.problems, *blind, *truth.problems)

    def __len__(self) -> int:
        return len(self.numbers)

    def __getitem__(self, position: int) -> Frame:
        number, stamp = int(self.numbers[position]), float(self.stamps[position])
        points = self.points(position)
        cloud, odd = self._columns.cloud(points, stamp, self._name(number))
        problems, views = points.problems + odd, list[View]()
        for camera in self._cameras:
            reader, faults = self._image(camera, position)
            views.append(View(camera.calibration, reader))
            problems += faults
        if not views:
            return Frame(number, stamp, cloud, problems=problems)
        ahead, *others = views
        return Frame(number, stamp, cloud, ahead.calibration, ahead.read_image, problems, tuple(others))

    @property
    def images(self) -> tuple[int | None, ...]:
        """The number of each scan's image in the topic of the camera that looks ahead, None for none."""
        if not self._cameras:
            return (None,) * len(self)
        return tuple(None if number < 0 else int(number) for number in self._cameras[0].images)

    def _image(self, camera: RecordedCamera, position: int) -> tuple[ImageReader, tuple[Problem, ...]]:
        """The reader of a camera's image of a scan, and what is wrong with the image."""
        if camera.images[position] < 0:
            where = f"{self.path}: {camera.topic.name} has no image for scan {self.numbers[position]}"
            return no_image, (Problem("missing image", f"{where}; its points stay without colour"),)
        reader = RecordedImage(self.recording, camera.topic, int(camera.images[position]))
        problem = reader.check()
        return reader, () if problem is None else (problem,)

    @property
    def _where(self) -> Path:
        return Path(f"{self.path}: {self._topic.name}")

    def _name(self, number: int) -> Path:
        """The name of a scan, for messages."""
        return Path(f"{self._where}, message {number}")

    def _in_window(self, topic: Topic, start: float | None, duration: float | None) -> Array:
        """The numbers of the messages in the chosen part, by their times of recording."""
        times = seconds(self.recording.times(topic.name))
        begin = min(other.first for other in self.recording.topics.values()) + (start or 0.0)
        chosen = np.flatnonzero((times >= begin) & (times < begin + (np.inf if duration is None else duration)))
        if len(chosen) == 0:
            lasts = f"its scans were recorded {times[0] - begin + (start or 0):.1f} s to "
            lasts += f"{times[-1] - begin + (start or 0):.1f} s after its start"
            raise InputError(f"{self.path}: no scans there; {lasts}")
        return chosen

    def points(self, position: int) -> Points:
        """Read a scan as the recording has it."""
        return self._scans.points(position, self._offset)

    def _first_scans(self) -> tuple[list[tuple[Points, float | None]], tuple[Problem, ...]]:
        """The first scans with points, and their stamps. Scans in a map's frame are moved by one offset for all."""
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

    def _truth(self, said: str | None, scans: TruthOf, mounting: Mounting) -> RecordedTruth:
        topic, odd = truth_topic(self.recording, said)
        if topic is None:
            return RecordedTruth(problems=odd)
        truth = read_truth(self.recording, topic, scans, mounting)
        if truth.poses is not None or truth.positions is not None:
            self.topics["truth"] = topic.name
        return replace(truth, problems=(*odd, *truth.problems))

    @property
    def _middle(self) -> float:
        """Time [s] from the stamp to the middle of the points' times: an image of then shows most of the points."""
        times = self.point_times
        return (times.first + times.last) / 2 if times.field else 0.0
