"""Safe parsing of YAML: nothing is executed, and memory is bounded. Imports nothing that is slow to import."""

from __future__ import annotations

from typing import Any

import yaml

#: Maximum length of a YAML text in characters: parsing takes about a thousand times as many bytes of memory.
LONGEST = 1 << 16


class _Loader(yaml.SafeLoader):
    """YAML's plain values. Aliases are refused: 400 bytes of them expand to gigabytes, and no file here needs them."""

    def compose_node(self, parent: Any, index: Any) -> Any:
        if self.check_event(yaml.AliasEvent):
            mark = self.peek_event().start_mark
            raise yaml.composer.ComposerError(None, None, "aliases such as *name are not read", mark)
        return super().compose_node(parent, index)


def parsed(text: str) -> Any:
    """Parse a YAML text.

    Raises:
        ValueError: The text is not YAML, too long, nested too deeply or has aliases; the message is one line.
    """
    if len(text) > LONGEST:
        raise ValueError(f"{len(text)} characters; at most {LONGEST} are read")
    try:
        return yaml.load(text, _Loader)  # derived from SafeLoader
    except RecursionError:
        raise ValueError("nested too deeply") from None
    except (yaml.YAMLError, ValueError, OverflowError, TypeError) as error:  # also of invalid dates and numbers
        raise ValueError(" ".join(str(error).split())) from error
