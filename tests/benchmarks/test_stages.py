"""Shares of the parts of a run, from the stacks of a sampling profiler."""

from __future__ import annotations

import pytest

from benchmarks.whole.stages import shares

SCRIPT = "<module> (lidarlift:8);main (lidarlift/cli/app.py:80)"  # of an installed command
MODULE = "_run_code (<frozen runpy>:88);<module> (lidarlift/__main__.py:5);main (lidarlift/cli/app.py:80)"


@pytest.mark.parametrize("command", [SCRIPT, MODULE])
def test_a_sample_counts_for_the_innermost_part(command: str) -> None:
    stacks = f"""\
{command};centre (slam/data/world_frame.py:20) 1
{command};<module> (slam/slam.py:3) 2
{command};register (slam/odometry.py:9);insert (slam/registration/voxels.py:120) 4
_bootstrap (threading.py:900);_worker (concurrent/futures/thread.py:80) 50
"""
    assert shares(stacks) == pytest.approx({"odometry": 4 / 7, "imports": 2 / 7, "other": 1 / 7})
