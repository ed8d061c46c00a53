"""Drives and their frames on the command line."""

from __future__ import annotations

import argparse
from pathlib import Path


def add_drives(parser: argparse.ArgumentParser) -> None:
    """SEQUENCE [SEQUENCE ...] and --frames A:B."""
    parser.add_argument("datasets", nargs="+", type=_folder, metavar="SEQUENCE", help="folder of a drive")
    add_frames(parser, ":")


def add_frames(parser: argparse.ArgumentParser, default: str | None) -> None:
    """--frames A:B."""
    help_text = "only these, as in Python's slices"
    parser.add_argument("--frames", type=_frames, default=default, metavar="A:B", help=help_text)


def as_slice(text: str) -> slice:
    """A:B as a slice."""
    return slice(*(int(part) if part else None for part in text.split(":", 1)))


def _folder(text: str) -> Path:
    if not Path(text).is_dir():
        raise argparse.ArgumentTypeError(f"{text}: no such folder")
    return Path(text)


def _frames(text: str) -> str:
    try:
        as_slice(text)
    except (ValueError, TypeError) as error:
        raise argparse.ArgumentTypeError(f"{text}: write A:B, as in 0:50") from error
    return text
