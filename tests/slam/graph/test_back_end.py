"""Two laps of a circle with true and false loops; covariances; the ledger."""

from __future__ import annotations

import csv
import io

import numpy as np
import pytest

from slam.data import se3
from slam.data.cloud import Array
from slam.graph.back_end import BackEnd
from slam.graph.clusters import QUANTILES
from slam.graph.ledger import LoopCandidate, csv_text
from slam.graph.loop_selection import select_loops
from slam.graph.pose_graph import Edge, adjoint, chained, disagreement, odometry_poses, reduced, reversed_edge
from slam.graph.solver import optimised, relative_covariances, squared_distances

LAP = 100
STEP = se3.exp(np.array([0, 0, 2 * np.pi / LAP, np.pi, 0, 0]))  # a circle of 50 m
ODOMETRY = np.diag(np.repeat([0.005**2, 0.05**2], 3))
LOOP = np.diag(np.repeat([0.01**2, 0.05**2], 3))
TRUE = [(k, k + LAP) for k in range(5, LAP, 10)]
FALSE = [(10, 60), (30, 180), (55, 120)]


def _noisy(pose: Array, covariance: Array, rng: np.random.Generator) -> Array:
    return se3.normalized(pose @ se3.exp(rng.normal(size=6) * np.sqrt(np.diag(covariance))))


def _circle(poses: int = 2 * LAP) -> tuple[Array, list[Edge]]:
    rng = np.random.default_rng(3)
    truth = odometry_poses([Edge(k, k + 1, STEP, ODOMETRY) for k in range(poses - 1)], np.eye(4))
    return truth, [Edge(k, k + 1, _noisy(STEP, ODOMETRY, rng), ODOMETRY) for k in range(poses - 1)]


def _loops(truth: Array) -> list[Edge]:
    """The ten true ones, then the three false ones, which say that the places are the same."""
    rng = np.random.default_rng(4)
    true = [Edge(i, j, _noisy(se3.inverse(truth[i]) @ truth[j], LOOP, rng), LOOP) for i, j in TRUE]
    return true + [Edge(i, j, np.eye(4), LOOP) for i, j in FALSE]


def _fed(odometry: list[Edge], loops: list[Edge]) -> BackEnd:
    back_end = BackEnd()
    for edge in odometry:
        back_end.add_odometry(edge.pose, edge.covariance)
        for loop in loops:
            if loop.j == edge.j:
                back_end.add_loop(LoopCandidate(loop.i, loop.j, loop.pose, distance=0.1, yaw=np.pi), loop.covariance)
    return back_end


def _rms(poses: Array, truth: Array) -> float:
    return float(np.sqrt(np.mean(np.sum((poses - truth)[:, :3, 3] ** 2, axis=1))))


def _fates(back_end: BackEnd) -> dict[tuple[int, int], tuple[str, float]]:
    return {(r.candidate.i, r.candidate.j): (r.status, r.weight) for r in back_end.ledger()}


def test_false_loops_get_weight_zero_and_do_not_change_the_poses() -> None:
    truth, odometry = _circle()
    loops = _loops(truth)
    back_end = _fed(odometry, loops)
    back_end.settle()
    fates = _fates(back_end)
    assert {pair for pair, fate in fates.items() if fate == ("rejected", 0.0)} == set(FALSE)
    assert {pair for pair, fate in fates.items() if fate == ("accepted", 1.0)} == set(TRUE)
    alone = optimised(odometry, loops[: len(TRUE)], odometry_poses(odometry, np.eye(4)))
    assert _rms(back_end.poses(), truth) == pytest.approx(_rms(alone, truth), rel=0.02)
    assert _rms(alone, truth) < 0.7 * _rms(odometry_poses(odometry, np.eye(4)), truth)


def test_the_kernel_downweights_false_loops_online() -> None:
    truth, odometry = _circle()
    back_end = _fed(odometry, _loops(truth))
    weights = {pair: weight for pair, (_, weight) in _fates(back_end).items()}
    assert max(weights[pair] for pair in FALSE) < 0.01
    assert min(weights[pair] for pair in TRUE) > 0.5
    assert _rms(back_end.poses(), truth) < 0.7 * _rms(odometry_poses(odometry, np.eye(4)), truth)


def test_consistent_false_loops_are_rejected() -> None:
    truth, odometry = _circle()
    poses = odometry_poses(odometry, np.eye(4))
    together = [Edge(k, k + 120, se3.inverse(poses[k]) @ poses[20] @ se3.inverse(poses[140]) @ poses[k + 120], LOOP)
                for k in range(20, 25)]  # fmt: skip
    selection = select_loops(odometry, [*_loops(truth), *together], poses)
    assert selection.accepted.tolist() == [True] * len(TRUE) + [False] * (len(FALSE) + len(together))


