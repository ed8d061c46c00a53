"""Choice of a recording's topics: for scans, images, calibration and ground truth."""

from __future__ import annotations

import re
from collections.abc import Sequence

from slam.data.errors import InputError
from slam.data.point_blocks import UnreadableError
from slam.data.point_files import NAMES
from slam.data.problem import Problem
from slam.data.recordings.clouds import CLOUDS
from slam.data.recordings.messages import CAMERA_INFO, COMPRESSED, FIX, IMAGE, OLD_TRANSFORMS, TRANSFORMS
from slam.data.recordings.packets import PACKETS
from slam.data.recordings.recording import TRUTH_TYPES, Recording, Topic
from slam.data.recordings.scans import packet_bytes
from slam.data.recordings.transforms import Mounting
from slam.data.yaml_files import suggest

TRIED = 5  # messages of a topic that are read at most until one is sound
SELDOM = 0.5  # share of the messages of the topic with most of its kind; with fewer, it is a map or a selection
RAW = re.compile(r"packet|scan|msop|raw", re.IGNORECASE)
NOT_COLOUR = re.compile(r"depth|mask|label|segment|thermal|infra|disparity", re.IGNORECASE)
TRUTH = re.compile(r"(^|[/_])(gt|ground_?truth|truth|reference|mocap|vicon|optitrack|vrpn)", re.IGNORECASE)
TRANSPORT = re.compile(r"/(compressed|theora|ffmpeg)$")
MOVING = 200  # messages of /tf that are read to find the frames that do not move


def cloud_topic(recording: Recording, said: str | None) -> tuple[Topic, tuple[Problem, ...]]:
    """Return the topic with the scans.

    By default, it is the topic whose first scan has times, else rings, else most points, among those with many
    messages. Packets are used if there are no point clouds.

    Args:
        recording: The recording.
        said: The topic that the user names, None for the default.

    Returns:
        The topic, and a Problem if there are others.

    Raises:
        InputError: There is none, or none of the name that is said.
    """
    known = recording.of_type(*CLOUDS)
    packets = {topic: packet_bytes(recording, topic) for topic in recording.of_type(*PACKETS)}
    if said is not None:
        return _named(recording, said, [*known, *packets], "--topic", "point clouds"), ()
    if not known and packets:
        most = max(packets.values())
        lidars = [topic for topic in packets if packets[topic] >= SELDOM * most]
        best = max(lidars, key=lambda topic: packets[topic])
        return best, _several(recording, lidars, best, "packets", "--topic")
    if not known:
        raise InputError(f"{recording.path}: no point clouds in it{_instead(recording)}")
    most = max(topic.count for topic in known)
    values = {topic.name: (topic.count >= SELDOM * most, *_worth(recording, topic)) for topic in known}
    best = max(known, key=lambda topic: values[topic.name])
    return best, _several(recording, known, best, "point clouds", "--topic")


def camera_topics(recording: Recording, said: str | None) -> tuple[list[Topic], tuple[Problem, ...]]:
    """Return a topic with images for each camera, that with most images first.

    Topics of one name space, or of one frame, are of one camera: those with a CameraInfo, uncompressed, and with most
    images are preferred.

    Args:
        recording: The recording.
        said: The only topic that is used, None for all.

    Raises:
        InputError: There is no topic with images of the name that is said.
    """
    known = recording.of_type(IMAGE, COMPRESSED)
    if said is not None:
        return [_named(recording, said, known, "--image-topic", "images")], ()
    cameras: list[list[Topic]] = []
    for topic in known:
        if NOT_COLOUR.search(topic.name):
            continue
        same = (camera for camera in cameras if any(_same_camera(recording, topic, other) for other in camera))
        if (camera := next(same, None)) is None:
            cameras.append([topic])
        else:
            camera.append(topic)
    infos = {camera_space(topic.name) for topic in recording.of_type(CAMERA_INFO)}
    values = {topic: (camera_space(topic.name) in infos, topic.type == IMAGE, topic.count) for topic in known}
    chosen, problems = list[Topic](), tuple[Problem, ...]()
    for camera in cameras:
        best = max(camera, key=lambda topic: values[topic])
        others = [topic for topic in camera if camera_space(topic.name) != camera_space(best.name)]
        problems += _several(recording, [best, *others], best, "images of one camera", "--image-topic")
        chosen.append(best)
    return sorted(chosen, key=lambda topic: (values[topic][0], topic.count), reverse=True), problems


def _same_camera(recording: Recording, topic: Topic, other: Topic) -> bool:
    if camera_space(topic.name) == camera_space(other.name):
        return True
    headers = (recording.header(each.name, 0) for each in (topic, other))
    frames = [header.frame if header else "" for header in headers]
    return bool(frames[0]) and frames[0] == frames[1]


