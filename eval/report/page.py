"""The page: one HTML file with its data, styles and scripts, which needs no network."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from importlib.resources import files
from typing import Any

from eval.evaluation import finite
from eval.report.chart import Chart
from eval.report.plotly_chart import plotly_chart
from eval.report.table import Table, html


@dataclass(frozen=True, eq=False)
class Image:
    """A picture as the page embeds it.

    Attributes:
        key: Its anchor.
        title: Title.
        caption: What is drawn.
        alt: Description.
        data: 'data:image/...;base64,...'.
        size: Width and height [pixels].
    """

    key: str
    title: str
    caption: str
    alt: str
    data: str
    size: tuple[int, int]


@dataclass(frozen=True, eq=False)
class Section:
    """A section of the page.

    Attributes:
        key: Its anchor.
        title: Its heading.
        parts: Tables, charts, images and ready HTML, in order.
    """

    key: str
    title: str
    parts: Sequence[Table | Chart | Image | str] = field(default=())


def page(title: str, sentences: Sequence[str], sections: Sequence[Section], view: Mapping[str, Any] | None) -> str:
    """Return the page.

    Args:
        title: The title.
        sentences: The verdict; the first sentence is set apart.
        sections: The sections; those without parts are left out.
        view: Content of the 3-D view, None without maps.
    """
    from plotly.offline import get_plotlyjs

    shown = [section for section in sections if section.parts]
    charts = {part.key: plotly_chart(part) for section in shown for part in section.parts if isinstance(part, Chart)}
    links = "".join(f'<li><a href="#{section.key}">{escape(section.title)}</a></li>' for section in shown)
    first, *others = sentences
    more = "".join(f"<li>{escape(sentence)}</li>" for sentence in others)
    return f"""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="light dark">
<link rel="icon" href="data:,">
<title>{escape(title)} · lidarlift</title>
<style>{_asset("page.css")}</style>
</head>
<body>
<a class="skip" href="#verdict">Skip to the verdict</a>
<header><p class="brand">lidarlift report</p><h1>{escape(title)}</h1></header>
<nav aria-label="Sections"><ul>{links}</ul></nav>
<main>
<section id="verdict" aria-labelledby="verdict-heading">
<h2 id="verdict-heading" class="quiet">Verdict</h2>
<p class="verdict">{escape(first)}</p>
{f'<ul class="also">{more}</ul>' if more else ""}
</section>
{"".join(map(_section, shown))}
</main>
<script type="application/json" id="charts">{_json(charts)}</script>
<script type="text/plain" id="plotly">{get_plotlyjs()}</script>
<script>{_asset("page.js")}</script>
<script type="application/json" id="view">{_json(view)}</script>
</body>
</html>
"""


def _section(section: Section) -> str:
    parts = "\n".join(map(_part, section.parts))
    return (
        f'<section id="{section.key}" aria-labelledby="{section.key}-heading">'
        f'<h2 id="{section.key}-heading">{escape(section.title)}</h2>\n{parts}\n</section>\n'
    )


def _part(part: Table | Chart | Image | str) -> str:
    if isinstance(part, str):
        return part
    if isinstance(part, Table):
        return html(part)
    if isinstance(part, Image):
        width, height = part.size
        drawing = (
            f'<img src="{part.data}" width="{width}" height="{height}" alt="{escape(part.alt, quote=True)}" '
            'decoding="async">'
        )
        drawing = (
            f'<div class="wide" tabindex="0" role="group" aria-label="{escape(part.title, quote=True)}">{drawing}</div>'
        )
    else:
        drawing = (
            f'<div class="chart" data-chart="{part.key}" role="img" aria-label="{escape(part.alt, quote=True)}"></div>'
        )
    return (
        f'<figure id="{part.key}"><h3>{escape(part.title)}</h3>{drawing}'
        f"<figcaption>{escape(part.caption)}</figcaption></figure>"
    )


def _asset(name: str) -> str:
    return files("eval.report").joinpath(name).read_text(encoding="utf-8")


def _json(content: Any) -> str:
    """JSON that cannot end the script element it stands in."""
    text = json.dumps(finite(content), allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c")
