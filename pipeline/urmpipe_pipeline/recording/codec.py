"""Arrays of a result, which stand apart from its JSON: each at the path of its field, bit for bit."""

from __future__ import annotations

import re
import types
from collections.abc import Callable, Container, Mapping, Sequence
from dataclasses import MISSING, Field, dataclass, fields, is_dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any, Literal, TypeAlias, Union, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import NDArray

from urmpipe_models.errors import RecordingError, UrmpipeError, format_value
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


CLOCK = "t_ns"
"""The field with the times of the arrays beside and below it."""

STORED = "stored"
"""Key of a field's metadata: False of what is not stored; the type that is stored where the hint is wider."""

PATH = "path"
"""Key of a field's metadata: where its array stands instead of below the field's name."""

MANY = 64
"""A longer list of plain values or of flat records stands as columns."""

CLASS, COLUMNS, COUNT = "$is", "$columns", "count"
"""The keys of an object that tells its class, and of one that stands for a long list."""


@dataclass(frozen=True, slots=True, eq=False)
class Form:
    """How the values of one type are written and read.

    Attributes:
        text: What it is, for a schema and for messages.
        holds: Tells whether a value is of this type, by a look at its outside.
        fits: Tells whether JSON is of this type, likewise.
        to_json: Returns a value as JSON.
        from_json: Returns the value that JSON tells.
        classes: The dataclasses that stand in it.
        plain: Whether it is text, a number, a truth value or None.
    """

    text: str
    holds: Callable[[Any], bool]
    fits: Callable[[Any], bool]
    to_json: Callable[[Any, Out], Any]
    from_json: Callable[[Any, In], Any]
    classes: tuple[type, ...] = ()
    plain: bool = False

    def write(self, value: Any, at: Out) -> Any:
        """Return a value as JSON, or raise a `CodecError`."""
        if not self.holds(value):
            raise at.wrong(value, self.text)
        return self.to_json(value, at)

    def read(self, tree: Any, at: In) -> Any:
        """Return the value that JSON tells, or raise a `CodecError`."""
        if not self.fits(tree):
            raise at.wrong(tree, self.text)
        return self.from_json(tree, at)


@cache
def form_of(hint: Any) -> Form:
    """Return the form of a type.

    Raises:
        TypeError: If there is none: for the author of a result.
    """
    origin, inner = get_origin(hint) or hint, get_args(hint)
    if hint is Any:
        return Form("Any", lambda value: True, lambda tree: True, _json, lambda tree, at: tree)
    if hint is None or hint in (types.NoneType, str, int, float, bool):
        return _plain_type(hint or types.NoneType)
    if hint is Path:
        return Form("Path", _is(Path), _is(str), lambda value, at: str(value), lambda tree, at: Path(tree))
    if isinstance(hint, type) and is_dataclass(hint):
        return _record(hint)
    makers: dict[Any, Callable[[tuple[Any, ...]], Form]]
    makers = {Literal: _choice, Union: _one_of, types.UnionType: _one_of, np.ndarray: _array, list: _list,
              tuple: _tuple, dict: _table, Mapping: _table}  # fmt: skip
    if origin not in makers:
        raise TypeError(f"found a field of type {hint}, allowed: one that `form_of` knows")
    return makers[origin](inner)


def _tuple(inner: tuple[Any, ...]) -> Form:
    return _items(tuple, inner) if inner[1:] == (...,) else _row(inner)


def _list(inner: tuple[Any, ...]) -> Form:
    return _items(list, inner)


def _is(*kinds: type) -> Callable[[Any], bool]:
    return lambda value: isinstance(value, kinds)


def _item(value: Any) -> Any:
    """Return a number of NumPy's as the number, anything else as it is."""
    return value.item() if isinstance(value, np.generic) else value


def _plain(text: str, fits: Callable[[Any], bool]) -> Form:
    """Return the form of what stands in JSON as it is."""
    return Form(
        text,
        lambda value: fits(_item(value)),
        fits,
        lambda value, at: _item(value),
        lambda tree, at: tree,
        plain=True,
    )


