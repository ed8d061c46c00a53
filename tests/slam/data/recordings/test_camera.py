"""Cameras in recordings: encodings, models, mounting, and which image belongs to which scan."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from slam.data.dataset import open_dataset
from slam.data.recordings.writer import RecordingWriter
from tests.slam.data.recordings.conftest import Event, clouds, mounting, nanoseconds

Record = Callable[..., Path]
#: T_velodyne_camera: half a metre ahead, z forward, x to the right.
T = np.array([[0, 0, 1, 0.5], [-1, 0, 0, 0], [0, -1, 0, -0.1], [0, 0, 0, 1.0]])
K = np.array([[300.0, 0, 20], [0, 310, 15], [0, 0, 1]])
PICTURE = np.zeros((30, 40, 3), np.uint8)
PICTURE[:15], PICTURE[15:] = (250, 40, 10), (20, 60, 220)
TO_CAMERA = {("base_link", "velodyne"): np.eye(4), ("base_link", "cam"): np.eye(4), ("cam", "optical"): T}


def images(
    make: Callable[[RecordingWriter, Any], Any], topic: str = "/cam/image_raw", ahead: float = 0.0
) -> list[Event]:
    """One in the middle of each sweep, its stamp `ahead` of the others' [s]."""

    def event(number: int) -> Event:
        at = 0.1 * number + 0.05

        def write(writer: RecordingWriter, recorded: int) -> None:
            writer.write(topic, recorded, make(writer, writer.header(nanoseconds(at + ahead), "optical")))

        return at + 0.01, write

    return [event(number) for number in range(10)]


def raw(encoding: str, pixels: Any, step: int = 0) -> Callable[[RecordingWriter, Any], Any]:
    def make(writer: RecordingWriter, header: Any) -> Any:
        height, width = pixels.shape[:2]
        row = pixels[0].nbytes
        table = np.zeros((height, step or row), np.uint8)
        table[:, :row] = np.ascontiguousarray(pixels).view(np.uint8).reshape(height, row)
        about = {"height": height, "width": width, "encoding": encoding, "step": table.shape[1], "is_bigendian": 0}
        return writer.make("sensor_msgs/msg/Image", header=header, **about, data=table.ravel())

    return make


def info(model: str = "plumb_bob", d: tuple[float, ...] = (), k: Any = K) -> list[Event]:
    def write(writer: RecordingWriter, recorded: int) -> None:
        region = {"x_offset": 0, "y_offset": 0, "height": 0, "width": 0, "do_rectify": False}
        message = writer.make(
            "sensor_msgs/msg/CameraInfo",
            header=writer.header(recorded, "optical"),
            **{"height": 30, "width": 40, "distortion_model": model, "d": np.array(d), "k": k.ravel()},
            **{"r": np.eye(3).ravel(), "p": np.hstack([2 * k, np.zeros((3, 1))]).ravel()},
            **{"binning_x": 0, "binning_y": 0, "roi": writer.make("sensor_msgs/msg/RegionOfInterest", **region)},
        )
        writer.write("/cam/camera_info", recorded, message)

    return [(0.0, write)]


def jpeg_or_png(suffix: str) -> Callable[[RecordingWriter, Any], Any]:
    data = cv2.imencode(suffix, np.ascontiguousarray(PICTURE[..., ::-1]))[1].ravel()

    def make(writer: RecordingWriter, header: Any) -> Any:
        return writer.make("sensor_msgs/msg/CompressedImage", header=header, format=suffix[1:], data=data)

    return make


def drive(record: Record, *events: Event, form: str = "bag") -> Any:
    return open_dataset(record([*clouds(), *events], form))


GREY = np.repeat(PICTURE.mean(axis=2).astype(np.uint8)[..., None], 3, axis=2)
BAYER = np.zeros((30, 40), np.uint8)
for row, column, channel in ((0, 0, 0), (0, 1, 1), (1, 0, 1), (1, 1, 2)):
    BAYER[row::2, column::2] = PICTURE[row::2, column::2, channel]


