"""Say what differs: python tests/snapshot/compare_snapshots.py BEFORE AFTER [--cases PATTERN] [--all].

Each is a folder of `snapshot.py`, or a file of its hashes (before.json), which tells that something differs,
and not what. Differences are sorted by meaning; alike ones of several cases are told once. Exit code 1:
something differs, or is gone, that must stay.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import re
import sys
from base64 import b64encode
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator
from difflib import SequenceMatcher
from fnmatch import fnmatch
from pathlib import Path
from typing import Any

Column = dict[str, Any]
Case = dict[str, Column]
Difference = tuple[str, str, str]
"""Its kind, what differs (alike in all cases), and how."""

KINDS = {
    "verdicts": "EXIT CODES, VERDICTS, KINDS OF WARNINGS (must stay)",
    "numbers": "NUMBERS of JSON, JUnit, CSV, exports, attributes (must stay)",
    "arrays": "ARRAYS of recordings, exports, attributes: changed or lost (must stay)",
    "times": "TIMES of arrays (must stay)",
    "scene": "WHAT IS DRAWN IN SPACE and lists of other components: changed or lost",
    "traces": "TRACES of reports, in any order",
    "shown": "NUMBERS SHOWN in reports and texts, in any order",
    "keys": "KEYS renamed, lost, new",
    "entities": "ARRAYS RENAMED, regrouped, new",
    "words": "WORDS",
    "looks": "COLOURS, WIDTHS, RADII",
    "cases": "CASES",
}
MUST_STAY = ("verdicts", "numbers", "arrays", "times")
JUDGED = re.compile(r"^exits$|verdict|warnings\[\]\.kind|reached|failure|failed|as_expected")


def load(path: Path) -> dict[str, Case]:
    """Return the cases of a snapshot by name, or their hashes."""
    if path.is_file():
        return dict(json.loads(path.read_bytes()))
    return {one.stem: json.loads(one.read_bytes()) for one in sorted((path / "cases").glob("*.json"))}


def differences(before: Case, after: Case) -> Iterator[Difference]:
    """Yield what differs between a case and the same case later."""
    new = sorted(after.keys() - before.keys())
    for name, one in before.items():
        found = name if name in after else _renamed(name, one, new, after)
        if found is None:
            yield _gone(name, one, after)
            continue
        other = after[found]
        if found != name:
            new.remove(found)
            yield _moved(name, one), f"{name} -> {found.partition('|')[2]}", "renamed"
        if (_values(one), one["kind"]) != (_values(other), other["kind"]):
            yield _kind(name, one), name, _how(one, other)
        elif one.get("t") != other.get("t"):
            yield "times", name, "its values stand at other times"
    yield from ((_moved(name, after[name]), name, "new") for name in new)


def _renamed(name: str, one: Column, new: list[str], after: Case) -> str | None:
    """Return which new column of the same file holds the same: of several that with the most alike name."""
    same = [key for key in new if _file(key) == _file(name) and _values(after[key]) == _values(one)]
    alike = [(after[key].get("t") == one.get("t"), SequenceMatcher(None, name, key).ratio()) for key in same]
    return same[alike.index(max(alike))] if same else None


def _values(one: Column) -> str:
    """Return the hash of a column's values; of an array in whichever shape they stand."""
    return str(one["flat"] if one["kind"] == "arrays" else one["hash"])


def _gone(name: str, one: Column, after: Case) -> Difference:
    """Return what is said of a column that is there later under no name."""
    there = {
        each for key, other in after.items() if _file(key) == _file(name) for each in other.get("columns", ())
    }
    if "shape" in one and set(one["columns"]) <= there:
        return _moved(name, one), name, "regrouped: its columns stand in other arrays"
    kind = _kind(name, one)
    about = f"shape {one['shape']}" if "shape" in one else " ".join(one.get("values", [])[:3])[:60]
    return "keys" if kind == "words" else kind, name, f"LOST, {about}"


def _moved(name: str, one: Column) -> str:
    """Return what it means that a column is new or has another name."""
    if one["kind"] == "looks":
        return "looks"
    return "entities" if "shape" in one or _file(name).endswith(".rrd") else "keys"


def _kind(name: str, one: Column) -> str:
    """Return what a change of a column means."""
    return "verdicts" if JUDGED.search(name) and "shape" not in one else str(one["kind"])


def _file(name: str) -> str:
    return name.partition("|")[0]


