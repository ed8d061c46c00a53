"""metrics.json from files and run folders, and what a user may get wrong."""

import json

import numpy as np
import pytest

from eval.evaluation import evaluate_files, evaluate_poses, evaluate_run, finite, write_json
from eval.metrics import RunMetrics
from eval.tables import format_metrics
from slam.data import se3
from slam.data.covariance_file import covariance_text
from slam.data.errors import InputError
from slam.data.pose_files import kitti_text, tum_text

T_CAMERA0_LIDAR = np.array([[0, -1, 0, 0.1], [0, 0, -1, -0.2], [1, 0, 0, -0.3], [0, 0, 0, 1.0]])


def drive(count=80, turn=0.02):
    """A LiDAR on a bend, a metre a pose."""
    return np.array([se3.exp(k * np.array([0, 0, turn, 1.0, 0, 0])) for k in range(count)])


def stamps(count=80):
    return 100 + 0.1 * np.arange(count)


def standing(count=20):
    return np.tile(np.eye(4), (count, 1, 1))


@pytest.fixture
def write(tmp_path):
    """Write a trajectory by name: TUM with stamps, KITTI without."""

    def write(name, poses, times=None):
        path = tmp_path / name
        path.write_text(kitti_text(poses) if times is None else tum_text(times, poses))
        return path

    return write


def test_all_figures_of_a_trajectory():
    metrics = evaluate_poses(drive() @ se3.exp(np.array([0, 0, 0.01, 0, 0, 0])), drive())
    assert metrics.drift.name == "short drive, 50 m"
    assert metrics.drift.body_rotation_removed.translation_percent < 1e-3 < metrics.drift.translation_percent
    assert metrics.path_length_m == pytest.approx(79, abs=0.01)
    assert (metrics.frames, metrics.notes) == (80, ())
    assert metrics.ate.origin.rmse > metrics.ate.aligned.rmse


def test_repeated_stamps_are_associated_in_order(tmp_path):
    """In a run folder, whose truth has the run's stamps."""
    times = stamps()
    times[40] = times[39]
    for name in ("trajectory", "odometry", "ground_truth"):
        (tmp_path / f"{name}_tum.txt").write_text(tum_text(times, drive()))
    assert evaluate_run(tmp_path).slam.rpe.frame.max < 1e-6


def test_a_standing_trajectory_is_evaluated_with_notes():
    noise = 0.01 * np.random.default_rng(0).normal(size=(20, 3))
    estimate = standing()
    estimate[:, :3, 3] += noise
    metrics = evaluate_poses(estimate, standing())
    assert metrics.ate.aligned.rmse < 0.03
    assert metrics.drift.translation_percent is None
    assert any("not unique" in note for note in metrics.notes)
    assert "no drift, the reference path of 0.0 m is shorter than 12 m" in format_metrics({"run": metrics})


def test_equal_kitti_files_have_no_error(write):
    metrics = evaluate_files(write("a.txt", drive()), write("b.txt", drive()))
    assert metrics.ate.unaligned.max == pytest.approx(0, abs=1e-9)
    assert metrics.protocol["association"] == "equal numbers of poses, in order"
    assert metrics.protocol["frame"] == "estimate: LiDAR axes; reference: LiDAR axes"


def test_tum_files_are_associated_by_stamp(write):
    estimate = write("a.txt", drive(), stamps() + 0.004)
    metrics = evaluate_files(estimate, write("b.txt", drive()[20:60], stamps()[20:60]))
    assert metrics.frames == 40
    assert metrics.ate.unaligned.max == pytest.approx(0, abs=1e-6)
    assert "40 of 80 frames have a reference" in metrics.notes[0]


def test_tum_against_kitti_needs_equal_numbers_of_poses(write):
    estimate = write("a.txt", drive(), stamps())
    assert evaluate_files(estimate, write("b.txt", drive())).frames == 80
    with pytest.raises(InputError, match=r"80 poses, .*c\.txt 79.*numbers must be equal"):
        evaluate_files(estimate, write("c.txt", drive(79)))


def test_disjoint_stamps_are_an_error(write):
    with pytest.raises(InputError, match="same clock"):
        evaluate_files(write("a.txt", drive(), stamps()), write("b.txt", drive(), stamps() + 1000))


def test_a_single_pose_is_an_error(write):
    with pytest.raises(InputError, match="at least two"):
        evaluate_files(write("a.txt", drive(1)), write("b.txt", drive(1)))