def test_a_false_loop_that_bends_the_graph_is_rejected() -> None:
    """One metre off, near two true loops: with it among them, all are within the limit."""
    truth, odometry = _circle()
    true = _loops(truth)[: len(TRUE)]
    aside = se3.exp(np.array([0, 0, 0, 0, 1.0, 0]))
    false = Edge(33, 133, se3.normalized(se3.inverse(truth[33]) @ truth[133] @ aside), LOOP)
    start = odometry_poses(odometry, np.eye(4))
    together = optimised(odometry, [*true, false], start)
    assert max(disagreement(loop, together) for loop in (*true, false)) < QUANTILES[0.9999]
    assert select_loops(odometry, [*true, false], start).accepted.tolist() == [True] * len(true) + [False]


def test_disagreement_equals_the_distance_of_the_solver() -> None:
    truth, odometry = _circle()
    edges = [*odometry, *_loops(truth)]
    expected = [disagreement(edge, truth) for edge in edges]
    np.testing.assert_allclose(squared_distances(edges, truth), expected, rtol=1e-6, atol=1e-6)


def test_later_loops_are_selected_jointly_with_earlier_ones() -> None:
    truth, odometry = _circle()
    loops = _loops(truth)
    back_end = _fed(odometry[:150], [loop for loop in loops if loop.j <= 150])
    back_end.settle()
    for edge in odometry[150:]:
        back_end.add_odometry(edge.pose, edge.covariance)
    for loop in loops:
        if loop.j > 150:
            back_end.add_loop(LoopCandidate(loop.i, loop.j, loop.pose), loop.covariance)
    back_end.settle()
    assert {pair for pair, (status, _) in _fates(back_end).items() if status == "rejected"} == set(FALSE)
    assert len(back_end.graph().edges) == len(odometry) + len(TRUE)


def _with_known(odometry: list[Edge], loops: list[Edge], known: range) -> BackEnd:
    """Fed with loops, of which those to poses in `known` are at known places."""
    back_end = BackEnd()
    for edge in odometry:
        back_end.add_odometry(edge.pose, edge.covariance)
        for loop in loops:
            if loop.j == edge.j:
                add = back_end.add_known if loop.j in known else back_end.add_loop
                add(LoopCandidate(loop.i, loop.j, loop.pose), loop.covariance)
    return back_end


def test_poses_at_known_places_are_given_by_their_loops() -> None:
    truth, odometry = _circle(3 * LAP)
    rng = np.random.default_rng(5)
    loops = [
        Edge(j % LAP, j, _noisy(se3.inverse(truth[j % LAP]) @ truth[j], LOOP, rng), LOOP) for j in range(LAP, 3 * LAP)
    ]
    known = range(2 * LAP, 3 * LAP)
    back_end = _with_known(odometry, loops, known)
    assert sorted(back_end.known) == list(known[:-1])  # the last one ties what would come next
    assert _rms(back_end.poses(), truth) < 0.5 * _rms(odometry_poses(odometry, np.eye(4)), truth)
    back_end.settle()
    poses = back_end.poses()
    np.testing.assert_allclose(poses[2 * LAP + 5], poses[5] @ loops[LAP + 5].pose, atol=1e-9)
    assert _rms(poses, truth) < 0.5 * _rms(odometry_poses(odometry, np.eye(4)), truth)
    assert len(back_end.graph().edges) == len(odometry) + len(loops)
    assert {record.status for record in back_end.ledger()} == {"accepted"}

    again = BackEnd()
    again.restore(odometry, [(LoopCandidate(e.i, e.j, e.pose), e.covariance, "") for e in loops], known)
    again.settle()
    assert again.poses().tobytes() == poses.tobytes()


def test_what_follows_a_known_place_is_tied_to_it() -> None:
    """New poses after a stretch of known ones follow from the last of these, not from the drift along the stretch."""
    truth, odometry = _circle(3 * LAP)
    loops = [Edge(j - LAP, j, se3.inverse(truth[j - LAP]) @ truth[j], LOOP) for j in range(LAP, 2 * LAP)]
    back_end = _with_known(odometry, loops, range(LAP + 1, 2 * LAP))
    back_end.settle()
    after, error = range(2 * LAP, 2 * LAP + 5), np.linalg.norm((back_end.poses() - truth)[:, :3, 3], axis=1)
    assert error[after].max() < 0.3
    assert len(back_end.known) == LAP - 2