def _plain_type(kind: type) -> Form:
    """Return the form of a plain type: a whole number is a float, too, a truth value is no number."""
    kinds = (float, int) if kind is float else (kind,)
    text = "None" if kind is types.NoneType else kind.__name__
    return _plain(text, lambda tree: isinstance(tree, kinds) and (kind is bool or not isinstance(tree, bool)))


def _choice(allowed: tuple[Any, ...]) -> Form:
    """Return the form of one of some values."""
    known = {(type(one), one) for one in allowed}
    text = " or ".join(map(repr, allowed))
    return _plain(text, lambda tree: isinstance(tree, (str, int)) and (type(tree), tree) in known)


def _json(value: Any, at: Out) -> Any:
    """Return anything as JSON has it: a tuple as a list, an array as a list of numbers."""
    if isinstance(value, Mapping):
        return {str(key): _json(one, at) for key, one in value.items()}
    if isinstance(value, (list, tuple)):
        return [_json(one, at) for one in value]
    if isinstance(value, (np.ndarray, np.generic)):
        return value.tolist()
    if value is not None and not isinstance(value, (str, int, float, Path)):
        raise at.wrong(value, "what JSON can hold")
    return str(value) if isinstance(value, Path) else value


def _array(inner: tuple[Any, ...]) -> Form:
    """Return the form of an array, by the hints of its shape and its dtype."""
    scalar = (get_args(inner[1]) or (Any,))[0]
    kinds = "".join(KINDS) if scalar is Any else np.dtype(scalar).kind
    text = f"array of {' or '.join(KINDS[kind] for kind in kinds)}"

    def holds(value: Any) -> bool:
        return hasattr(value, "__array__") and not isinstance(value, np.generic) and value.dtype.kind in kinds

    return Form(text, holds, is_array, write_array, lambda tree, at: read_array(tree, kinds, at))


def _items(kind: type, inner: tuple[Any, ...]) -> Form:
    """Return the form of a tuple or a list of any length."""
    form = form_of(inner[0])
    text = f"{kind.__name__}[{form.text}, ...]"

    def to_json(value: Sequence[Any], at: Out) -> Any:
        if len(value) <= MANY or not (form.plain or _flat(form)):
            pairs = zip(child_keys(value), value, strict=True)
            return [form.write(one, at.below(key)) for key, one in pairs]
        trees = [form.write(one, at) for one in value]
        if form.plain:
            return {COLUMNS: write_column(trees, at), COUNT: len(trees)}
        columns = {name: write_column([one[name] for one in trees], at.below(name)) for name in trees[0]}
        return {COLUMNS: columns, COUNT: len(trees)}

    def from_json(tree: Any, at: In) -> Any:
        if isinstance(tree, list):
            return kind(form.read(one, at.below(str(i))) for i, one in enumerate(tree))
        told, count = tree[COLUMNS], tree.get(COUNT)
        if form.plain:
            return kind(_column(form, told, count, at))
        parts = parts_of(form.classes[0]) if _flat(form) and isinstance(told, dict) else {}
        known = {name: part for name, part in parts.items() if name in told}
        if not known:
            raise at.wrong(told, "columns of plain values")
        columns = [_column(part, told[name], count, at.below(name)) for name, part in known.items()]
        rows = (dict(zip(known, row, strict=True)) for row in zip(*columns, strict=True))
        return kind(_made(form.classes[0], row, at) for row in rows)

    def fits(tree: Any) -> bool:
        return isinstance(tree, list) or (isinstance(tree, dict) and tree.keys() == {COLUMNS, COUNT})

    return Form(text, _is(tuple, list), fits, to_json, from_json, form.classes)


def _column(form: Form, tree: Any, count: Any, at: In) -> list[Any]:
    """Return the values of a column, each of which a form allows."""
    values = read_column(tree, at)
    if len(values) != count:
        raise at.wrong(len(values), f"{count} values")
    for one in values:
        if not form.fits(one):
            raise at.wrong(one, form.text)
    return values


def _is_record(form: Form) -> bool:
    return len(form.classes) == 1 and form is form_of(form.classes[0])


def _flat(form: Form) -> bool:
    """Tell whether a form is that of a record of plain values."""
    return _is_record(form) and all(part.plain for part in parts_of(form.classes[0]).values())


