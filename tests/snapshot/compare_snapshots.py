"""Say what differs: python tests/snapshot/compare_snapshots.py BEFORE AFTER [--cases PATTERN] [--all].

Each is a folder of `snapshot.py`, or a file that its --net wrote (net.json: no texts, but their hashes).
Numbers and projections of arrays agree within |a - b| <= 1e-9 max |a| + 1e-12: two processors differ by less.
Differences are sorted by meaning; equal ones of several cases are listed once. Exit code 1: something that
must stay differs, or is gone.
"""

from __future__ import annotations

import argparse
import json
import re
import sys
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Sequence
from difflib import SequenceMatcher
from fnmatch import fnmatch
from pathlib import Path
from typing import Any

Column = dict[str, Any]
Case = dict[str, Column]
Difference = tuple[str, str, str]  # its kind, what differs (with the same name in all cases), and how

KINDS = {
    "verdicts": "EXIT CODES, VERDICTS, KINDS OF WARNINGS (must stay)",
    "numbers": "NUMBERS of JSON, JUnit, CSV, exports, attributes (must stay)",
    "arrays": "ARRAYS of recordings, exports, attributes: changed or lost (must stay)",
    "times": "TIMES of arrays (must stay)",
    "scene": "WHAT IS DRAWN IN SPACE and lists of other components: changed or lost",
    "traces": "TRACES of reports",
    "shown": "NUMBERS SHOWN in reports and texts, in any order",
    "keys": "KEYS renamed, lost, new",
    "entities": "ARRAYS RENAMED, regrouped, new",
    "words": "WORDS",
    "looks": "COLOURS, WIDTHS, RADII",
    "cases": "CASES",
}
MUST_STAY = ("verdicts", "numbers", "arrays", "times")
JUDGED = re.compile(r"^exits$|verdict|warnings\[\]\.kind|reached|failure|failed|as_expected")
# Where a transmission is extreme or zero: rounding decides between equal samples, and at the end of a motion.
UNSTABLE = re.compile(r"\.transmission\[\]\.(dead_points|smallest_at|largest_at)")
DRAWN = ("scene", "traces", "looks")
RELATIVE, ABSOLUTE = 1e-9, 1e-12


def load(path: Path) -> dict[str, Case]:
    """Return the cases of a snapshot by name."""
    if path.is_file():
        return unpack(json.loads(path.read_bytes()))
    return {file.stem: json.loads(file.read_bytes()) for file in sorted((path / "cases").glob("*.json"))}


def pack(cases: dict[str, Case]) -> str:
    """Return a snapshot as JSON: names and times that several files share once, drawings as sums."""
    names: dict[str, int] = {}
    layouts: dict[str, int] = {}
    times: dict[str, int] = {}
    lines = []
    for case, columns in sorted(cases.items()):
        files: dict[str, Case] = defaultdict(dict)
        for name, column in columns.items():
            file, _, key = name.rpartition("|")
            files[file][key] = column
        packed = {}
        for file, some in files.items():
            kept = {key: column for key, column in some.items() if column["kind"] not in DRAWN}
            if len(kept) < len(some):
                kept |= {f"all {kind}": _sums(kind, some.values()) for kind in DRAWN}
            layout = [names.setdefault(f"{column['kind']} {key}", len(names)) for key, column in kept.items()]
            values = [_packed(column, times) for column in kept.values()]
            packed[file] = [layouts.setdefault(json.dumps(layout), len(layouts)), *values]
        lines.append(f"{json.dumps(case)}: {json.dumps(packed, separators=(',', ':'))}")
    rows = (",\n".join(some) for some in (map(json.dumps, names), layouts, times, lines))
    return '{{"names": [\n{}],\n"layouts": [\n{}],\n"times": [\n{}],\n"cases": {{\n{}}}}}\n'.format(*rows)


def _sums(kind: str, columns: Iterable[Column]) -> Column:
    """Return the sums of the figures of a file's arrays of one kind: in whichever order they come."""
    arrays = [column for column in columns if column["kind"] == kind and column.get("figures")]
    sums = [sum(figures) for figures in zip(*(array["figures"] for array in arrays), strict=True)]
    return {
        "kind": kind,
        "shape": len(arrays),
        "nan": sum(array["nan"] for array in arrays),
        "figures": [float(f"{value:.10g}") for value in sums],
    }


def _packed(column: Column, times: dict[str, int]) -> str | list[Any]:
    """Return the hash of a text, the values of numbers, or what is kept of an array."""
    if "figures" in column:
        kept = [column["shape"], column["nan"], column["figures"]]
        at = [times.setdefault(json.dumps(column["times"]), len(times))] if "times" in column else []
        return [*kept, *at]
    return str(column["hash"]) if "hash" in column else " ".join(value or "-" for value in column["values"])


def unpack(net: dict[str, Any]) -> dict[str, Case]:
    """Return the cases of a packed snapshot."""
    cases: dict[str, Case] = {}
    for case, files in net["cases"].items():
        cases[case] = {}
        for file, (layout, *values) in files.items():
            for index, value in zip(net["layouts"][layout], values, strict=True):
                kind, _, key = net["names"][index].partition(" ")
                column: Column = {"kind": kind}
                if isinstance(value, list):
                    column |= dict(zip(("shape", "nan", "figures"), value, strict=False))
                    column |= {"times": net["times"][value[3]]} if len(value) > 3 else {}
                elif kind == "numbers":
                    column["values"] = ["" if word == "-" else word for word in value.split(" ")]
                else:
                    column["hash"] = value
                cases[case][f"{file}|{key}" if file else key] = column
    return cases


