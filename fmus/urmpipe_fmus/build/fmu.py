"""The arm of a unit as a file in its FMU, so that a system draws the arm of an FMU like that of a unit.

From a unit to an FMU file.

FMUs that were built before, found again by the hash of all that they are made from.

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
import tomllib
import uuid
import zipfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

from urmpipe_fmus.block import BlockModel, Recipe
from urmpipe_fmus.build.description import Backend, documentation, model_description
from urmpipe_fmus.fmu_file import ZIP_ERRORS, content_guid, this_platform, write_fmu
from urmpipe_models.arm.chain import Chain
from urmpipe_models.display import Displayable, format_headline
from urmpipe_models.errors import Finding, FmuError, Hint, UrmpipeError
from urmpipe_models.robots.toml import chain_from_dict

if TYPE_CHECKING:
    import pandas as pd

ROBOT_FILE = "resources/robot.toml"


def robot_to_entry(model: BlockModel) -> dict[str, bytes]:
    """Return the file of the arm that a unit was made of, if it was."""
    robot = model.recipe.arguments.get("robot") if model.recipe else None
    return {ROBOT_FILE: robot.encode()} if isinstance(robot, str) else {}


def read_robot_entry(fmu: Path) -> Chain | None:
    """Return the arm in an FMU that `open_fmu` accepted; None if it has none that can be read.

    Any tool may have made the FMU, and a file of this name in it is no fault.
    """
    try:
        with zipfile.ZipFile(fmu) as archive:
            return chain_from_dict(tomllib.loads(archive.read(ROBOT_FILE).decode()))
    except (*ZIP_ERRORS, KeyError, OSError, UrmpipeError):
        return None


DESCRIPTION = "modelDescription.xml"
DOCUMENTATION = "documentation/index.html"


@dataclass(frozen=True, slots=True, repr=False)
class BuiltFmu(Displayable):
    """An FMU that was built.

    Attributes:
        path: The file.
        unit: What is in it.
        backend: Who runs the unit: its own machine code, or Python on the target.
        platforms: FMI's names of the platforms it has binaries for.
        guid: The GUID, of its content.
        note: One line on why it is not native although nobody asked for Python; else empty.
    """

    path: Path
    unit: BlockModel
    backend: Backend
    platforms: tuple[str, ...]
    guid: str
    note: str = ""

    def _headline(self) -> str:
        """Return the file, and what is in it."""
        return format_headline(str(self.path), self.unit.name, self.backend, *self.platforms)

    def _notes(self) -> list[str]:
        """Return why it is not native."""
        return [self.note] if self.note else []

    def to_frame(self) -> pd.DataFrame:
        """Return one row a variable of the unit: name, causality, unit, start, description."""
        import pandas as pd

        fields = ("name", "causality", "unit", "start", "description")
        return pd.DataFrame(
            [[getattr(one, field) for field in fields] for one in self.unit.variables], columns=list(fields)
        )

    def to_dict(self) -> dict[str, Any]:
        """Return the object that `urmpipe fmu build --json` prints."""
        return {
            "schema": 1,
            "fmu": str(self.path),
            "unit": self.unit.name,
            "backend": self.backend,
            "platforms": list(self.platforms),
            "guid": self.guid,
            "size": self.path.stat().st_size,
            "note": self.note or None,
        }


def build_fmu(
    model: BlockModel,
    target: Path,
    *,
    backend: Backend | None = None,
    platforms: Sequence[str] = (),
    on_message: Callable[[str], None] | None = None,
) -> BuiltFmu:
    """Build the FMU of a unit; the same unit, versions and compiler give the same bytes.

    Args:
        model: The block model.
        target: The file, or a folder that exists: then UNIT.fmu in it.
        backend: Native or Python; None for native, or Python if native cannot be built here and no platform
            is named.
        platforms: FMI's names of platforms; by default native is for this one, Python for all it knows.
        on_message: Told what takes minutes: compiling for another platform.

    Raises:
        FmuError: If a compiler is missing or fails, Python cannot make the unit again, or the file cannot
            be written.
        UnitError: If a function of the unit does what cannot be traced.
    """
    chosen, missing = select_backend(backend, platforms)
    if chosen == "native":
        files, guid, found = _native(model, platforms, on_message)
    else:
        files, guid, found = _python(model, platforms)
    note = missing and f"{model.name}.fmu runs on Python, as no native one can be built here: {missing}"
    path = target / f"{model.name}.fmu" if target.is_dir() else target
    write_fmu(path, files)
    return BuiltFmu(path, model, chosen, found, guid, note)


def select_backend(backend: Backend | None, platforms: Sequence[str] = ()) -> tuple[Backend, str]:
    """Return the backend that builds here, and why it is Python where nobody asked for it.

    Args:
        backend: What is asked for; None for native if it can be built here, else Python.
        platforms: FMI's names of platforms; by default this one.

    Raises:
        FmuError: If native, or platforms without a backend, are asked for and cannot be built here: who names
            a platform wants a file that runs there without Python.
    """
    from urmpipe_fmus.native import native_unavailable_reason

    missing = None if backend == "python" else native_unavailable_reason(platforms)
    if missing and backend == "native":
        found = f"native, which cannot be built here: {missing}"
        raise FmuError(Finding(parameter="backend", found=found, allowed="python"))
    if missing and backend is None and platforms:
        found = f"{', '.join(platforms)}, which cannot be compiled here: {missing}"
        hint = Hint("backend", "python", "packages an FMU that needs Python with NumPy")
        raise FmuError(Finding(parameter="platforms", found=found, hints=(hint,)))
    return backend or ("python" if missing else "native"), missing or ""


def _native(
    model: BlockModel, platforms: Sequence[str], on_message: Callable[[str], None] | None
) -> tuple[dict[str, bytes], str, tuple[str, ...]]:
    """Return files, GUID and platforms of a native FMU: machine code, and the C that it is made from."""
    from urmpipe_fmus.native import guid_header, native_binaries, native_sources, this_platform
    from urmpipe_fmus.native.compile import GUID_HEADER

    chosen = tuple(dict.fromkeys(platforms)) or (this_platform(),)
    sources = native_sources(model)
    compiled = [name.removeprefix("sources/") for name in sorted(sources) if name.endswith(".c")]
    files, guid = _described(model, "native", {**sources, **_table(model)}, compiled)
    files |= native_binaries(model, sources, guid, chosen, on_message=on_message)
    return files | {GUID_HEADER: guid_header(guid)}, guid, chosen


def _python(model: BlockModel, platforms: Sequence[str]) -> tuple[dict[str, bytes], str, tuple[str, ...]]:
    """Return files, GUID and platforms of a Python FMU: the unit's sources under pythonfmu's binaries."""
    from urmpipe_fmus.python_fmu.package import PLATFORMS, python_files

    chosen = tuple(dict.fromkeys(platforms)) or PLATFORMS
    files, guid = _described(model, "python", python_files(model, chosen, _table(model)), [])
    return files, guid, chosen


def _table(model: BlockModel) -> dict[str, bytes]:
    """Return the file of a unit's table, if it has one."""
    from urmpipe_fmus.block import TABLE_FILE, table_bytes

    return {} if model.table is None else {TABLE_FILE: table_bytes(model.table)}