def _row(inner: tuple[Any, ...]) -> Form:
    """Return the form of a tuple with a type for each place."""
    forms = tuple(map(form_of, inner))

    def fits(tree: Any) -> bool:
        return isinstance(tree, (list, tuple)) and len(tree) == len(forms)

    def to_json(value: Any, at: Out) -> Any:
        return [form.write(value[i], at.below(str(i))) for i, form in enumerate(forms)]

    def from_json(tree: Any, at: In) -> Any:
        return tuple(form.read(tree[i], at.below(str(i))) for i, form in enumerate(forms))

    text = f"tuple[{', '.join(form.text for form in forms)}]"
    return Form(text, fits, fits, to_json, from_json, _classes(forms))


def _table(inner: tuple[Any, ...]) -> Form:
    """Return the form of a mapping from texts."""
    if inner[0] is not str:
        raise TypeError(f"found a mapping from {inner[0]}, allowed: from str")
    form = form_of(inner[1])

    def to_json(value: Mapping[str, Any], at: Out) -> Any:
        pairs = zip(child_keys(list(value)), value.items(), strict=True)
        return {name: form.write(one, at.below(key)) for key, (name, one) in pairs}

    def from_json(tree: Any, at: In) -> Any:
        return {name: form.read(one, at.below(name)) for name, one in tree.items()}

    return Form(f"dict[str, {form.text}]", _is(Mapping), _is(dict), to_json, from_json, form.classes)


def _record(cls: Any) -> Form:
    """Return the form of a dataclass: its fields by their names."""

    def to_json(value: Any, at: Out) -> Any:
        clock, paths = getattr(value, CLOCK, None), paths_of(cls)
        parts = parts_of(cls).items()
        return {name: part.write(getattr(value, name), at.below(paths[name], clock)) for name, part in parts}

    def from_json(tree: Any, at: In) -> Any:
        known = ((name, part) for name, part in parts_of(cls).items() if name in tree)
        return _made(cls, {name: part.read(tree[name], at.below(name)) for name, part in known}, at)

    return Form(cls.__name__, lambda value: type(value) is cls, _is(dict), to_json, from_json, (cls,))


def _made(cls: type, told: Mapping[str, Any], at: In) -> Any:
    """Return an object of a class with what its fields hold, each of which was checked."""
    missing = [one.name for one in stored(cls) if one.name not in told and not has_default(one)]
    if missing:
        raise at.wrong(None, f"the field {missing[0]} of {cls.__name__}")
    try:
        return cls(**told)
    except RecordingError:  # an array that is read as it is used
        raise
    except (UrmpipeError, ArithmeticError, AttributeError, LookupError, TypeError, ValueError) as error:
        raise CodecError(f"{at.path or '/'}: {error}") from error


def _one_of(inner: tuple[Any, ...]) -> Form:
    """Return the form of a union: of several dataclasses in it, each tells the name of its class.

    Lists of this and lists of that are one list of this or that: an empty one is of both.
    """
    lists = [get_args(one)[0] for one in inner if get_origin(one) is list]
    if len(lists) > 1:
        others = [one for one in inner if get_origin(one) is not list]
        return form_of(Union[(*others, list[Union[tuple(lists)]])])  # type: ignore[misc]  # noqa: UP007
    named = sum(is_dataclass(one) for one in inner) > 1
    forms = [form_of(one) for one in inner]
    if named:
        forms = [_named(form) if _is_record(form) else form for form in forms]
    forms.sort(key=lambda form: form.fits({}))  # an object may stand for a long list or an array
    text = " or ".join(form.text for form in forms)
    probes: tuple[Any, ...] = ("", [], {}, {ARRAY: ""})
    for probe in probes:
        if sum(form.fits(probe) for form in forms) > 1:
            raise TypeError(f"found a field of type {text}, allowed: what JSON tells apart")

    def to_json(value: Any, at: Out) -> Any:
        return next(form for form in forms if form.holds(value)).write(value, at)

    def from_json(tree: Any, at: In) -> Any:
        return next(form for form in forms if form.fits(tree)).read(tree, at)

    return Form(
        text,
        lambda value: any(form.holds(value) for form in forms),
        lambda tree: any(form.fits(tree) for form in forms),
        to_json,
        from_json,
        _classes(forms),
        plain=all(form.plain for form in forms),
    )


