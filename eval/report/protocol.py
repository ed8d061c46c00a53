"""The last sections of a report: the protocol of each run, the definitions of the figures, and how to repeat it."""

from __future__ import annotations

import json
import shlex
from collections.abc import Mapping
from html import escape
from typing import Any

from eval.report.content import Report
from eval.runs import RunDetails

#: Entries of run.json's protocol that have a place of their own.
APART = ("config", "versions")


def protocol(report: Report) -> str:
    """Return the definitions, and for each run its protocol, notes, problems and settings, as HTML."""
    measured = next((row.metrics for row in report.rows if row.metrics), None)
    parts = []
    if measured:
        parts.append(_details("Definition of each figure", _list(measured.protocol), opened=True))
    for row, run in report.runs:
        parts.append(_details(f"Run {row.label}", _run(run)))
    others = [row.label for row in report.rows if row.run is None]
    if others:
        parts.append(f"<p>Trajectories of other systems, as read: {escape(', '.join(others))}.</p>")
    return "".join(parts)


def repeat(report: Report) -> str:
    """Return the commands that make the runs and the report again, and the versions of the packages, as HTML."""
    commands = [report.command] if report.command else [_command(run) for _, run in report.runs]
    text = "\n".join(command for command in commands if command)
    how = f'<pre tabindex="0" role="region" aria-label="Command">{escape(text)}</pre>' if text else ""
    if not report.command:
        how += "<p>Made by a program: settings that differ from the defaults are in the protocol.</p>"
    versions: dict[str, Any] = {}
    for _, run in report.runs:
        versions |= run.report["protocol"].get("versions", {})
    listed = ", ".join(f"{name} {version}" for name, version in versions.items())
    return (
        f"{how}<p>The same command with the same versions on the same machine gives the same trajectories and maps, "
        f"bit for bit; times differ.{f' Versions: {escape(listed)}.' if listed else ''}</p>"
        "<p>Every figure of this page is also in <code>figures/</code> next to it, as PNG and SVG, and the tables as "
        "Markdown and LaTeX (<code>tables.md</code>, <code>tables.tex</code>).</p>"
    )


def _run(run: RunDetails) -> str:
    report = run.report
    entries = {name: value for name, value in report["protocol"].items() if name not in APART and value is not None}
    parts = [_list({**entries, "counts": report["counts"], "run folder": run.folder.name})]
    for title, name in (("Notes", "notes"), ("Problems of the data", "problems")):
        if report.get(name):
            items = "".join(f"<li>{escape(str(text))}</li>" for text in report[name])
            parts.append(f"<h4>{title}</h4><ul>{items}</ul>")
    settings = json.dumps(report["protocol"].get("config", {}), indent=2)
    return "".join(
        [*parts, f'<h4>Settings</h4><pre tabindex="0" role="region" aria-label="Settings">{escape(settings)}</pre>']
    )


def _command(run: RunDetails) -> str:
    """The command of one run; settings that differ from the defaults are those in the protocol."""
    about = run.report["protocol"]
    if not about.get("path"):
        return ""
    start, stop, step = about["frames"]
    frames = f"{start}:{stop}" + (f":{step}" if step != 1 else "")
    words = ["lidarlift", "run", str(about["path"]), "--input", about["input"], "--frames", frames]
    if about["input"] == "enriched":
        words += ["--enricher", str(about["config"]["front_end"]["enricher"])]
    return shlex.join([*words, "--out", str(run.folder)])


def _list(entries: Mapping[str, Any]) -> str:
    terms = (
        f"<dt>{escape(str(name)).replace('_', ' ')}</dt><dd>{escape(_words(value))}</dd>"
        for name, value in entries.items()
    )
    return f"<dl>{''.join(terms)}</dl>"


def _words(value: Any) -> str:
    if isinstance(value, Mapping):
        return ", ".join(f"{name} {_words(each)}" for name, each in value.items()) or "none"
    if isinstance(value, list | tuple):
        return ", ".join(map(_words, value))
    if isinstance(value, bool):
        return "yes" if value else "no"
    return str(value)


def _details(title: str, content: str, opened: bool = False) -> str:
    return f"<details{' open' if opened else ''}><summary>{escape(title)}</summary><div>{content}</div></details>"
