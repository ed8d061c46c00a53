"""docs/datasets.md: a row for each data set that is known."""

from __future__ import annotations

import re
from pathlib import Path

from slam.data.dataset import DATASETS, FOLDER

OWN_PAGES = (FOLDER, "recording", "packets")
PAGE = Path(__file__).parents[2] / "docs" / "datasets.md"


def test_each_data_set_has_a_row_in_the_order_in_which_they_are_tried() -> None:
    rows = [line.split("|")[1] for line in PAGE.read_text(encoding="utf-8").splitlines() if line.startswith("| ")]
    bare = [re.sub(r"\(.*\)", "", row).strip().lower().replace(" ", "-") for row in rows[1:]]
    names = [name.replace("paris-luco", "parisluco") for name in DATASETS.own if name not in OWN_PAGES]
    assert bare == [*names, "any-folder"]
