"""Layout of a simulated sequence as a recording: a ROS 1 bag, or one of ROS 2 in SQLite or MCAP."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from slam.data import se3
from slam.data.atomic import write_text, written_beside
from slam.data.cloud import Array
from slam.data.conventions import INSTANTS
from slam.data.errors import InputError
from slam.data.recordings.recording import Recording
from slam.data.recordings.writer import FORMS, RecordingWriter, recording_writer
from slam.simulation.camera import CAMERA
from slam.simulation.drivers import Driver
from slam.simulation.instruments import Fixes, Motion, fixes_along, motion_along
from slam.simulation.layouts import sensor_text, write_truth
from slam.simulation.lidar import Scan
from slam.simulation.rig import Rig, SimulatedFrame

CAMERA_TOPIC, TRUTH_TOPIC, IMU_TOPIC, FIX_TOPIC = "/camera", "/ground_truth/odom", "/imu/data", "/gps/fix"
BASE, CAMERA_FRAME, IMU_FRAME, FIX_FRAME = "base_link", "camera_optical", "imu_link", "gps"
#: Seconds after its stamp, or after the end of its sweep, that a message is recorded.
DELAYS = {"scan": 0.005, "image": 0.02, "other": 0.001}


class RecordedLayout:
    """One recording, in a folder with sensor.yaml.

    Scans in the layout of a driver; images as PNG, which lose nothing, with CameraInfo; IMU and GNSS; the mounting of
    all of these on /tf_static; true poses of the LiDAR at the stamps. The clock starts with the first sweep.

    Args:
        folder: To write into. The frames lie in its `frames/` until all are put together.
        form: 'bag', 'ros2' or 'mcap'.
        driver: Of the LiDAR.
        fill: Makes the driver's points of a scan and the number of its frame.
        period: Seconds of a sweep.
        stamp: The instant of it that scans are stamped with.
        seed: Of the noise of IMU and GNSS.
    """

    def __init__(
        self,
        folder: Path,
        form: str,
        driver: Driver,
        fill: Callable[[Scan, int], Array],
        period: float,
        stamp: str,
        seed: int,
    ) -> None:
        self._folder, self._form, self._driver, self._fill = folder, form, driver, fill
        self._period, self._instant, self._seed = period, INSTANTS[stamp], seed

    def files(self, number: int) -> dict[str, Path]:
        """See `Layout`."""
        return {
            "image": self._folder / f"frames/{number:06d}.png",
            "depth": self._folder / f"depth/{number:06d}.png",
            "exact": self._folder / f"exact/{number:06d}.bin",
            "scan": self._folder / f"frames/{number:06d}.npy",
        }

    def write(self, frame: SimulatedFrame, number: int) -> None:
        """See `Layout`."""
        files = self.files(number)
        write_truth(files, frame)
        with written_beside(files["scan"]) as temporary, temporary.open("wb") as file:
            np.save(file, self._fill(frame.scan, number), allow_pickle=False)

    def write_surroundings(self, rig: Rig, stamps: Array) -> None:
        """See `Layout`."""
        write_text(self._folder / "sensor.yaml", sensor_text(rig))

    def holds(self, count: int) -> bool:
        """See `Layout`."""
        file = self._folder / f"{self._name}{FORMS[self._form]}"
        if not file.is_file():
            return False
        try:
            topic = Recording(file, [file]).topics.get(self._driver.topic)
        except InputError:
            return False
        return topic is not None and topic.count == count

    def put_together(self, rig: Rig, count: int) -> None:
        """See `Layout`."""
        if self.holds(count):
            return
        events = [*self._scans(rig, count), *self._images(count), *self._motion(rig, count)]
        with recording_writer(self._folder / self._name, self._form) as writer:
            writer.write("/tf_static", 0, writer.transforms(self._mounting(rig)))
            for recorded, write in sorted(events, key=lambda event: event[0]):
                write(writer, _nanoseconds(recorded))
        shutil.rmtree(self._folder / "frames")

    @property
    def _name(self) -> str:
        return self._folder.resolve().name

    def _scans(self, rig: Rig, count: int) -> Iterator[Event]:
        """Scans and true poses."""
        for number in range(count):
            stamp = _nanoseconds((number + self._instant) * self._period)
            pose = rig.sweep(number).at(self._instant)
            path = self.files(number)["scan"]
            yield (number + 1) * self._period + DELAYS["scan"], self._scan_writer(path, stamp)
            yield stamp / 1e9 + DELAYS["other"], self._pose_writer(pose, stamp)

    def _scan_writer(self, path: Path, stamp: int) -> Write:
        def write(writer: RecordingWriter, recorded: int) -> None:
            points, frame = np.load(path, allow_pickle=False), self._driver.frame
            livox = points.dtype.names[0] == "offset_time"
            message = (
                writer.livox(stamp, frame, points) if livox else writer.cloud(stamp, frame, points, self._driver.dense)
            )
            writer.write(self._driver.topic, recorded, message)

        return write

    def _pose_writer(self, pose: Array, stamp: int) -> Write:
        return lambda writer, recorded: writer.write(
            TRUTH_TOPIC, recorded, writer.odometry(stamp, "world", self._driver.frame, pose)
        )

    def _images(self, count: int) -> Iterator[Event]:
        """Images of mid-sweep, where there are any."""
        for number in range(count):
            path = self.files(number)["image"]
            if path.is_file():
                stamp = (number + 0.5) * self._period
                yield stamp + DELAYS["image"], _image_writer(path, _nanoseconds(stamp))

    def _motion(self, rig: Rig, count: int) -> Iterator[Event]:
        """Write the measurements of IMU and GNSS."""
        middles, rng = (np.arange(count) + 0.5) * self._period, np.random.default_rng([self._seed, 11])
        if count < 4:  # too few for accelerations
            return
        motion = motion_along(middles, rig.poses[:count] @ T_LIDAR_IMU, rng)
        fixes = fixes_along(middles, rig.poses[:count], rng)
        for at in range(len(motion.stamps)):
            yield motion.stamps[at] + DELAYS["other"], _imu_writer(motion, at)
        for at in range(len(fixes.stamps)):
            yield fixes.stamps[at] + DELAYS["other"], _fix_writer(fixes, at)

    def _mounting(self, rig: Rig) -> dict[tuple[str, str], Array]:
        """How things are mounted, from the ground below the LiDAR on."""
        T_base_lidar = np.eye(4)
        T_base_lidar[2, 3] = rig.height
        return {
            (BASE, self._driver.frame): T_base_lidar,
            (self._driver.frame, CAMERA_FRAME): se3.inverse(rig.calibration.T_camera_lidar),
            (BASE, IMU_FRAME): T_base_lidar @ T_LIDAR_IMU,
            (BASE, FIX_FRAME): T_base_lidar,
        }


Write = Callable[[RecordingWriter, int], None]
Event = tuple[float, Write]
#: The IMU lies 8 cm below the LiDAR, its axes parallel to the LiDAR's.
T_LIDAR_IMU = np.array([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, -0.08], [0, 0, 0, 1.0]])


def _nanoseconds(stamp: float) -> int:
    return round(stamp * 1e9)


def _image_writer(path: Path, stamp: int) -> Write:
    def write(writer: RecordingWriter, recorded: int) -> None:
        header = writer.header(stamp, CAMERA_FRAME)
        data = np.fromfile(path, np.uint8)
        image = writer.make("sensor_msgs/msg/CompressedImage", header=header, format="png", data=data)
        writer.write(f"{CAMERA_TOPIC}/image_rect/compressed", recorded, image)
        writer.write(f"{CAMERA_TOPIC}/camera_info", recorded, _camera_info(writer, header))

    return write


def _camera_info(writer: RecordingWriter, header: Any) -> Any:
    P = CAMERA.P2 * [1, 1, 1, 0]
    region = {"x_offset": 0, "y_offset": 0, "height": 0, "width": 0, "do_rectify": False}
    return writer.make(
        "sensor_msgs/msg/CameraInfo",
        header=header,
        height=CAMERA.height,
        width=CAMERA.width,
        distortion_model="plumb_bob",
        d=np.zeros(5),
        k=P[:, :3].ravel(),
        r=np.eye(3).ravel(),
        p=P.ravel(),
        binning_x=0,
        binning_y=0,
        roi=writer.make("sensor_msgs/msg/RegionOfInterest", **region),
    )


def _imu_writer(motion: Motion, at: int) -> Write:
    def write(writer: RecordingWriter, recorded: int) -> None:
        unknown = np.zeros(9)
        unknown[0] = -1
        message = writer.make(
            "sensor_msgs/msg/Imu",
            header=writer.header(_nanoseconds(motion.stamps[at]), IMU_FRAME),
            orientation=writer.quaternion(np.eye(3)),
            orientation_covariance=unknown,
            angular_velocity=writer.vector("Vector3", motion.rate[at]),
            angular_velocity_covariance=np.zeros(9),
            linear_acceleration=writer.vector("Vector3", motion.force[at]),
            linear_acceleration_covariance=np.zeros(9),
        )
        writer.write(IMU_TOPIC, recorded, message)

    return write


def _fix_writer(fixes: Fixes, at: int) -> Write:
    def write(writer: RecordingWriter, recorded: int) -> None:
        latitude, longitude, altitude = fixes.places[at].tolist()
        message = writer.make(
            "sensor_msgs/msg/NavSatFix",
            header=writer.header(_nanoseconds(fixes.stamps[at]), FIX_FRAME),
            status=writer.make("sensor_msgs/msg/NavSatStatus", status=0, service=1),
            latitude=latitude,
            longitude=longitude,
            altitude=altitude,
            position_covariance=np.diag(np.square(fixes.sigma)).ravel(),
            position_covariance_type=2,
        )
        writer.write(FIX_TOPIC, recorded, message)

    return write