def _how(one: Column, other: Column) -> str:
    """Return the first values that differ, or of those in any order which are gone and new."""
    if "values" not in one or "values" not in other:
        return f"hash differs; {one.get('shape', one['n'])} -> {other.get('shape', other['n'])}"
    a: list[str] = one["values"]
    b: list[str] = other["values"]
    if one["kind"] in {"shown", "traces"}:
        gone, new = list((Counter(a) - Counter(b)).elements()), list((Counter(b) - Counter(a)).elements())
        return f"{len(gone)} gone: {' '.join(gone[:8])}; {len(new)} new: {' '.join(new[:8])}"
    was, now = next(
        ((x, y) for x, y in zip(a, b, strict=False) if x != y), (f"{len(a)} values", f"{len(b)} values")
    )
    return f"{was} -> {now}"


def hashes(cases: dict[str, Case]) -> str:
    """Return the hashes of a snapshot as JSON: of each case its files by suffix and kind, its arrays."""
    lines = []
    for case, columns in sorted(cases.items()):
        files: dict[str, dict[str, list[str]]] = defaultdict(lambda: defaultdict(list))
        for name, one in columns.items():
            of = files[Path(_file(name)).suffix[1:] or name]
            of["keys"].append(name)
            kind = _kind(name, one)
            of["entities" if kind == "arrays" else kind].append(one["hash"])
        of_files = {
            f"{suffix} {kind}": _short(sorted(some))
            for suffix, kinds in files.items()
            for kind, some in kinds.items()
        }
        arrays = {
            _short([each])
            for name, one in columns.items()
            if _kind(name, one) == "arrays"
            for each in one["columns"]
        }
        lines.append(f"{json.dumps(case)}: {json.dumps(of_files | {'arrays': ''.join(sorted(arrays))})}")
    return "{\n" + ",\n".join(lines) + "\n}\n"


def _short(some: list[str]) -> str:
    """Return four letters for some hashes."""
    return b64encode(hashlib.sha256("\n".join(some).encode()).digest())[:4].decode()


def differences_of_hashes(before: dict[str, str], after: dict[str, str]) -> Iterator[Difference]:
    """Yield what differs between the hashes of a case."""
    one, other = (
        {side["arrays"][k : k + 4] for k in range(0, len(side["arrays"]), 4)} for side in (before, after)
    )
    if one - other:
        yield "arrays", "columns of arrays", f"LOST {len(one - other)} of {len(one)}"
    if other - one:
        yield "entities", "columns of arrays", f"{len(other - one)} new"
    for name in sorted((before.keys() | after.keys()) - {"arrays"}):
        if before.get(name) != after.get(name):
            yield name.split(" ")[1], f"files .{name.split(' ')[0]}", "hash differs"


def main() -> int:
    """Compare two snapshots, print what differs, and return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("before", type=Path)
    parser.add_argument("after", type=Path)
    parser.add_argument("--cases", default="*", help="names of cases, as ik.*")
    parser.add_argument(
        "--all", action="store_true", help="tell every difference, not the first 15 of a kind"
    )
    given = parser.parse_args()
    paths = (given.before, given.after)
    sides: list[dict[str, Any]] = [load(path) for path in paths]
    compare: Callable[[Any, Any], Iterator[Difference]] = differences
    if any(path.is_file() for path in paths):
        compare = differences_of_hashes
        sides = [
            side if path.is_file() else json.loads(hashes(side))
            for side, path in zip(sides, paths, strict=True)
        ]
    found: dict[str, dict[str, list[tuple[str, str]]]] = defaultdict(lambda: defaultdict(list))
    for case in sorted(name for name in sides[0].keys() | sides[1].keys() if fnmatch(name, given.cases)):
        if case in sides[0] and case in sides[1]:
            for kind, name, how in compare(sides[0][case], sides[1][case]):
                file, _, column = name.rpartition("|")
                found[kind][column].append((f"{case}/{file}" if file else case, how))
        else:
            found["cases"]["only before" if case in sides[0] else "only after"].append((case, case))
    for kind, title in KINDS.items():
        print(f"{title}: {len(found[kind]) or 'none'}")
        ordered = sorted(found[kind].items(), key=lambda one: (-len(one[1]), one[0]))
        for name, places in ordered[: None if given.all else 15]:
            more = f" and {len(places) - 3} more" if len(places) > 3 else ""
            print(f"  {name}: {places[0][1]}  [{', '.join(case for case, _ in places[:3])}{more}]")
    return 1 if any(found[kind] for kind in MUST_STAY) else 0


if __name__ == "__main__":
    sys.exit(main())