@pytest.mark.parametrize(
    ("encoding", "pixels", "wanted"),
    [
        ("rgb8", PICTURE, PICTURE),
        ("bgr8", PICTURE[..., ::-1], PICTURE),
        ("rgba8", np.dstack([PICTURE, PICTURE[..., :1]]), PICTURE),
        ("bgra8", np.dstack([PICTURE[..., ::-1], PICTURE[..., :1]]), PICTURE),
        ("mono8", GREY[..., 0], GREY),
        ("mono16", GREY[..., 0].astype("<u2") << 8, GREY),
        ("bayer_rggb8", BAYER, PICTURE),
        ("bayer_rggb16", BAYER.astype("<u2") << 8, PICTURE),
    ],
)
@pytest.mark.parametrize("form", ["bag", "mcap"])
def test_encodings(record: Record, form: str, encoding: str, pixels: Any, wanted: Any) -> None:
    padded = 512 if encoding == "rgb8" else 0
    data = drive(record, *images(raw(encoding, pixels, padded)), *info(), *mounting(TO_CAMERA), form=form)
    image = data[4].image
    rows = np.r_[2:12, 18:28]  # away from the edge, where colours of a Bayer pattern mix
    np.testing.assert_allclose(image[rows, 2:-2].astype(int), wanted[rows, 2:-2], atol=1)


@pytest.mark.parametrize("suffix", [".png", ".jpg"])
def test_compressed_images(record: Record, suffix: str) -> None:
    topic = "/cam/image_raw/compressed"
    data = drive(record, *images(jpeg_or_png(suffix), topic), *info(), *mounting(TO_CAMERA), form="ros2")
    assert data.topics["images"] == topic
    np.testing.assert_allclose(data[0].image[:12].astype(int), PICTURE[:12], atol=6)
    assert data.problems == ()


def test_the_camera_is_where_the_transforms_have_it(record: Record) -> None:
    data = drive(record, *images(raw("rgb8", PICTURE)), *info(), *mounting(TO_CAMERA))
    np.testing.assert_allclose(data.calibration.T_camera_lidar, np.linalg.inv(T), atol=1e-12)
    np.testing.assert_array_equal(data.calibration.K, K)
    assert data.calibration.distortion == ()


def test_of_transforms_those_that_never_change_count(record: Record) -> None:
    fixed = [(0.1 * at, event) for at, (_, event) in enumerate(mounting(TO_CAMERA, "/tf") * 5)]
    assert drive(record, *images(raw("rgb8", PICTURE)), *info(), *fixed).calibration is not None
    turned = {**TO_CAMERA, ("cam", "optical"): T @ np.diag([-1, -1, 1, 1.0])}
    data = drive(record, *images(raw("rgb8", PICTURE)), *info(), *fixed, (0.7, mounting(turned, "/tf")[0][1]))
    assert data.calibration is None
    assert "no transform between its frame 'optical' and the LiDAR's 'velodyne'" in data.problems[0].message


@pytest.mark.parametrize(
    ("model", "d", "used", "words"),
    [
        ("plumb_bob", (0.1, -0.2, 0.001, 0.002, 0.01), True, ()),
        ("plumb_bob", (0.0,) * 5, True, ()),
        ("rational_polynomial", (0.1, -0.2, 0.001, 0.002, 0.01, 0.1, 0.1, 0.1), True, ()),
        ("equidistant", (0.1, -0.2, 0.001, 0.002), False, ("'equidistant' is not one of plumb_bob", "rectify")),
        ("plumb_bob", (0.1, 0.2), False, ("2 coefficients",)),
    ],
)
def test_models_of_lenses(record: Record, model: str, d: tuple[float, ...], used: bool, words: tuple[str, ...]) -> None:
    data = drive(record, *images(raw("rgb8", PICTURE)), *info(model, d), *mounting(TO_CAMERA))
    if used:
        assert data.calibration.distortion == (d if any(d) else ())
        assert data.problems == ()
        return
    assert data.calibration is None
    assert data[0].image is None
    assert [problem.kind for problem in data.problems] == ["no calibration"]
    for word in (*words, "the camera is not used; give calib.yaml"):
        assert word in data.problems[0].message


