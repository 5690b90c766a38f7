"""Reasons for what is over a bound: `reasons.toml`, by file:function."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

KINDS = ("files", "functions", "duplicates")


@dataclass(frozen=True, slots=True)
class Judged:
    """What is over a bound, parted by whether a reason stands beside it.

    Attributes:
        excused: With a reason: what it is, and the reason.
        faults: Without one.
        stale: Reasons for something that is over no bound any more, or has another name by now.
    """

    excused: tuple[tuple[str, str], ...]
    faults: tuple[str, ...]
    stale: tuple[str, ...]


def read_reasons(path: Path) -> dict[str, dict[str, str]]:
    """Return the reasons of each kind; a kind that there is none of, or an empty reason, is a ValueError."""
    with path.open("rb") as file:
        found = tomllib.load(file)
    unknown = sorted(set(found) - set(KINDS))
    empty = sorted(key for reasons in found.values() for key, reason in reasons.items() if not reason.strip())
    if unknown or empty:
        raise ValueError(
            f"{path.name}: {', '.join([*unknown, *empty])}; allowed: {', '.join(KINDS)}, each with a reason"
        )
    return {kind: found.get(kind, {}) for kind in KINDS}


def judge(over: Mapping[str, str], reasons: Mapping[str, str]) -> Judged:
    """Part what is over a bound, by key and as it is to be read, by the reasons for it."""
    return Judged(
        tuple((text, reasons[key]) for key, text in over.items() if key in reasons),
        tuple(text for key, text in over.items() if key not in reasons),
        tuple(sorted(reasons.keys() - over.keys())),
    )
