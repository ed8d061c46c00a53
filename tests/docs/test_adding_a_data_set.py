"""docs/adding-a-data-set.md: the package works as it stands there, and so do the commands."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from slam.data.cloud import Array


def test_the_package_and_the_commands_of_the_page(
    page: Callable[[str], Any], lidarlift: Callable[..., Any], street_scans: list[Array], tmp_path: Path
) -> None:
    sequences = tmp_path / "sequences"
    sequences.mkdir()
    scans = {f"points_{number}": scan for number, scan in enumerate(street_scans[:3])}
    np.savez(sequences / "street.npz", stamps=0.1 * np.arange(3), **scans)  # type: ignore[arg-type]
    np.savez(sequences / "other.npz", stamps=np.zeros(1), points_0=street_scans[0])
    places = {"my_sequences/street.npz": sequences / "street.npz", "my_sequences": sequences}
    assert page("adding-a-data-set.md").run(lidarlift, places) == 2
    for name, channels in (("street", "full"), ("enriched", "enriched")):
        report = json.loads((tmp_path / "runs" / name / "run.json").read_text())
        assert report["protocol"]["dataset"] == "street"
        assert report["protocol"]["input"] == channels
        assert report["counts"]["registered"] == 3