def info_topic(recording: Recording, images: Topic, only: bool) -> Topic | None:
    """Return the CameraInfo of a topic with images: in its name space, else of its frame.

    Args:
        recording: The recording.
        images: The topic with images.
        only: Whether it is of the only camera, so that the only CameraInfo belongs to it.
    """
    infos = recording.of_type(CAMERA_INFO)
    inside = [topic for topic in infos if camera_space(topic.name) == camera_space(images.name)]
    framed = [topic for topic in infos if _same_camera(recording, topic, images)]
    found = [*inside, *framed, *(infos if only and len(infos) == 1 else ())]
    return found[0] if found else None


def truth_topic(recording: Recording, said: str | None) -> tuple[Topic | None, tuple[Problem, ...]]:
    """Return the topic with the ground truth: the one that is said, else one of poses whose name says so, else GNSS.

    The odometry of a robot is not taken for ground truth.

    Raises:
        InputError: There is none of the name that is said.
    """
    known, fixes = recording.of_type(*TRUTH_TYPES), recording.of_type(FIX)
    if said is not None:
        return _named(recording, said, [*known, *fixes], "--truth-topic", "poses"), ()
    named = [topic for topic in known if TRUTH.search(topic.name)]
    if named:
        best = max(named, key=lambda topic: topic.count)
        return best, _several(recording, named, best, "true poses", "--truth-topic")
    if fixes:
        best = max(fixes, key=lambda topic: topic.count)
        return best, _several(recording, fixes, best, "GNSS fixes", "--truth-topic")
    if known:
        text = f"{recording.path}: poses on {', '.join(map(str, known))}, none of which is called truth"
        return None, (Problem("no ground truth", f"{text}; to take one as such name it with --truth-topic"),)
    return None, ()


def mounting_of(recording: Recording) -> Mounting:
    """Read how the frames are mounted to each other, from /tf_static and a sample of /tf."""
    mounting = Mounting()
    for topic in recording.of_type(TRANSFORMS, OLD_TRANSFORMS):
        fixed = "static" in topic.name
        numbers = range(topic.count) if fixed else range(0, topic.count, max(1, topic.count // MOVING))
        for number in numbers:
            try:
                mounting.add(recording.message(topic.name, number).transforms, fixed)
            except UnreadableError:
                continue
    return mounting


def is_rectified(images: str) -> bool:
    """Return whether the images of a topic are rectified, by its name: image_rect, image_rect_color/compressed."""
    return "rect" in TRANSPORT.sub("", images).rpartition("/")[2]


def camera_space(topic: str) -> str:
    """Return the name space of a camera by one of its topics."""
    return TRANSPORT.sub("", topic).rpartition("/")[0]


def _named(recording: Recording, said: str, known: Sequence[Topic], option: str, what: str) -> Topic:
    name = said if said.startswith("/") else f"/{said}"
    found = [topic for topic in known if topic.name in (said, name)]
    if found:
        return found[0]
    other = recording.topics.get(said) or recording.topics.get(name)
    if other:
        raise InputError(f"{recording.path}: {option} {said}: holds {other.type}, not {what}{_choice(known)}")
    raise InputError(f"{recording.path}: {option} {said}: no such topic{suggest(said, [t.name for t in known])}")


def _choice(known: Sequence[Topic]) -> str:
    return f"; there are {', '.join(map(str, known))}" if known else "; there are none"


def _several(recording: Recording, known: Sequence[Topic], best: Topic, what: str, option: str) -> tuple[Problem, ...]:
    if len(known) < 2:
        return ()
    text = f"{recording.path}: {what} on {', '.join(map(str, known))}; {best.name} is used, {option} chooses"
    return (Problem("several topics", text),)


def _instead(recording: Recording) -> str:
    """The content of a recording without point clouds, for the error message."""
    if not recording.topics:
        return ", nor anything else"
    raw = [topic for topic in recording.topics.values() if RAW.search(topic.name) or RAW.search(topic.type)]
    if raw:
        packets = ", ".join(map(str, raw))
        remedy = "only those of Velodyne and Ouster are read; let its driver publish PointCloud2, and record that"
        return f"; {packets} may be a LiDAR's packets: {remedy}"
    return f"; it has {', '.join(str(topic) for topic in list(recording.topics.values())[:8])}"


def _worth(recording: Recording, topic: Topic) -> tuple[bool, bool, int]:
    """Whether the scans have times, whether they have rings, and the number of points of the first sound one."""
    for number in range(min(topic.count, TRIED)):
        try:
            content, encoding = recording.read(topic.name, number)
            table = CLOUDS[topic.type](content, encoding)
        except UnreadableError:
            continue
        names = {name.lower() for name in table.dtype.names or ()}
        return bool(names & set(NAMES["time"])), bool(names & set(NAMES["ring"])), table.size
    return False, False, 0
