"""Cameras in recordings: encodings, models, mounting, and which image belongs to which scan."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from slam.data.dataset import open_dataset
from slam.data.images import found_in_reading
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
    make: Callable[[RecordingWriter, Any], Any],
    topic: str = "/cam/image_raw",
    ahead: float = 0.0,
    frame: str = "optical",
) -> list[Event]:
    """One in the middle of each sweep, its stamp `ahead` of the others' [s]."""

    def event(number: int) -> Event:
        at = 0.1 * number + 0.05

        def write(writer: RecordingWriter, recorded: int) -> None:
            writer.write(topic, recorded, make(writer, writer.header(nanoseconds(at + ahead), frame)))

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


def info(
    model: str = "plumb_bob",
    d: tuple[float, ...] = (),
    k: Any = K,
    *,
    topic: str = "/cam/camera_info",
    binning: int = 0,
    region: dict[str, int] | None = None,
) -> list[Event]:
    def write(writer: RecordingWriter, recorded: int) -> None:
        whole = {"x_offset": 0, "y_offset": 0, "height": 0, "width": 0, "do_rectify": False}
        roi = writer.make("sensor_msgs/msg/RegionOfInterest", **(whole | (region or {})))
        message = writer.make(
            "sensor_msgs/msg/CameraInfo",
            header=writer.header(recorded, "optical"),
            **{"height": 30, "width": 40, "distortion_model": model, "d": np.array(d), "k": k.ravel()},
            **{"r": np.eye(3).ravel(), "p": np.hstack([2 * k, np.zeros((3, 1))]).ravel()},
            **{"binning_x": binning, "binning_y": binning, "roi": roi},
        )
        writer.write(topic, recorded, message)

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
        ("equidistant", (0.1, -0.2, 0.001, 0.002), True, ()),
        ("equidistant", (0.0,) * 4, True, ()),
        ("equidistant", (0.1, -0.2, 0.001, 0.002, 0.1), False, ("5 distortion coefficients", "fisheye model has 4")),
        ("plumb_bob", (0.1, 0.2), False, ("2 distortion coefficients",)),
        ("omni", (0.1, 0.2, 0, 0), False, ("its distortion model 'omni' is unknown; rectify the images",)),
    ],
)
def test_models_of_lenses(record: Record, model: str, d: tuple[float, ...], used: bool, words: tuple[str, ...]) -> None:
    data = drive(record, *images(raw("rgb8", PICTURE)), *info(model, d), *mounting(TO_CAMERA))
    if used:
        assert data.calibration.distortion == (d if any(d) else ())
        assert data.calibration.fisheye == (model == "equidistant")
        assert data.problems == ()
        return
    assert data.calibration is None
    assert data[0].image is None
    assert [problem.kind for problem in data.problems] == ["no calibration"]
    for word in (*words, "this camera is not used; give calib.yaml"):
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