def _described(
    model: BlockModel, backend: Backend, files: dict[str, bytes], source_files: Sequence[str]
) -> tuple[dict[str, bytes], str]:
    """Return files with their description, documentation and arm, and the GUID of them all."""
    files = files | robot_to_entry(model) | {DOCUMENTATION: documentation(model).encode()}
    without = model_description(model, "", backend, source_files)
    guid = content_guid({**files, DESCRIPTION: without.encode()})
    described = without.replace(' guid=""', f' guid="{guid}"', 1)  # the root's: values hold no quotes
    return {**files, DESCRIPTION: described.encode()}, guid


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
    model: BlockModel, backend: Backend | None = None, *, on_message: Callable[[str], None] | None = None
) -> Path:
    """Return the FMU of a unit for this platform, built if it is not in the cache, or damaged there.

    A unit without a recipe of urmpipe or of a file is built each time, as nothing tells what its functions
    do; its place is named by what was built. Nothing is ever removed: the folder may be, at any time.

    Args:
        model: The block model.
        backend: Native or Python; None for native if it can be built here, else Python.
        on_message: Told the name of the unit before it is built, which takes its time.

    Raises:
        FmuError: If it cannot be built, or the cache cannot be written.
        UnitError: If a function of the unit does what cannot be traced.
    """
    chosen, _ = select_backend(backend)
    tell = on_message or (lambda name: None)
    folder = cache_folder() / "fmus"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if not _is_told(model.recipe):
            tell(model.name)
            return _built_anew(model, chosen, this_platform(), folder)
        folder /= _key(model, chosen, this_platform())
        path, digest = folder / f"{model.name}.fmu", folder / f"{model.name}.sha256"
        if not _is_whole(path, digest):
            tell(model.name)
            folder.mkdir(exist_ok=True)
            build_fmu(model, path, backend=chosen, platforms=(this_platform(),))
            _write(digest, _hash_of(path))
    except OSError as error:
        said = f"cannot be written: {error.strerror or error}; the variable URMPIPE_CACHE names another place"
        raise FmuError(Finding(said, file=str(folder))) from error
    return path


def _is_told(recipe: Recipe) -> bool:
    """Tell whether a recipe says all that a unit is made from: with the text of a file, or urmpipe's own."""
    return bool(recipe.source) or recipe.module.partition(".")[0] in PACKAGES


def _built_anew(model: BlockModel, backend: Backend, target: str, folder: Path) -> Path:
    """Build an FMU, and put it where its own hash says."""
    part = folder / f"{uuid.uuid4().hex}.part"
    try:
        build_fmu(model, part, backend=backend, platforms=(target,))
        place = folder / _hash_of(part)[:32]
        place.mkdir(exist_ok=True)
        return part.replace(place / f"{model.name}.fmu")
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


def _key(model: BlockModel, backend: Backend, target: str) -> str:
    """Return the hash of all that the FMU of a unit is made from."""
    recipe = model.recipe
    made_of: list[Any] = [
        [recipe.module, recipe.function, dict(recipe.arguments), recipe.source],
        [model.name, model.description, repr(model.variables), model.equations, model.source],
        [backend, target, platform.python_version(), sys.implementation.name, *_versions()],
        _compiler() if backend == "native" else "",
        _sources(),
    ]
    digest = hashlib.sha256(json.dumps(made_of, sort_keys=True, default=repr).encode())
    if recipe.source and backend == "native":
        from urmpipe_fmus.native import native_sources

        digest.update(content_guid(native_sources(model)).encode())
    if model.table is not None:
        digest.update(repr(model.table.values.shape).encode())
        digest.update(model.table.t_ns.tobytes())
        digest.update(model.table.values.tobytes())
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
