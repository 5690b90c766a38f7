"""Arrays of a result, which stand apart from its JSON: each at the path of its field, bit for bit."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from urmpipe_models.errors import format_value
from urmpipe_pipeline.text import unique

ARRAY, DTYPE, SHAPE, TEXT, CODES = "$array", "dtype", "shape", "$text", "codes"
"""The keys of an object that stands for an array."""

KINDS = {"f": "float", "i": "int", "u": "int without sign", "b": "bool", "O": "str", "U": "str of one size"}
"""What `dtype.kind` may be."""

ArrayOf: TypeAlias = Callable[[str, tuple[int, ...], "np.dtype[Any]"], Any]
"""Returns the array of a path, with the shape and the type that were told of it."""


class CodecError(ValueError):
    """A value is not what the type of its field allows."""


@dataclass(frozen=True, slots=True, eq=False)
class Column:
    """An array of a result.

    Attributes:
        at: Its path in the result, such as /runs/matlab/delta.
        values: In the units of its field, shape (n, ...).
        t_ns: Time of each row in integer [ns], shape (n,); None where it has none.
        plotted: Whether its rows stand by themselves, as plots want them: floats in one or two dimensions.
    """

    at: str
    values: NDArray[Any]
    t_ns: NDArray[np.int64] | None
    plotted: bool

    @property
    def rows(self) -> int:
        """How many rows it has; a single value is one."""
        return len(self.values) if self.values.ndim else 1


@dataclass(frozen=True, slots=True)
class Place:
    """Where a value stands in a result: its path."""

    path: str

    def wrong(self, found: Any, allowed: str) -> CodecError:
        """Return an error that says where, what was found and what is allowed."""
        return CodecError(f"{self.path or '/'}: found {format_value(found)}, allowed: {allowed}")


@dataclass(frozen=True, slots=True)
class Out(Place):
    """Where a value stands that is being written.

    Attributes:
        clock: The nearest times above it.
        columns: All arrays so far.
        paths: Their paths by `id`, and that of their times: an array that stands in two places is kept once.
    """

    clock: Any
    columns: list[Column]
    paths: dict[tuple[int, int], str]

    def below(self, part: str, clock: Any = None) -> Out:
        """Return the place of a part, which may have times of its own."""
        return Out(f"{self.path}/{part}", self.clock if clock is None else clock, self.columns, self.paths)

    def array(self, values: Any, *, plotted: bool = True) -> dict[str, Any]:
        """Keep an array, and return what stands for it."""
        if not values.dtype.isnative:
            raise self.wrong(values.dtype, "the order of bytes of this computer")
        clock = None if self.clock is values else self.clock
        if clock is not None and values.shape[:1] != clock.shape:
            clock = None
        key = id(values), id(clock)
        if values.size and key not in self.paths:
            self.paths[key] = self.path
            rows = plotted and values.dtype == np.float64 and values.ndim in (1, 2)
            self.columns.append(Column(self.path, values, clock, rows))
        return {ARRAY: self.paths.get(key), SHAPE: list(values.shape), DTYPE: values.dtype.str}


@dataclass(frozen=True, slots=True)
class In(Place):
    """Where a value stands that is being read.

    Attributes:
        array: Returns the array of a path.
    """

    array: ArrayOf

    def below(self, part: str) -> In:
        """Return the place of a part."""
        return In(f"{self.path}/{part}", self.array)


def write_array(value: Any, at: Out) -> dict[str, Any]:
    """Keep an array, and return what stands for it: of texts each once, and which stands where."""
    if value.dtype.kind not in "OU":
        return at.array(value)
    names: dict[Any, int] = {}
    codes = np.fromiter((names.setdefault(one, len(names)) for one in value.flat), np.int64, value.size)
    if not all(isinstance(one, str) for one in names):
        raise at.wrong(value, "an array of texts")
    return {TEXT: list(map(str, names)), CODES: at.array(codes.reshape(value.shape)), DTYPE: value.dtype.str}


def is_array(tree: Any) -> bool:
    """Tell whether JSON stands for an array."""
    return isinstance(tree, dict) and (ARRAY in tree or TEXT in tree)


def read_array(tree: Any, kinds: str, at: In) -> Any:
    """Return the array that JSON stands for, if its `dtype.kind` is one of those that are allowed."""
    if not is_array(tree) or not isinstance(tree.get(DTYPE), str):
        raise at.wrong(tree, "what stands for an array")
    if not re.fullmatch(rf"[<>|=][{kinds}]\d*", tree[DTYPE]):
        raise at.wrong(tree[DTYPE], f"an array of {' or '.join(KINDS[kind] for kind in kinds)}")
    try:
        shape, dtype = tree.get(SHAPE), np.dtype(tree[DTYPE])
    except TypeError:  # a size that no type has
        raise at.wrong(tree[DTYPE], "a type of NumPy's") from None
    if TEXT in tree:
        return _texts(tree, dtype, at)
    if not isinstance(shape, list) or not all(type(one) is int and one >= 0 for one in shape):
        raise at.wrong(shape, "the shape of an array")
    return np.empty(shape, dtype) if 0 in shape else at.array(str(tree[ARRAY]), tuple(shape), dtype)


def _texts(tree: Mapping[str, Any], dtype: np.dtype[Any], at: In) -> NDArray[Any]:
    """Return an array of texts."""
    names = tree[TEXT]
    if (
        not isinstance(names, list)
        or not all(isinstance(one, str) for one in names)
        or dtype.kind not in "OU"
    ):
        raise at.wrong(names, "a list of texts")
    codes = np.asarray(read_array(tree.get(CODES), "i", at))
    if codes.size and not 0 <= codes.min() <= codes.max() < len(names):
        raise at.wrong(int(codes.max()), f"the number of one of {len(names)} texts")
    found: NDArray[Any] = np.array([*names, ""], dtype=dtype)[codes]
    return found


def write_column(plain: list[Any], at: Out) -> Any:
    """Return many plain values as JSON: where they are of one type, as what stands for an array."""
    kinds = {type(one) for one in plain}
    if kinds == {str}:
        return write_array(np.array(plain, dtype=np.object_), at)
    whole = kinds == {int} and -(2**63) <= min(plain) <= max(plain) < 2**63
    if whole or kinds in ({float}, {bool}):
        return at.array(np.array(plain), plotted=False)
    return plain


def read_column(tree: Any, at: In) -> list[Any]:
    """Return many values from JSON, none checked yet but for what JSON is."""
    if isinstance(tree, list):
        return tree
    found = np.asarray(read_array(tree, "fibO", at))
    if found.ndim != 1:
        raise at.wrong(found.shape, "one dimension")
    values: list[Any] = found.tolist()
    return values


def child_keys(items: Sequence[Any]) -> list[str]:
    """Return what the parts of a list are called in a path, all different: text, a name, or a number."""
    names = (one if isinstance(one, str) else getattr(one, "name", None) for one in items)
    return unique([path_key(name) if isinstance(name, str) else str(i) for i, name in enumerate(names)])


def path_key(name: str) -> str:
    """Return a name with an underscore for all that Rerun would escape in a path, or not find again."""
    return re.sub(r"[^\w.-]", "_", name) or "_"
