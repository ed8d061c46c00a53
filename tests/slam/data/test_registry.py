"""Names that stand for "module:attribute", and those that other packages add."""

from __future__ import annotations

import subprocess
import sys
from collections import Counter, OrderedDict
from collections.abc import Callable
from typing import Any

import pytest

from slam.data.errors import InputError
from slam.data.registry import Registry

Install = Callable[[str, str, dict[str, str]], object]
OWN = {"ordered": "collections:OrderedDict", "counted": "collections:Counter"}
THINGS: Registry[Any] = Registry("thing", OWN, "lidarlift.things")


def test_own_names_stand_for_their_factories() -> None:
    assert THINGS.names() == ["ordered", "counted"]
    assert THINGS.load("ordered") is OrderedDict
    assert THINGS.load("counted") is Counter


@pytest.mark.parametrize("ask", [THINGS.require, THINGS.load])
def test_an_unknown_name_is_refused_with_the_nearest_one(ask: Callable[[str], object]) -> None:
    with pytest.raises(InputError, match="unknown thing 'odered'; did you mean 'ordered'"):
        ask("odered")


def test_nothing_is_imported_before_it_is_asked_for() -> None:
    program = (
        "import sys; from slam.data.registry import Registry\n"
        "things = Registry('thing', {'one': 'colorsys:rgb_to_hsv'}); things.require('one')\n"
        "assert 'colorsys' not in sys.modules; things.load('one'); assert 'colorsys' in sys.modules"
    )
    subprocess.run([sys.executable, "-c", program], check=True)


def test_a_package_adds_a_name(installed: Install) -> None:
    installed("more-things", "[lidarlift.things]\nthird = more_things:Third\n", {"more_things.py": "class Third: ..."})
    assert THINGS.names() == ["ordered", "counted", "third"]
    assert THINGS.load("third").__name__ == "Third"
    with pytest.raises(InputError, match="did you mean 'third'"):
        THINGS.require("thirt")


def test_a_registry_without_a_group_has_its_own_names_alone(installed: Install) -> None:
    installed("more-things", "[lidarlift.things]\nthird = more_things:Third\n", {"more_things.py": "class Third: ..."})
    assert Registry[Any]("thing", OWN).names() == ["ordered", "counted"]


@pytest.mark.parametrize(
    ("target", "source", "fault"),
    [
        ("broken:Third", "import no_such_module", "ModuleNotFoundError: No module named 'no_such_module'"),
        ("broken:Third", "raise ValueError('two\\nlines')", "ValueError: two lines"),
        ("broken:Third", "", "AttributeError"),
        ("broken:Third", "Third = 3", "broken:Third cannot be called"),
        ("no_module_of_that_name:Third", "", "ModuleNotFoundError"),
    ],
)
def test_a_broken_entry_point_is_said_in_one_line_that_names_the_package(
    installed: Install, target: str, source: str, fault: str
) -> None:
    installed("broken-things", f"[lidarlift.things]\nthird = {target}\n", {"broken.py": source})
    assert "third" in THINGS.names()
    assert THINGS.load("ordered") is OrderedDict  # the others are as they were
    with pytest.raises(InputError) as raised:
        THINGS.load("third")
    message = str(raised.value)
    assert message.startswith("thing 'third' of the package broken-things cannot be loaded")
    assert fault in message
    assert "\n" not in message


def test_a_name_of_our_own_is_not_overridden(installed: Install) -> None:
    installed("other-things", "[lidarlift.things]\nordered = other:Third\n", {"other.py": "class Third: ..."})
    assert THINGS.names() == ["ordered", "counted"]
    for ask in (THINGS.require, THINGS.load):
        with pytest.raises(InputError, match="'ordered': the packages lidarlift and other-things each have one"):
            ask("ordered")


def test_two_packages_with_one_name_are_told_apart_by_the_user(installed: Install) -> None:
    for package in ("first", "second"):
        installed(package, f"[lidarlift.things]\nthird = {package}:Third\n", {f"{package}.py": "class Third: ..."})
    assert THINGS.names() == ["ordered", "counted", "third"]
    with pytest.raises(InputError, match=r"(first and second|second and first) each have one"):
        THINGS.load("third")
