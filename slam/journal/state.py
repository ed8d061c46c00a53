"""Snapshots of objects: their attributes and arrays as plain data, never pickled, so that reading one runs no code.

An object that is thawed behaves exactly as the one that was frozen: shared references stay shared, and arrays keep
their layout in memory, which selects the numerical kernels.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from slam.data.cloud import Array
from slam.settings import Settings

OWN = "slam."  # objects of our classes are frozen, others are an error
PLAIN = (bool, int, float, str)
MAX_STRETCH = 64  # memory that an array with gaps may take, relative to its elements


class StateError(ValueError):
    """A snapshot is damaged, or an object cannot be frozen."""


@dataclass(frozen=True, eq=False)
class Frozen:
    """A value as plain data.

    Attributes:
        root: The value: None, a bool, a number, a text, or {"at": number of a node}.
        nodes: Containers, objects and arrays, each a list of its kind and its contents.
        arrays: The arrays, copied.
    """

    root: Any
    nodes: list[Any]
    arrays: list[Array]


def freeze(value: Any) -> Frozen:
    """Copy a value: numbers, texts, arrays, lists, tuples, dicts, deques, k-d trees, and objects of our classes.

    Raises:
        StateError: It contains something else.
    """
    freezer = _Freezer()
    return Frozen(freezer.value(value), freezer.nodes, freezer.arrays)


def thaw(frozen: Frozen) -> Any:
    """Return the value that was frozen, as a new object.

    Raises:
        StateError: The data are damaged.
    """
    try:
        return _Thawer(frozen).value(frozen.root)
    except StateError:
        raise
    except Exception as error:  # whatever a file says that was not written by `freeze`
        raise StateError(f"damaged ({type(error).__name__}: {error})") from error


class _Freezer:
    def __init__(self) -> None:
        self.nodes: list[Any] = []
        self.arrays: list[Array] = []
        self._numbers: dict[int, int] = {}  # by the identity of an object, so that shared references stay shared
        self._kept: list[Any] = []  # an identity is unique only while its object exists

    def value(self, value: Any) -> Any:
        if value is None or type(value) in PLAIN:
            return value
        if id(value) not in self._numbers:
            number = self._numbers[id(value)] = len(self.nodes)
            self._kept.append(value)
            self.nodes.append(None)
            self.nodes[number] = self._node(value)
        return {"at": self._numbers[id(value)]}

    def _node(self, value: Any) -> list[Any]:
        kind = type(value)
        if isinstance(value, np.ndarray | np.generic):
            return self._array(value)
        if kind in (list, tuple):
            return [kind.__name__, [self.value(each) for each in value]]
        if kind is deque:
            return ["deque", [self.value(each) for each in value], value.maxlen]
        if kind is dict:
            return ["dict", [[self.value(key), self.value(each)] for key, each in value.items()]]
        if kind is range:
            return ["range", value.start, value.stop, value.step]
        if kind is cKDTree:
            return ["tree", self.value(value.data)]
        name = f"{kind.__module__}:{kind.__qualname__}"
        if isinstance(value, Settings):
            return ["settings", name, value.model_dump_json()]
        if not name.startswith(OWN) or not hasattr(value, "__dict__"):
            raise StateError(f"an object of {name} cannot be part of a snapshot")
        return ["object", name, [[key, self.value(each)] for key, each in vars(value).items()]]

    def _array(self, value: Any) -> list[Any]:
        if value.dtype.kind not in "biuf" or not value.dtype.isnative:
            raise StateError(f"an array of {value.dtype} cannot be part of a snapshot")
        self.arrays.append(np.array(value, order="K"))
        if isinstance(value, np.generic):
            return ["scalar", len(self.arrays) - 1]
        dense = value.flags.c_contiguous or value.flags.f_contiguous
        return ["array", len(self.arrays) - 1, value.flags.writeable, None if dense else list(value.strides)]


class _Thawer:
    def __init__(self, frozen: Frozen) -> None:
        self._nodes, self._arrays = frozen.nodes, frozen.arrays
        self._done: dict[int, Any] = {}

    def value(self, value: Any) -> Any:
        if value is None or type(value) in PLAIN:
            return value
        number = value["at"]
        if number not in self._done:
            kind, *content = self._nodes[number]
            self._done[number] = getattr(self, f"_{kind}")(number, *content)
        return self._done[number]

    def _list(self, number: int, values: list[Any]) -> list[Any]:
        result = self._done[number] = []
        result.extend(self.value(each) for each in values)
        return result

    def _tuple(self, number: int, values: list[Any]) -> tuple[Any, ...]:
        return tuple(self.value(each) for each in values)

    def _deque(self, number: int, values: list[Any], longest: int | None) -> deque[Any]:
        result: deque[Any] = deque(maxlen=longest)
        self._done[number] = result
        result.extend(self.value(each) for each in values)
        return result

    def _dict(self, number: int, items: list[list[Any]]) -> dict[Any, Any]:
        result: dict[Any, Any] = {}
        self._done[number] = result
        result.update((self.value(key), self.value(each)) for key, each in items)
        return result

    def _range(self, number: int, start: int, stop: int, step: int) -> range:
        return range(start, stop, step)

    def _tree(self, number: int, points: Any) -> cKDTree:
        return cKDTree(self.value(points))

    def _settings(self, number: int, name: str, text: str) -> Settings:
        kind = _own_class(name)
        if not issubclass(kind, Settings):
            raise StateError(f"{name} is no class of settings")
        return kind.model_validate_json(text)

    def _object(self, number: int, name: str, attributes: list[list[Any]]) -> Any:
        result: Any = object.__new__(_own_class(name))
        self._done[number] = result
        vars(result).update({str(key): self.value(each) for key, each in attributes})
        return result

    def _scalar(self, number: int, at: int) -> Any:
        return self._arrays[at][()]

    def _array(self, number: int, at: int, writeable: bool, strides: list[int] | None) -> Array:
        values = self._arrays[at].copy(order="K") if strides is None else _with_strides(self._arrays[at], strides)
        values.flags.writeable = bool(writeable)
        return values


def _with_strides(values: Array, strides: list[int]) -> Array:
    """The array with gaps between its elements, as a slice of another one has; without them if they are too large."""
    size = sum((length - 1) * step for length, step in zip(values.shape, strides, strict=True)) + values.itemsize
    if values.size == 0 or min(strides) <= 0 or size > MAX_STRETCH * values.nbytes:
        return values.copy()
    result = np.ndarray(values.shape, values.dtype, np.zeros(size, np.uint8), strides=tuple(strides))
    result[...] = values
    return result


def _own_class(name: str) -> type:
    """One of our classes by MODULE:NAME."""
    module, _, kind = name.partition(":")
    found = getattr(import_module(module), kind, None) if name.startswith(OWN) and kind.isidentifier() else None
    if not isinstance(found, type) or found.__module__ != module:
        raise StateError(f"{name} is no class of a snapshot")
    return found
