"""What a file that a command wrote contains: named columns of values. Nothing of urmpipe reads it.

A column is a dict with its `kind` (of `compare_snapshots.KINDS`). A text column has the `hash` of its values,
and the `values` if they are few. A column of numbers has its `values`. An array or column of many numbers
has what stays on every machine: its `shape`, how many values are no number (`nan`), and in `figures` the
largest |a| and four projections, three of a and one of |a|: sum(s_i a_i) / sqrt(n), with signs s_i = +-1 that
never change. `times` are the figures of its times in [ns].
"""

from __future__ import annotations

import csv
import hashlib
import json
import math
import re
import xml.etree.ElementTree as ET
import zipfile
from base64 import b64decode, b64encode
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import fields, is_dataclass
from functools import cache
from html import unescape
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet
import scipy.io
from numpy.typing import NDArray

Columns = dict[str, dict[str, Any]]
MAX_LETTERS = 4000  # of a text column, from where on only its hash is kept
MAX_NUMBERS = 6  # of a column, from where on it is kept as an array: so many figures has one
DIGITS = 10  # significant ones: one more than a comparison needs

NUMBER = re.compile(r"(?<![\w.])[-+−]?\d+(?:\.\d+)?(?:e[-+]?\d+)?(?!\w)")
LOOKS = {"colors", "widths", "radii", "aggregation_policy", "markers", "marker_sizes", "xyz", "show_labels"}
# What docs/python.md names of each result; of other classes, all fields.
ATTRIBUTES = {
    "Run": "t q qd qdd tcp audit warnings log",
    "Comparison": "verdict runs ranking baseline warnings",
    "Deviation": "name t delta angle joint_delta statistics sync alignment",
    "IkResult": "q branch reasons verdict position_error path",
    "Simulation": "t signals verdicts failed",
    "Report": "path figures",
    "Exported": "path files columns",
    "Chain": "joints coordinates start",
}

# Takes out of a text what differs from run to run; `snapshot` sets it.
normal: Callable[[str], str] = str


def contents(path: Path) -> Columns:
    """Return the columns of a file by its suffix; of JSON its tree, of other text numbers and words."""
    if path.suffix in READERS:
        return READERS[path.suffix](path)
    words = path.read_text(encoding="utf-8", errors="replace")
    return tree(json.loads(words)) if words.startswith("{") else text(words)


def column(kind: str, values: Sequence[str]) -> dict[str, Any]:
    """Return a column of texts."""
    words = "\n".join(values)
    found = {"kind": kind, "n": len(values), "hash": _hash(words.encode("utf-8", "surrogatepass"))}
    return found | ({"values": list(values)} if len(words) <= MAX_LETTERS or kind == "shown" else {})


def numbers(texts: Sequence[str]) -> dict[str, Any]:
    """Return a column of numbers, some of which may be missing."""
    if len(texts) > MAX_NUMBERS:
        return array(
            np.array([math.nan if word in {"", "null"} else float(word) for word in texts]), kind="numbers"
        )
    return {
        "kind": "numbers",
        "values": [word if word in {"", "null"} else f"{float(word):.{DIGITS}g}" for word in texts],
    }


def array(
    values: NDArray[Any], times: NDArray[Any] | None = None, kind: str = "arrays", widths: str = ""
) -> dict[str, Any]:
    """Return an array with a row a time, its numbers as floats; `widths` are those of rows that differ."""
    if values.dtype.kind in "OUSM":
        return column("words", [normal(str(value)) for value in values.ravel().tolist()])
    flat = values.astype(np.float64).ravel()
    missing = int(np.count_nonzero(~np.isfinite(flat)))
    return {
        "kind": kind,
        "shape": "x".join(map(str, values.shape)) + widths,
        "nan": missing,
        "figures": _figures(np.where(np.isfinite(flat), flat, 0.0)),
    } | ({} if times is None else {"times": _figures(times.astype(np.float64))})


def _figures(flat: NDArray[np.float64]) -> list[float]:
    """Return the largest |a| and the four projections of an array."""
    if not flat.size:
        return []
    signs = _signs(1 << (flat.size - 1).bit_length())[:, : flat.size]
    figures = [np.abs(flat).max(), *(signs[:3] @ flat), signs[3] @ np.abs(flat)]
    figures[1:] = [figure / math.sqrt(flat.size) for figure in figures[1:]]
    return [float(f"{figure:.{DIGITS}g}") for figure in figures]


