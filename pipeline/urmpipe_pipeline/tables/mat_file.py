"""MATLAB's MAT (version 5), which MATLAB, Octave and SciPy load: one struct by the result's kind."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from urmpipe_models.errors import Finding, Hint, OutputError
from urmpipe_pipeline.outputs import EXPORT_HEADER
from urmpipe_pipeline.subprocess_reader import mark_safe

DESCRIPTION = 116
"""Bytes at the start of a MAT file that are free text."""

LARGEST = 2**31 - 1
"""Bytes that a variable of version 5 may have."""


def write_mat(name: str, fields: Mapping[str, Any], path: Path, target: Path) -> list[str]:
    """Write one struct and return how the file differs from it, read back.

    Raises:
        OutputError: If it is larger than the format allows.
    """
    from scipy.io import savemat

    struct = {key: _for_matlab(value) for key, value in fields.items()}
    size = _size(struct)
    if size > LARGEST:
        allowed = f"{LARGEST} in a MAT file of version 5"
        hint = Hint("to", "parquet", "takes all")
        raise OutputError(Finding(file=str(target), found=f"{size} bytes", allowed=allowed, hints=(hint,)))
    savemat(path, {name: struct}, appendmat=False, oned_as="column", long_field_names=True)
    with path.open("r+b") as file:
        file.write(f"MATLAB 5.0 MAT-file, {EXPORT_HEADER}".encode().ljust(DESCRIPTION))
    found = differences(name, struct, path)
    mark_safe(path)
    return found


def cells(items: Sequence[Any]) -> np.ndarray[tuple[int, int], np.dtype[np.object_]]:
    """Return n texts, numbers or structs as a row of MATLAB's cells [-], shape (1, n)."""
    row = np.empty((1, len(items)), dtype=object)
    for k, item in enumerate(items):
        row[0, k] = item
    return row


def _for_matlab(value: Any) -> Any:
    """Return a value with its lists as rows of cells, at every depth, and its arrays read."""
    if isinstance(value, Mapping):
        return {key: _for_matlab(one) for key, one in value.items()}
    if isinstance(value, list):
        return cells([_for_matlab(one) for one in value])
    return np.asarray(value) if hasattr(value, "__array__") else value


def _size(value: Any) -> int:
    """Return the bytes of all numbers below a value."""
    if isinstance(value, Mapping):
        return sum(map(_size, value.values()))
    if isinstance(value, np.ndarray) and value.dtype == object:
        return sum(map(_size, value.ravel()))
    return value.nbytes if isinstance(value, np.ndarray) else 0


def differences(name: str, fields: Mapping[str, Any], path: Path) -> list[str]:
    """Return the places of a struct that a file holds otherwise: texts, shapes, first and last rows."""
    from scipy.io import loadmat

    found = loadmat(path, appendmat=False, struct_as_record=False, variable_names=[name])
    return list(_different(name, dict(fields), found[name]))


def _different(place: str, wanted: Any, found: Any) -> Iterator[str]:
    """Yield the places that read back otherwise: structs and cells in depth, arrays by shape and ends."""
    if isinstance(wanted, dict):
        struct = found.item()
        for key, value in wanted.items():
            yield from _different(f"{place}.{key}", value, getattr(struct, key))
    elif isinstance(wanted, np.ndarray) and wanted.dtype == object:
        if wanted.shape != found.shape:
            yield place
            return
        for k, (one, other) in enumerate(zip(wanted.ravel(), found.ravel(), strict=True), start=1):
            yield from _different(f"{place}{{{k}}}", one, other)
    elif isinstance(wanted, np.ndarray):
        if not _same_ends(wanted, found):
            yield place
    elif (found.item() if found.size else "") != wanted:
        yield place


def _same_ends(wanted: Any, found: Any) -> bool:
    """Tell whether two arrays have the same shape (a vector as a column) and the same first and last row."""
    if (wanted.shape if wanted.ndim > 1 else (len(wanted), 1)) != found.shape:
        return False
    found = found.reshape(wanted.shape)
    ends = (0, -1) if len(wanted) else ()
    return all(np.array_equal(wanted[k], found[k], equal_nan=wanted.dtype.kind == "f") for k in ends)
