"""YAML of others: one line says what is wrong, whatever it is."""

from __future__ import annotations

import contextlib
import tracemalloc
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from slam.config import load_config
from slam.data.errors import InputError
from slam.data.yaml_files import numbers, read_mapping
from slam.data.yaml_text import parsed

LAUGHS = "a: &a [1, 1, 1, 1, 1, 1, 1, 1]\n" + "".join(
    f"{name}: &{name} [{', '.join([f'*{before}'] * 9)}]\n" for before, name in zip("abcdefg", "bcdefgh", strict=True)
)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (LAUGHS, "aliases such as"),
        ("model: &a [*a]", "aliases such as"),
        ("[" * 3000, "nested too deeply"),
        ("model: 2001-99-99", "month"),
        ("model: !!python/object/apply:os.system [ls]", "could not determine a constructor"),
        ("model: " + "9" * 5000, "limit"),
        ("model: x\n" * 10_000, "at most 65536"),
        ("model: \x00", "special characters"),
        ("- 1", "lines like 'key: value'"),
        ("? [1, 2]\n: 3", "unhashable|unknown key"),
        ('"a\\n b": 3', "unknown key 'a b'"),
    ],
)
def test_what_is_wrong_is_said_in_one_line(tmp_path: Path, content: str, message: str) -> None:
    path = tmp_path / "sensor.yaml"
    path.write_text(content)
    tracemalloc.start()
    try:
        with pytest.raises(InputError, match=message) as error:
            read_mapping(path, ("model", "beams"))
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert str(error.value).startswith(f"{path}: ")
    assert "\n" not in str(error.value)
    assert peak < 10_000_000


def test_settings_have_no_aliases_either(tmp_path: Path) -> None:
    path = tmp_path / "config.yaml"
    path.write_text(LAUGHS)
    with pytest.raises(InputError, match="aliases"):
        load_config(path)


@pytest.mark.parametrize("value", [[[1, 2], [3]], "x", [1, None], [[1e400]], {"a": 1}, [10**400]])
def test_what_are_no_numbers_is_refused(value: object) -> None:
    with pytest.raises(InputError, match=r"^a\.yaml: 'K' must be"):
        numbers(Path("a.yaml"), "K", value, (-1, 1))


@given(st.text(max_size=200))
def test_any_text_is_yaml_or_a_value_error(text: str) -> None:
    with contextlib.suppress(ValueError):
        parsed(text)