@cache
def _signs(count: int) -> NDArray[np.float64]:
    """Return four rows of signs, the first ones alike for every count."""
    bits = np.random.PCG64(46).random_raw(count)
    return np.where(bits[None, :] >> np.array([[60], [61], [62], [63]], np.uint64) & np.uint64(1), 1.0, -1.0)


def text(words: str) -> Columns:
    """Return a text: its numbers in any order, and its words without them."""
    words = normal(words)
    lines = [
        line.rstrip() for line in NUMBER.sub("#", words).splitlines() if not line.startswith("note: building")
    ]
    return {"numbers": column("shown", sorted(NUMBER.findall(words))), "words": column("words", lines)}


def tree(value: Any, name: str = "") -> Columns:
    """Return the leaves of a tree of mappings, lists, dataclasses and arrays: a column a key."""
    return _grouped(
        (
            at,
            one
            if isinstance(one, np.ndarray)
            else json.dumps(normal(one) if isinstance(one, str) else one, ensure_ascii=False),
        )
        for at, one in _leaves(value, name)
    )


def _leaves(value: Any, at: str) -> Iterator[tuple[str, Any]]:
    """Yield the leaves in their order, their names without indices."""
    names = ATTRIBUTES.get(type(value).__name__, "").split()
    if is_dataclass(value):
        value = {
            one: getattr(value, one)
            for one in names or [one.name for one in fields(value)]
            if hasattr(value, one)
        }
    elif isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, Mapping):
        for key, one in value.items():
            yield from _leaves(one, f"{at}.{key}")
    elif isinstance(value, list | tuple):
        yield f"{at}.len", len(value)
        for one in value:
            yield from _leaves(one, f"{at}[]")
    else:
        plain = value is None or isinstance(value, np.ndarray | bool | int | float | str)
        yield at, value if plain else str(value) if isinstance(value, Path) else type(value).__name__


def _grouped(pairs: Iterable[tuple[str, Any]]) -> Columns:
    """Return a column for each name, and one for each array."""
    texts: dict[str, list[str]] = defaultdict(list)
    found: Columns = {}
    for name, value in pairs:
        if isinstance(value, np.ndarray):
            found[f"{name} #{sum(one.startswith(f'{name} #') for one in found)}"] = array(value)
        else:
            texts[name].append(value)
    return found | {name: _texts(name, some) for name, some in texts.items()}


def _texts(name: str, some: list[str]) -> dict[str, Any]:
    if name == ".size":  # of a file that has the texts of modules
        return column("shown", some)
    return numbers(some) if all(map(_is_number, some)) and set(some) - {"", "null"} else column("words", some)


def _is_number(word: str) -> bool:
    return (
        word in {"", "null"}
        or re.fullmatch(r"[-+]?(\d[\d.]*(e[-+]?\d+)?|nan|inf(inity)?)", word, re.IGNORECASE) is not None
    )


def _table(path: Path) -> Columns:
    """Return the columns of a CSV, or those of a TUM, which has no names."""
    with path.open(encoding="utf-8", newline="") as file:
        rows = (
            list(csv.reader(file))
            if path.suffix == ".csv"
            else [line.split() for line in file if not line.startswith("#")]
        )
    names = rows.pop(0) if path.suffix == ".csv" and rows else ["" for _ in max(rows, key=len, default=[])]
    cells = (
        (f"{name} #{k}", normal(row[k]) if k < len(row) else "")
        for row in rows
        for k, name in enumerate(names)
    )
    return {"names": column("words", names)} | _grouped(cells)


def _xml(path: Path) -> Columns:
    return _elements(ET.parse(path))


def _elements(read: ET.ElementTree[Any]) -> Columns:
    """Return the attributes and texts of an XML file; its properties by their names."""
    pairs: list[tuple[str, str]] = []
    for one in read.iter():
        named = (
            {one.attrib["name"]: one.attrib["value"]}
            if one.tag == "property"
            else one.attrib | {"text": (one.text or "").strip()}
        )
        pairs += [(f"{one.tag}.{key}", normal(value)) for key, value in named.items()]
    return _grouped(pairs)


def _parquet(path: Path) -> Columns:
    read = pyarrow.parquet.read_table(path)
    about = {
        key.decode(): value.decode("utf-8", "replace") for key, value in (read.schema.metadata or {}).items()
    }
    about.pop("ARROW:schema", None)
    return {name: array(read.column(name).to_numpy()) for name in read.column_names} | tree(about, "about")


def _mat(path: Path) -> Columns:
    read = scipy.io.loadmat(path, simplify_cells=True)
    return tree({name: value for name, value in read.items() if not name.startswith("__")})