def test_rectified_images_have_the_camera_of_p(record: Record) -> None:
    events = [*images(raw("rgb8", PICTURE), "/cam/image_rect_color"), *info("plumb_bob", (0.1, 0.2, 0, 0, 0))]
    data = drive(record, *events, *mounting(TO_CAMERA))
    np.testing.assert_array_equal(data.calibration.K, np.diag([2, 2, 2]) @ K)
    assert data.calibration.distortion == ()


def test_a_camera_that_nobody_calibrated(record: Record) -> None:
    data = drive(record, *images(raw("rgb8", PICTURE)), *info(k=np.zeros((3, 3))), *mounting(TO_CAMERA))
    assert "it is not calibrated, its K is 0" in data.problems[0].message
    assert "images, but no CameraInfo" in drive(record, *images(raw("rgb8", PICTURE))).problems[0].message


def test_a_calibration_beside_the_recording_comes_first(record: Record, tmp_path: Path) -> None:
    (tmp_path / "calib.yaml").write_text(f"K: {(3 * K + np.diag([0, 0, -2])).tolist()}\nT_camera_lidar: {T.tolist()}\n")
    data = drive(record, *images(raw("rgb8", PICTURE)))
    assert data.calibration.K[0, 0] == 900
    assert data[0].image is not None


def numbered(writer: RecordingWriter, header: Any) -> Any:
    """An image whose colour tells in which tenth of a second its camera says that it was taken."""
    tenth = (header.stamp.sec * 10**9 + header.stamp.nanosec - nanoseconds(0)) // 10**8 % 100
    return raw("mono8", np.full((30, 40), tenth, np.uint8))(writer, header)


def test_each_scan_has_the_image_of_its_middle(record: Record) -> None:
    data = drive(record, *images(numbered), *info(), *mounting(TO_CAMERA))
    assert [int(data[number].image[0, 0, 0]) for number in range(10)] == list(range(10))


def test_clocks_that_differ_are_matched_by_the_times_of_recording(record: Record) -> None:
    data = drive(record, *images(numbered, ahead=7.0), *info(), *mounting(TO_CAMERA))
    assert [int(data[number].image[0, 0, 0]) for number in range(10)] == list(range(70, 80))


def test_a_missing_image_is_a_problem_of_its_frame(record: Record) -> None:
    events = images(numbered)
    del events[3]
    data = drive(record, *events, *info(), *mounting(TO_CAMERA))
    assert [problem.kind for problem in data[3].problems] == ["missing image"]
    assert data[3].image is None
    assert data[4].problems == ()


def test_an_image_that_cannot_be_read_is_none(record: Record, caplog: pytest.LogCaptureFixture) -> None:
    def broken(writer: RecordingWriter, header: Any) -> Any:
        message = raw("rgb8", PICTURE)(writer, header)
        message.encoding = "x-secret"
        return message

    data = drive(record, *images(broken), *info(), *mounting(TO_CAMERA))
    assert data[0].image is None
    assert "an image encoded as 'x-secret'" in caplog.text


def test_of_several_cameras_one_is_used(record: Record) -> None:
    others = [*images(raw("mono8", GREY[..., 0]), "/rear/image_raw"), *images(raw("mono8", GREY[..., 0]), "/cam/depth")]
    path = record([*clouds(), *images(raw("rgb8", PICTURE)), *others, *info(), *mounting(TO_CAMERA)])
    data: Any = open_dataset(path)
    assert data.topics["images"] == "/cam/image_raw"
    assert "--image-topic chooses" in data.problems[0].message
    other: Any = open_dataset(path, image_topic="/rear/image_raw")
    assert other.topics["images"] == "/rear/image_raw"
