"""README.md: its Python runs as it stands there."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import pytest

from slam.data.cloud import Array

README = Path(__file__).parents[2] / "README.md"


def test_the_examples(
    street_drive: Callable[..., Path],
    street_scans: list[Array],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    examples = re.findall(r"^```python\n(.*?)^```$", README.read_text(), re.MULTILINE | re.DOTALL)
    assert len(examples) == 2
    code = "".join(examples).replace("my_drive", str(street_drive())).replace("vlp16", "hdl64")
    exec(code, {"scans": [(0.1 * number, scan) for number, scan in enumerate(street_scans)]})
    printed = capsys.readouterr().out.splitlines()
    assert printed[0].startswith("(8, 4, 4) ")
    assert float(printed[1]) < 0.1
    assert len(printed) == 2 + len(street_scans)
    assert (tmp_path / "runs/mine/map.pcd").is_file()
    assert (tmp_path / "runs/live/run.json").is_file()
