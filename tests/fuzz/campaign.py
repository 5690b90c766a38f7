"""Many inputs of every kind: how they are shared out, what is kept of them, and the table at the end."""

from __future__ import annotations

import hashlib
import json
import sys
import time
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from tests.fuzz.corpus import Specimen
from tests.fuzz.examine import ABORT, FAULT, LARGE, SLOW, Outcome
from tests.fuzz.kinds import BY_NAME
from tests.fuzz.made import make
from tests.fuzz.workers import FORK, Batch, Worker, run

BATCH = 20
"""Inputs that a worker is given at a time."""

HEADS = (
    "kind",
    "inputs",
    "read",
    "fault lines",
    "aborts",
    "over time",
    "over 1 GB",
    "seconds",
    "slowest",
    "most MB",
)


@dataclass
class Tally:
    """What was seen of a kind."""

    inputs: int = 0
    read: int = 0
    seconds: float = 0.0
    slowest: float = 0.0
    peak: int = 0
    problems: dict[str, int] = field(default_factory=lambda: dict.fromkeys((FAULT, ABORT, SLOW, LARGE), 0))

    def row(self, name: str) -> tuple[str, ...]:
        """Return its row of the table."""
        figures = f"{self.seconds:.0f}", f"{self.slowest:.2f}", f"{self.peak / 1e6:.0f}"
        return (name, str(self.inputs), str(self.read), *map(str, self.problems.values()), *figures)


class Findings:
    """What is wrong, each once: a file of the input that showed it first, and a line.

    Args:
        folder: Where they are kept.
        seed: Of the inputs.
        limit: Time in [s] that an input may take.
    """

    def __init__(self, folder: Path, seed: int, limit: float) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self.folder, self._seed, self.limit = folder, seed, limit
        self.tallies: dict[str, Tally] = {}
        self.seen: dict[tuple[str, ...], int] = {}

    def keep(self, kind: str, number: int, path: Path, outcome: Outcome) -> None:
        """Count an input, and save it if something new is wrong with it."""
        tally = self.tallies.setdefault(kind, Tally())
        tally.inputs += 1
        tally.read += not outcome.error
        tally.seconds += outcome.seconds
        tally.slowest, tally.peak = max(tally.slowest, outcome.seconds), max(tally.peak, outcome.peak)
        problem = outcome.problem or (SLOW if outcome.seconds > self.limit else "")
        if not problem:
            return
        tally.problems[problem] += 1
        key = (kind, problem, outcome.error, outcome.where)
        self.seen[key] = self.seen.get(key, 0) + 1
        if self.seen[key] > 1:
            return
        name = f"{kind}-{hashlib.sha256(repr(key).encode()).hexdigest()[:8]}-{path.name}"
        (self.folder / name).write_bytes(path.read_bytes())
        told = {
            "kind": kind,
            "seed": self._seed,
            "number": number,
            "file": name,
            "name": path.name,
            **outcome.to_dict(),
            "problem": problem,
        }
        with (self.folder / "findings.jsonl").open("a", encoding="utf-8") as lines:
            lines.write(json.dumps(told) + "\n")
        print(f"{kind} {number}: {problem}: {outcome.error} {outcome.where}", file=sys.stderr, flush=True)

    def to_dict(self) -> dict[str, Any]:
        """Return all figures as JSON has them."""
        kinds = {
            name: {
                "inputs": one.inputs,
                "read": one.read,
                "seconds": one.seconds,
                "slowest": one.slowest,
                "peak": one.peak,
                **one.problems,
            }
            for name, one in self.tallies.items()
        }
        found = [
            {"kind": kind, "problem": problem, "error": error, "where": where, "count": count}
            for (kind, problem, error, where), count in self.seen.items()
        ]
        return {"seed": self._seed, "folder": str(self.folder), "kinds": kinds, "findings": found}

    def table(self) -> str:
        """Return the figures as lines."""
        rows = [HEADS, *(self.tallies[name].row(name) for name in BY_NAME if name in self.tallies)]
        total = [sum(int(row[i]) for row in rows[1:]) for i in range(1, 8)]
        rows.append(("all", *map(str, total), "", ""))
        widths = [max(len(row[i]) for row in rows) for i in range(len(HEADS))]
        return "\n".join(
            "  ".join(cell.rjust(width) for cell, width in zip(row, widths, strict=True)) for row in rows
        )


def shared_out(counts: Mapping[str, int]) -> Iterator[Batch]:
    """Yield the inputs of some kinds, so many of each."""
    for kind, count in counts.items():
        for first in range(0, count, BATCH):
            yield Batch(kind, first, min(first + BATCH, count))


def kept_in(folder: Path, kinds: Iterable[str]) -> Iterator[Batch]:
    """Yield the inputs of some kinds that were kept in a folder."""
    for line in (folder / "findings.jsonl").read_text("utf-8").splitlines():
        one = json.loads(line)
        if one["kind"] in kinds:
            yield Batch(one["kind"], 0, 1, (Specimen(one["name"], (folder / one["file"]).read_bytes()),))


def until(end: float, kinds: Iterable[str], findings: Findings) -> Iterator[Batch]:
    """Yield inputs until a time, always of the kind that has had the least of it."""
    given = dict.fromkeys(kinds, 0)
    while time.monotonic() < end:
        kind = min(given, key=lambda one: (findings.tallies.get(one, Tally()).seconds, given[one]))
        given[kind] += BATCH
        yield Batch(kind, given[kind] - BATCH, given[kind])


def made_in(folder: Path) -> Path:
    """Return the folder with what urmpipe makes, made in a process of its own: threads are not forked."""
    folder.mkdir(parents=True)
    process = FORK.Process(target=make, args=(folder,))
    process.start()
    process.join()
    if process.exitcode:
        raise SystemExit("the specimens could not be made")
    return folder


def run_all(
    batches: Iterator[Batch], findings: Findings, folder: Path, made: Path, seed: int, workers: int
) -> None:
    """Let workers read all inputs."""
    crew = [Worker(folder / f"worker-{i}", made, seed) for i in range(workers)]
    run(crew, batches, findings.limit, findings.keep)
