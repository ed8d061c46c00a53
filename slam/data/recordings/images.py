"""Images in messages."""

from __future__ import annotations

from typing import Any

import numpy as np

from slam.data.cloud import Array
from slam.data.image_damage import TAIL, UNKNOWN, fault_inside, fault_of
from slam.data.images import ReportingReader
from slam.data.point_blocks import UnreadableError
from slam.data.problem import Problem
from slam.data.recordings.messages import COMPRESSED, IMAGE, read_message
from slam.data.recordings.recording import Recording, Topic

#: Encodings of images: number of channels, and OpenCV's conversion into RGB, None for none.
ENCODINGS = {
    **{"rgb8": (3, None), "8UC3": (3, "BGR2RGB"), "bgr8": (3, "BGR2RGB"), "rgba8": (4, "RGBA2RGB")},
    **{"bgra8": (4, "BGRA2RGB"), "8UC4": (4, "BGRA2RGB"), "mono8": (1, "GRAY2RGB"), "8UC1": (1, "GRAY2RGB")},
    **{"bayer_rggb8": (1, "BayerRGGB2RGB"), "bayer_bggr8": (1, "BayerBGGR2RGB")},
    **{"bayer_gbrg8": (1, "BayerGBRG2RGB"), "bayer_grbg8": (1, "BayerGRBG2RGB")},
    **{"yuv422": (2, "YUV2RGB_UYVY"), "uyvy": (2, "YUV2RGB_UYVY"), "yuv422_yuy2": (2, "YUV2RGB_YUY2")},
    **{"yuyv": (2, "YUV2RGB_YUY2")},
}
#: Encodings of two bytes per value, the upper of which is kept.
WIDE = {"mono16": "mono8", "16UC1": "mono8", "rgb16": "rgb8", "bgr16": "bgr8"} | {
    f"bayer_{order}16": f"bayer_{order}8" for order in ("rggb", "bggr", "gbrg", "grbg")
}


def image_of(content: bytes, kind: str, encoding: str) -> Array:
    """Decode an Image or a CompressedImage.

    Args:
        content: Bytes of the message.
        kind: Type of the message.
        encoding: Encoding of the message, `ROS1` or `CDR`.

    Returns:
        (H, W, 3) uint8 RGB.

    Raises:
        UnreadableError: The message is damaged, or the encoding of its pixels is unknown.
    """
    message = read_message(content, kind, encoding)
    if kind == COMPRESSED:
        return _unpacked(np.asarray(message.data, np.uint8), message.format)
    assert kind == IMAGE
    return _converted(message)


def _unpacked(data: Array, form: str) -> Array:
    import cv2  # takes a while to import, and a LiDAR alone does not need it

    content = data.tobytes()
    if fault_of(content[:16], content[-TAIL:]) is None and (fault := fault_inside(content)):
        raise UnreadableError(fault)
    image = cv2.imdecode(data, cv2.IMREAD_COLOR) if len(data) else None
    if image is None:
        raise UnreadableError(f"an image of {len(data)} bytes, format '{form}', that is no JPEG or PNG, or damaged")
    return np.ascontiguousarray(image[..., ::-1])


def _converted(message: Any) -> Array:
    import cv2

    pixels, conversion = _pixels(message)
    return pixels if conversion is None else np.asarray(cv2.cvtColor(pixels, getattr(cv2, f"COLOR_{conversion}")))


def _pixels(message: Any) -> tuple[Array, str | None]:
    """The pixels (H, W, C) uint8 of an Image, and their conversion into RGB."""
    name = WIDE.get(message.encoding, message.encoding)
    size = 2 if message.encoding in WIDE else 1
    if name not in ENCODINGS:
        raise UnreadableError(f"an image encoded as '{message.encoding}'; known: {', '.join([*ENCODINGS, *WIDE])}")
    channels, conversion = ENCODINGS[name]
    height, width, step = int(message.height), int(message.width), int(message.step)
    row, data = width * channels * size, np.asarray(message.data, np.uint8)
    step = step or row
    if height * width == 0 or step < row or len(data) < (height - 1) * step + row:
        raise UnreadableError(f"an image of {height} x {width} pixels in {len(data)} bytes")
    data = np.concatenate([data, np.zeros(max(0, height * step - len(data)), np.uint8)])
    values = data[: height * step].reshape(height, step)[:, :row]
    if size == 2:
        values = values[:, 0 if message.is_bigendian else 1 :: 2]
    return np.ascontiguousarray(values).reshape(height, width, channels), conversion


class RecordedImage(ReportingReader):
    """Reads the image of a message.

    Args:
        recording: The recording.
        topic: A topic with images.
        number: Number of the message in it.
    """

    def __init__(self, recording: Recording, topic: Topic, number: int) -> None:
        self._recording, self._topic, self._number = recording, topic, number

    def __call__(self) -> Array | None:
        """Read the image, (H, W, 3) uint8 RGB; None for a damaged one."""
        try:
            content, encoding = self._recording.read(self._topic.name, self._number)
            return image_of(content, self._topic.type, encoding)
        except UnreadableError as error:
            self._damaged(str(error))
            return None

    def check(self) -> Problem | None:
        """Return what is wrong with the message, without decoding the pixels."""
        try:
            content, encoding = self._recording.read(self._topic.name, self._number)
            message = read_message(content, self._topic.type, encoding)
            if self._topic.type == IMAGE:
                _pixels(message)
                return None
            fault = fault_of(bytes(message.data[:16]), bytes(message.data[-TAIL:]))
            if fault and fault != UNKNOWN:  # OpenCV reads more than PNG and JPEG
                self._damaged(fault)
        except UnreadableError as error:
            self._damaged(str(error))
        return self.problem

    def _damaged(self, fault: str) -> None:
        where = f"{self._recording.path}: {self._topic.name}, message {self._number}"
        text = f"{where}: {fault}; this scan's points stay without colour"
        self.problem = self.problem or Problem("damaged image", text)
