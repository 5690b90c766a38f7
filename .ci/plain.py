"""Check that names and prose of the product are plain technical English: .ci/plain.py [--list] [PATH...].

Prose is docstrings, comments and strings of three words or more; text in backticks is skipped. The words and
phrases, with what to write instead, are in plain.toml, and so is the ratchet: how many hits each package has.
More fail, and so do fewer, until --write lowers the ratchet. `# plain: ok` at the end of a line excuses it.
"""

from __future__ import annotations

import argparse
import ast
import io
import re
import sys
import tokenize
import tomllib
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
RULES_FILE = Path(__file__).with_suffix(".toml")
RULES = tomllib.loads(RULES_FILE.read_text(encoding="utf-8"))
PHRASES = {re.compile(phrase, re.IGNORECASE): instead for phrase, instead in RULES["prose"].items()}
NAMES = RULES["identifier"]
AREAS = ("models", "fmus", "pipeline", "cli", "datasets")


def iter_prose(source: str, tree: ast.Module) -> Iterator[tuple[int, str]]:
    """Yield the lines of docstrings, of strings of three words or more, and of comments."""
    docstrings = {
        node.value
        for body in (getattr(node, "body", None) for node in ast.walk(tree))
        if isinstance(body, list)
        for node in body
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
    }
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            has_words = len(re.findall("[A-Za-z]{2,}", node.value)) >= 3 and " " in node.value.strip()
            if node in docstrings or has_words:
                for k, line in enumerate(node.value.split("\n")):
                    yield node.lineno + (k if node in docstrings else 0), line
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type == tokenize.COMMENT:
            yield token.start[0], token.string


def iter_names(tree: ast.Module) -> Iterator[tuple[int, str]]:
    """Yield the identifiers of a module, each as often as it is used."""
    for node in ast.walk(tree):
        match node:
            case ast.Name(id=name) | ast.Attribute(attr=name) | ast.arg(arg=name):
                yield node.lineno, name
            case ast.FunctionDef(name=name) | ast.ClassDef(name=name):
                yield node.lineno, name
            case ast.keyword(arg=str(name)) if name != "found":  # the field of a message keeps its name
                yield node.value.lineno, name


def name_fault(name: str) -> str | None:
    """Return what is wrong with an identifier, or None."""
    if name in NAMES["exact"]:
        return f"name {name}"
    words = [word.lower() for word in re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+", name)]
    faults = [f"word {word}" for word in words if word in NAMES["words"]]
    faults += [f"prefix {start}" for start in NAMES["prefix"] if name.lstrip("_").startswith(start)]
    faults += [f"suffix {end}" for end in NAMES["suffix"] if name.endswith(end)]
    return faults[0] if faults else None


def iter_hits(path: Path) -> Iterator[tuple[int, str, str]]:
    """Yield line, hit and advice for a file."""
    source = path.read_text(encoding="utf-8")
    tree = ast.parse(source)
    lines = source.split("\n")
    for number, text in iter_prose(source, tree):
        if not lines[number - 1].rstrip().endswith("# plain: ok"):
            clean = re.sub("`[^`]*`", "", text)
            for phrase, instead in PHRASES.items():
                yield from ((number, hit[0], instead) for hit in phrase.finditer(clean))
    for number, name in iter_names(tree):
        if (fault := name_fault(name)) and not lines[number - 1].rstrip().endswith("# plain: ok"):
            yield number, name, fault


def package_of(path: Path) -> str:
    """Return the package that a file counts for: its folder below the area, or the area."""
    parts = path.relative_to(ROOT).parts
    return "/".join((parts[0], *parts[2:3])) if len(parts) > 3 else parts[0]


def main() -> int:
    """Count the hits of each package, compare them with the ratchet, and return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("paths", nargs="*", type=Path, help="files or folders; without any, the product")
    parser.add_argument("--list", action="store_true", help="print every hit")
    parser.add_argument("--write", action="store_true", help="lower the ratchet to what is found")
    options = parser.parse_args()
    roots = [path.resolve() for path in options.paths] or [ROOT / area for area in AREAS]
    files = [file for root in roots for file in (sorted(root.rglob("*.py")) if root.is_dir() else [root])]
    counts: dict[str, int] = {}
    for file in files:
        hits = sorted(iter_hits(file))
        counts[package_of(file)] = counts.get(package_of(file), 0) + len(hits)
        if options.list or options.paths:
            for number, hit, advice in hits:
                print(f"{file.relative_to(ROOT)}:{number}: {hit}: {advice}")
    if options.paths:
        return 1 if any(counts.values()) else 0
    allowed = RULES["ratchet"]
    changed = {name for name in counts.keys() | allowed.keys() if counts.get(name, 0) != allowed.get(name, 0)}
    if options.write and all(not allowed or counts.get(name, 0) <= allowed.get(name, 0) for name in changed):
        text = RULES_FILE.read_text(encoding="utf-8")
        lines = "".join(f'"{name}" = {count}\n' for name, count in sorted(counts.items()) if count)
        RULES_FILE.write_text(text[: text.index("[ratchet]\n")] + "[ratchet]\n" + lines, encoding="utf-8")
        return 0
    for name in sorted(changed):
        found, limit = counts.get(name, 0), allowed.get(name, 0)
        step = "see --list for better words" if found > limit else "lower the ratchet with --write"
        print(f"{name}: found {found} hits, allowed: {limit}; {step}")
    return 1 if changed else 0


if __name__ == "__main__":
    sys.exit(main())
