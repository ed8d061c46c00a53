"""g2o files: what is written is read again, and damage is named with its line."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slam.data import se3
from slam.data.errors import InputError
from slam.graph.g2o import read_g2o, write_g2o
from slam.graph.pose_graph import Edge, PoseGraph

IDENTITY = "0 0 0 0 0 0 1"
UNIT = "1 0 0 0 0 0 1 0 0 0 0 1 0 0 0 1 0 0 1 0 1"
TWO = f"VERTEX_SE3:QUAT 0 {IDENTITY}\nVERTEX_SE3:QUAT 1 {IDENTITY}\n"


def _graph(seed: int) -> PoseGraph:
    rng = np.random.default_rng(seed)
    poses = np.array([se3.exp(rng.normal(size=6) * [1, 1, 1, 1e3, 1e3, 1e3]) for _ in range(4)])
    edges = []
    for i, j in ((0, 1), (1, 2), (2, 3), (0, 3)):
        A = rng.normal(size=(6, 6))
        edges.append(Edge(i, j, se3.exp(rng.normal(size=6)), A @ A.T + 0.1 * np.eye(6)))
    return PoseGraph(poses, tuple(edges))


@given(st.integers(0, 2**32 - 1))
def test_a_graph_is_written_and_read_back(tmp_path_factory: pytest.TempPathFactory, seed: int) -> None:
    graph, path = _graph(seed), tmp_path_factory.mktemp("g2o") / "graph.g2o"
    write_g2o(path, graph)
    read = read_g2o(path)
    np.testing.assert_allclose(read.poses[:, :3, :3], graph.poses[:, :3, :3], atol=1e-14)
    np.testing.assert_array_equal(read.poses[:, :3, 3], graph.poses[:, :3, 3])
    assert [(edge.i, edge.j) for edge in read.edges] == [(edge.i, edge.j) for edge in graph.edges]
    for ours, theirs in zip(read.edges, graph.edges, strict=True):
        np.testing.assert_allclose(ours.pose, theirs.pose, atol=1e-14)
        np.testing.assert_allclose(ours.covariance, theirs.covariance, rtol=1e-9, atol=1e-12)


def test_the_information_has_the_translation_first(tmp_path: Path) -> None:
    covariance = np.diag([1.0, 0.5, 0.25, 0.2, 0.1, 0.05])  # rotation first
    covariance[0, 4] = covariance[4, 0] = 0.05
    path = tmp_path / "graph.g2o"
    write_g2o(path, PoseGraph(np.tile(np.eye(4), (2, 1, 1)), (Edge(0, 1, np.eye(4), covariance),)))
    values = [float(word) for word in path.read_text().splitlines()[-1].split()[10:]]
    information = np.zeros((6, 6))
    information[np.triu_indices(6)] = values
    expected = np.linalg.inv(covariance)
    assert information[0, 0] == pytest.approx(expected[3, 3])  # x
    assert information[5, 5] == pytest.approx(expected[2, 2])  # about z
    assert information[1, 3] == pytest.approx(expected[4, 0])  # y with the rotation about x


def test_ids_need_not_be_consecutive(tmp_path: Path) -> None:
    path = tmp_path / "graph.g2o"
    path.write_text(
        f"# a comment\n\nVERTEX_SE3:QUAT 30 1 2 3 0 0 0 1\nVERTEX_SE3:QUAT 7 {IDENTITY}\nFIX 7\n"
        f"EDGE_SE3:QUAT 7 30 1 2 3 0 0 0 1 {UNIT}\n"
    )
    graph = read_g2o(path)
    np.testing.assert_array_equal(graph.poses[:, :3, 3], [[0, 0, 0], [1, 2, 3]])
    assert [(edge.i, edge.j) for edge in graph.edges] == [(0, 1)]


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("EDGE_SE3:QUAT 0 1 0 0 0 0 0 0 1 1 0 0", "12 values, expected 30"),
        (f"EDGE_SE3:QUAT 0 1 x 0 0 0 0 0 1 {UNIT}", "not a number"),
        (f"EDGE_SE3:QUAT 0 1 nan 0 0 0 0 0 1 {UNIT}", "not finite"),
        (f"EDGE_SE3:QUAT 0 1 0 0 0 0 0 0 0 {UNIT}", "quaternion"),
        (f"EDGE_SE3:QUAT 0 1.5 {IDENTITY} {UNIT}", "vertex id"),
        (f"EDGE_SE3:QUAT 0 9 {IDENTITY} {UNIT}", "vertex 9"),
        (f"EDGE_SE3:QUAT 1 1 {IDENTITY} {UNIT}", "to itself"),
        (f"EDGE_SE3:QUAT 0 1 {IDENTITY} -{UNIT}", "positive definite"),
        (f"VERTEX_SE3:QUAT 1 {IDENTITY}", "twice"),
        ("VERTEX_SE2 2 0 0 0", "VERTEX_SE2 is unknown"),
    ],
)
def test_a_damaged_line_is_an_error_with_its_number(tmp_path: Path, line: str, message: str) -> None:
    path = tmp_path / "graph.g2o"
    path.write_text(TWO + line + "\n")
    with pytest.raises(InputError, match="line 3") as caught:
        read_g2o(path)
    assert message in str(caught.value)
    assert str(path) in str(caught.value)


@pytest.mark.parametrize(("content", "message"), [(b"", "no VERTEX"), (b"\xff\xfe\x00", "not a text file")])
def test_a_file_without_a_graph_is_an_error(tmp_path: Path, content: bytes, message: str) -> None:
    path = tmp_path / "graph.g2o"
    path.write_bytes(content)
    with pytest.raises(InputError, match=message):
        read_g2o(path)
    with pytest.raises(InputError, match="cannot be read"):
        read_g2o(tmp_path / "missing.g2o")
