"""Factories by their names: our own, and those that other packages add through entry points."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib.metadata import EntryPoint, entry_points
from typing import Any, Generic, TypeVar

from slam.data.errors import InputError

T = TypeVar("T")


@dataclass(frozen=True)
class Registry(Generic[T]):
    """What can be chosen by name; nothing is imported before it is asked for.

    A package adds a name by an entry point, in its pyproject.toml:

        [project.entry-points."lidarlift.methods"]
        its-name = "its_package.module:Class"

    Attributes:
        kind: What one of them is, for messages: "method".
        own: Our names, each with the "module:attribute" of its factory.
        group: The entry point group by which packages add names; None where they cannot.
    """

    kind: str
    own: Mapping[str, str]
    group: str | None = None

    def names(self) -> list[str]:
        """All names: our own in their order, then those that packages add, sorted."""
        return [*self.own, *sorted({entry.name for entry in self._added()} - set(self.own))]

    def require(self, *names: str) -> None:
        """Check names without importing what they stand for.

        Raises:
            InputError: A name is unknown, with the nearest right one; or a package adds a name that is taken.
        """
        for name in names:
            self._entry(name)

    def load(self, name: str) -> Callable[..., T]:
        """The factory of that name, imported.

        Raises:
            InputError: As `require`; or a package's entry point leads to nothing that can be called.
        """
        entry = self._entry(name)
        if entry.dist is None:
            factory: Callable[..., T] = entry.load()
            return factory
        try:
            found: Any = entry.load()
        except Exception as error:  # whatever a package that we do not know raises while it is imported
            raise self._broken(entry, f"{type(error).__name__}: {' '.join(str(error).split())}") from error
        if not callable(found):
            raise self._broken(entry, f"{entry.value} cannot be called")
        made: Callable[..., T] = found
        return made

    def _entry(self, name: str) -> EntryPoint:
        own = [EntryPoint(name, self.own[name], self.group or "")] if name in self.own else []
        found = [*own, *(entry for entry in self._added() if entry.name == name)]
        if not found:
            from slam.data.yaml_files import suggest  # imports numpy, which takes as long as all the rest of --help

            raise InputError(f"unknown {self.kind} '{name}'{suggest(name, self.names())}")
        if len(found) > 1:
            packages = " and ".join(_package(entry) for entry in found)
            raise InputError(
                f"{self.kind} '{name}': the packages {packages} each have one; rename an entry point "
                f"in the group {self.group}, or uninstall a package"
            )
        return found[0]

    def _added(self) -> list[EntryPoint]:
        return [] if self.group is None else list(entry_points(group=self.group))

    def _broken(self, entry: EntryPoint, fault: str) -> InputError:
        return InputError(
            f"{self.kind} '{entry.name}' of the package {_package(entry)} cannot be loaded ({fault}); "
            "repair or uninstall that package"
        )


def _package(entry: EntryPoint) -> str:
    return "lidarlift" if entry.dist is None else entry.dist.name
