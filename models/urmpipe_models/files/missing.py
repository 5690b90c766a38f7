"""Files that are not there: which one may have been meant, or how far the folders go."""

from __future__ import annotations

from collections.abc import Collection
from itertools import islice
from pathlib import Path

from urmpipe_models.names import nearest

MOST_SEEN = 2000
"""So many files of a folder are looked at."""

MOST_TOLD = 3
"""So many that may be meant are named."""


def meant_by(path: Path, suffixes: Collection[str] = ()) -> str:
    """Return which file may be meant by one that is not there, as ` (did you mean FILE?)`; else nothing.

    Where a folder is missing, that is returned, with the one above it, which is there.

    Args:
        path: The file.
        suffixes: How files of its kind end; of several that may be meant, only such are named, if any is.
    """
    missing = next((one for one in reversed(path.parents) if one.name and not one.is_dir()), None)
    if missing is not None:
        above = Path.cwd() if missing.parent == Path() else missing.parent
        folders = [one for one in map(missing.with_name, _like(missing)) if one.is_dir()]
        return f": {above} has no folder {missing.name}{_asked(folders[:MOST_TOLD])}"
    there = path.exists() or path.is_symlink()  # a link to what is not there
    alike = [] if there else [path.with_name(name) for name in _like(path)]
    of_kind = [one for one in alike if one.suffix.lower() in suffixes]
    return _asked((of_kind or alike)[:MOST_TOLD])


def _asked(meant: list[Path]) -> str:
    """Return the question for some files."""
    return f" (did you mean {' or '.join(map(str, meant))}?)" if meant else ""


def _like(path: Path) -> list[str]:
    """Return the names beside a path that are its own in other letters, of its stem, or like its stem."""
    try:
        names = sorted(one.name for one in islice(path.parent.iterdir(), MOST_SEEN))
    except OSError:  # a folder that may not be read
        return []
    names = [name for name in names if not name.startswith(".")]
    same = [name for name in names if name.casefold() == path.name.casefold()]
    stem = _stem(path.name)
    near = same or [name for name in names if _stem(name) == stem]
    if near:
        return near
    others = nearest(stem, {_stem(name) for name in names})
    return [name for name in names if _stem(name) == others]


def _stem(name: str) -> str:
    """Return a name without its suffixes, in small letters: log of LOG.csv.gz."""
    return name.casefold().split(".", 1)[0]