@pytest.mark.parametrize(("i", "j"), [(LAP + 3, 2 * LAP - 1), (3, LAP + 5), (5, 20)])
def test_a_loop_that_known_places_exclude_is_an_error(i: int, j: int) -> None:
    truth, odometry = _circle()
    loops = [Edge(k - LAP, k, se3.inverse(truth[k - LAP]) @ truth[k], LOOP) for k in range(LAP, LAP + 10)]
    back_end = _with_known(odometry, loops, range(LAP + 1, LAP + 10))
    with pytest.raises(ValueError, match=r"known place|part of the graph"):
        back_end.add_known(LoopCandidate(i, j, STEP), LOOP)


def test_without_loops_the_poses_are_the_odometry() -> None:
    _, odometry = _circle()
    back_end = _fed(odometry, [])
    chain = odometry_poses(odometry, np.eye(4))
    np.testing.assert_allclose(back_end.poses(), chain, atol=1e-6)
    back_end.settle()
    np.testing.assert_allclose(back_end.poses(), chain, atol=1e-6)
    assert len(back_end.ledger()) == 0


def test_an_empty_graph_can_be_settled() -> None:
    back_end = BackEnd()
    back_end.settle()
    np.testing.assert_allclose(back_end.poses(), np.eye(4)[None], atol=1e-12)


def test_results_are_deterministic() -> None:
    truth, odometry = _circle()
    results = []
    for _ in range(2):
        back_end = _fed(odometry, _loops(truth))
        online = back_end.poses()
        back_end.settle()
        results.append((online, back_end.poses(), csv_text(back_end.ledger())))
    np.testing.assert_array_equal(results[0][0], results[1][0])
    np.testing.assert_array_equal(results[0][1], results[1][1])
    assert results[0][2] == results[1][2]


def test_a_loop_with_half_a_turn_is_closed() -> None:
    """There and back again: the places are seen in the opposite direction."""
    turn = se3.exp(np.array([0, 0, np.pi / 4, 0.5, 0, 0]))
    ahead = se3.exp(np.array([0, 0, 0, 2.0, 0, 0]))
    steps = [ahead] * 20 + [turn] * 4 + [ahead] * 20
    truth = odometry_poses([Edge(k, k + 1, step, ODOMETRY) for k, step in enumerate(steps)], np.eye(4))
    bend = se3.exp(np.array([0, 0, 0.002, 0, 0, 0]))
    odometry = [Edge(k, k + 1, step @ bend, ODOMETRY) for k, step in enumerate(steps)]
    loops = [Edge(i, 44 - i, se3.inverse(truth[i]) @ truth[44 - i], LOOP) for i in (0, 6, 12)]
    back_end = _fed(odometry, loops)
    back_end.settle()
    assert all(record.status == "accepted" for record in back_end.ledger())
    assert _rms(back_end.poses(), truth) < 0.3 * _rms(odometry_poses(odometry, np.eye(4)), truth)


def test_a_gap_in_precise_odometry_is_bridged_by_a_loop() -> None:
    """The edge of the gap says nothing: beside the others, Cholesky's method finds the equations indeterminate."""
    precise = np.diag(np.repeat([1e-4**2, 1e-3**2], 3))
    unknown = np.diag(np.repeat([np.pi**2, 300.0**2], 3))
    truth, _ = _circle()
    edges = [Edge(k, k + 1, se3.normalized(STEP), precise) for k in range(2 * LAP - 1)]
    edges[LAP] = Edge(LAP, LAP + 1, se3.exp(np.array([0, 0, 1.0, 20.0, -10.0, 0])), unknown)
    back_end = _fed(edges, [Edge(i, i + LAP, np.eye(4), precise) for i in (20, 30)])
    np.testing.assert_allclose(back_end.poses()[:LAP], truth[:LAP], atol=0.01)
    back_end.settle()
    np.testing.assert_allclose(back_end.poses(), truth, atol=0.01)


def test_the_covariance_grows_with_distance_and_a_loop_reduces_it() -> None:
    truth, odometry = _circle(LAP + 1)
    chain = odometry_poses(odometry, np.eye(4))
    grown = relative_covariances(odometry, chain, [(0, i) for i in (1, 20, 50, LAP)])
    volumes = [np.linalg.slogdet(covariance)[1] for covariance in grown]
    assert volumes == sorted(volumes)
    loop = Edge(0, LAP, se3.inverse(truth[0]) @ truth[LAP], LOOP)
    [closed] = relative_covariances([*odometry, loop], chain, [(0, LAP)])
    assert np.linalg.slogdet(closed)[1] < volumes[-1]
    assert np.linalg.eigvalsh(closed)[0] > 0


