"""For griffe, which reads the docstrings for the site: `Example:` before `>>>` is a section, as `Examples:` is."""

from __future__ import annotations

import re

import griffe

EXAMPLE = re.compile(r"^Example:(?=\n +>>>)", re.MULTILINE)


class Examples(griffe.Extension):
    def on_object(self, *, obj: griffe.Object, **_: object) -> None:
        if obj.docstring:
            obj.docstring.value = EXAMPLE.sub("Examples:", obj.docstring.value)
