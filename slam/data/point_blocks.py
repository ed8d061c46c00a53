"""Common parts of the point file readers: columns in blocks, so that reading takes little memory beyond the points."""

from __future__ import annotations

import codecs
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import islice
from typing import BinaryIO

import numpy as np

from slam.data.cloud import Array

#: A block of n points: the wanted columns (n,) by their names in lower case.
Block = Mapping[str, Array]
#: Bytes of a file, and lines of text, per block.
BLOCK, LINES = 1 << 18, 1 << 11
#: Points per block of a table that is in memory as a whole.
AT_ONCE = 1 << 14
#: Maximum bytes of a header, and of a line of text.
LONGEST = 1 << 18
#: Maximum number of damaged lines of text; with more, the file is unreadable.
DAMAGED_LINES = 1000


class UnreadableError(Exception):
    """A file is damaged or not of the format of its suffix; the message is the fault, without the file's name."""


@dataclass
class Content:
    """A point file whose header has been read.

    Attributes:
        names: Names of all columns, in lower case.
        count: Upper bound of the number of points: never more than the size of the file allows.
        blocks: The points, read while iterating.
        organised: True for an image of points, which has an entry for pixels without a return, too.
        faults: Kind and message of each fault; complete after the last block.
    """

    names: Sequence[str]
    count: int
    blocks: Iterator[Block]
    organised: bool = False
    faults: list[tuple[str, str]] = field(default_factory=list)

    def cut_short(self, whole: int, promised: int) -> None:
        """Note that the file is truncated after `whole` of the `promised` points."""
        text = f"truncated; the first {whole} of {promised} points are used"
        self.faults.append(("truncated scan", text))

    def left_out(self, names: Sequence[str]) -> None:
        """Note wanted columns that do not have one number per point."""
        if names:
            self.faults.append(("unusable field", f"{', '.join(names)}: not one number per point; left out"))


@dataclass(frozen=True)
class Columns:
    """Layout of a point in a file, in bytes or in words of a line.

    Attributes:
        places: Offset, in bytes or words, and type of each wanted column.
        stride: Length of a point, in the same unit.
    """

    places: Mapping[str, tuple[int, np.dtype]]
    stride: int

    def binary(self, file: BinaryIO, count: int) -> Iterator[Block]:
        """Read `count` consecutive binary points from the current position of `file`.

        Raises:
            UnreadableError: A point is larger than 2 GiB.
        """
        if not count:
            return
        if self.stride > np.iinfo(np.int32).max:
            raise UnreadableError(f"the header states {self.stride} bytes per point")
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
        """Read `count` points from as many lines; damaged lines are left out and noted in `content`.

        Raises:
            UnreadableError: More than `DAMAGED_LINES` lines are damaged, or a line is too long.
        """
        read, damaged = 0, 0
        while read < count:
            lines = list(islice(lines_of(file), min(LINES, count - read)))
            if not lines:
                break
            if not lines[-1].endswith(b"\n") and (read + len(lines) < count or not self._whole(lines[-1])):
                lines.pop()  # truncated, perhaps within a number
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
        """Parse lines, bisecting those with damaged lines among them: the blocks, and the number of damaged lines.

        Raises:
            UnreadableError: More than `bearable` lines are damaged.
        """
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
                    raise UnreadableError("the lines are not numbers") from None
        return parts, bad

    def _table(self, lines: list[bytes]) -> Block:
        """Parse lines; raises ValueError if a line does not have the numbers of a point."""
        # Integers of 8 bytes are read in their type, since float64 keeps only 53 bits; all others are read as float64,
        # since they may be written as 3.0 or nan.
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
    """Some words of every line as numbers; raises ValueError if a line is too short or a word is not a number."""
    kind = np.dtype([(f"{at}", each) for at, each in enumerate(kinds)])
    table = np.loadtxt(lines, kind, comments=None, usecols=words, ndmin=1, encoding=None)
    return [table[name] for name in table.dtype.names or ()]


_F8 = np.dtype(np.float64)


def _as_promised(values: Array, kind: np.dtype) -> Array:
    """Numbers in the type that the header states, if the type can represent them."""
    with np.errstate(over="ignore", invalid="ignore"):
        if kind.kind != "f" and values.dtype.kind == "f":
            limits = np.iinfo(kind)
            whole = (values >= limits.min) & (values < float(limits.max) + 1) & (values % 1 == 0)
            return values.astype(kind) if whole.all() else values
        return values.astype(kind)


def lines_of(file: BinaryIO) -> Iterator[bytes]:
    """Yield the lines that are not blank.

    Raises:
        UnreadableError: A line is longer than `LONGEST`.
    """
    while line := file.readline(LONGEST):
        if len(line) == LONGEST:
            raise UnreadableError(f"a line of more than {LONGEST} characters")
        if not line.isspace():
            yield line


def header_lines(file: BinaryIO) -> Iterator[str]:
    """Yield the lines of a text header, stripped.

    Raises:
        UnreadableError: The header is longer than `LONGEST` or does not end.
    """
    read = 0
    while line := file.readline(LONGEST - read):
        read += len(line)
        if read >= LONGEST or b"\0" in line:
            break
        yield line.removeprefix(codecs.BOM_UTF8).decode("latin-1").strip()
    raise UnreadableError("the header has no end")


def whole_number(word: str, what: str) -> int:
    """Parse a count in a header, 0 or more.

    Raises:
        UnreadableError: The word is not a count.
    """
    if not (word.isascii() and word.isdigit() and len(word) < 19):
        raise UnreadableError(f"the header has an invalid count, {what} {word[:20]}")
    return int(word)
