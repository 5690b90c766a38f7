"""The start of commands: python benchmarks/startup.py [--rounds N] [--before OTHER_CHECKOUT].

1. `urmpipe --help` against `import click`.
2. `urmpipe.compare`, `ingest` and `compare` of the sample logs as whole processes, also of another checkout.
3. What the two commands import: modules and dataclasses, and the time that the modules of urmpipe take
   themselves (`-X importtime`; the least of all rounds).
"""

from __future__ import annotations

import argparse
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from pairs import Bound, machine, ratio, rounds, table, write_results

from urmpipe_datasets import LOGS

HELP_ROUNDS = 30
MAX_MODULES = 300  # of urmpipe, in compare: a presenter of another kind brings a hundred
MAX_OWN_SHARE = 0.35  # of the imports of compare; the rest are NumPy, pyarrow, rerun and SciPy
AREAS = ("models", "fmus", "pipeline", "cli", "datasets")
COUNT = """
import atexit, dataclasses, sys
from urmpipe.main import main

def count():
    own = {name: module for name, module in sys.modules.items() if name.startswith("urmpipe")}
    classes = [
        value
        for name, module in own.items()
        for value in vars(module).values()
        if isinstance(value, type) and value.__module__ == name and dataclasses.is_dataclass(value)
    ]
    print(len(sys.modules), len(own), len(classes))

atexit.register(count)
main()
"""


def commands(folder: Path) -> dict[str, list[str]]:
    """Return the arguments of the commands: one log, and the three logs of the paper against their path."""
    arm = ["--robot", "urm6", "-q", "-o"]
    logs = [str(LOGS / name) for name in ("path.csv", "matlab.csv", "solidworks", "coppeliasim.csv")]
    return {
        "ingest": ["ingest", logs[1], *arm, str(folder / "run.rrd")],
        "compare": ["compare", *logs, *arm, str(folder / "verdict.rrd")],
    }


def of_checkout(root: Path, arguments: Sequence[str]) -> list[str]:
    """Return a command that runs the urmpipe of a checkout."""
    paths = os.pathsep.join(str(root / area) for area in AREAS)
    return ["env", f"PYTHONPATH={paths}", sys.executable, "-m", "urmpipe", *arguments]


def imports(arguments: Sequence[str], count: int) -> tuple[tuple[int, ...], float, float]:
    """Return numbers of modules and dataclasses, and the seconds of all imports and of those of urmpipe."""
    counted = subprocess.run(
        [sys.executable, "-c", COUNT, *arguments], capture_output=True, text=True, check=True
    )
    everything, own = [], []
    for _ in range(count):
        command = [sys.executable, "-X", "importtime", "-m", "urmpipe", *arguments]
        shown = subprocess.run(command, capture_output=True, text=True, check=True).stderr
        rows = re.findall(r"import time:\s+(\d+) \|\s+\d+ \|\s+(\S+)", shown)
        everything.append(sum(int(time) for time, _ in rows) / 1e6)
        own.append(sum(int(time) for time, name in rows if name.startswith("urmpipe")) / 1e6)
    return tuple(map(int, counted.stdout.split())), min(everything), min(own)


def main() -> None:
    """Measure and keep the results."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=5, help="of the commands that read logs")
    parser.add_argument("--before", type=Path, help="another checkout to compare with")
    options = parser.parse_args()
    python = sys.executable
    short = {
        "import click": [python, "-c", "import click"],
        "urmpipe --help": [str(Path(python).parent / "urmpipe"), "--help"],
    }
    lines = [f"# Start-up: {HELP_ROUNDS} rounds in pairs", "", *machine("click", "rerun-sdk", "pyarrow")]
    taken = rounds(short, HELP_ROUNDS)
    found = ratio(taken["urmpipe --help"], taken["import click"])
    bounds = [Bound("urmpipe --help / import click", found, under=1.5)]
    lines += table(taken, "import click")
    root = Path(__file__).resolve().parents[1]
    with tempfile.TemporaryDirectory() as name:
        ours = commands(Path(name))
        long = {"import rerun": [python, "-c", "import rerun.blueprint"]}
        long |= {"urmpipe.compare": [python, "-c", "import urmpipe; urmpipe.compare"]}
        for command, arguments in ours.items():
            if options.before:
                long[f"{command}, before"] = of_checkout(options.before.resolve(), arguments)
            long[command] = of_checkout(root, arguments)
        several = rounds(long, options.rounds)
        lines += ["", f"## Commands: {options.rounds} rounds in turn", "", *table(several, "import rerun")]
        if options.before:
            bounds.append(
                Bound("compare / before", ratio(several["compare"], several["compare, before"]), under=1.0)
            )
        lines += [
            "",
            "## Imports",
            "",
            "| command | modules | of urmpipe | dataclasses of urmpipe | s | of urmpipe |",
        ]
        lines.append("|---|---|---|---|---|---|")
        for command, arguments in ours.items():
            (modules, own, classes), seconds, own_seconds = imports(arguments, options.rounds)
            lines.append(f"| {command} | {modules} | {own} | {classes} | {seconds:.2f} | {own_seconds:.2f} |")
    bounds.append(Bound("modules of urmpipe in compare", own, most=MAX_MODULES))
    bounds.append(
        Bound("share of urmpipe in the imports of compare", own_seconds / seconds, under=MAX_OWN_SHARE)
    )
    write_results("startup", lines, bounds)


main()
