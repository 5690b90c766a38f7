"""Codec of results: any dataclass as a JSON tree and named arrays, and back, by the types of its fields.

1. Arrays (`StoredArray`) are stored separately from the JSON, each at the path of its field, bit for bit. The
   tree holds a reference, `{"$array": path, "shape": [...], "dtype": "<f8"}`; an array that occurs twice is
   stored once, an array of texts as its different texts and the number of the text of each element.
2. A type (`TypeCodec`, made from the annotation of a field by `codec_for_type`) states how its values are
   written as JSON, and what is checked when they are read. A union may contain the types that JSON
   distinguishes; if it contains several dataclasses, each is stored with the name of its class. Only classes
   that an annotation names are ever created.
3. A list of more than `MAX_LISTED` plain values, or of records of plain values, is stored as columns.
4. `encode` and `decode` convert a result; `schema` lists everything that is stored.

The metadata of a field of a dataclass may have the keys `STORED` and `PATH`.
"""

from __future__ import annotations

import re
import types
from collections.abc import Callable, Container, Mapping, Sequence
from dataclasses import MISSING, Field, fields, is_dataclass
from functools import cache
from pathlib import Path
from typing import Any, Literal, NamedTuple, TypeAlias, Union, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import NDArray

from urmpipe_models.errors import RecordingError, UrmpipeError, format_value
from urmpipe_pipeline.text import make_unique

ARRAY, DTYPE, SHAPE, TEXT, CODES = "$array", "dtype", "shape", "$text", "codes"  # keys of a reference
CLASS, COLUMNS, COUNT = (
    "$is",
    "$columns",
    "count",
)  # key of a record's class; keys of a list stored as columns

STORED = (
    "stored"  # metadata of a field: False if it is not stored, or a type that is narrower than its annotation
)
PATH = "path"  # metadata of a field: path of its array, if that is not the name of the field

CLOCK = "t_ns"  # the field with the times of the arrays in the same record and below it
MAX_LISTED = 64  # values of a list in JSON; a longer one is stored as columns

# Names of the supported values of `dtype.kind`.
KINDS = {"f": "float", "i": "int", "u": "int without sign", "b": "bool", "O": "str", "U": "str of one size"}

# Returns the array at a path, with the given shape and dtype.
ArrayReader: TypeAlias = Callable[[str, tuple[int, ...], "np.dtype[Any]"], Any]


class CodecError(ValueError):
    """The value of a field does not match its type."""


class StoredArray(NamedTuple):
    """Array of a result.

    Attributes:
        path: Path in the result, such as /runs/matlab/delta.
        values: Values in the units of the field, shape (n, ...).
        t_ns: Time of each row in integer [ns], shape (n,), or None.
        plotted: Whether the rows are stored one by one for plots: floats in one or two dimensions.
    """

    path: str
    values: NDArray[Any]
    t_ns: NDArray[np.int64] | None
    plotted: bool

    @property
    def rows(self) -> int:
        """Number of rows; a single value has one."""
        return len(self.values) if self.values.ndim else 1


class Encoded(NamedTuple):
    """A result as JSON and arrays.

    Attributes:
        tree: Everything except the arrays, as JSON.
        arrays: The arrays.
        paths: Path of each array by its `id` and that of its times, see `path_of`.
        clocks: Path of the times that identify the rows of a plotted array, by the path of that array.
    """

    tree: Any
    arrays: tuple[StoredArray, ...]
    paths: Mapping[tuple[int, int], str]
    clocks: Mapping[str, str]

    def path_of(self, values: Any, t_ns: Any = None) -> str:
        """Return the path of an array with its times; empty for one without values, which is not stored."""
        return self.paths.get((id(values), id(t_ns)), "")

    def packed(self, max_rows: int, kept: Container[str]) -> Encoded:
        """Return a copy in which longer arrays, except those at some paths, are packed instead of plotted."""
        arrays = tuple(
            array._replace(plotted=array.plotted and (array.rows <= max_rows or array.path in kept))
            for array in self.arrays
        )
        plotted = {array.path for array in arrays if array.plotted}
        clocks = {path: clock for path, clock in self.clocks.items() if path in plotted}
        return self._replace(arrays=arrays, clocks=clocks)


