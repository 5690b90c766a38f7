"""Whole processes side by side: each round runs every command once, so that a drifting machine hits all."""

from __future__ import annotations

import math
import os
import platform
import statistics
import subprocess
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

RESULTS = Path(__file__).parent / "results"


@dataclass(frozen=True, slots=True)
class Usage:
    """What one process took, by the operating system's own account: seconds and MB."""

    wall: float
    cpu: float
    rss: float


@dataclass(frozen=True, slots=True)
class Bound:
    """What a figure may be: below `under`, at most `most`, or at least `least`."""

    what: str
    found: float
    under: float = math.inf
    least: float = -math.inf
    most: float = math.inf

    @property
    def held(self) -> bool:
        """Whether the figure is within the bound."""
        return self.least <= self.found < self.under and self.found <= self.most

    def __str__(self) -> str:
        """Return the line of the table."""
        limits = {"under": self.under, "at most": self.most, "at least": self.least}
        allowed = " and ".join(f"{word} {limit:g}" for word, limit in limits.items() if math.isfinite(limit))
        found = str(self.found) if isinstance(self.found, int) else f"{self.found:.2f}"
        return f"| {self.what} | {found} | {allowed} | {'held' if self.held else 'MISSED'} |"


def timed(job: Callable[[], object]) -> float:
    """Return how long a job takes in [s]."""
    start = time.perf_counter()
    job()
    return time.perf_counter() - start


def in_turn(jobs: Mapping[str, Callable[[], object]], count: int) -> dict[str, list[float]]:
    """Return how long jobs take in [s], run in turn, after one round that does not count."""
    taken: dict[str, list[float]] = {name: [] for name in jobs}
    for number in range(count + 1):
        for name, job in jobs.items():
            found = timed(job)
            if number:
                taken[name].append(found)
    return taken


def measure(command: Sequence[str]) -> Usage:
    """Run a command to its end; a failing one stops the benchmark."""
    start = time.perf_counter()
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    assert process.stderr is not None
    complaint = process.stderr.read()
    _, status, usage = os.wait4(process.pid, 0)
    wall = time.perf_counter() - start
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise RuntimeError(f"{' '.join(command)} failed: {complaint.decode()}")
    return Usage(wall, usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024)


def rounds(
    commands: Mapping[str, Sequence[str]], count: int, outputs: Sequence[Path] = ()
) -> dict[str, list[Usage]]:
    """Run all commands in turn, one warm-up round first; their outputs are removed before each run."""
    taken: dict[str, list[Usage]] = {name: [] for name in commands}
    for number in range(count + 1):
        for name, command in commands.items():
            for output in outputs:
                output.unlink(missing_ok=True)
            usage = measure(command)
            if number:
                taken[name].append(usage)
    return taken


def median(usages: Sequence[Usage], what: str) -> float:
    """Return the median of one of the figures."""
    return float(statistics.median(getattr(usage, what) for usage in usages))


def ratio(usages: Sequence[Usage], base: Sequence[Usage]) -> float:
    """Return the median of the ratios of wall times, pair by pair."""
    return statistics.median(a.wall / b.wall for a, b in zip(usages, base, strict=True))


def table(taken: Mapping[str, Sequence[Usage]], base: str) -> list[str]:
    """Return a Markdown table: medians, and the ratio of wall times pair by pair against `base`."""
    lines = [
        f"| whole process | wall s (min-max) | CPU s | peak MB | wall / {base}, median of pairs |",
        "|---|---|---|---|---|",
    ]
    for name, usages in taken.items():
        walls = [usage.wall for usage in usages]
        lines.append(
            f"| {name} | {median(usages, 'wall'):.3f} ({min(walls):.3f}-{max(walls):.3f}) |"
            f" {median(usages, 'cpu'):.3f} | {median(usages, 'rss'):.0f} | {ratio(usages, taken[base]):.2f} |"
        )
    return lines


def machine(*distributions: str) -> list[str]:
    """Return lines that say when, on what, and with which versions something was measured."""
    model = next(
        (
            line.split(":")[1].strip()
            for line in Path("/proc/cpuinfo").read_text().splitlines()
            if "model name" in line
        ),
        platform.processor(),
    )
    versions = []
    for name in ("urmpipe", "numpy", *distributions):
        try:
            versions.append(f"{name} {version(name)}")
        except PackageNotFoundError:
            versions.append(f"{name} not installed")
    return [
        f"Measured {datetime.now(UTC):%Y-%m-%d} on {os.cpu_count()} shared cores ({model}), Python"
        f" {platform.python_version()}, {', '.join(versions)}.",
        "",
    ]


def write_results(name: str, lines: Sequence[str], bounds: Sequence[Bound]) -> None:
    """Print the results, keep them, and exit with 1 if a bound was missed."""
    held = ["", "| what is held | found | allowed | |", "|---|---|---|---|", *map(str, bounds)]
    text = "\n".join([*lines, *held]) + "\n"
    print(text)
    RESULTS.mkdir(exist_ok=True)
    (RESULTS / f"{name}.md").write_text(text, encoding="utf-8")
    if not all(bound.held for bound in bounds):
        raise SystemExit(1)
