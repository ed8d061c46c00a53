"""YAML of others, parsed without executing anything and without taking all memory. Imports nothing that takes time."""

from __future__ import annotations

from typing import Any

import yaml

#: Bytes of the longest YAML text that is read: parsing takes a thousand times that of memory.
LONGEST = 1 << 16


class _Loader(yaml.SafeLoader):
    """YAML's plain values. Aliases are refused: 400 bytes of them unfold into gigabytes, and nobody needs them here."""

    def compose_node(self, parent: Any, index: Any) -> Any:
        if self.check_event(yaml.AliasEvent):
            mark = self.peek_event().start_mark
            raise yaml.composer.ComposerError(None, None, "aliases such as *name are not read", mark)
        return super().compose_node(parent, index)


def parsed(text: str) -> Any:
    """What a YAML text holds. Raises ValueError, in one line, where it is none or hostile."""
    if len(text) > LONGEST:
        raise ValueError(f"{len(text)} characters; at most {LONGEST} are read")
    try:
        return yaml.load(text, _Loader)  # derived from SafeLoader
    except RecursionError:
        raise ValueError("nested too deeply") from None
    except (yaml.YAMLError, ValueError, OverflowError, TypeError) as error:  # some dates and numbers are none
        raise ValueError(" ".join(str(error).split())) from error