def _named(form: Form) -> Form:
    """Return the form of a record that tells its class."""
    name = form.text

    def fits(tree: Any) -> bool:
        return isinstance(tree, dict) and tree.get(CLASS) == name

    def to_json(value: Any, at: Out) -> Any:
        return {CLASS: name, **form.to_json(value, at)}

    return Form(name, form.holds, fits, to_json, form.from_json, form.classes)


def _classes(forms: Sequence[Form]) -> tuple[type, ...]:
    return tuple(dict.fromkeys(cls for form in forms for cls in form.classes))


def stored(cls: type) -> list[Field[Any]]:
    """Return the fields of a dataclass that are stored."""
    return [one for one in fields(cls) if one.init and one.metadata.get(STORED) is not False]


def has_default(field: Field[Any]) -> bool:
    """Tell whether a field may be missing."""
    return field.default is not MISSING or field.default_factory is not MISSING


@cache
def parts_of(cls: type) -> dict[str, Form]:
    """Return the forms of the fields of a dataclass that are stored."""
    hints = get_type_hints(cls)
    return {one.name: form_of(one.metadata.get(STORED, hints[one.name])) for one in stored(cls)}


@cache
def paths_of(cls: type) -> dict[str, str]:
    """Return where the fields of a dataclass stand below it, by their names."""
    return {one.name: one.metadata.get(PATH, one.name) for one in stored(cls)}


@dataclass(frozen=True, slots=True, eq=False)
class Encoded:
    """A result taken apart.

    Attributes:
        tree: All but its arrays, as JSON has it.
        columns: Its arrays.
        entities: The path of each array by its `id` and that of its times; see `entity_of`.
        clocks: The path of the times by which the rows of a plotted array are known, by its own.
    """

    tree: Any
    columns: tuple[Column, ...]
    entities: Mapping[tuple[int, int], str]
    clocks: Mapping[str, str]

    def entity_of(self, array: Any, t_ns: Any = None) -> str:
        """Return the path of an array on some times; empty for one that has no values, which is not kept."""
        return self.entities.get((id(array), id(t_ns)), "")

    def packed(self, rows: int, kept: Container[str]) -> Encoded:
        """Return it with arrays of more rows packed, but those of some paths: they are not plotted."""
        columns = tuple(
            replace(one, plotted=one.plotted and (one.rows <= rows or one.at in kept)) for one in self.columns
        )
        plotted = {one.at for one in columns if one.plotted}
        clocks = {own: clock for own, clock in self.clocks.items() if own in plotted}
        return replace(self, columns=columns, clocks=clocks)


def encode(result: Any) -> Encoded:
    """Return the tree of a dataclass and its arrays.

    Raises:
        CodecError: If a field holds what its type does not allow.
    """
    at = Out("", None, [], {})
    cls: Any = type(result)
    tree = form_of(cls).write(result, at)
    return Encoded(tree, tuple(at.columns), at.paths, _clocks(at))


def _clocks(at: Out) -> dict[str, str]:
    """Return the path of the times of each plotted array whose times rise, so that they tell its rows."""
    times = {id(one.t_ns): one.t_ns for one in at.columns if one.plotted and one.t_ns is not None}
    paths = {key: at.paths.get((key, id(None))) for key, t_ns in times.items() if (np.diff(t_ns) > 0).all()}
    found = ((one.at, paths.get(id(one.t_ns))) for one in at.columns if one.plotted)
    return {own: clock for own, clock in found if clock is not None}


def decode(cls: Any, tree: Any, array: ArrayOf) -> Any:
    """Return the object of a dataclass that a tree made by `encode` tells, and its arrays by their paths.

    Raises:
        CodecError: If the tree tells what the types of its fields do not allow.
    """
    return form_of(cls).read(tree, In("", array))


def schema(classes: Sequence[type]) -> str:
    """Return what is stored of some classes and all that stand in them: a line a field, "=" for a default."""
    waiting, lines = list(classes), []
    for one in waiting:
        parts = parts_of(one)
        lines.append(one.__name__)
        for field in stored(one):
            lines.append(f"    {field.name}: {parts[field.name].text}{' =' if has_default(field) else ''}")
            waiting += [cls for cls in parts[field.name].classes if cls not in waiting]
    return "\n".join(lines) + "\n"
