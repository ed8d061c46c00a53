"""Images and cameras in messages."""

from __future__ import annotations

from typing import Any

import numpy as np

from slam.data.cloud import Array, Calibration
from slam.data.point_blocks import UnreadableError
from slam.data.recordings.messages import COMPRESSED, IMAGE, read_message

#: Distortion models of OpenCV's pinhole camera, with the coefficients that it takes.
PINHOLE = {"plumb_bob": (4, 5), "rational_polynomial": (8, 12, 14)}
#: Encodings of images: channels, and the conversion of OpenCV into RGB, None for none.
ENCODINGS = {
    **{"rgb8": (3, None), "8UC3": (3, "BGR2RGB"), "bgr8": (3, "BGR2RGB"), "rgba8": (4, "RGBA2RGB")},
    **{"bgra8": (4, "BGRA2RGB"), "8UC4": (4, "BGRA2RGB"), "mono8": (1, "GRAY2RGB"), "8UC1": (1, "GRAY2RGB")},
    **{"bayer_rggb8": (1, "BayerRGGB2RGB"), "bayer_bggr8": (1, "BayerBGGR2RGB")},
    **{"bayer_gbrg8": (1, "BayerGBRG2RGB"), "bayer_grbg8": (1, "BayerGRBG2RGB")},
    **{"yuv422": (2, "YUV2RGB_UYVY"), "uyvy": (2, "YUV2RGB_UYVY"), "yuv422_yuy2": (2, "YUV2RGB_YUY2")},
    **{"yuyv": (2, "YUV2RGB_YUY2")},
}
#: Of two bytes a value, the upper of which is kept.
WIDE = {"mono16": "mono8", "16UC1": "mono8", "rgb16": "rgb8", "bgr16": "bgr8"} | {
    f"bayer_{order}16": f"bayer_{order}8" for order in ("rggb", "bggr", "gbrg", "grbg")
}


def image_of(content: bytes, kind: str, encoding: str) -> Array:
    """(H, W, 3) uint8 RGB of an Image or a CompressedImage.

    Raises:
        UnreadableError: It is damaged, or encoded in a way that is not known.
    """
    message = read_message(content, kind, encoding)
    if kind == COMPRESSED:
        return _unpacked(np.asarray(message.data, np.uint8), message.format)
    assert kind == IMAGE
    return _converted(message)


def _unpacked(data: Array, form: str) -> Array:
    import cv2  # takes a while to import, and a LiDAR alone does not need it

    image = cv2.imdecode(data, cv2.IMREAD_COLOR) if len(data) else None
    if image is None:
        raise UnreadableError(f"an image of {len(data)} bytes, format '{form}', that is no JPEG or PNG, or damaged")
    return np.ascontiguousarray(image[..., ::-1])


def _converted(message: Any) -> Array:
    import cv2

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
    pixels = np.ascontiguousarray(values).reshape(height, width, channels)
    return pixels if conversion is None else np.asarray(cv2.cvtColor(pixels, getattr(cv2, f"COLOR_{conversion}")))


def camera_of(message: Any, rectified: bool) -> tuple[Array, tuple[float, ...]] | str:
    """K (3, 3) and OpenCV's distortion of a CameraInfo; or, in words, why it cannot be used.

    Args:
        message: The CameraInfo, of ROS 1 or 2.
        rectified: Whether the images have been rectified, so that its P holds.
    """
    K, D, P = (np.array(_either(message, name), np.float64) for name in ("K", "D", "P"))
    if rectified and P.size == 12 and P[0] > 0:
        return P.reshape(3, 4)[:, :3].copy(), ()
    if K.size != 9 or not K[0] > 0 or not K[4] > 0:
        return "it is not calibrated, its K is 0"
    model = message.distortion_model
    if not D.any():
        return K.reshape(3, 3), ()
    if model not in PINHOLE:
        return f"its distortion model '{model}' is not one of {', '.join(PINHOLE)}; rectify the images"
    if len(D) not in PINHOLE[model]:
        return f"{len(D)} coefficients of distortion, where {model} has {' or '.join(map(str, PINHOLE[model]))}"
    return K.reshape(3, 3), tuple(D.tolist())


def _either(message: Any, name: str) -> Any:
    """A field that ROS 2 has in lower case."""
    return getattr(message, name) if hasattr(message, name) else getattr(message, name.lower())


def calibration_of(message: Any, rectified: bool, T_camera_lidar: Array) -> Calibration | str:
    """The camera beside the LiDAR, or why it cannot be used."""
    found = camera_of(message, rectified)
    return found if isinstance(found, str) else Calibration(found[0], T_camera_lidar, found[1])
