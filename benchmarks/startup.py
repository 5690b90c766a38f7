"""`urmpipe --help` against `import click`: python benchmarks/startup.py."""

from __future__ import annotations

import sys
from pathlib import Path

from pairs import Bound, machine, ratio, rounds, table, write_results

ROUNDS = 30


def main() -> None:
    """Measure and keep the results."""
    python = sys.executable
    commands = {
        "import click": [python, "-c", "import click"],
        "urmpipe --help": [str(Path(python).parent / "urmpipe"), "--help"],
    }
    lines = [f"# Start-up: {ROUNDS} rounds in pairs", "", *machine("click")]
    taken = rounds(commands, ROUNDS)
    found = ratio(taken["urmpipe --help"], taken["import click"])
    bound = Bound("urmpipe --help / import click", found, under=1.5)
    write_results("startup", [*lines, *table(taken, "import click")], [bound])


main()
