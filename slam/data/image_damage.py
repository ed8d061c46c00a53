"""Damage inside image files that decoders pass over in silence."""

from __future__ import annotations

import zlib
from collections.abc import Iterator

import numpy as np

PNG, JPEG = b"\x89PNG\r\n\x1a\n", b"\xff\xd8\xff"
UNKNOWN = "neither PNG nor JPEG"
PNG_END, JPEG_END = b"IEND", b"\xff\xd9"
TAIL = 4096  # bytes at the end of a complete file, among which its end mark is
ZEROS = bytes(512)  # a lost sector of a disk or card
#: Number of codes by length in JPEG's standard table (ITU T.81, K.3.3.2). With these codes, no compressed data are
#: ZEROS; with codes fitted to an image, a plain area may be.
STANDARD_CODES = bytes([0, 2, 1, 3, 3, 2, 4, 3, 5, 5, 4, 4, 0, 0, 1, 0x7D])
START_OF_SCAN, END_OF_IMAGE, FILL, LOWEST_MARK = 0xDA, 0xD9, 0xFF, 0xC0
#: Second bytes of marks that stand within compressed data: a stuffed 0xff, restarts, fill bytes.
INSIDE = np.array([0x00, *range(0xD0, 0xD8), FILL])


def fault_of(head: bytes, tail: bytes) -> str | None:
    """Return what is wrong with a file by its first bytes and its last TAIL bytes, or None."""
    for begin, end in ((PNG, PNG_END), (JPEG, JPEG_END)):
        if head.startswith(begin):
            return None if end in tail else "cut short"
    return UNKNOWN if head else "nothing in it"


def fault_inside(content: bytes) -> str | None:
    """Return what is wrong inside a complete file, or None.

    PNG has checksums, so all damage is found. JPEG has none: sectors of zeros (with the standard codes, which cameras
    use) and most sectors of foreign data are found; single wrong bytes are not, since the file stays valid.
    """
    if content.startswith(PNG):
        return None if all(sound for sound in _png_chunks(content)) else "wrong checksum inside"
    return None if _sound_jpeg(content) else "damaged inside"


def _png_chunks(content: bytes) -> Iterator[bool]:
    """Whether each chunk up to the last has its checksum."""
    at, kind = len(PNG), b""
    while kind != PNG_END:
        size = int.from_bytes(content[at : at + 4], "big")
        kind, end = content[at + 4 : at + 8], at + 8 + size
        yield zlib.crc32(content[at + 4 : end]) == int.from_bytes(content[end : end + 4], "big") and end < len(content)
        at = end + 4


def _sound_jpeg(content: bytes) -> bool:
    """Whether the segments follow each other up to the end of the image, and compressed data have no other marks."""
    values = np.frombuffer(content, np.uint8)
    marks = np.flatnonzero((values[:-1] == 0xFF) & ~np.isin(values[1:], INSIDE))
    standard = STANDARD_CODES in content
    at = 2
    while content[at : at + 1] == b"\xff" and (kind := content[at + 1]) != END_OF_IMAGE:
        if kind == FILL:
            at += 1
            continue
        begin = at + 2 + int.from_bytes(content[at + 2 : at + 4], "big")
        if kind < LOWEST_MARK or begin >= len(content):
            return False
        at = begin
        if kind == START_OF_SCAN:
            after = np.searchsorted(marks, begin)
            at = int(marks[after]) if after < len(marks) else len(content)
            if standard and ZEROS in content[begin:at]:
                return False
    return content[at : at + 2] == JPEG_END