def encode(result: Any) -> Encoded:
    """Return the JSON tree and the arrays of a dataclass.

    Raises:
        CodecError: If a value does not match the type of its field.
    """
    at = WriteContext("", None, [], {})
    cls: Any = type(result)
    tree = codec_for_type(cls).write(result, at)
    plotted = [array for array in at.arrays if array.plotted]
    times = {id(array.t_ns): array.t_ns for array in plotted if array.t_ns is not None}
    # Times identify rows only where they rise.
    paths = {key: at.paths.get((key, id(None))) for key, t_ns in times.items() if (np.diff(t_ns) > 0).all()}
    clocks = ((array.path, paths.get(id(array.t_ns))) for array in plotted)
    return Encoded(
        tree, tuple(at.arrays), at.paths, {path: clock for path, clock in clocks if clock is not None}
    )


def decode(cls: Any, tree: Any, array: ArrayReader) -> Any:
    """Return the object of a dataclass from the tree that `encode` made, and a reader of its arrays.

    Raises:
        CodecError: If a value in the tree does not match the type of its field.
    """
    return codec_for_type(cls).read(tree, ReadContext("", array))


def schema(classes: Sequence[type]) -> str:
    """Return the stored fields of classes and of all classes in them: one per line, "=" for a default."""
    queue, lines = list(classes), []
    for cls in queue:
        codecs = field_codecs(cls)
        lines.append(cls.__name__)
        for field in stored_fields(cls):
            codec = codecs[field.name]
            lines.append(f"    {field.name}: {codec.text}{' =' if has_default(field) else ''}")
            queue += [part for part in codec.classes if part not in queue]
    return "\n".join(lines) + "\n"


# Arrays


def field_error(path: str, value: Any, allowed: str) -> CodecError:
    """Return an error with the path of a field, its value and what is allowed."""
    return CodecError(f"{path or '/'}: found {format_value(value)}, allowed: {allowed}")


class WriteContext(NamedTuple):
    """Path of a value that is being written, and what has been written before.

    Attributes:
        path: Path of the value in the result.
        clock: Times of the nearest record that has times.
        arrays: All arrays so far.
        paths: Their paths by the `id` of the array and of its times, so that a shared array is stored once.
    """

    path: str
    clock: Any
    arrays: list[StoredArray]
    paths: dict[tuple[int, int], str]

    def child(self, part: str, clock: Any = None) -> WriteContext:
        """Return the context of a part, which may have other times."""
        times = self.clock if clock is None else clock
        return WriteContext(f"{self.path}/{part}", times, self.arrays, self.paths)

    def add(self, values: Any, *, plotted: bool = True) -> dict[str, Any]:
        """Add an array, and return the reference to it."""
        if not values.dtype.isnative:
            raise field_error(self.path, values.dtype, "the order of bytes of this computer")
        clock = None if self.clock is values else self.clock
        if clock is not None and values.shape[:1] != clock.shape:
            clock = None
        key = id(values), id(clock)
        if values.size and key not in self.paths:
            self.paths[key] = self.path
            plotted = plotted and values.dtype == np.float64 and values.ndim in (1, 2)
            self.arrays.append(StoredArray(self.path, values, clock, plotted))
        return {ARRAY: self.paths.get(key), SHAPE: list(values.shape), DTYPE: values.dtype.str}


class ReadContext(NamedTuple):
    """Path of a value that is being read, and the reader of arrays."""

    path: str
    array: ArrayReader

    def child(self, part: str) -> ReadContext:
        """Return the context of a part."""
        return ReadContext(f"{self.path}/{part}", self.array)


def _write_array(values: Any, at: WriteContext) -> dict[str, Any]:
    if values.dtype.kind not in "OU":
        return at.add(values)
    numbers: dict[Any, int] = {}
    codes = np.fromiter(
        (numbers.setdefault(text, len(numbers)) for text in values.flat), np.int64, values.size
    )
    if not all(isinstance(text, str) for text in numbers):
        raise field_error(at.path, values, "an array of texts")
    return {
        TEXT: list(map(str, numbers)),
        CODES: at.add(codes.reshape(values.shape)),
        DTYPE: values.dtype.str,
    }


def _is_reference(tree: Any) -> bool:
    return isinstance(tree, dict) and (ARRAY in tree or TEXT in tree)


