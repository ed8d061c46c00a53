"""What the readers of point files share: columns in blocks, so that no file takes much more memory than its points."""

from __future__ import annotations

import codecs
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import islice
from typing import BinaryIO

import numpy as np

from slam.data.cloud import Array

#: Some points: the columns (n,) that were asked for, by their names in lower case.
Block = Mapping[str, Array]
#: Bytes of a file that are looked at at once, and lines of text.
BLOCK, LINES = 1 << 18, 1 << 11
#: Points of what is in memory as a whole that are looked at at once.
AT_ONCE = 1 << 14
#: A header of more bytes is none, nor is a longer line of text.
LONGEST = 1 << 18
#: Lines of text that may be damaged before a file is given up.
DAMAGED_LINES = 1000


class UnreadableError(Exception):
    """A file is not what its name says. Holds the reason, to be read after the file's name."""


@dataclass
class Content:
    """A file with points whose header has been read.

    Attributes:
        names: The names of all columns, in lower case.
        count: The points that there are at most: never more than the file has room for.
        blocks: The points, read while one goes through them.
        organised: True for an image of points, in which those without return have a place too.
        faults: Kind and message of what is wrong; complete when all blocks have been read.
    """

    names: Sequence[str]
    count: int
    blocks: Iterator[Block]
    organised: bool = False
    faults: list[tuple[str, str]] = field(default_factory=list)

    def cut_short(self, whole: int, promised: int) -> None:
        """Note that the file ends early, after `whole` of its points."""
        text = f"cut short; its first {whole} points of {promised} are used"
        self.faults.append(("truncated scan", text))

    def left_out(self, names: Sequence[str]) -> None:
        """Note the columns that were asked for and are not one number a point."""
        if names:
            self.faults.append(("unusable field", f"{', '.join(names)}: not one number a point; left out"))


@dataclass(frozen=True)
class Columns:
    """A point as it lies in a file: bytes, or words in a line.

    Attributes:
        places: Where each column that was asked for begins, and its type: by bytes, or by words in a line of text.
        stride: The length of a point, in the same unit.
    """

    places: Mapping[str, tuple[int, np.dtype]]
    stride: int

    def binary(self, file: BinaryIO, count: int) -> Iterator[Block]:
        """`count` points that lie in `file` one after another, from where it stands."""
        if not count:
            return
        if self.stride > np.iinfo(np.int32).max:
            raise UnreadableError(f"its points have {self.stride} bytes each")
        names = list(self.places)
        point = np.dtype(
            {
                "names": names,
                "offsets": [self.places[name][0] for name in names],
                "formats": [self.places[name][1] for name in names],
                "itemsize": self.stride,
            }
        )
        at_once = max(1, min(BLOCK // self.stride, count))
        buffer = bytearray(at_once * self.stride)
        while count > 0:
            wanted = min(at_once, count)
            got = file.readinto(memoryview(buffer)[: wanted * self.stride]) // self.stride  # type: ignore[attr-defined]
            table = np.frombuffer(buffer, point, got)
            yield {name: table[name] for name in names}
            count = count - got if got == wanted else 0

    def text(self, file: BinaryIO, count: int, content: Content) -> Iterator[Block]:
        """`count` points from as many lines; lines that hold something else are left out, and noted."""
        read, damaged = 0, 0
        while read < count:
            lines = list(islice(lines_of(file), min(LINES, count - read)))
            if not lines:
                break
            if not lines[-1].endswith(b"\n") and (read + len(lines) < count or not self._whole(lines[-1])):
                lines.pop()  # cut short, maybe in the middle of a number
            parts, bad = self._parsed(lines, DAMAGED_LINES - damaged)
            if parts:
                yield {name: np.concatenate([part[name] for part in parts]) for name in self.places}
            read, damaged = read + len(lines), damaged + bad
        if read < count:
            content.cut_short(read - damaged, count)
        if damaged:
            content.faults.append(("damaged lines", f"{damaged} of {read} lines are not numbers; left out"))

    def _whole(self, line: bytes) -> bool:
        try:
            self._table([line])
        except ValueError:
            return False
        return True

    def _parsed(self, lines: list[bytes], bearable: int) -> tuple[list[Block], int]:
        """The lines that are numbers, found by halving what has others among them; and how many of these there are, at
        most as many as are `bearable`."""
        waiting, parts, bad = [lines] if lines else [], list[Block](), 0
        while waiting:
            some = waiting.pop()
            try:
                parts.append(self._table(some))
            except ValueError:
                if len(some) > 1:
                    waiting += [some[len(some) // 2 :], some[: len(some) // 2]]
                    continue
                bad += 1
                if bad > bearable:
                    raise UnreadableError("its lines are not numbers") from None
        return parts, bad

    def _table(self, lines: list[bytes]) -> Block:
        """Raises ValueError where a line does not have the numbers of a point."""
        # Whole numbers of 8 bytes are read as they are, since float64 holds 53 bits of them; all others as float64, for
        # they may be written as 3.0 or nan.
        kinds = [kind if kind.kind in "iu" and kind.itemsize == 8 else _F8 for _, kind in self.places.values()]
        try:
            columns = _words(lines, [*self._words, self.stride - 1], [*kinds, _F8])
        except ValueError:
            columns = _words(lines, [*self._words, self.stride - 1], [_F8] * (len(kinds) + 1))
        return {
            name: _as_promised(values, kind)
            for (name, (_, kind)), values in zip(self.places.items(), columns, strict=False)
        }

    @property
    def _words(self) -> list[int]:
        return [place for place, _ in self.places.values()]


def _words(lines: list[bytes], words: list[int], kinds: list[np.dtype]) -> list[Array]:
    """Some words of every line as numbers. Raises ValueError where a line is too short, or has something else there."""
    kind = np.dtype([(f"{at}", each) for at, each in enumerate(kinds)])
    table = np.loadtxt(lines, kind, comments=None, usecols=words, ndmin=1, encoding=None)
    return [table[name] for name in table.dtype.names or ()]


_F8 = np.dtype(np.float64)


def _as_promised(values: Array, kind: np.dtype) -> Array:
    """Numbers in the type that the header names, where that holds them."""
    with np.errstate(over="ignore", invalid="ignore"):
        if kind.kind != "f" and values.dtype.kind == "f":
            limits = np.iinfo(kind)
            whole = (values >= limits.min) & (values < float(limits.max) + 1) & (values % 1 == 0)
            return values.astype(kind) if whole.all() else values
        return values.astype(kind)


def lines_of(file: BinaryIO) -> Iterator[bytes]:
    """The lines that are not blank."""
    while line := file.readline(LONGEST):
        if len(line) == LONGEST:
            raise UnreadableError(f"a line of more than {LONGEST} characters")
        if not line.isspace():
            yield line


def header_lines(file: BinaryIO) -> Iterator[str]:
    """The lines of a text header, stripped; UnreadableError where there is no end to them."""
    read = 0
    while line := file.readline(LONGEST - read):
        read += len(line)
        if read >= LONGEST or b"\0" in line:
            break
        yield line.removeprefix(codecs.BOM_UTF8).decode("latin-1").strip()
    raise UnreadableError("its header has no end")


def whole_number(word: str, what: str) -> int:
    """A count in a header, 0 or more."""
    if not (word.isascii() and word.isdigit() and len(word) < 19):
        raise UnreadableError(f"its header says {what} {word[:20]}")
    return int(word)