def test_lidar_against_camera_without_calib_is_an_error(write, tmp_path):
    estimate = write("estimate.txt", drive())
    reference = write("poses.txt", T_CAMERA0_LIDAR @ drive() @ se3.inverse(T_CAMERA0_LIDAR))
    calib = tmp_path / "calib.txt"
    calib.write_text("Tr: " + " ".join(map(str, T_CAMERA0_LIDAR[:3].ravel())))
    with pytest.raises(InputError, match=r"LiDAR trajectory .* camera 0 .*--calib calib\.txt"):
        evaluate_files(estimate, reference)
    metrics = evaluate_files(estimate, reference, calib)
    assert metrics.ate.unaligned.max < 1e-6
    assert "calib.txt" in metrics.protocol["reference"]
    with pytest.raises(InputError, match="leave it out"):
        evaluate_files(estimate, estimate, calib)


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("", "no poses"),
        ("1 2 3\n", "3 columns"),
        ("hello world\n", "not a table of numbers"),
        ("1 0 0 0 0 1 0 0 0 0 nan 0\n", "not finite"),
        ("5 0 0 0 0 1 0 0 0 0 1 0\n" * 2, "not a rotation"),
        ("1 0 0 0 0 1 0 0 0 0 -1 0\n" * 2, "not a rotation"),
    ],
)
def test_malformed_files_are_an_error(tmp_path, write, text, complaint):
    broken = tmp_path / "broken.txt"
    broken.write_text(text)
    with pytest.raises(InputError, match=complaint) as caught:
        evaluate_files(broken, write("b.txt", drive()))
    assert "broken.txt" in str(caught.value)


def test_a_missing_file_is_an_error(tmp_path, write):
    with pytest.raises(InputError, match="cannot be read"):
        evaluate_files(tmp_path / "nothing.txt", write("b.txt", drive()))


def test_a_run_folder_is_evaluated(write, tmp_path):
    write("trajectory_tum.txt", drive(), stamps())
    write("odometry_tum.txt", drive(turn=0.021), stamps())
    assert evaluate_run(tmp_path) is None
    assert not (tmp_path / "metrics.json").exists()
    write("ground_truth_tum.txt", drive(70), stamps(70))
    result = evaluate_run(tmp_path)
    assert RunMetrics.from_dict(json.loads((tmp_path / "metrics.json").read_text())) == result
    assert result.slam.frames == 70
    assert result.slam.ate.aligned.rmse < 1e-6 < result.odometry.ate.aligned.rmse
    assert [path.name for path in tmp_path.iterdir() if path.name.startswith(".")] == []


def test_covariances_are_evaluated(write, tmp_path):
    """All poses but the first are 0.2 m to the left, with a sigma of 0.1 m: two sigma in one of six directions."""
    shifted = drive()
    shifted[1:] = shifted[1:] @ se3.exp(np.array([0, 0, 0, 0, 0.2, 0]))
    for name in ("trajectory_tum.txt", "odometry_tum.txt"):
        write(name, shifted, stamps())
    write("ground_truth_tum.txt", drive(), stamps())
    covariances = np.tile(np.diag([1e-6] * 3 + [0.01] * 3), (80, 1, 1))
    covariances[0] = 0
    (tmp_path / "trajectory_covariance.csv").write_text(covariance_text(range(80), stamps(), covariances))
    result = evaluate_run(tmp_path)
    assert result.nees.frames == 79
    assert result.nees.pose == pytest.approx(4 / 6, rel=1e-3)
    assert result.nees.translation == pytest.approx(4 / 3, rel=1e-3)
    assert result.nees.by_axis["y"] == pytest.approx(4, rel=1e-3)
    assert result.nees.rotation < 1e-3
    assert RunMetrics.from_dict(json.loads((tmp_path / "metrics.json").read_text())) == result


def test_covariances_need_a_reference_of_the_first_pose(write, tmp_path):
    for name in ("trajectory_tum.txt", "odometry_tum.txt"):
        write(name, drive(), stamps())
    write("ground_truth_tum.txt", drive()[1:], stamps()[1:])
    (tmp_path / "trajectory_covariance.csv").write_text(covariance_text(range(80), stamps(), np.zeros((80, 6, 6))))
    assert evaluate_run(tmp_path).nees is None


