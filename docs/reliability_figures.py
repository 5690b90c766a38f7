"""Measure what docs/reliability.md promises, and write its table of figures.

    python docs/reliability_figures.py [--minutes N] [--moments N]

It runs everything at more moments, sizes and inputs than the tests do: with 30 moments for half an hour,
beside the minutes of changed files. What is not as promised ends it with an error.
"""

from __future__ import annotations

import argparse
import json
import signal
import statistics
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent
sys.path[:0] = [str(ROOT / "tests" / "faults"), str(ROOT / "benchmarks")]

from pairs import machine  # noqa: E402

from forks import Forks, forks  # noqa: E402
from jobs import JOBS, Job, write_inputs  # noqa: E402
from trials import full, interrupted, limited, small_disk  # noqa: E402

PAGE = HERE / "reliability.md"
START, END = "<!-- figures: python docs/reliability_figures.py -->", "<!-- end of figures -->"

ROUNDS = 334
"""Of three calls each: a thousand."""

SIGNALS = {"Ctrl-C": signal.SIGINT, "SIGTERM": signal.SIGTERM, "kill -9": signal.SIGKILL}


def main() -> None:
    """Measure, and put the table into the page."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--minutes", type=float, default=30.0, help="for how long changed files are read")
    parser.add_argument("--moments", type=int, default=30, help="moments, and sizes, of each command")
    asked = parser.parse_args()
    lines = [*machine("rerun-sdk", "fmpy", "pyarrow"), "| provoked | times | found |", "|---|---|---|"]
    for found in (changed_files(asked.minutes), stopped_and_out_of_room(asked.moments), calls()):
        for row in found:
            print(row, flush=True)
            lines.append(row)
    text = PAGE.read_text(encoding="utf-8")
    before, after = text.partition(START)[0], text.partition(END)[2]
    PAGE.write_text(before + "\n".join([START, "", *lines, "", END]) + after, encoding="utf-8", newline="\n")


def changed_files(minutes: float) -> Iterator[str]:
    """Yield the row of files of every kind that were changed at random and read."""
    done = subprocess.run(
        [sys.executable, "-m", "tests.fuzz", "--minutes", str(minutes), "--json"],
        cwd=ROOT, capture_output=True, text=True, check=True,
    )  # fmt: skip
    kinds = json.loads(done.stdout)["kinds"].values()
    said = ", ".join(f"{sum(one[key] for one in kinds)} {words}" for key, words in FINDINGS.items())
    inputs = sum(one["inputs"] for one in kinds)
    yield f"| files of {len(kinds)} kinds changed at random, and read | {inputs:,} | {said} |"


FINDINGS = {
    "fault": "faults of urmpipe itself", "abort": "processes ended", "slow": "over 20 s",
    "large": "over 1 GB",
}  # fmt: skip
"""What is counted of changed files, and in which words."""


def stopped_and_out_of_room(moments: int) -> Iterator[str]:
    """Yield the rows of commands that were stopped, or had no room for what they write."""
    trials: dict[str, Callable[[Forks, Job, Path], Counter[str]]] = {
        name: partial(interrupted, number=number, moments=moments) for name, number in SIGNALS.items()
    }
    trials["a file may not grow"] = partial(limited, sizes=moments)
    trials["the disk is full"] = partial(full, sizes=moments)
    with forks() as forked, tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        with small_disk(folder, "12m") as mounted:
            write_inputs(folder)
            for what, provoke in trials.items():
                if what == "the disk is full" and not mounted:
                    continue
                found = sum((provoke(forked, job, folder) for job in JOBS), Counter[str]())
                said = f"all outputs as before {found['old']}, all new and whole {found['new']}, else 0"
                yield f"| {what}, {len(JOBS)} commands | {found.total()} | {said} |"


def calls() -> Iterator[str]:
    """Yield the row of a thousand calls in one process."""
    with tempfile.TemporaryDirectory() as folder:
        script = ROOT / "tests" / "faults" / "calls.py"
        done = subprocess.run(
            [sys.executable, script, str(ROUNDS)], cwd=folder, capture_output=True, text=True, check=True
        )
    threads, files, memory = zip(*map(json.loads, done.stdout.splitlines()), strict=True)
    early, late = statistics.median(memory[20:40]), statistics.median(memory[-20:])
    said = (
        f"threads {threads[20]} to {threads[-1]}, open files {files[20]} to {files[-1]},"
        f" memory {early:.0f} to {late:.0f} MB"
    )
    yield f"| a log ingested, compared and reported in one process | {3 * ROUNDS:,} calls | {said} |"


if __name__ == "__main__":
    main()
