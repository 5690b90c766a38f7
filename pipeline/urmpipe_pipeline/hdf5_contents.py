"""The contents of an HDF5 file, for `file_contents`: variables of MATLAB or Octave, or datasets.

- MATLAB (MAT 7.3): a variable is a dataset or a group with the attribute `MATLAB_class`. Arrays are stored by
  columns, so their axes are reversed; cells, and fields of arrays of structs, are references.
- Octave (`save -hdf5`): a variable is a group of `type` and `value`.
- pandas (`to_hdf`): blocks of columns with datasets of their names, or a table of PyTables.
- Others: datasets of numbers or texts with one or two axes. Images, long lists and objects are not read.
"""

from __future__ import annotations

import pickletools
from collections.abc import Callable, Iterator, Mapping
from typing import Any, NamedTuple, TypeAlias

import h5py
import numpy as np

from urmpipe_pipeline.array_choice import (
    OPAQUE,
    Choice,
    Name,
    Question,
    choose_arrays,
    find_episodes,
    pick_episode,
)

Array: TypeAlias = np.ndarray[Any, np.dtype[Any]]

MAX_ENTRIES = 500  # columns of a dataset of a log; packed images have more
MAX_LISTED = 9  # episodes of which a question states the rows
MAX_DEPTH = 16  # structs in structs


class Contents(NamedTuple):
    """What was read of a file.

    Attributes:
        variables: Variables of MATLAB or Octave, structs as dictionaries; None of other files.
        choice: The arrays of the table, or the question which they are.
        columns: Name, unit and values of each column.
        scalars: Single numbers by name, also those of attributes.
        not_read: Name and shape of each dataset that is no column.
        size: Bytes that the arrays unpack to; if more than allowed, none of them is read.
    """

    variables: dict[str, Any] | None = None
    choice: Choice | Question | None = None
    columns: tuple[tuple[Name, str, Array], ...] = ()
    scalars: Mapping[str, float] = {}
    not_read: tuple[tuple[str, tuple[int, ...]], ...] = ()
    size: int = 0


def read_contents(path: str, most: int, episode: str | None, topic: str | None) -> Contents:
    """Return the contents of a file.

    Args:
        path: The file.
        most: The bytes that its arrays may unpack to.
        episode: The episode to read; None: the only one.
        topic: The array or group to read; None: the only length.
    """
    with h5py.File(path, "r") as file:
        members = [file[name] for name in file if isinstance(file.get(name, getlink=True), h5py.HardLink)]
        if any("MATLAB_class" in item.attrs for item in members):
            return _read_variables(file, most, _of_matlab)
        if members and all("OCTAVE_NEW_FORMAT" in item.attrs for item in members):
            return _read_variables(file, most, _of_octave)
        return _read_datasets(file, most, episode, topic)


# 1. Variables of MATLAB and Octave


def _read_variables(file: Any, most: int, read: Callable[[Any, int], Any]) -> Contents:
    items: list[Any] = []  # links to other places and files are not followed
    file.visititems(lambda _, item: items.append(item))
    arrays = (item for item in items if isinstance(item, h5py.Dataset) and len(item.shape or ()) <= 3)
    size = sum(item.nbytes for item in arrays)
    if size > most:
        return Contents(size=size)
    return Contents({name: read(file[name], 0) for name in file if not name.startswith("#")}, size=size)


def _of_matlab(node: Any, depth: int) -> Any:
    """Return a variable of MATLAB as SciPy returns those of MAT 5: squeezed, structs as dictionaries."""
    kind = bytes(node.attrs.get("MATLAB_class", b"")).decode(errors="replace")
    if depth > MAX_DEPTH or "MATLAB_sparse" in node.attrs or len(getattr(node, "shape", None) or ()) > 3:
        return None
    if isinstance(node, h5py.Dataset) and kind in _MATLAB:
        empty = node.attrs.get("MATLAB_empty", 0)
        return ("" if kind == "char" else np.empty(0)) if empty else _MATLAB[kind](node, depth)
    if isinstance(node, h5py.Dataset) or kind not in ("struct", ""):
        return (OPAQUE, kind)
    if len(node) and all(_refers(item) and "MATLAB_class" not in item.attrs for item in node.values()):
        return _structs({name: _cells(item, depth) for name, item in node.items()})
    return {name: _of_matlab(item, depth + 1) for name, item in node.items()}


def _refers(node: Any) -> bool:
    return isinstance(node, h5py.Dataset) and h5py.check_ref_dtype(node.dtype) is not None


def _cells(node: Any, depth: int) -> list[Any]:
    """Return the values that references point to, in MATLAB's order: by columns, as they are stored."""
    references = node[()].ravel() if _refers(node) else ()
    return [_of_matlab(node.file[reference], depth + 1) for reference in references]


def _structs(cells: Mapping[str, list[Any]]) -> list[dict[str, Any]]:
    """Return an array of structs, of which each field is given as a list."""
    return [dict(zip(cells, row, strict=True)) for row in zip(*cells.values(), strict=True)]


