"""A run as a process of its own: its processor time, wall time, peak memory, and the stages of its run.json."""

from __future__ import annotations

import json
import os
import subprocess
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from slam.data.errors import InputError

#: Options of `lidarlift run` by the name of the row.
INPUTS = {
    "64": ("--input", "64"),
    "16": ("--input", "16"),
    "ray-segment": ("--input", "enriched", "--enricher", "ray-segment"),
    "lift": ("--input", "enriched", "--enricher", "lift"),
}


def run_of(program: Path, sequence: Path, input: str, frames: str = ":", prefix: Sequence[str] = ()) -> dict[str, Any]:
    """Run `lidarlift run` over a sequence with one of INPUTS, everything included: imports, SLAM, metrics, report.

    Args:
        program: The command lidarlift of an environment.
        sequence: The folder of the sequence.
        input: The name of the input.
        frames: A:B, as in Python's slices.
        prefix: Words before the command, as of a profiler.

    Returns:
        processor_s, wall_s and memory_mb of the process, frames, and stages, the median milliseconds by stage.

    Raises:
        InputError: The run failed.
    """
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "run"
        words = ("run", str(sequence.absolute()), *INPUTS[input], "--frames", frames, "--out", str(out))
        command = [*prefix, str(program.absolute()), *words]
        found = usage_of(command)
        report = json.loads((out / "run.json").read_text(encoding="utf-8"))
    stages = {stage: times["median"] for stage, times in report["timings_ms"].items()}
    return found | {"frames": report["counts"]["frames"], "stages": stages}


def usage_of(command: Sequence[str]) -> dict[str, float]:
    """Run a command, and return its processor_s, wall_s and memory_mb, those of the processes it waited for included.

    Raises:
        InputError: It failed.
    """
    with tempfile.TemporaryFile() as said:
        begin = time.perf_counter()
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=said)
        _, status, usage = os.wait4(process.pid, 0)
        wall = time.perf_counter() - begin
        process.returncode = os.waitstatus_to_exitcode(status)
        if process.returncode:
            said.seek(0)
            last = said.read().decode(errors="replace").strip().splitlines()[-1:]
            raise InputError(f"{' '.join(command)}: failed: {' '.join(last)}")
    return {"processor_s": usage.ru_utime + usage.ru_stime, "wall_s": wall, "memory_mb": usage.ru_maxrss / 1024}


def alternated(makers: Mapping[str, Callable[[], dict[str, Any]]], repeats: int) -> dict[str, dict[str, Any]]:
    """Measure in turn, in the opposite order each other time; keep the one of each name with the least processor time.

    What else runs on a machine only adds to the processor time, by caches and by the clock rate.
    """
    best: dict[str, dict[str, Any]] = {}
    names = list(makers)
    for repeat in range(repeats):
        for name in names[:: 1 if repeat % 2 == 0 else -1]:
            found = makers[name]()
            if name not in best or found["processor_s"] < best[name]["processor_s"]:
                best[name] = found
    return {name: best[name] for name in names}
