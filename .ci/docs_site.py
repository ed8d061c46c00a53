"""Hooks of the documentation site: pages from outside docs/, links between them, the command line, equations.

Pages of docs/ and the README link to files by their places in the repository, so that they can be read there as well.
On the site, these links lead to the page that the file has become; a link to a file without a page, such as a module,
is left out and its text stays. A link to nothing stays as it is, so that the strict build fails.
"""

from __future__ import annotations

import os
import re
from html import unescape
from pathlib import Path
from typing import TYPE_CHECKING

import latex2mathml.converter
import typer.main
from typer.cli import get_docs_for_click

from lidarlift.cli.app import app

if TYPE_CHECKING:
    from mkdocs.config.defaults import MkDocsConfig
    from mkdocs.structure.files import Files
    from mkdocs.structure.pages import Page

REPOSITORY = Path(__file__).resolve().parents[1]
#: Files outside docs/ and their places on the site.
OUTSIDE = {
    "README.md": "index.md",
    "CONTRIBUTING.md": "contributing.md",
    "CHANGELOG.md": "changelog.md",
    "examples/README.md": "examples.md",
    "benchmarks/README.md": "results/index.md",
    "benchmarks/RUNNING.md": "results/running.md",
}
FOLDERS = {"benchmarks/results": "results", "enrichment/weights": "weights"}  # of all their pages and pictures
COMMANDS = "command-line.md"  # which says where the text comes from; the site has the text
LINK = re.compile(r"(?P<picture>!?)\[(?P<text>(?:[^\[\]]|\[[^\]]*\])*)\]\((?P<target>[^)\s#]+)(?P<anchor>#[^)\s]*)?\)")
EQUATION = re.compile(r'<(div|span) class="arithmatex">\\[\[(](.*?)\\[\])]</\1>', re.DOTALL)


def on_config(config: MkDocsConfig) -> None:
    """The results' pages enter the navigation."""
    pages = {site for site in _places().values() if re.fullmatch(r"results/.*\.md", site)} - {"results/index.md"}
    section = next(entry for entry in config.nav or [] if "Results" in entry)
    section["Results"] = ["results/index.md", *sorted(pages)]


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """The pages from outside docs/ become files of the site."""
    from mkdocs.structure.files import File

    for place, site in _places().items():
        if not place.startswith("docs/"):
            files.append(File.generated(config, site, abs_src_path=str(REPOSITORY / place)))
    return files


def on_page_markdown(markdown: str, *, page: Page, **_: object) -> str:
    """Links by places in the repository become links of the site; the command line's page gets its text."""
    if page.file.src_uri == COMMANDS:
        return _command_line()
    places = _places()
    place = next((place for place, site in places.items() if site == page.file.src_uri), None)
    if place is None:
        return markdown

    def link(found: re.Match[str]) -> str:
        target, folder = found["target"], Path(place).parent
        where = os.path.normpath(folder / target)
        if "://" in target or not (REPOSITORY / where).exists():
            return found[0]
        if where not in places:
            return found["text"]
        new = os.path.relpath(places[where], Path(page.file.src_uri).parent)
        return f"{found['picture']}[{found['text']}]({new}{found['anchor'] or ''})"

    return LINK.sub(link, markdown)


def on_page_content(html: str, **_: object) -> str:
    """Equations become MathML, which browsers show by themselves."""

    def equation(found: re.Match[str]) -> str:
        display = "block" if found[1] == "div" else "inline"
        return latex2mathml.converter.convert(unescape(found[2]), display=display)

    return EQUATION.sub(equation, html)


def _places() -> dict[str, str]:
    """Places in the repository -> places on the site, of pages and pictures."""
    inside = {f"docs/{file.name}": file.name for file in (REPOSITORY / "docs").iterdir() if file.is_file()}
    many = {
        f"{folder}/{file.name}": f"{site}/{file.name}"
        for folder, site in FOLDERS.items()
        for file in (REPOSITORY / folder).iterdir()
        if file.suffix in (".md", ".png")
    }
    return inside | OUTSIDE | many


def _command_line() -> str:
    """The help of all commands, as typer writes it."""
    command = typer.main.get_command(app)
    text = get_docs_for_click(obj=command, ctx=typer.Context(command, info_name="lidarlift"), name="lidarlift")
    return text.replace("# `lidarlift`", "# Command line", 1)
