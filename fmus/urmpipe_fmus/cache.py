"""FMUs that were built before, found again by the hash of all that they are made from.

Of a unit of urmpipe the hash takes milliseconds: it reads the unit's recipe and table and urmpipe's own
sources, and neither runs the unit nor imports what would trace it. A user's file may read other files and
import other packages, which end up in the machine code as numbers: so the traced C of its native FMU is
hashed too.
"""

from __future__ import annotations

import hashlib
import json
import os
import platform
import shutil
import sys
import uuid
from collections.abc import Callable
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from urmpipe_fmus.archive import content_guid
from urmpipe_fmus.build import build_fmu, chosen_backend
from urmpipe_fmus.description import Backend
from urmpipe_fmus.platforms import this_platform
from urmpipe_fmus.unit import Recipe, Unit
from urmpipe_models.errors import Finding, FmuError

PACKAGES = ("urmpipe_fmus", "urmpipe_models", "urmpipe_datasets")
SUFFIXES = (".py", ".c", ".h", ".jinja", ".toml", ".urdf")
"""Files of those packages that may go into an FMU."""

DISTRIBUTIONS = ("urmpipe", "numpy", "casadi", "fmpy", "pythonfmu", "ziglang")


def cache_folder() -> Path:
    """Return the folder of the cache: what URMPIPE_CACHE says, else urmpipe's in the user's cache folder.

    Raises:
        FmuError: If neither is known.
    """
    told = os.environ.get("URMPIPE_CACHE")
    if told:
        return Path(told)
    home = os.environ.get("LOCALAPPDATA") if os.name == "nt" else os.environ.get("XDG_CACHE_HOME")
    try:
        return (Path(home) if home else Path.home() / ".cache") / "urmpipe"
    except RuntimeError as error:  # a user without a home, in a container
        said = "cache of FMUs: found no home folder, allowed: a folder that the variable URMPIPE_CACHE names"
        raise FmuError(said) from error


def cached_fmu(
    unit: Unit, backend: Backend | None = None, *, told: Callable[[str], None] | None = None
) -> Path:
    """Return the FMU of a unit for this platform, built if it is not in the cache, or damaged there.

    A unit without a recipe of urmpipe or of a file is built each time, as nothing tells what its functions
    do; its place is named by what was built. Nothing is ever removed: the folder may be, at any time.

    Args:
        unit: The unit.
        backend: Native or Python; None for native if it can be built here, else Python.
        told: Told the name of the unit before it is built, which takes its time.

    Raises:
        FmuError: If it cannot be built, or the cache cannot be written.
        UnitError: If a function of the unit does what cannot be traced.
    """
    chosen, _ = chosen_backend(backend)
    tell = told or (lambda name: None)
    folder = cache_folder() / "fmus"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if not _is_told(unit.recipe):
            tell(unit.name)
            return _built_anew(unit, chosen, this_platform(), folder)
        folder /= _key(unit, chosen, this_platform())
        path, digest = folder / f"{unit.name}.fmu", folder / f"{unit.name}.sha256"
        if not _is_whole(path, digest):
            tell(unit.name)
            folder.mkdir(exist_ok=True)
            build_fmu(unit, path, backend=chosen, platforms=(this_platform(),))
            _write(digest, _hash_of(path))
    except OSError as error:
        said = f"cannot be written: {error.strerror or error}; the variable URMPIPE_CACHE names another place"
        raise FmuError(Finding(said, file=str(folder))) from error
    return path


def _is_told(recipe: Recipe) -> bool:
    """Tell whether a recipe says all that a unit is made from: with the text of a file, or urmpipe's own."""
    return bool(recipe.source) or recipe.module.partition(".")[0] in PACKAGES


def _built_anew(unit: Unit, backend: Backend, target: str, folder: Path) -> Path:
    """Build an FMU, and put it where its own hash says."""
    part = folder / f"{uuid.uuid4().hex}.part"
    try:
        build_fmu(unit, part, backend=backend, platforms=(target,))
        place = folder / _hash_of(part)[:32]
        place.mkdir(exist_ok=True)
        return part.replace(place / f"{unit.name}.fmu")
    finally:
        part.unlink(missing_ok=True)


def _is_whole(path: Path, digest: Path) -> bool:
    """Tell whether a file is there as it was written."""
    try:
        return digest.read_text(encoding="ascii") == _hash_of(path)
    except (OSError, UnicodeDecodeError):
        return False


def _hash_of(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _write(path: Path, text: str) -> None:
    """Write a small file beside its place, then rename it."""
    part = path.with_name(f"{uuid.uuid4().hex}.part")
    part.write_text(text, encoding="ascii")
    part.replace(path)


def _key(unit: Unit, backend: Backend, target: str) -> str:
    """Return the hash of all that the FMU of a unit is made from."""
    recipe = unit.recipe
    made_of: list[Any] = [
        [recipe.module, recipe.function, dict(recipe.arguments), recipe.source],
        [unit.name, unit.description, repr(unit.variables), unit.equations, unit.source],
        [backend, target, platform.python_version(), sys.implementation.name, *_versions()],
        _compiler() if backend == "native" else "",
        _sources(),
    ]
    digest = hashlib.sha256(json.dumps(made_of, sort_keys=True, default=repr).encode())
    if recipe.source and backend == "native":
        from urmpipe_fmus.native import native_sources

        digest.update(content_guid(native_sources(unit)).encode())
    if unit.table is not None:
        digest.update(repr(unit.table.values.shape).encode())
        digest.update(unit.table.t_ns.tobytes())
        digest.update(unit.table.values.tobytes())
    return digest.hexdigest()[:32]


@cache
def _versions() -> list[str]:
    """Return the versions of what takes part, empty for what is not installed."""
    found = []
    for name in DISTRIBUTIONS:
        try:
            found.append(version(name))
        except PackageNotFoundError:
            found.append("")
    return found


def _compiler() -> list[Any]:
    """Return what tells one C compiler from another without running it: command, files, sizes and times."""
    from urmpipe_fmus.native.compile import system_compiler

    told: list[Any] = list(command := system_compiler() or [])
    for found in filter(None, map(shutil.which, command)):  # of `ccache gcc` both
        file = Path(found).resolve()
        status = file.stat()
        told += [str(file), status.st_size, status.st_mtime_ns]
    return told


@cache
def _sources() -> str:
    """Return the hash of urmpipe's own sources."""
    digest = hashlib.sha256()
    for package in PACKAGES:
        spec = find_spec(package)
        for root in (spec.submodule_search_locations or []) if spec else []:
            for path in sorted(Path(root).rglob("*")):
                if path.suffix in SUFFIXES:
                    content = path.read_bytes()
                    name = path.relative_to(root).as_posix().encode()
                    digest.update(f"{package} {len(name)} {len(content)} ".encode() + name + content)
    return digest.hexdigest()
