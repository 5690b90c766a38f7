"""Which modules are mutated, and which of them are models: found by name, whatever is added or moved."""

from __future__ import annotations

from collections.abc import Sequence
from fnmatch import fnmatch
from pathlib import Path

PACKAGE = "urmpipe_models"

SAMPLED = ("inverse.*", "robots.*", "files.*", "chains.visual", "errors", "row_blocks")
"""What is no model: the inverse, which is too much to be tried whole, readers and writers, and helpers."""


def modules(folder: Path, patterns: Sequence[str]) -> list[str]:
    """Return the modules of the package in a folder that match a pattern, by name or by its last part."""
    files = sorted((folder / PACKAGE).rglob("*.py"))
    names = [".".join(file.relative_to(folder).with_suffix("").parts) for file in files]
    return [
        name
        for name in names
        if not name.endswith("__init__")
        and any(fnmatch(inner(name), one) or fnmatch(stem(name), one) for one in patterns)
    ]


def inner(module: str) -> str:
    """Return the name of a module inside the package."""
    return module.removeprefix(f"{PACKAGE}.")


def stem(module: str) -> str:
    """Return the last part of a dotted name."""
    return module.rpartition(".")[2]


def is_model(module: str) -> bool:
    """Tell whether a module is a model, so that most or all of its mutants are tried."""
    return not any(fnmatch(inner(module), one) for one in SAMPLED)
