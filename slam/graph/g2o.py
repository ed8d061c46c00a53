"""Pose graphs as g2o files have them: lines VERTEX_SE3:QUAT and EDGE_SE3:QUAT.

g2o has the translation first in its information matrices; ours have the rotation first. As in GTSAM's reader, the
rotation's block is taken for radians.
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
NUMBERS = {VERTEX: 8, EDGE: 30}  # id or ids, translation, quaternion, upper triangle of the information by rows
ROTATION_FIRST = np.array([3, 4, 5, 0, 1, 2])
UPPER = np.triu_indices(6)


def read_g2o(path: Path) -> PoseGraph:
    """The graph of a file, its vertices numbered 0, 1, 2 .. in the order of their ids; comments and FIX are skipped.

    Raises InputError, with the number of the line, for a file that cannot be read, another kind of line, values that
    are too few, too many or not finite, information that is not positive definite, edges to vertices that are missing.
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
                raise InputError(f"{where}: vertex {index} stands in the file twice; remove one of the two")
            vertices[index] = _pose(values[1:8], where)
        elif tag == EDGE:
            values = _numbers(tag, words, where)
            i, j = _index(words[0], where), _index(words[1], where)
            edges.append((where, i, j, _pose(values[2:9], where), _covariance(values[9:], where)))
        else:
            raise InputError(f"{where}: {tag[:40]} is not known; {VERTEX} and {EDGE} are read")
    if not vertices:
        raise InputError(f"{path}: no {VERTEX} in it; a three-dimensional g2o pose graph is expected")
    numbers = {index: n for n, index in enumerate(sorted(vertices))}
    poses = np.array([vertices[index] for index in sorted(vertices)])
    return PoseGraph(poses, tuple(_edge(numbers, *edge) for edge in edges))


def write_g2o(path: Path, graph: PoseGraph) -> None:
    """The graph with all the digits of a float64, whole or not at all. Raises InputError where it cannot be written."""
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
        raise InputError(f"{path}: not a text file; a g2o pose graph is expected") from error


def _numbers(tag: str, words: list[str], where: str) -> Array:
    if len(words) != NUMBERS[tag]:
        raise InputError(f"{where}: {tag} with {len(words)} values, it takes {NUMBERS[tag]}; is the file cut short?")
    try:
        values = np.array([float(word) for word in words])
    except ValueError as error:
        raise InputError(f"{where}: not a number ({error}); repair the line or export the graph afresh") from error
    if not np.isfinite(values).all():
        raise InputError(f"{where}: holds a value that is not finite; remove or repair it")
    return values


def _index(word: str, where: str) -> int:
    if not (word.isascii() and word.isdigit() and len(word) < 19):
        raise InputError(f"{where}: {word[:40]} is no vertex id; whole numbers from 0 on are")
    return int(word)


def _pose(seven: Array, where: str) -> Array:
    if not 0.9 < np.linalg.norm(seven[3:]) < 1.1:
        raise InputError(f"{where}: a quaternion whose length is not 1; the order is x y z qx qy qz qw")
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
                f"{where}: an edge to vertex {index}, which the file does not have; add it or remove the edge"
            )
    try:
        return Edge(numbers[i], numbers[j], pose, covariance)
    except ValueError as error:
        raise InputError(f"{where}: {error}") from error


def _seven(pose: Array) -> Array:
    return np.concatenate([pose[:3, 3], Rotation.from_matrix(pose[:3, :3]).as_quat(canonical=True)])


def _words(values: Array) -> str:
    return " ".join(repr(float(value)) for value in values)