def test_the_covariance_of_a_chain_is_that_of_the_full_graph() -> None:
    """GTSAM's marginals of the whole chain, first pose held, against the edges composed between a few of its poses."""
    _, odometry = _circle(40)
    poses = odometry_poses(odometry, np.eye(4))
    loop = Edge(12, 30, np.eye(4), LOOP)
    touched, chain, [renamed] = reduced(odometry, [loop])
    assert touched == [0, 12, 30, 39]
    assert (renamed.i, renamed.j) == (1, 2)
    marginals = relative_covariances(odometry, poses, [(0, k) for k in touched[1:]])
    for n, (pose, marginal) in enumerate(zip(poses[touched[1:]], marginals, strict=True), 1):
        edge = chained(chain[:n])
        np.testing.assert_allclose(pose, edge.pose, atol=1e-6)
        np.testing.assert_allclose(marginal, edge.covariance, rtol=0.01, atol=1e-5)


def test_a_reversed_edge_is_the_same_measurement() -> None:
    edge = Edge(3, 8, se3.exp(np.array([0.1, -0.2, 0.5, 3, 1, -2])), LOOP)
    back = reversed_edge(edge)
    np.testing.assert_allclose(back.pose @ edge.pose, np.eye(4), atol=1e-12)
    again = reversed_edge(back)
    np.testing.assert_allclose(again.covariance, edge.covariance, atol=1e-12)
    xi = np.array([1e-3, 2e-3, -1e-3, 1e-2, 0, 1e-2])
    moved = se3.exp(adjoint(edge.pose) @ xi) @ edge.pose
    np.testing.assert_allclose(moved, edge.pose @ se3.exp(xi), atol=1e-12)


@pytest.mark.parametrize(
    ("covariance", "message"),
    [
        (np.full((6, 6), np.nan), "finite"),
        (np.eye(3), "6 x 6"),
        (np.diag([1.0, 1, 1, 1, 1, 0]), "positive definite"),
        (np.diag([1.0, 1, 1, 1, 1, -1]), "positive definite"),
        (np.eye(6) + np.eye(6, k=1), "symmetric"),
    ],
)
def test_an_invalid_covariance_is_an_error(covariance: Array, message: str) -> None:
    back_end = BackEnd()
    with pytest.raises(ValueError, match=f"edge 0 -> 1.*{message}"):
        back_end.add_odometry(STEP, covariance)
    back_end.add_odometry(STEP, ODOMETRY)
    with pytest.raises(ValueError, match=message):
        back_end.add_loop(LoopCandidate(0, 1, STEP), covariance)
    assert len(back_end) == 2
    assert len(back_end.ledger()) == 0


@pytest.mark.parametrize("pose", [np.full((4, 4), np.nan), 2 * np.eye(4), np.diag([1.0, 1, -1, 1])])
def test_an_invalid_pose_is_an_error(pose: Array) -> None:
    with pytest.raises(ValueError, match="edge 0 -> 1: the pose"):
        BackEnd().add_odometry(pose, ODOMETRY)


def test_a_loop_to_a_missing_pose_is_an_error() -> None:
    with pytest.raises(ValueError, match="poses 0 to 0 exist"):
        BackEnd().add_loop(LoopCandidate(0, 5, STEP), LOOP)


def test_the_ledger_records_every_candidate() -> None:
    truth, odometry = _circle()
    back_end = _fed(odometry, _loops(truth))
    back_end.reject(LoopCandidate(2, 90, np.eye(4), distance=0.4, inlier_ratio=0.31), "inlier ratio 0.31, below 0.6")
    back_end.settle()
    frames = list(range(0, 3 * len(back_end), 3))
    rows = list(csv.DictReader(io.StringIO(csv_text(back_end.ledger(), frames))))
    fields = "i,j,distance,yaw_deg,inlier_ratio,overlap,weight,status,reason,tx,ty,tz,qx,qy,qz,qw"
    assert ",".join(rows[0]) == fields
    assert len(rows) == len(TRUE) + len(FALSE) + 1
    by_pair = {(int(row["i"]), int(row["j"])): row for row in rows}
    true, false, refused = by_pair[15, 315], by_pair[30, 180], by_pair[6, 270]
    assert (true["status"], true["weight"], true["yaw_deg"]) == ("accepted", "1", "180")
    assert (false["status"], false["weight"]) == ("rejected", "0")
    assert "contradicts" in false["reason"]
    assert refused["reason"] == "inlier ratio 0.31, below 0.6"
    assert (refused["inlier_ratio"], refused["overlap"]) == ("0.31", "")
    assert [float(false[name]) for name in ("tx", "ty", "tz", "qx", "qy", "qz", "qw")] == [0, 0, 0, 0, 0, 0, 1]