@pytest.mark.parametrize("lines", [3, 0])
def test_covariances_of_another_run_are_an_error(write, tmp_path, lines):
    for name in ("trajectory_tum.txt", "odometry_tum.txt", "ground_truth_tum.txt"):
        write(name, drive(), stamps())
    text = covariance_text(range(lines), stamps(lines), np.zeros((lines, 6, 6))) if lines else "a,b\n1,2\n"
    (tmp_path / "trajectory_covariance.csv").write_text(text)
    with pytest.raises(InputError, match=r"trajectory_covariance\.csv: .*run again"):
        evaluate_run(tmp_path)


def test_metrics_json_keeps_its_keys(write, tmp_path):
    """Other programs read the files of a run: they are a contract."""
    for name in ("trajectory_tum.txt", "odometry_tum.txt", "ground_truth_tum.txt"):
        write(name, drive(), stamps())
    evaluate_run(tmp_path)
    content = json.loads((tmp_path / "metrics.json").read_text())
    assert list(content) == ["slam", "odometry", "nees", "protocol"]
    seven = ["rmse", "mean", "median", "std", "min", "max", "sse"]
    for metrics in (content["slam"], content["odometry"]):
        assert list(metrics) == [
            "frames", "path_length_m", "reference_path_length_m", "ate", "rpe", "drift", "paper_table_iii", "notes",
        ]  # fmt: skip
        assert list(metrics["ate"]) == ["aligned", "origin", "unaligned"]
        assert list(metrics["rpe"]) == ["frame", "frame_rotation"]
        for statistics in (*metrics["ate"].values(), *metrics["rpe"].values(), metrics["paper_table_iii"]):
            assert list(statistics) == seven
        assert list(metrics["drift"]) == [
            "translation_percent", "rotation_deg_per_100m", "lengths_m", "segments", "name", "body_rotation_removed",
            "reason",
        ]  # fmt: skip
        assert list(metrics["drift"]["body_rotation_removed"]) == [
            "translation_percent", "rotation_deg_per_100m", "rotation_deg",
        ]  # fmt: skip
    assert list(content["protocol"]) == [
        "ate", "rpe", "paper_table_iii", "drift", "drift.body_rotation_removed", "software", "association", "frame",
        "nees",
    ]  # fmt: skip


def test_ground_truth_in_camera_axes_is_noted(write, tmp_path):
    for name in ("trajectory_tum.txt", "odometry_tum.txt"):
        write(name, drive(), stamps())
    write("ground_truth_tum.txt", T_CAMERA0_LIDAR @ drive() @ se3.inverse(T_CAMERA0_LIDAR), stamps())
    assert any("probably not those of a LiDAR" in note for note in evaluate_run(tmp_path).slam.notes)


def test_a_run_without_a_trajectory_is_an_error(write, tmp_path):
    write("ground_truth_tum.txt", drive(), stamps())
    with pytest.raises(InputError, match=r"trajectory_tum\.txt: cannot be read"):
        evaluate_run(tmp_path)


def test_json_has_null_instead_of_nan(tmp_path):
    write_json(tmp_path / "x.json", {"a": [float("nan"), np.float64("inf")], "b": (1, 2.5)})
    assert json.loads((tmp_path / "x.json").read_text()) == {"a": [None, None], "b": [1, 2.5]}
    assert finite(np.float32(0.5)) == 0.5


def test_the_table_prints_each_figure_with_its_protocol(write):
    metrics = evaluate_files(write("a.txt", drive()), write("b.txt", drive()))
    text = format_metrics({"a rather long name [of a run]" * 3: metrics})
    for part in (
        "SE(3) Umeyama",
        "delta 1 frame",
        "short drive, 50 m",
        "Table III",
        "segments",
        "a start every 10",
        "evo 1",
    ):
        assert part in text
    assert "a rather long name [of a run]" * 3 in text
    assert "…" not in text
    assert "\x1b" not in text
    assert "0.000" in text


def test_a_reference_with_w_first_is_read_as_the_estimate_tells(tmp_path):
    """Too few poses for the motion alone to tell."""
    poses, times = drive(7), 0.1 * np.arange(7)
    (tmp_path / "estimate.txt").write_text(tum_text(times, poses))
    table = np.loadtxt(tmp_path / "estimate.txt")
    np.savetxt(tmp_path / "reference.txt", table[:, [0, 1, 2, 3, 7, 4, 5, 6]])
    metrics = evaluate_files(tmp_path / "estimate.txt", tmp_path / "reference.txt")
    assert metrics.rpe.frame.rmse == pytest.approx(0, abs=1e-6)
    assert any("judging by the estimate, its quaternions have w first" in note for note in metrics.notes)
