"""`urmpipe --help` against `import click`: python benchmarks/startup.py"""

from __future__ import annotations

import sys
from pathlib import Path

from pairs import machine, rounds, table, write_results

ROUNDS = 30


def main() -> None:
    """Measure and keep the results."""
    python = sys.executable
    commands = {
        "import click": [python, "-c", "import click"],
        "urmpipe --help": [str(Path(python).parent / "urmpipe"), "--help"],
    }
    lines = [f"# Start-up: {ROUNDS} rounds in pairs", "", *machine("click")]
    write_results("startup", [*lines, *table(rounds(commands, ROUNDS), "import click")])


main()
