"""From a block model to an FMU file, and the cache of FMUs that were built.

1. `build_fmu` selects the backend (`select_backend`), collects the files of the FMU - C sources and binaries,
   or Python sources under pythonfmu's binaries; the table, the robot, modelDescription.xml and the page of
   documentation - and writes them with a GUID of their content. The same model, versions and compiler give
   the same bytes.
2. `cached_fmu` finds an FMU by the hash of its inputs (`cache_key`). For a block of urmpipe the hash takes
   milliseconds: it reads recipe, table and urmpipe's sources, and neither calls the functions of the model
   nor imports CasADi. A user's file may read other files and import other packages, which become numbers of
   the machine code: so the traced C of its native FMU is hashed too.
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

from urmpipe_fmus.block import TABLE_FILE, BlockModel, table_bytes
from urmpipe_fmus.build.description import Backend, documentation, model_description
from urmpipe_fmus.fmu_file import DESCRIPTION, ZIP_ERRORS, content_guid, this_platform, write_fmu
from urmpipe_models.arm.chain import Chain
from urmpipe_models.display import Displayable, format_headline
from urmpipe_models.errors import Finding, FmuError, Hint, UrmpipeError
from urmpipe_models.robots.toml import chain_from_dict

if TYPE_CHECKING:
    import pandas as pd

DOCUMENTATION = "documentation/index.html"  # path in an FMU
ROBOT_FILE = "resources/robot.toml"  # path in an FMU; a system draws this robot

PACKAGES = ("urmpipe_fmus", "urmpipe_models", "urmpipe_datasets")
SUFFIXES = (".py", ".c", ".h", ".jinja", ".toml", ".urdf")  # of files of PACKAGES that may go into an FMU
DISTRIBUTIONS = ("urmpipe", "numpy", "casadi", "fmpy", "pythonfmu", "ziglang")


@dataclass(frozen=True, slots=True, repr=False)
class BuiltFmu(Displayable):
    """An FMU that was built.

    Attributes:
        path: The file.
        unit: The block model in it.
        backend: Native, which runs its own machine code, or Python, which needs Python on the target.
        platforms: FMI's names of the platforms it has binaries for.
        guid: The GUID, of its content.
        note: One line on why it is a Python FMU although Python was not requested; else empty.
    """

    path: Path
    unit: BlockModel
    backend: Backend
    platforms: tuple[str, ...]
    guid: str
    note: str = ""

    def _headline(self) -> str:
        return format_headline(str(self.path), self.unit.name, self.backend, *self.platforms)

    def _notes(self) -> list[str]:
        return [self.note] if self.note else []

    def to_frame(self) -> pd.DataFrame:
        """Return one row per variable of the model: name, causality, unit, start, description."""
        import pandas as pd

        fields = ["name", "causality", "unit", "start", "description"]
        rows = [[getattr(variable, field) for field in fields] for variable in self.unit.variables]
        return pd.DataFrame(rows, columns=fields)

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
    """Build the FMU of a block model.

    Args:
        model: The block model.
        target: The file, or an existing folder for NAME.fmu.
        backend: Native or Python; None for native, or Python if native cannot be built here and no platform
            is named.
        platforms: FMI's names of platforms; default: this one for native, all of pythonfmu for Python.
        on_message: Called before steps that take minutes: compiling for another platform.

    Raises:
        FmuError: If a compiler is missing or fails, Python cannot make the model again, or the file cannot
            be written.
        UnitError: If a function of the model cannot be traced.
    """
    selected, missing = select_backend(backend, platforms)
    table = {} if model.table is None else {TABLE_FILE: table_bytes(model.table)}
    platforms = tuple(dict.fromkeys(platforms))
    if selected == "native":
        from urmpipe_fmus.native.compile import GUID_HEADER, guid_header, native_binaries, native_sources

        platforms = platforms or (this_platform(),)
        sources = native_sources(model)
        compiled = [name.removeprefix("sources/") for name in sorted(sources) if name.endswith(".c")]
        files, guid = _add_description(model, "native", {**sources, **table}, compiled)
        files |= native_binaries(model, sources, guid, platforms, on_message=on_message)
        files |= {GUID_HEADER: guid_header(guid)}
    else:
        from urmpipe_fmus.python_fmu.package import PLATFORMS, python_files

        platforms = platforms or PLATFORMS
        files, guid = _add_description(model, "python", python_files(model, platforms, table), [])
    note = missing and f"{model.name}.fmu runs on Python, as no native one can be built here: {missing}"
    path = target / f"{model.name}.fmu" if target.is_dir() else target
    write_fmu(path, files)
    return BuiltFmu(path, model, selected, platforms, guid, note)


def select_backend(backend: Backend | None, platforms: Sequence[str] = ()) -> tuple[Backend, str]:
    """Return the backend that builds here, and why it is Python if that was not requested.

    Args:
        backend: The requested one; None for native if it can be built here, else Python.
        platforms: FMI's names of platforms; by default this one.

    Raises:
        FmuError: If native, or platforms without a backend, are requested and cannot be built here: the user
            of a named platform expects a file that runs there without Python.
    """
    from urmpipe_fmus.native import native_unavailable_reason

    missing = None if backend == "python" else native_unavailable_reason(platforms)
    if missing and backend == "native":
        message = f"native, which cannot be built here: {missing}"
        raise FmuError(Finding(parameter="backend", found=message, allowed="python"))  # plain: ok
    if missing and backend is None and platforms:
        message = f"{', '.join(platforms)}, which cannot be compiled here: {missing}"
        hint = Hint("backend", "python", "packages an FMU that needs Python with NumPy")
        raise FmuError(Finding(parameter="platforms", found=message, hints=(hint,)))  # plain: ok
    return backend or ("python" if missing else "native"), missing or ""


def _add_description(
    model: BlockModel, backend: Backend, files: dict[str, bytes], source_files: Sequence[str]
) -> tuple[dict[str, bytes], str]:
    """Return files with robot, documentation and description, and the GUID of their content."""
    robot = model.recipe.arguments.get("robot")
    files = files | ({ROBOT_FILE: robot.encode()} if isinstance(robot, str) else {})
    files |= {DOCUMENTATION: documentation(model).encode()}
    text = model_description(model, "", backend, source_files)
    guid = content_guid({**files, DESCRIPTION: text.encode()})
    text = text.replace(' guid=""', f' guid="{guid}"', 1)  # of the root: values contain no quotes
    return {**files, DESCRIPTION: text.encode()}, guid


def read_robot_entry(fmu: Path) -> Chain | None:
    """Return the robot in an FMU that `open_fmu` accepted; None if there is none that can be read.

    Any tool may have made the FMU, so that another file of this name is no error.
    """
    try:
        with zipfile.ZipFile(fmu) as archive:
            return chain_from_dict(tomllib.loads(archive.read(ROBOT_FILE).decode()))
    except (*ZIP_ERRORS, KeyError, OSError, UrmpipeError):
        return None


def cache_folder() -> Path:
    """Return the folder of the cache: URMPIPE_CACHE, else urmpipe's in the user's cache folder.

    Raises:
        FmuError: If neither is known.
    """
    folder = os.environ.get("URMPIPE_CACHE")
    if folder:
        return Path(folder)
    home = os.environ.get("LOCALAPPDATA") if os.name == "nt" else os.environ.get("XDG_CACHE_HOME")
    try:
        return (Path(home) if home else Path.home() / ".cache") / "urmpipe"
    except RuntimeError as error:  # a user without a home, in a container
        message = (
            "cache of FMUs: found no home folder, allowed: a folder that the variable URMPIPE_CACHE names"
        )
        raise FmuError(message) from error


def cached_fmu(
    model: BlockModel, backend: Backend | None = None, *, on_message: Callable[[str], None] | None = None
) -> Path:
    """Return the FMU of a block model for this platform, built if it is not in the cache, or damaged there.

    A model whose recipe is of neither urmpipe nor a file is built each time, as its functions are unknown;
    its folder is named by the hash of the FMU. Nothing is ever removed: the user may remove the folder at any
    time.

    Args:
        model: The block model.
        backend: Native or Python; None for native if it can be built here, else Python.
        on_message: Called with the name of the model before it is built, which takes seconds.

    Raises:
        FmuError: If it cannot be built, or the cache cannot be written.
        UnitError: If a function of the model cannot be traced.
    """
    selected, _ = select_backend(backend)
    on_message = on_message or (lambda name: None)
    options: dict[str, Any] = {"backend": selected, "platforms": (this_platform(),)}
    recipe = model.recipe
    folder = cache_folder() / "fmus"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if not recipe.source and recipe.module.partition(".")[0] not in PACKAGES:
            on_message(model.name)
            return _build_at_hash(model, folder, options)
        folder /= cache_key(model, selected, this_platform())
        path, digest = folder / f"{model.name}.fmu", folder / f"{model.name}.sha256"
        if not _is_complete(path, digest):
            on_message(model.name)
            folder.mkdir(exist_ok=True)
            build_fmu(model, path, **options)
            part = digest.with_name(f"{uuid.uuid4().hex}.part")
            part.write_text(_file_hash(path), encoding="ascii")
            part.replace(digest)
    except OSError as error:
        message = (
            f"cannot be written: {error.strerror or error}; the variable URMPIPE_CACHE names another place"
        )
        raise FmuError(Finding(message, file=str(folder))) from error
    return path


def _build_at_hash(model: BlockModel, folder: Path, options: dict[str, Any]) -> Path:
    """Build an FMU, and move it to the folder that its hash names."""
    part = folder / f"{uuid.uuid4().hex}.part"
    try:
        build_fmu(model, part, **options)
        folder /= _file_hash(part)[:32]
        folder.mkdir(exist_ok=True)
        return part.replace(folder / f"{model.name}.fmu")
    finally:
        part.unlink(missing_ok=True)


def _is_complete(path: Path, digest: Path) -> bool:
    """Return whether a file has the hash that was stored when it was written."""
    try:
        return digest.read_text(encoding="ascii") == _file_hash(path)
    except (OSError, UnicodeDecodeError):
        return False


def _file_hash(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def cache_key(model: BlockModel, backend: Backend, target: str) -> str:
    """Return the hash of all inputs of the FMU of a block model.

    Args:
        model: The block model.
        backend: Native or Python.
        target: FMI's name of the platform.
    """
    recipe = model.recipe
    inputs: list[Any] = [
        [recipe.module, recipe.function, dict(recipe.arguments), recipe.source],
        [model.name, model.description, repr(model.variables), model.equations, model.source],
        [backend, target, platform.python_version(), sys.implementation.name, *_versions()],
        _compiler_files() if backend == "native" else "",
        _sources_hash(),
    ]
    digest = hashlib.sha256(json.dumps(inputs, sort_keys=True, default=repr).encode())
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
    """Return the versions of `DISTRIBUTIONS`, empty if not installed."""
    versions = []
    for name in DISTRIBUTIONS:
        try:
            versions.append(version(name))
        except PackageNotFoundError:
            versions.append("")
    return versions


def _compiler_files() -> list[Any]:
    """Return what distinguishes C compilers without running them: command, files, sizes and times."""
    from urmpipe_fmus.native.compile import system_compiler

    properties: list[Any] = list(command := system_compiler() or [])
    for program in filter(None, map(shutil.which, command)):  # both of `ccache gcc`
        file = Path(program).resolve()
        status = file.stat()
        properties += [str(file), status.st_size, status.st_mtime_ns]
    return properties


@cache
def _sources_hash() -> str:
    """Return the hash of urmpipe's sources."""
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
