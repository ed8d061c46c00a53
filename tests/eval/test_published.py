"""KISS-ICP's published run of KITTI 00: the same figures as its log and as evo's own command line."""

import os
import re
import shutil
import subprocess
import sys
import time
from dataclasses import asdict
from pathlib import Path

import pytest

from eval.evaluation import evaluate_files

DATA = Path(os.environ.get("LIDARLIFT_TEST_DATA", Path(__file__).parents[3] / "shared" / "data")) / "trajectories"
ESTIMATE, REFERENCE = DATA / "kitti_00_kiss_icp.txt", DATA / "kitti_00_ground_truth.txt"

pytestmark = pytest.mark.skipif(not ESTIMATE.is_file(), reason=f"{ESTIMATE} is not there (LIDARLIFT_TEST_DATA)")


@pytest.fixture(scope="module")
def metrics():
    return evaluate_files(ESTIMATE, REFERENCE)


def evo_statistics(home, *arguments):
    """Return the output of evo's command, run with a temporary home (it writes its settings there)."""
    command = shutil.which(arguments[0], path=str(Path(sys.executable).parent)) or shutil.which(arguments[0])
    assert command, f"{arguments[0]} is not installed"
    environment = os.environ | {"HOME": str(home), "MPLCONFIGDIR": str(home), "MPLBACKEND": "Agg"}
    run = subprocess.run([command, *arguments[1:]], env=environment, capture_output=True, text=True, check=True)
    return {name: float(value) for name, value in re.findall(r"^\s*(\w+)\s+([\d.]+)$", run.stdout, re.MULTILINE)}


def test_figures_agree_with_published_ones(metrics):
    assert metrics.drift.translation_percent == pytest.approx(0.527, abs=5.1e-4)
    assert metrics.ate.aligned.rmse == pytest.approx(3.516, abs=1e-3)
    assert metrics.drift.name == "KITTI 100-800 m"
    assert metrics.reference_path_length_m == pytest.approx(3724.2, abs=0.1)
    assert metrics.frames == 4541


def test_ate_agrees_with_evos_command_line(metrics, tmp_path):
    printed = evo_statistics(tmp_path, "evo_ape", "kitti", REFERENCE, ESTIMATE, "-a")
    assert printed == pytest.approx(asdict(metrics.ate.aligned), abs=1e-5)


def test_rpe_agrees_with_evos_command_line(metrics, tmp_path):
    printed = evo_statistics(tmp_path, "evo_rpe", "kitti", REFERENCE, ESTIMATE, "-a", "-d", "1", "-u", "f")
    assert printed == pytest.approx(asdict(metrics.paper_table_iii), abs=1e-5)


def test_evaluation_takes_seconds_not_minutes():
    begin = time.process_time()
    evaluate_files(ESTIMATE, REFERENCE)
    assert time.process_time() - begin < 6  # 1 s on a quiet core