def _page(path: Path) -> Columns:
    """Return the visible numbers and words of a page or a drawing, and the arrays that its figures draw."""
    source = path.read_text(encoding="utf-8")
    specs = re.findall(r'<script type="application/json">(.*?)</script>', source, re.DOTALL)
    traces = [tree(json.loads(spec, object_hook=_unpacked)["data"]) for spec in specs]
    drawn = {
        f"trace {k} {name}": one | {"kind": "traces"}
        for k, found in enumerate(traces)
        for name, one in found.items()
        if "figures" in one
    }
    seen = re.sub(r"<(script|style|head)\b.*?</\1>|<[^>]*>", "\n", source, flags=re.DOTALL)
    words = text(re.sub(r"\s*\n\s*", "\n", unescape(seen)))
    return drawn | words


def _fmu(path: Path) -> Columns:
    """Return the model description of an FMU: its attributes in their order."""
    with zipfile.ZipFile(path) as archive, archive.open("modelDescription.xml") as file:
        return _elements(ET.parse(file))


def _unpacked(value: dict[str, Any]) -> Any:
    """Return an array that is packed for plotly.js unpacked, and any other object as it is."""
    if "bdata" not in value:
        return value
    values = np.frombuffer(b64decode(value["bdata"]), value["dtype"])
    return values.reshape([int(one) for one in str(value.get("shape", values.size)).split(",")])


def _recording(path: Path) -> Columns:
    """Return every component of every entity, whatever the layout, in the order of time."""
    from rerun.chunk import RrdReader

    reader = RrdReader(path)
    parts: dict[str, list[tuple[NDArray[Any], NDArray[Any], NDArray[Any]]]] = defaultdict(list)
    for chunk in (chunk for entry in reader.recordings() for chunk in reader.store(store=entry).stream()):
        batch = chunk.to_record_batch()
        clock = next((name for name in ("t", "row") if name in batch.schema.names), None)
        t = batch.column(clock).cast("int64").to_numpy() if clock else np.zeros(len(batch), np.int64)
        for about, cells in zip(batch.schema, batch.columns, strict=True):
            if about.metadata[b"rerun:kind"] == b"data" and about.name != "metadata":
                there = cells.is_valid().to_numpy(zero_copy_only=False)
                name = f"{chunk.entity_path} {about.name}"
                if name.endswith(" checksum"):  # of bytes, which hold the time of writing
                    continue
                parts[name].append((t[there], *_flat(cells.drop_null())))
    return {name: _joined(name, some) for name, some in parts.items() if any(part[2].size for part in some)}


def _flat(cells: Any) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return how many values each row has, and all of them, of lists of lists."""
    bounds = np.arange(len(cells) + 1)
    while hasattr(cells.type, "value_type"):
        size = getattr(cells.type, "list_size", None)
        bounds = bounds * size if size else (cells.offsets.to_numpy() - cells.offsets[0].as_py())[bounds]
        cells = cells.flatten()
    return np.diff(bounds), cells.to_numpy(zero_copy_only=False)


def _joined(name: str, parts: list[tuple[NDArray[Any], NDArray[Any], NDArray[Any]]]) -> dict[str, Any]:
    """Return the parts of a component as one array, ordered by time."""
    t, widths, values = (np.concatenate([part[k] for part in parts]) for k in range(3))
    order = np.argsort(t, kind="stable")
    rows = np.split(values, np.cumsum(widths)[:-1])
    values = np.concatenate([rows[k] for k in order]) if len(order) else values
    component = name.rpartition(":")[2]
    kind = "looks" if component in LOOKS else "scene"
    if component in {"scalars", "packed"} and not name.startswith("/shown"):  # what is shown is thinned
        kind = "arrays"
    if len(np.unique(widths)) == 1 and widths[0]:
        return array(values.reshape(len(t), -1), t[order], kind)
    return array(values, t[order], kind, f" widths {_hash(widths[order].tobytes())}")


def _hash(data: bytes) -> str:
    return b64encode(hashlib.sha256(data).digest())[:8].decode()


READERS: Mapping[str, Callable[[Path], Columns]] = {
    ".csv": _table,
    ".tum": _table,
    ".xml": _xml,
    ".parquet": _parquet,
    ".mat": _mat,
    ".html": _page,
    ".svg": _page,
    ".rrd": _recording,
    ".fmu": _fmu,
    ".columns": lambda path: json.loads(path.read_text()),
}