def _read_array(tree: Any, kinds: str, at: ReadContext) -> Any:
    """Return the array of a reference, if its `dtype.kind` is one of `kinds`."""
    if not _is_reference(tree) or not isinstance(tree.get(DTYPE), str):
        raise field_error(at.path, tree, "what stands for an array")
    if not re.fullmatch(rf"[<>|=][{kinds}]\d*", tree[DTYPE]):
        raise field_error(at.path, tree[DTYPE], f"an {_array_text(kinds)}")
    try:
        shape, dtype = tree.get(SHAPE), np.dtype(tree[DTYPE])
    except TypeError:  # NumPy has no dtype of this size
        raise field_error(at.path, tree[DTYPE], "a type of NumPy's") from None
    if TEXT in tree:
        return _read_texts(tree, dtype, at)
    if not isinstance(shape, list) or not all(type(length) is int and length >= 0 for length in shape):
        raise field_error(at.path, shape, "the shape of an array")
    return np.empty(shape, dtype) if 0 in shape else at.array(str(tree[ARRAY]), tuple(shape), dtype)


def _read_texts(tree: Mapping[str, Any], dtype: np.dtype[Any], at: ReadContext) -> NDArray[Any]:
    texts = tree[TEXT]
    is_list_of_texts = isinstance(texts, list) and all(isinstance(text, str) for text in texts)
    if not is_list_of_texts or dtype.kind not in "OU":
        raise field_error(at.path, texts, "a list of texts")
    codes = np.asarray(_read_array(tree.get(CODES), "i", at))
    if codes.size and not 0 <= codes.min() <= codes.max() < len(texts):
        raise field_error(at.path, int(codes.max()), f"the number of one of {len(texts)} texts")
    array: NDArray[Any] = np.array([*texts, ""], dtype=dtype)[codes]
    return array


def child_keys(items: Sequence[Any]) -> list[str]:
    """Return the parts of the paths of the items of a list, all different: text, `name`, or number."""
    names = (item if isinstance(item, str) else getattr(item, "name", None) for item in items)
    # Rerun would escape other characters in a path, or not find the path again.
    keys = (re.sub(r"[^\w.-]", "_", name) or "_" if isinstance(name, str) else None for name in names)
    return make_unique([str(i) if key is None else key for i, key in enumerate(keys)])


# Types


class TypeCodec(NamedTuple):
    """How the values of a type are written and read.

    Attributes:
        text: Name of the type, for the schema and for messages.
        accepts: Whether a value has this type; its parts are checked when they are written.
        accepts_json: Whether a JSON value has this type, likewise.
        to_json: Returns a value as JSON.
        from_json: Returns the value of JSON.
        classes: The dataclasses in it.
        is_plain: Whether it is a text, number, truth value or None.
    """

    text: str
    accepts: Callable[[Any], bool]
    accepts_json: Callable[[Any], bool]
    to_json: Callable[[Any, WriteContext], Any]
    from_json: Callable[[Any, ReadContext], Any]
    classes: tuple[type, ...] = ()
    is_plain: bool = False

    def write(self, value: Any, at: WriteContext) -> Any:
        """Return a value as JSON, or raise a `CodecError`."""
        if not self.accepts(value):
            raise field_error(at.path, value, self.text)
        return self.to_json(value, at)

    def read(self, tree: Any, at: ReadContext) -> Any:
        """Return the value of JSON, or raise a `CodecError`."""
        if not self.accepts_json(tree):
            raise field_error(at.path, tree, self.text)
        return self.from_json(tree, at)


