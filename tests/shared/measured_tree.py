"""Small trees of sources, written and measured."""

from __future__ import annotations

from pathlib import Path
from textwrap import dedent

from survey.house import House, survey


def measured(tmp_path: Path, reasons: str = "", **files: str) -> House:
    """Measure files given as `models__urmpipe_models__arm="..."`, each below a docstring of its own."""
    for name, text in files.items():
        path = tmp_path / (name.replace("__", "/") + ".py")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text('"""A module."""\n' + dedent(text), encoding="utf-8")
    allowed = tmp_path / "reasons.toml"
    allowed.write_text(reasons, encoding="utf-8")
    return survey(tmp_path, allowed)


def faults(house: House) -> dict[str, tuple[str, ...]]:
    """Return the bounds that are missed, and by what."""
    return {what: places for what, places in house.faults().items() if places}


def function(lines: int, name: str = "turn") -> str:
    """Return the source of a function of so many lines."""
    body = [f"    {name}({i})" for i in range(lines - 2)]
    return "\n".join([f"def {name}() -> None:", '    """Turn."""', *body]) + "\n"
