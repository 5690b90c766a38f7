"""The tables of variables in docs/drives.md are those of the units."""

from __future__ import annotations

import runpy
from pathlib import Path

DOCS = Path(__file__).parents[2] / "docs"


def test_the_tables_of_the_drives_are_those_of_their_units() -> None:
    page = (DOCS / "drives.md").read_text(encoding="utf-8")
    script = runpy.run_path(str(DOCS / "unit_tables.py"))
    named = [block["unit"] for block in script["BLOCK"].finditer(page)]
    assert named == ["dc_drive", "inertia", "drive_controller", "set_point"]
    assert script["with_tables"](page) == page, "python docs/unit_tables.py writes them"
