"""A disk that is full at a random byte: the run ends with an error in one line, and is resumed when there is space."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.faults.process import counted, digests, run

SMALLEST = 2000  # bytes


def campaign(drive: Path, folder: Path, runs: int, seed: int = 0) -> dict[str, Any]:
    """Run with a limit on the size of each file, between 2 kB and that of the largest one, evenly by its logarithm.

    Args:
        drive: The data set.
        folder: A folder with an undisturbed run in `whole`.
        runs: Number of runs.
        seed: Seed of the limits.
    """
    rng = np.random.default_rng(seed)
    largest = max(path.stat().st_size for path in (folder / "whole").rglob("*") if path.is_file())
    expected, out = digests(folder / "whole"), folder / "full"
    endings, faults = [], []
    for limit in np.exp(rng.uniform(np.log(SMALLEST), np.log(largest), runs)).astype(int).tolist():
        ending = run(drive, out, file_size=limit)
        endings.append(ending.how)
        if ending.how not in ("done", "error in one line") or "\n" in ending.message:
            faults.append(f"{limit} bytes: {ending.how}: {ending.message}")
        ending = run(drive, out, resume=True)
        if ending.how != "done" or digests(out) != expected:
            faults.append(f"resumed after {limit} bytes: {ending.how}: {ending.message}")
        shutil.rmtree(out)
    return {"runs": runs, "endings": counted(endings), "faults": faults}