def _of_octave(node: Any, depth: int) -> Any:
    """Return a variable of Octave, as `_of_matlab` does."""
    kind, value = bytes(node["type"][()]).decode(errors="replace"), node["value"]
    if depth > MAX_DEPTH:
        return None
    if isinstance(value, h5py.Dataset):
        return np.empty(0) if "OCTAVE_EMPTY_MATRIX" in node.attrs else _octave_array(kind, value)
    inner = {name: _of_octave(item, depth + 1) for name, item in value.items() if name != "dims"}
    if kind == "cell":
        return [inner[name] for name in sorted(inner, key=lambda name: int(name[1:]))]
    return _structs(inner) if kind == "struct" else inner


def _octave_array(kind: str, value: Any) -> Any:
    if kind in ("string", "sq_string"):
        return _texts(value, "utf-8")
    if kind.endswith("range"):
        first, last, step = value[()].item()
        return np.minimum(first + np.arange(int(value.attrs["OCTAVE_RANGE_NELEM"])) * step, last)
    return _squeezed(value)


def _squeezed(stored: Any) -> Any:
    """Return numbers in the order of their program: with reversed axes, without axes of length 1."""
    if stored.dtype.names or len(stored.shape) > 3:  # complex numbers; images
        return None
    values = np.squeeze(stored[()].T)
    return values.item() if values.ndim == 0 else values


def _texts(stored: Any, encoding: str) -> Any:
    """Return the rows of an array of letters as a text, or as several."""
    rows = [row.tobytes().decode(encoding, errors="replace") for row in np.atleast_2d(stored[()].T)]
    return rows[0] if len(rows) == 1 else rows


_MATLAB: dict[str, Callable[[Any, int], Any]] = {
    **{f"{sign}int{bits}": lambda node, _: _squeezed(node) for sign in ("", "u") for bits in (8, 16, 32, 64)},
    **dict.fromkeys(("double", "single", "logical"), lambda node, _: _squeezed(node)),
    "char": lambda node, _: _texts(node, "utf-16-le"),
    "cell": _cells,
}


# 2. Datasets


def _read_datasets(file: Any, most: int, episode: str | None, topic: str | None) -> Contents:
    """Return the columns of datasets: those of one table."""
    paths = _leaves(file)
    unopened = _other_episodes(paths, episode)
    opened = {name: file["/".join(name)] for name in paths if name not in unopened}
    frames = {name[:-1]: _is_frame(item.parent) for name, item in opened.items()}
    datasets = {
        name: item
        for name, item in opened.items()
        if isinstance(item, h5py.Dataset)
        and not (_repeats(name, opened) or _describes(item, frame=frames[name[:-1]]))
    }
    columns = {name: item for name, item in datasets.items() if _is_column(item)}
    shapes = {name: item.shape for name, item in columns.items()} | dict.fromkeys(unopened, (0,))
    choice = choose_arrays(shapes, episode, topic, separator="/", by_rows=True)
    group, rows, names = choice[:3] if isinstance(choice, Choice) else ((), 1, ())
    used = [name for name in names if columns[name].size <= MAX_ENTRIES * rows]
    unused = (name for name in datasets if name[: len(group)] == group and name not in used)
    arrays = (("/".join(name), datasets[name].shape) for name in unused if datasets[name].shape)
    contents = Contents(choice=choice, not_read=tuple(arrays))
    size = sum(columns[name].nbytes for name in used)
    if isinstance(choice, Question) or size > most:
        return contents._replace(size=size)
    depth = len(group)
    read = [column for name in used for column in _iter_columns(name[depth:], columns[name], rows)]
    groups = [file, *(file["/".join(group[: k + 1])] for k in range(depth))]
    single = {name[-1]: item[()] for name, item in datasets.items() if name[:-1] == group and item.size == 1}
    single |= {name: value for item in groups for name, value in item.attrs.items()}
    values = ((name, np.asarray(value)) for name, value in single.items())
    scalars = {name: value.item() for name, value in values if value.size == 1 and value.dtype.kind in "iuf"}
    return contents._replace(columns=tuple(read), scalars=scalars, size=size)


def _is_column(dataset: Any) -> bool:
    """Return whether a dataset has numbers or texts of a log: one or two axes, few entries per row."""
    if _is_text(dataset) or dataset.dtype.names:
        return len(dataset.shape or ()) == 1
    axes = len(dataset.shape or ())
    return dataset.dtype.kind in "biuf" and (axes == 1 or (axes == 2 and _is_narrow(dataset)))


def _leaves(file: Any) -> list[Name]:
    """Return the paths that contain no others, of datasets or empty groups; links are not followed."""
    paths: list[str] = []
    file.visit(paths.append)
    names = [tuple(path.split("/")) for path in paths]
    groups = {name[:-1] for name in names}
    return [name for name in names if name not in groups]


