"""Writes the tables of variables in drives.md from the units: python docs/unit_tables.py."""

from __future__ import annotations

import re
from pathlib import Path

from urmpipe_fmus.blocks import make_block
from urmpipe_fmus.build.description import TITLES, variable_row

PAGE = Path(__file__).with_name("drives.md")
BLOCK = re.compile(r"(<!-- variables of (?P<unit>\w+) -->\n).*?(<!-- end -->)", re.DOTALL)


def table(name: str) -> str:
    """Return the variables of a unit as a table in Markdown."""
    rows = [TITLES, ("---",) * len(TITLES), *map(variable_row, make_block(name).variables)]
    return "".join(f"| {' | '.join(row)} |\n" for row in rows)


def with_tables(page: str) -> str:
    """Return a page whose tables are those of the units."""
    return BLOCK.sub(lambda block: f"{block[1]}{table(block['unit'])}{block[3]}", page)


if __name__ == "__main__":
    PAGE.write_text(with_tables(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