@cache
def codec_for_type(hint: Any) -> TypeCodec:
    """Return the codec of a type.

    Raises:
        TypeError: If there is none: an error of the author of a result.
    """
    origin, inner = get_origin(hint) or hint, get_args(hint)
    if hint is Any:
        return TypeCodec("Any", lambda value: True, lambda tree: True, _any_to_json, lambda tree, at: tree)
    if hint is None or hint in (types.NoneType, str, int, float, bool):
        return _plain_codec(hint or types.NoneType)
    if hint is Path:
        return TypeCodec("Path", _is(Path), _is(str), lambda path, at: str(path), lambda text, at: Path(text))
    if isinstance(hint, type) and is_dataclass(hint):
        return _record_codec(hint)
    makers: dict[Any, Callable[[tuple[Any, ...]], TypeCodec]]
    makers = {
        Literal: _literal_codec, Union: _union_codec, types.UnionType: _union_codec, np.ndarray: _array_codec,
        list: lambda inner: _sequence_codec(list, inner[0]),
        tuple: lambda inner: _sequence_codec(tuple, inner[0]) if inner[1:] == (...,) else _tuple_codec(inner),
        dict: _mapping_codec, Mapping: _mapping_codec,
    }  # fmt: skip
    if origin not in makers:
        raise TypeError(f"found a field of type {hint}, allowed: one that `codec_for_type` knows")
    return makers[origin](inner)


def _is(*classes: type) -> Callable[[Any], bool]:
    return lambda value: isinstance(value, classes)


def _to_python(value: Any) -> Any:
    return value.item() if isinstance(value, np.generic) else value


def _codec_of_plain(text: str, accepts: Callable[[Any], bool]) -> TypeCodec:
    return TypeCodec(
        text,
        lambda value: accepts(_to_python(value)),
        accepts,
        lambda value, at: _to_python(value),
        lambda tree, at: tree,
        is_plain=True,
    )


def _plain_codec(cls: type) -> TypeCodec:
    """Return the codec of None, str, int, float or bool: an int is a float, too, a bool is no number."""
    classes = (float, int) if cls is float else (cls,)
    text = "None" if cls is types.NoneType else cls.__name__
    return _codec_of_plain(
        text, lambda value: isinstance(value, classes) and (cls is bool or not isinstance(value, bool))
    )


def _literal_codec(allowed: tuple[Any, ...]) -> TypeCodec:
    known, text = {(type(value), value) for value in allowed}, " or ".join(map(repr, allowed))
    return _codec_of_plain(
        text, lambda value: isinstance(value, (str, int)) and (type(value), value) in known
    )


def _any_to_json(value: Any, at: WriteContext) -> Any:
    if isinstance(value, Mapping):
        return {str(key): _any_to_json(item, at) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_any_to_json(item, at) for item in value]
    if isinstance(value, (np.ndarray, np.generic)):
        return value.tolist()
    if value is not None and not isinstance(value, (str, int, float, Path)):
        raise field_error(at.path, value, "what JSON can hold")
    return str(value) if isinstance(value, Path) else value


def _array_text(kinds: str) -> str:
    return f"array of {' or '.join(KINDS[kind] for kind in kinds)}"


def _array_codec(inner: tuple[Any, ...]) -> TypeCodec:
    """Return the codec of an array, by the annotations of its shape and its dtype."""
    scalar = (get_args(inner[1]) or (Any,))[0]
    kinds = "".join(KINDS) if scalar is Any else np.dtype(scalar).kind

    def accepts(value: Any) -> bool:
        return hasattr(value, "__array__") and not isinstance(value, np.generic) and value.dtype.kind in kinds

    return TypeCodec(
        _array_text(kinds),
        accepts,
        _is_reference,
        _write_array,
        lambda tree, at: _read_array(tree, kinds, at),
    )


def _sequence_codec(cls: type, hint: Any) -> TypeCodec:
    """Return the codec of a tuple or a list of any length, whose items are of one type."""
    item = codec_for_type(hint)

    def to_json(values: Sequence[Any], at: WriteContext) -> Any:
        if len(values) <= MAX_LISTED or not (item.is_plain or _is_flat(item)):
            pairs = zip(child_keys(values), values, strict=True)
            return [item.write(value, at.child(key)) for key, value in pairs]
        trees = [item.write(value, at) for value in values]
        if item.is_plain:
            return {COLUMNS: _write_column(trees, at), COUNT: len(trees)}
        columns = {name: _write_column([tree[name] for tree in trees], at.child(name)) for name in trees[0]}
        return {COLUMNS: columns, COUNT: len(trees)}

    def from_json(tree: Any, at: ReadContext) -> Any:
        if isinstance(tree, list):
            return cls(item.read(value, at.child(str(i))) for i, value in enumerate(tree))
        stored, count = tree[COLUMNS], tree.get(COUNT)
        if item.is_plain:
            return cls(_read_column(item, stored, count, at))
        codecs = field_codecs(item.classes[0]) if _is_flat(item) and isinstance(stored, dict) else {}
        known = {name: codec for name, codec in codecs.items() if name in stored}
        if not known:
            raise field_error(at.path, stored, "columns of plain values")
        columns = [_read_column(codec, stored[name], count, at.child(name)) for name, codec in known.items()]
        rows = (dict(zip(known, row, strict=True)) for row in zip(*columns, strict=True))
        return cls(_create(item.classes[0], row, at) for row in rows)

    def accepts_json(tree: Any) -> bool:
        return isinstance(tree, list) or (isinstance(tree, dict) and tree.keys() == {COLUMNS, COUNT})

    text = f"{cls.__name__}[{item.text}, ...]"
    return TypeCodec(text, _is(tuple, list), accepts_json, to_json, from_json, item.classes)