def _other_episodes(names: list[Name], episode: str | None) -> set[Name]:
    """Return the paths that need not be opened: of episodes that are not read, nor shown in the question."""
    groups = find_episodes(dict.fromkeys(names, (0,)))
    chosen = pick_episode(groups, episode)
    needed = [chosen] if chosen else list(groups)[:MAX_LISTED]
    left_out = {groups[name] for name in groups if name not in needed}
    depth = len(next(iter(left_out), ()))
    return {name for name in names if left_out and name[:depth] in left_out}


def _is_frame(group: Any) -> bool:
    """Return whether pandas wrote a group with blocks of columns."""
    return bool(group.attrs.get("pandas_type") == b"frame")


def _describes(dataset: Any, *, frame: bool) -> bool:
    """Return whether a dataset of pandas or PyTables is no column: names of columns, a count, an index."""
    if not frame:
        return "/_i_" in dataset.name
    counts = dataset.attrs.get("kind") == b"integer" and dataset.attrs.get("name") == b"N."
    return not _last_name(dataset).endswith("_values") and (_last_name(dataset) != "axis1" or counts)


def _is_narrow(dataset: Any) -> bool:
    """Return whether an array may have one row or one column per sample; packed images have long rows."""
    high, wide = dataset.shape
    return bool(wide <= MAX_ENTRIES or (high <= MAX_ENTRIES and dataset.dtype != np.uint8))


def _is_text(dataset: Any) -> bool:
    return h5py.check_string_dtype(dataset.dtype) is not None


def _last_name(dataset: Any) -> str:
    return str(dataset.name).rpartition("/")[2]


def _repeats(name: Name, datasets: Mapping[Name, Any]) -> bool:
    """Return whether a dataset repeats another one row later: robomimic writes `next_obs` next to `obs`."""
    return "next_obs" in name and tuple("obs" if part == "next_obs" else part for part in name) in datasets


def _iter_columns(name: Name, dataset: Any, rows: int) -> Iterator[tuple[Name, str, Array]]:
    """Yield the columns of a dataset: NAME, NAME[0], NAME[1], ..., or GROUP/LABEL where labels are known."""
    if _is_text(dataset):
        yield name, "", dataset.asstr(errors="replace")[()]
        return
    values, attributes = dataset[()], dataset.attrs
    if values.dtype.names:
        for field in values.dtype.names:
            field_values = values[field]
            counts = field == "index" and attributes.get("index_kind") == b"integer"
            if field_values.dtype.kind == "S":
                yield (*name, field), "", np.char.decode(field_values, "utf-8", "replace").astype(object)
            elif field_values.dtype.kind in "biuf" and field_values.ndim <= 2 and not counts:
                labels = _pickled_texts(attributes.get(f"{field}_kind"))
                yield from _spread((*name, field), field_values, name, labels, [])
        return
    values = values.reshape(rows, -1) if values.shape[0] in (1, rows) else values.T
    units = next((texts for key in ("unit", "units") if (texts := _texts_of(attributes.get(key)))), [])
    if _is_frame(dataset.parent):
        kind = bytes(attributes.get("kind", b"")).decode()
        if kind:  # the index
            label = bytes(attributes["name"]).decode().replace("N.", "time")
            units = [kind[11:-1] or "ns"] if kind.startswith("datetime64") else []
            yield (*name[:-1], label), "".join(units), np.ascontiguousarray(values[:, 0])
            return
        labels = _texts_of(dataset.parent[_last_name(dataset).replace("_values", "_items")][()])
        yield from _spread(name, values, name[:-1], labels, units)
    else:
        named = (_texts_of(attributes.get(key)) for key in attributes if key not in ("unit", "units"))
        labels = next((texts for texts in named if len(texts) == values.shape[1] > 1), [])
        yield from _spread(name, values, name, labels, units)


def _spread(
    name: Name, values: Array, group: Name, labels: list[str], units: list[str]
) -> Iterator[tuple[Name, str, Array]]:
    """Yield the columns of an array of shape (n,) or (n, k): NAME[0], ..., or GROUP/LABEL, with units."""
    matrix = values.reshape(len(values), -1)
    count = matrix.shape[1]
    names = [name] if count == 1 else [(*name[:-1], f"{name[-1]}[{k}]") for k in range(count)]
    names = [(*group, label) for label in labels] if len(labels) == count else names
    units = units if len(units) == count else units[:1] * count or [""] * count
    for column, field_values, unit in zip(matrix.T, names, units, strict=True):
        yield field_values, unit, np.ascontiguousarray(column)


def _texts_of(value: Any) -> list[str]:
    """Return the texts of an attribute or array; an empty list if it contains anything else."""
    if not isinstance(value, (str, bytes, np.ndarray, np.generic)):
        return []
    texts = [
        item.decode(errors="replace") if isinstance(item, bytes) else item
        for item in np.ravel(value).tolist()
    ]
    return texts if all(isinstance(item, str) for item in texts) else []


def _pickled_texts(value: Any) -> list[str]:
    """Return the texts in a pickle, the names that pandas keeps of a block of columns. It is not loaded."""
    if not isinstance(value, bytes):
        return []
    try:
        return [str(text) for kind, text, _ in pickletools.genops(value) if "UNICODE" in kind.name]
    except ValueError:
        return []
