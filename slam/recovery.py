"""Results of a run that did not finish, from its session."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pydantic import ValidationError

from slam.data.cloud import Array, PointCloud
from slam.data.errors import InputError
from slam.frame_record import records_in
from slam.graph.back_end import BackEnd
from slam.journal.journal import SESSION as SESSION_NAME
from slam.journal.session_file import REMEDY, SessionFile
from slam.mapping.global_map import build_map
from slam.mapping.keyframes import Keyframe, Keyframes
from slam.mapping_record import add_edges, kept_keyframes
from slam.mapping_result import corrected_poses, mapped
from slam.segments import segment_starts
from slam.session import SESSION, UNFINISHED
from slam.settings import Config


@dataclass(frozen=True, eq=False)
class Recovered:
    """A run so far, with the loops so far.

    Attributes:
        stamps: (N,) [s].
        poses: (N, 4, 4) T_world_lidar, corrected by the loops.
        T_camera0_lidar: (4, 4), None if it is unknown.
        keyframes: The complete keyframes, without those at known places.
        keyframe_poses: (K, 4, 4) T_world_keyframe.
        config: The settings of the run.
    """

    stamps: Array
    poses: Array
    T_camera0_lidar: Array | None
    keyframes: Sequence[Keyframe]
    keyframe_poses: Array
    config: Config

    def map(self) -> PointCloud:
        """Build the map of the keyframes."""
        return build_map(self.keyframes, self.keyframe_poses, self.config.map)


def session_of(folder: Path) -> Path | None:
    """Return the session in a run folder, the unfinished one first; None if there is none."""
    paths = (folder / name / SESSION_NAME for name in (UNFINISHED, SESSION))
    return next((path for path in paths if path.is_file()), None)


def recovered(path: Path) -> Recovered:
    """Return what a session has: all frames, and the loops that were found, selected jointly.

    Args:
        path: The session.

    Raises:
        InputError: It is damaged, or has no frames.
    """
    with SessionFile.open(path) as file:
        about = file.about
        try:
            config = Config.model_validate(about["settings"])
            T = about["input"]["T_camera0_lidar"]
            T_camera0_lidar = None if T is None else np.array(T, float).reshape(4, 4)
        except (ValidationError, KeyError, TypeError, ValueError) as error:
            raise InputError(f"{path}: damaged (its description: {type(error).__name__}); {REMEDY}") from error
        records, kept, back_end = records_in(file), kept_keyframes(file), BackEnd()
        if not records:
            raise InputError(f"{path}: has no frames yet")
        add_edges(file, back_end)
    edges = len(back_end.odometry)
    if edges > max(len(kept) - 1, 0) or any(position >= len(records) for position, _, _ in kept):
        raise InputError(f"{path}: damaged (keyframes are missing); {REMEDY}")
    keyframes = Keyframes(config.keyframes, _Clouds(path), kept[: edges + 1])
    poses, own = records.poses, keyframes.poses
    optimised = own
    if back_end.has_loops:
        back_end.settle()
        optimised = own[0] @ back_end.poses()
        starts = keyframes.indices[segment_starts(back_end.odometry)].tolist()
        poses = corrected_poses(poses, keyframes.indices, own, optimised, starts)
    return Recovered(records.stamps, poses, T_camera0_lidar, *mapped(keyframes, optimised, back_end), config)


@dataclass(frozen=True)
class _Clouds:
    """The clouds of a session, for reading."""

    path: Path

    def store(self, index: int, travelled: float, pose: Array, block: bytes) -> None:
        raise NotImplementedError("the session is only read")

    def block(self, number: int) -> bytes:
        with SessionFile.open(self.path) as file:
            return file.cloud(number)
