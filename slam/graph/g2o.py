"""Pose graphs in g2o files: lines VERTEX_SE3:QUAT and EDGE_SE3:QUAT.

Information matrices have the translation first in g2o, and the rotation first here. As in GTSAM's reader, the rotation
block is taken to be in radians.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from slam.data import atomic
from slam.data.cloud import Array
from slam.data.errors import InputError
from slam.graph.pose_graph import Edge, PoseGraph, symmetric

VERTEX, EDGE = "VERTEX_SE3:QUAT", "EDGE_SE3:QUAT"
NUMBERS = {VERTEX: 8, EDGE: 30}  # ids, translation, quaternion, upper triangle of the information matrix by rows
ROTATION_FIRST = np.array([3, 4, 5, 0, 1, 2])
UPPER = np.triu_indices(6)


def read_g2o(path: Path) -> PoseGraph:
    """Read a pose graph; vertices are numbered 0, 1, 2 .. in the order of their ids, comments and FIX are skipped.

    Raises:
        InputError: The file cannot be read, a line is of another kind, has the wrong number of values or non-finite
            ones, an information matrix is not positive definite, or a vertex is missing. The line number is given.
    """
    vertices: dict[int, Array] = {}
    edges: list[tuple[str, int, int, Array, Array]] = []
    for number, line in enumerate(_lines(path), start=1):
        tag, *words = line.split() or ["#"]
        if tag.startswith("#") or tag == "FIX":
            continue
        where = f"{path}: line {number}"
        if tag == VERTEX:
            values = _numbers(tag, words, where)
            index = _index(words[0], where)
            if index in vertices:
                raise InputError(f"{where}: vertex {index} is in the file twice; remove one of the two")
            vertices[index] = _pose(values[1:8], where)
        elif tag == EDGE:
            values = _numbers(tag, words, where)
            i, j = _index(words[0], where), _index(words[1], where)
            edges.append((where, i, j, _pose(values[2:9], where), _covariance(values[9:], where)))
        else:
            raise InputError(f"{where}: {tag[:40]} is unknown; expected {VERTEX} or {EDGE}")
    if not vertices:
        raise InputError(f"{path}: has no {VERTEX}; expected a three-dimensional g2o pose graph")
    numbers = {index: n for n, index in enumerate(sorted(vertices))}
    poses = np.array([vertices[index] for index in sorted(vertices)])
    return PoseGraph(poses, tuple(_edge(numbers, *edge) for edge in edges))


def write_g2o(path: Path, graph: PoseGraph) -> None:
    """Write a pose graph atomically, with all digits of a float64.

    Raises:
        InputError: The file cannot be written.
    """
    lines = [f"{VERTEX} {n} {_words(_seven(pose))}" for n, pose in enumerate(graph.poses)]
    for edge in graph.edges:
        information = edge.information[np.ix_(ROTATION_FIRST, ROTATION_FIRST)][UPPER]
        lines.append(f"{EDGE} {edge.i} {edge.j} {_words(_seven(edge.pose))} {_words(information)}")
    atomic.write_text(path, "\n".join(lines) + "\n")


def _lines(path: Path) -> list[str]:
    try:
        return path.read_text(encoding="utf-8").splitlines()
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from error
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: not a text file; expected a g2o pose graph") from error


def _numbers(tag: str, words: list[str], where: str) -> Array:
    if len(words) != NUMBERS[tag]:
        raise InputError(f"{where}: {tag} has {len(words)} values, expected {NUMBERS[tag]}; is the file truncated?")
    try:
        values = np.array([float(word) for word in words])
    except ValueError as error:
        raise InputError(f"{where}: not a number ({error}); repair the line or export the graph again") from error
    if not np.isfinite(values).all():
        raise InputError(f"{where}: has a value that is not finite; remove or repair it")
    return values


def _index(word: str, where: str) -> int:
    if not (word.isascii() and word.isdigit() and len(word) < 19):
        raise InputError(f"{where}: {word[:40]} is not a vertex id; expected a whole number from 0")
    return int(word)


def _pose(seven: Array, where: str) -> Array:
    if not 0.9 < np.linalg.norm(seven[3:]) < 1.1:
        raise InputError(f"{where}: the norm of the quaternion is not 1; the order is x y z qx qy qz qw")
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_quat(seven[3:]).as_matrix()
    pose[:3, 3] = seven[:3]
    return pose


def _covariance(upper: Array, where: str) -> Array:
    information = np.zeros((6, 6))
    information[UPPER] = upper
    information = information + np.triu(information, 1).T
    try:
        np.linalg.cholesky(information)
    except np.linalg.LinAlgError as error:
        raise InputError(f"{where}: the information matrix is not positive definite; repair or remove it") from error
    return symmetric(np.linalg.inv(information))[np.ix_(ROTATION_FIRST, ROTATION_FIRST)]


def _edge(numbers: dict[int, int], where: str, i: int, j: int, pose: Array, covariance: Array) -> Edge:
    for index in (i, j):
        if index not in numbers:
            raise InputError(
                f"{where}: the edge refers to vertex {index}, which is not in the file; add it or remove the edge"
            )
    try:
        return Edge(numbers[i], numbers[j], pose, covariance)
    except ValueError as error:
        raise InputError(f"{where}: {error}") from error


def _seven(pose: Array) -> Array:
    return np.concatenate([pose[:3, 3], Rotation.from_matrix(pose[:3, :3]).as_quat(canonical=True)])


def _words(values: Array) -> str:
    return " ".join(repr(float(value)) for value in values)
