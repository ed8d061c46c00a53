"""Registries of factories by name: those of lidarlift, and those that other packages add by entry points."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib.metadata import EntryPoint, entry_points
from typing import Any, Generic, TypeVar

from slam.data.errors import InputError

T = TypeVar("T")


@dataclass(frozen=True)
class Registry(Generic[T]):
    """Names and what they stand for, which is imported when it is loaded.

    A package adds a name by an entry point, in its pyproject.toml:

        [project.entry-points."lidarlift.methods"]
        my-name = "my_package.module:Class"

    Attributes:
        kind: Kind of the entries, for messages: "method".
        own: Names of lidarlift, each with the "module:attribute" of its factory.
        group: Entry point group by which packages add names; None if they cannot.
    """

    kind: str
    own: Mapping[str, str]
    group: str | None = None

    def names(self) -> list[str]:
        """Return all names: those of lidarlift in their order, then those of other packages, sorted."""
        return [*self.own, *sorted({entry.name for entry in self._added()} - set(self.own))]

    def require(self, *names: str) -> None:
        """Check names, without an import.

        Raises:
            InputError: A name is unknown (the message has the most similar one), or two packages add the same name.
        """
        for name in names:
            self._entry(name)

    def load(self, name: str) -> Callable[..., T]:
        """Import the factory of a name.

        Raises:
            InputError: As in `require`, or the entry point of a package cannot be imported or called.
        """
        entry = self._entry(name)
        if entry.dist is None:
            factory: Callable[..., T] = entry.load()
            return factory
        try:
            found: Any = entry.load()
        except Exception as error:  # an unknown package can raise anything while it is imported
            raise self._broken(entry, f"{type(error).__name__}: {' '.join(str(error).split())}") from error
        if not callable(found):
            raise self._broken(entry, f"{entry.value} cannot be called")
        made: Callable[..., T] = found
        return made

    def _entry(self, name: str) -> EntryPoint:
        own = [EntryPoint(name, self.own[name], self.group or "")] if name in self.own else []
        found = [*own, *(entry for entry in self._added() if entry.name == name)]
        if not found:
            from slam.data.yaml_files import suggest  # imports numpy, which takes as long as the rest of --help

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
