"""The page in a browser: it draws, turns, sorts, and everybody can read it.

Needs playwright and a Chromium: the one that CHROMIUM names, else Debian's. Screenshots: build/report.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

playwright = pytest.importorskip("playwright.sync_api", reason="the browser tests need playwright: pip install .[dev]")
CHROMIUM = os.environ.get("CHROMIUM") or shutil.which("chromium") or shutil.which("chromium-browser")
pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="no Chromium: apt-get install chromium, or set CHROMIUM")

SHOTS = Path(__file__).resolve().parents[3] / "build" / "report"
FLAGS = ["--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--no-sandbox"]  # WebGL without a graphics card
DESK, PHONE = {"width": 1280, "height": 900}, {"width": 375, "height": 780}
DRAWN = "one => new Promise(done => { const ask = () => one.dataset.drawn ? done() : setTimeout(ask, 30); ask(); })"
SERIOUS = {"serious", "critical"}

Opened = Callable[..., Any]


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with playwright.sync_playwright() as started:
        chromium = started.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        yield chromium
        chromium.close()


@pytest.fixture(scope="module")
def opened(browser: Any, written: Path) -> Iterator[Opened]:
    """`opened("dark", PHONE)`: the page with all its figures drawn; what the console says is in page.said."""
    pages: dict[str, Any] = {}

    def open_page(scheme: str = "light", size: dict[str, int] = DESK) -> Any:
        name = f"{scheme}-{size['width']}"
        if name not in pages:
            phone = {"has_touch": True, "is_mobile": True} if size is PHONE else {}
            page = browser.new_context(viewport=size, color_scheme=scheme, offline=True, **phone).new_page()
            page.said = []
            page.on("console", lambda message: page.said.append((message.type, message.text)))
            page.on("pageerror", lambda error: page.said.append(("error", str(error))))
            page.goto((written / "report.html").as_uri())
            for drawing in page.query_selector_all(".chart, .space"):
                drawing.scroll_into_view_if_needed()
                drawing.evaluate(DRAWN)
            SHOTS.mkdir(parents=True, exist_ok=True)
            page.screenshot(path=SHOTS / f"{name}.png", full_page=True)
            pages[name] = page
        return pages[name]

    yield open_page
    for page in pages.values():
        page.context.close()


@pytest.mark.parametrize(("scheme", "size"), [("light", DESK), ("dark", DESK), ("light", PHONE)])
def test_all_figures_are_drawn_without_errors(opened: Opened, scheme: str, size: dict[str, int]) -> None:
    page = opened(scheme, size)
    assert not [text for kind, text in page.said if kind == "error"]
    lines = page.eval_on_selector_all(".chart", "all => all.map(one => one.querySelectorAll('svg path').length)")
    assert len(lines) == 6
    assert min(lines) > 5
    natural = page.eval_on_selector_all("figure img", "all => all.map(one => one.naturalWidth)")
    assert len(natural) == 3
    assert min(natural) > 300


@pytest.mark.parametrize("size", [DESK, PHONE])
def test_nothing_is_wider_than_the_window(opened: Opened, size: dict[str, int]) -> None:
    assert opened("light", size).evaluate("document.documentElement.scrollWidth") <= size["width"]


def test_the_theme_is_the_readers(opened: Opened) -> None:
    ground = "getComputedStyle(document.body).backgroundColor"
    text = "getComputedStyle(document.querySelector('.xtick text')).fill"
    for colour in (ground, text):
        assert opened("light").evaluate(colour) != opened("dark").evaluate(colour)


def test_the_map_turns_by_drag_and_by_button(opened: Opened) -> None:
    page = opened()
    space = page.query_selector("#space")
    space.scroll_into_view_if_needed()
    before = space.screenshot()
    box = space.bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + 150, y + 40, steps=4)
    page.mouse.up()
    page.wait_for_timeout(400)
    dragged = space.screenshot()
    assert dragged != before
    page.click("button[data-look=left]")
    page.wait_for_timeout(400)
    assert space.screenshot() != dragged


def test_the_map_shows_each_input_in_each_colour(opened: Opened) -> None:
    page = opened()
    space, seen = page.query_selector("#space"), set()
    for label in ("16", "64"):
        page.check(f"input[name=map][value='{label}']")
        for colour in ("height", "intensity", "camera"):
            page.check(f"input[name=colour][value={colour}]")
            page.wait_for_timeout(300)
            seen.add(space.screenshot())
    assert len(seen) == 6


def test_a_table_is_sorted_by_a_column(opened: Opened) -> None:
    page = opened()

    def column() -> list[str]:
        found = "all => all.map(row => row.cells[4].textContent)"
        return list(page.eval_on_selector_all("#table-accuracy tbody tr", found))

    button = page.query_selector("#table-accuracy thead th:nth-child(5) button")
    button.focus()
    page.keyboard.press("Enter")  # by the keyboard alone
    assert column() == sorted(column(), key=float)
    assert page.get_attribute("#table-accuracy thead th:nth-child(5)", "aria-sort") == "ascending"
    button.click()
    assert column() == sorted(column(), key=float, reverse=True)


def test_unknown_figures_stand_last(opened: Opened) -> None:
    page = opened()
    button = page.query_selector("#table-ledger thead th:nth-child(6) button")
    for _ in range(2):
        button.click()
        cells = page.eval_on_selector_all("#table-ledger tbody tr", "all => all.map(row => row.cells[5].textContent)")
        assert cells == ["0.120"] * 3 + ["-"] * 3


@pytest.mark.parametrize(("scheme", "size"), [("light", DESK), ("dark", DESK), ("light", PHONE)])
def test_axe_finds_nothing_serious(opened: Opened, scheme: str, size: dict[str, int]) -> None:
    axe = pytest.importorskip("axe_core_python.sync_playwright", reason="needs axe-core-python: pip install .[dev]")
    found = axe.Axe().run(opened(scheme, size))["violations"]
    serious = [(one["id"], [node["html"][:120] for node in one["nodes"]]) for one in found if one["impact"] in SERIOUS]
    assert not serious