def _write_column(values: list[Any], at: WriteContext) -> Any:
    """Return many plain values as the reference to an array, if they are of one type, else as they are."""
    classes = set(map(type, values))
    if classes == {str}:
        return _write_array(np.array(values, dtype=np.object_), at)
    fits_int64 = classes == {int} and -(2**63) <= min(values) <= max(values) < 2**63
    return at.add(np.array(values), plotted=False) if fits_int64 or classes in ({float}, {bool}) else values


def _read_column(codec: TypeCodec, tree: Any, count: Any, at: ReadContext) -> list[Any]:
    """Return as many values as stated that `_write_column` wrote, each of which the codec accepts."""
    if isinstance(tree, list):
        values = tree
    else:
        array = np.asarray(_read_array(tree, "fibO", at))
        if array.ndim != 1:
            raise field_error(at.path, array.shape, "one dimension")
        values = array.tolist()
    if len(values) != count:
        raise field_error(at.path, len(values), f"{count} values")
    for value in values:
        if not codec.accepts_json(value):
            raise field_error(at.path, value, codec.text)
    return values


def _is_record(codec: TypeCodec) -> bool:
    return len(codec.classes) == 1 and codec is codec_for_type(codec.classes[0])


def _is_flat(codec: TypeCodec) -> bool:
    """Return whether a codec is that of a record of plain values."""
    return _is_record(codec) and all(part.is_plain for part in field_codecs(codec.classes[0]).values())


def _tuple_codec(hints: tuple[Any, ...]) -> TypeCodec:
    """Return the codec of a tuple with a type for each item."""
    items = tuple(map(codec_for_type, hints))

    def accepts(value: Any) -> bool:
        return isinstance(value, (list, tuple)) and len(value) == len(items)

    def to_json(value: Any, at: WriteContext) -> Any:
        return [item.write(value[i], at.child(str(i))) for i, item in enumerate(items)]

    def from_json(tree: Any, at: ReadContext) -> Any:
        return tuple(item.read(tree[i], at.child(str(i))) for i, item in enumerate(items))

    text = f"tuple[{', '.join(item.text for item in items)}]"
    return TypeCodec(text, accepts, accepts, to_json, from_json, _classes(items))


def _mapping_codec(hints: tuple[Any, ...]) -> TypeCodec:
    """Return the codec of a mapping from texts."""
    if hints[0] is not str:
        raise TypeError(f"found a mapping from {hints[0]}, allowed: from str")
    item = codec_for_type(hints[1])

    def to_json(mapping: Mapping[str, Any], at: WriteContext) -> Any:
        pairs = zip(child_keys(list(mapping)), mapping.items(), strict=True)
        return {name: item.write(value, at.child(key)) for key, (name, value) in pairs}

    def from_json(tree: Any, at: ReadContext) -> Any:
        return {name: item.read(value, at.child(name)) for name, value in tree.items()}

    return TypeCodec(f"dict[str, {item.text}]", _is(Mapping), _is(dict), to_json, from_json, item.classes)