def differences(before: Case, after: Case) -> Iterator[Difference]:
    """Yield what differs between a case and the same case later."""
    new = sorted(after.keys() - before.keys())
    for name, column in before.items():
        found = name if name in after else _renamed(name, column, new, after)
        if found is None:
            yield _kind(name, column), name, f"LOST, {_shown(column)}"
            continue
        other = after[found]
        if found != name:
            new.remove(found)
            yield _moved(name, column), f"{name} -> {found.partition('|')[2]}", "renamed"
        if not same(column, other):
            yield _kind(name, column), name, _how(column, other)
        elif not _near(column.get("times", []), other.get("times", [])):
            yield "times", name, "its values have other times"
    yield from ((_moved(name, after[name]), name, "new") for name in new)


def same(one: Column, other: Column) -> bool:
    """Return whether two columns hold the same, numbers within the tolerance."""
    if one["kind"] != other["kind"] or one.get("hash") != other.get("hash"):
        return False
    if "figures" in one and "figures" in other:
        return (one["shape"], one["nan"]) == (other["shape"], other["nan"]) and _near(
            one["figures"], other["figures"]
        )
    if "hash" in one:
        return True
    return "values" in one and "values" in other and _same_numbers(one["values"], other["values"])


def _same_numbers(some: list[str], others: list[str]) -> bool:
    empty = {"", "null"}
    if [word in empty for word in some] != [word in empty for word in others]:
        return False
    a, b = ([float(word) for word in words if word not in empty] for words in (some, others))
    finite = [[value for value in values if abs(value) < float("inf")] for values in (a, b)]
    odd = [[str(value) for value in values if not abs(value) < float("inf")] for values in (a, b)]
    return odd[0] == odd[1] and _near(*finite)


def _near(some: Sequence[float], others: Sequence[float]) -> bool:
    """Return whether numbers agree within the tolerance, relative to the largest."""
    allowed = RELATIVE * max(map(abs, some), default=0.0) + ABSOLUTE
    return len(some) == len(others) and all(abs(a - b) <= allowed for a, b in zip(some, others, strict=True))


def _renamed(name: str, column: Column, new: list[str], after: Case) -> str | None:
    """Return which new column of the same file holds the same: of several that with the most similar name."""
    candidates = [key for key in new if _file(key) == _file(name) and same(column, after[key])]
    return max(candidates, key=lambda key: SequenceMatcher(None, name, key).ratio(), default=None)


def _moved(name: str, column: Column) -> str:
    """Return what it means that a column is new or has another name."""
    if column["kind"] == "looks":
        return "looks"
    return "entities" if _file(name).endswith(".rrd") else "keys"


def _kind(name: str, column: Column) -> str:
    """Return what a change of a column means."""
    if UNSTABLE.search(name):
        return "shown"
    return "verdicts" if JUDGED.search(name) and "shape" not in column else str(column["kind"])


def _file(name: str) -> str:
    return name.partition("|")[0]


def _shown(column: Column) -> str:
    if "figures" in column:
        return f"shape {column['shape']}"
    return " ".join(column.get("values", [])[:3])[:60]


def _how(one: Column, other: Column) -> str:
    """Return the first values that differ, or of those in any order which are gone and new."""
    if "figures" in one and "figures" in other:
        pairs = zip(one["figures"], other["figures"], strict=False)
        change = max((abs(a - b) for a, b in pairs), default=0.0)
        largest = one["figures"][0] if one["figures"] else 0.0
        return (
            f"{one['shape']} -> {other['shape']}, changed by {change:.2g} where the largest is {largest:.4g}"
        )
    if "values" not in one or "values" not in other:
        return "hash differs"
    a: list[str] = one["values"]
    b: list[str] = other["values"]
    if one["kind"] == "shown":
        gone, new = list((Counter(a) - Counter(b)).elements()), list((Counter(b) - Counter(a)).elements())
        return f"{len(gone)} gone: {' '.join(gone[:8])}; {len(new)} new: {' '.join(new[:8])}"
    was, now = next(
        ((x, y) for x, y in zip(a, b, strict=False) if x != y), (f"{len(a)} values", f"{len(b)} values")
    )
    return f"{was} -> {now}"


def main() -> int:
    """Compare two snapshots, print what differs, and return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("before", type=Path)
    parser.add_argument("after", type=Path)
    parser.add_argument("--cases", default="*", help="names of cases, as ik.*")
    parser.add_argument(
        "--all", action="store_true", help="list every difference, not the first 15 of a kind"
    )
    options = parser.parse_args()
    paths = (options.before, options.after)
    reduced = any(path.is_file() for path in paths)
    before, after = (
        unpack(json.loads(pack(load(path)))) if reduced and path.is_dir() else load(path) for path in paths
    )
    found: dict[str, dict[str, list[tuple[str, str]]]] = defaultdict(lambda: defaultdict(list))
    for case in sorted(name for name in before.keys() | after.keys() if fnmatch(name, options.cases)):
        if case in before and case in after:
            for kind, name, how in differences(before[case], after[case]):
                file, _, column = name.rpartition("|")
                found[kind][column].append((f"{case}/{file}" if file else case, how))
        else:
            found["cases"]["only before" if case in before else "only after"].append((case, case))
    for kind, title in KINDS.items():
        print(f"{title}: {len(found[kind]) or 'none'}")
        ordered = sorted(found[kind].items(), key=lambda item: (-len(item[1]), item[0]))
        for name, places in ordered[: None if options.all else 15]:
            more = f" and {len(places) - 3} more" if len(places) > 3 else ""
            print(f"  {name}: {places[0][1]}  [{', '.join(place for place, _ in places[:3])}{more}]")
    return 1 if any(found[kind] for kind in MUST_STAY) else 0


if __name__ == "__main__":
    sys.exit(main())
