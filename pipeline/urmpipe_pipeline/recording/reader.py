"""Read a recording back: the result as it was, every array with every bit of it."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from urmpipe_models.errors import format_value, shell_quote
from urmpipe_pipeline.recording.codec import ArrayOf, CodecError, In, decode, form_of
from urmpipe_pipeline.recording.rows import Rows
from urmpipe_pipeline.recording.store import LAYOUT_VERSION, Store, checksum


def read_result(path: Path, kinds: Mapping[str, type], *, lazy: bool = False) -> Any:
    """Return the result of one of some named kinds that a recording holds, see `urmpipe_pipeline.results`.

    What stands inside a result comes back without the file that it once stood in. Read lazily, arrays are
    read when they are used (`Rows`).

    Raises:
        RecordingError: If it is no recording, was cut off, is not of urmpipe, or of another layout.
    """
    store = Store(path)
    document = _document(store)
    cls = kinds.get(str(document.get("kind", "")))
    if cls is None:
        raise store.error(f"found a result of kind {document.get('kind')!r}, allowed: {', '.join(kinds)}")
    try:
        result = decode(cls, document.get("result"), _reads(store, lazy, document))
    except CodecError as error:
        raise store.error(f"found damaged metadata, {error}") from error
    located = any(one.name == "recording" for one in fields(result))
    return replace(result, recording=path) if located else result


def _reads(store: Store, lazy: bool, document: Mapping[str, Any]) -> ArrayOf:
    """Return what reads the array of a path, once."""
    clocks = form_of(dict[str, str]).read(document.get("clocks"), In("/clocks", _no_array))
    checksums = form_of(dict[str, int]).read(document.get("checksums"), In("/checksums", _no_array))
    if not clocks.keys().isdisjoint(clocks.values()):
        raise CodecError(
            f"/clocks: found {format_value(clocks)}, allowed: the paths of times by those of arrays"
        )
    known: dict[tuple[str, tuple[int, ...], str], Any] = {}

    def array(at: str, shape: tuple[int, ...], dtype: np.dtype[Any]) -> Any:
        key = at, shape, dtype.str
        if key not in known:
            rows = shape or (1,)

            def read(first: int, end: int) -> NDArray[Any]:
                """Return some of the rows."""
                clock = array(clocks[at], rows[:1], np.dtype(np.int64)) if at in clocks else None
                t_ns = None if clock is None else np.asarray(clock)
                found = store.read(at, first, end, rows[1:], dtype, t_ns)
                if end - first == rows[0] and checksum(found) != checksums.get(at):
                    raise store.error(f"found other values in {at} than were written (by their checksum)")
                return found

            found = Rows(read, rows, dtype)
            known[key] = found if lazy and shape else found.whole.reshape(shape)
        return known[key]

    return array


def _no_array(at: str, shape: tuple[int, ...], dtype: np.dtype[Any]) -> Any:
    raise CodecError(f"{at}: found an array, allowed: none")


def _document(store: Store) -> dict[str, Any]:
    """Return the metadata, of the layout that is known."""
    try:
        document: dict[str, Any] = json.loads(store.metadata)
        version = document["layout_version"]
        newer = version > LAYOUT_VERSION
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise store.error(f"found damaged metadata ({error!r}), allowed: what urmpipe wrote") from error
    if version != LAYOUT_VERSION:
        who = "a newer" if newer else "an older"
        said = f"found layout version {version}, allowed: {LAYOUT_VERSION}; {who} urmpipe wrote it"
        raise store.error(f"{said}: make it again{_again(document)}")
    if store.checksum != checksum(store.metadata):
        raise store.error("found damaged metadata (by their checksum), allowed: what urmpipe wrote")
    return document


def _again(document: dict[str, Any]) -> str:
    """Return how to make a recording again: by which command, as far as its metadata tell."""
    try:
        made = document["result"]["provenance"]
        inputs = " ".join(shell_quote(one["name"]) for one in made["inputs"])
        return f": urmpipe {made['command']} {inputs} and its options"
    except (KeyError, TypeError):
        return " from what it was made of"