def _record_codec(cls: Any) -> TypeCodec:
    """Return the codec of a dataclass: its fields by their names."""

    def to_json(record: Any, at: WriteContext) -> Any:
        clock, paths = getattr(record, CLOCK, None), field_paths(cls)
        codecs = field_codecs(cls).items()
        return {
            name: codec.write(getattr(record, name), at.child(paths[name], clock)) for name, codec in codecs
        }

    def from_json(tree: Any, at: ReadContext) -> Any:
        known = ((name, codec) for name, codec in field_codecs(cls).items() if name in tree)
        return _create(cls, {name: codec.read(tree[name], at.child(name)) for name, codec in known}, at)

    return TypeCodec(cls.__name__, lambda value: type(value) is cls, _is(dict), to_json, from_json, (cls,))


def _create(cls: type, values: Mapping[str, Any], at: ReadContext) -> Any:
    """Return an object of a class with the values of its fields, each of which was checked."""
    missing = [
        field.name for field in stored_fields(cls) if field.name not in values and not has_default(field)
    ]
    if missing:
        raise field_error(at.path, None, f"the field {missing[0]} of {cls.__name__}")
    try:
        return cls(**values)
    except RecordingError:  # of an array that is read when it is used
        raise
    except (UrmpipeError, ArithmeticError, AttributeError, LookupError, TypeError, ValueError) as error:
        raise CodecError(f"{at.path or '/'}: {error}") from error


def _union_codec(hints: tuple[Any, ...]) -> TypeCodec:
    """Return the codec of a union; of several dataclasses in it, each is stored with the name of its class.

    Lists of A or lists of B are stored as one list of A or B, since an empty list is both.
    """
    lists = [get_args(hint)[0] for hint in hints if get_origin(hint) is list]
    if len(lists) > 1:
        rest = [hint for hint in hints if get_origin(hint) is not list]
        return codec_for_type(Union[(*rest, list[Union[tuple(lists)]])])  # type: ignore[misc]  # noqa: UP007
    members = [codec_for_type(hint) for hint in hints]
    if sum(map(is_dataclass, hints)) > 1:
        members = [_with_class_name(member) if _is_record(member) else member for member in members]
    members.sort(key=lambda member: member.accepts_json({}))  # an object may be a long list or an array
    text = " or ".join(member.text for member in members)
    probes: tuple[Any, ...] = ("", [], {}, {ARRAY: ""})
    for probe in probes:
        if sum(member.accepts_json(probe) for member in members) > 1:
            raise TypeError(f"found a field of type {text}, allowed: what JSON tells apart")

    def to_json(value: Any, at: WriteContext) -> Any:
        return next(member for member in members if member.accepts(value)).write(value, at)

    def from_json(tree: Any, at: ReadContext) -> Any:
        return next(member for member in members if member.accepts_json(tree)).read(tree, at)

    return TypeCodec(
        text,
        lambda value: any(member.accepts(value) for member in members),
        lambda tree: any(member.accepts_json(tree) for member in members),
        to_json,
        from_json,
        _classes(members),
        is_plain=all(member.is_plain for member in members),
    )


def _with_class_name(record: TypeCodec) -> TypeCodec:
    name = record.text

    def to_json(value: Any, at: WriteContext) -> Any:
        return {CLASS: name, **record.to_json(value, at)}

    return record._replace(
        accepts_json=lambda tree: isinstance(tree, dict) and tree.get(CLASS) == name, to_json=to_json
    )


def _classes(codecs: Sequence[TypeCodec]) -> tuple[type, ...]:
    return tuple(dict.fromkeys(cls for codec in codecs for cls in codec.classes))


def stored_fields(cls: type) -> list[Field[Any]]:
    """Return the fields of a dataclass that are stored."""
    return [field for field in fields(cls) if field.init and field.metadata.get(STORED) is not False]


def has_default(field: Field[Any]) -> bool:
    """Return whether a field may be missing in JSON."""
    return field.default is not MISSING or field.default_factory is not MISSING


@cache
def field_codecs(cls: type) -> dict[str, TypeCodec]:
    """Return the codecs of the stored fields of a dataclass, by name."""
    hints = get_type_hints(cls)
    return {
        field.name: codec_for_type(field.metadata.get(STORED, hints[field.name]))
        for field in stored_fields(cls)
    }


@cache
def field_paths(cls: type) -> dict[str, str]:
    """Return the paths of the stored fields of a dataclass relative to it, by name."""
    return {field.name: field.metadata.get(PATH, field.name) for field in stored_fields(cls)}
