"""What the code is like: sizes, docstrings, units and shapes, annotations, imports, duplicates, mutants.

python benchmarks/house.py [--write]

With --write the table in CONTRIBUTING is renewed too. The code is read, never run: the mutation score is
the one that benchmarks/mutation.py measured last.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from pairs import write_results
from survey.contributing import show
from survey.house import survey
from survey.mutation_score import mutation_score
from survey.tables import full, summary

ROOT = Path(__file__).resolve().parents[1]


def main() -> None:
    """Measure, keep the results, and name what is over a bound."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--write", action="store_true", help="renew the table in CONTRIBUTING.md")
    options = parser.parse_args()
    house, score = survey(ROOT), mutation_score(ROOT / "benchmarks" / "results" / "mutation.md")
    if options.write:
        show(ROOT / "CONTRIBUTING.md", [*summary(house), "", score])
    write_results("house", [*full(house), score], house.bounds())


if __name__ == "__main__":
    main()