@pytest.mark.parametrize("form", ["bag", "ros2", "mcap"])
@pytest.mark.parametrize("kind", ["encoding", "bytes", "png", "jpeg", "empty"])
def test_a_damaged_image_is_a_problem_of_its_frame(record: Record, form: str, kind: str) -> None:
    def broken(writer: RecordingWriter, header: Any) -> Any:
        number = round((header.stamp.sec * 10**9 + header.stamp.nanosec - nanoseconds(0.05)) / 1e8)
        compressed = kind in ("png", "jpeg", "empty")
        message = (jpeg_or_png(f".{'png' if kind == 'empty' else kind}") if compressed else raw("rgb8", PICTURE))(
            writer, header
        )
        if number == 4 and kind == "encoding":
            message.encoding = "x-secret"
        elif number == 4:
            message.data = message.data[: 0 if kind == "empty" else len(message.data) // 2]
        return message

    topic = "/cam/image_raw/compressed" if kind in ("png", "jpeg", "empty") else "/cam/image_raw"
    data = drive(record, *images(broken, topic), *info(), *mounting(TO_CAMERA), form=form)
    assert data.problems == ()
    assert [problem.kind for problem in data[4].problems] == ["damaged image"]
    assert f"{topic}, message 4" in data[4].problems[0].message
    assert data[4].image is None
    assert data[5].problems == ()
    assert data[5].image is not None


def test_damage_that_only_decoding_finds_is_told_by_the_reader(record: Record) -> None:
    def broken(writer: RecordingWriter, header: Any) -> Any:
        message = jpeg_or_png(".png")(writer, header)
        message.data = message.data.copy()
        message.data[20:60] = 0
        return message

    data = drive(record, *images(broken, "/cam/image_raw/compressed"), *info(), *mounting(TO_CAMERA))
    frame = data[4]
    assert frame.problems == ()
    assert frame.image is None
    assert [problem.kind for problem in found_in_reading(frame)] == ["damaged image"]


def test_topics_of_one_camera_are_alternatives(record: Record) -> None:
    others = [*images(raw("mono8", GREY[..., 0]), "/cam/grey/image_raw"), *images(raw("mono8", GREY[..., 0]), "/depth")]
    path = record([*clouds(), *images(raw("rgb8", PICTURE)), *others, *info(), *mounting(TO_CAMERA)])
    data: Any = open_dataset(path)
    assert data.topics["images"] == "/cam/image_raw"
    assert data[0].others == ()
    assert "--image-topic chooses" in data.problems[0].message
    other: Any = open_dataset(path, image_topic="/cam/grey/image_raw")
    assert other.topics["images"] == "/cam/grey/image_raw"
    assert other.calibration is not None


BOTH = {("velodyne", "optical"): T, ("velodyne", "rear_optical"): np.diag([-1, -1, 1, 1.0]) @ T}


def both_cameras() -> list[Event]:
    rear = [*images(raw("rgb8", PICTURE[::-1]), "/a_rear/image_raw", frame="rear_optical")]
    return [
        *rear,
        *images(raw("rgb8", PICTURE)),
        *info(topic="/a_rear/camera_info", k=2 * K + np.diag([0, 0, -1])),
        *info(),
    ]


def test_all_calibrated_cameras_are_used_the_one_ahead_first(record: Record) -> None:
    data = drive(record, *both_cameras(), *mounting(BOTH))
    assert data.problems == ()
    assert data.topics == {
        "points": "/velodyne_points",
        "images": "/cam/image_raw",
        "images 2": "/a_rear/image_raw",
    }
    frame = data[3]
    assert [view.calibration.K[0, 0] for view in frame.views] == [300, 600]
    np.testing.assert_array_equal(frame.views[0].read_image()[0, 0], PICTURE[0, 0])
    np.testing.assert_array_equal(frame.views[1].read_image()[0, 0], PICTURE[-1, 0])
    assert data.images == tuple(range(10))
    one = open_dataset(data.path, image_topic="/a_rear/image_raw")
    assert len(one[3].views) == 1
    assert one.calibration is not None
    assert one.calibration.K[0, 0] == 600


def test_a_camera_without_a_mounting_is_left_out_and_said(record: Record) -> None:
    data = drive(record, *both_cameras(), *mounting({("velodyne", "optical"): T}))
    assert len(data[3].views) == 1
    assert [problem.kind for problem in data.problems] == ["no calibration"]
    assert "/a_rear/image_raw: no transform between its frame 'rear_optical'" in data.problems[0].message


def test_cameras_of_a_file_are_matched_by_name_or_topic(record: Record, tmp_path: Path) -> None:
    def camera(factor: int, T: Any) -> str:
        k = np.diag([factor, factor, 1]) @ K
        return f"K: {k.tolist()}, T_camera_lidar: {np.linalg.inv(T).tolist()}"

    path = record([*clouds(), *both_cameras()])
    rear = BOTH["velodyne", "rear_optical"]
    (tmp_path / "calib.yaml").write_text(f"cameras:\n  a_rear: {{{camera(5, rear)}}}\n  cam: {{{camera(3, T)}}}\n")
    data: Any = open_dataset(path)
    assert (data.problems, data.topics["images"], data.topics["images 2"]) == (
        (),
        "/cam/image_raw",
        "/a_rear/image_raw",
    )
    assert [view.calibration.K[0, 0] for view in data[0].views] == [900, 1500]
    (tmp_path / "calib.yaml").write_text(
        f"cameras:\n  left: {{{camera(5, rear)}, images: /a_rear/image_raw}}\n  right: {{{camera(3, T)}}}\n"
    )
    named: Any = open_dataset(path)
    assert named.topics["images"] == "/a_rear/image_raw"
    assert [problem.kind for problem in named.problems] == ["no images"]
    assert "camera right" in named.problems[0].message


def test_parts_of_images_have_their_own_camera_matrix(record: Record) -> None:
    """Published is every second pixel of a region that begins at column 10 and row 4."""
    region = {"x_offset": 10, "y_offset": 4, "width": 80, "height": 60}
    data = drive(record, *images(raw("rgb8", PICTURE)), *info(binning=2, region=region), *mounting(TO_CAMERA))
    np.testing.assert_allclose(data.calibration.K, [[150, 0, 5], [0, 155, 5.5], [0, 0, 1]])
    assert data.problems == ()


def test_resized_images_are_told(record: Record) -> None:
    data = drive(record, *images(raw("rgb8", PICTURE[::2, ::2])), *info(), *mounting(TO_CAMERA))
    np.testing.assert_allclose(data.calibration.K, [[150, 0, 9.75], [0, 155, 7.25], [0, 0, 1]])
    assert [problem.kind for problem in data.problems] == ["resized images"]
    cropped = drive(record, *images(raw("rgb8", PICTURE[:20])), *info(), *mounting(TO_CAMERA))
    assert cropped.calibration is None
    assert "images of 40 x 20 pixels, and a CameraInfo for 40 x 30" in cropped.problems[0].message
