"""The mutation score, as benchmarks/mutation.py measured it last: the code itself does not tell it."""

from __future__ import annotations

import re
from pathlib import Path

HEADING = re.compile(r"^## (.+): (\d+\.\d %) \((.+?)\)", re.MULTILINE)
"""A group of modules, its score and its interval, over the table of the group."""

MEASURED = re.compile(r"^Measured (\S+) ", re.MULTILINE)


def mutation_score(results: Path) -> str:
    """Return in a sentence how many changes of the code the tests find, by group of modules, and since when.

    Args:
        results: What benchmarks/mutation.py wrote.

    Raises:
        ValueError: If it has no score.
    """
    text = results.read_text(encoding="utf-8")
    groups, measured = HEADING.findall(text), MEASURED.search(text)
    if not groups or measured is None:
        raise ValueError(f"{results.name} has no score: run benchmarks/mutation.py")
    said = "; ".join(f"{name[0].lower()}{name[1:]} {score} ({span})" for name, score, span in groups)
    return f"Mutation score, by `benchmarks/mutation.py` on {measured[1]}, with the 95 % interval: {said}."
