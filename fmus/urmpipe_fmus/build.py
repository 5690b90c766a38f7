"""From a unit to an FMU file."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from urmpipe_fmus.archive import content_guid, write_fmu
from urmpipe_fmus.description import Backend, model_description
from urmpipe_fmus.documentation import documentation
from urmpipe_fmus.robot_entry import robot_file
from urmpipe_fmus.unit import Unit
from urmpipe_models.display import Shown, line_of
from urmpipe_models.errors import Finding, FmuError, Hint

if TYPE_CHECKING:
    import pandas as pd

DESCRIPTION = "modelDescription.xml"
DOCUMENTATION = "documentation/index.html"


@dataclass(frozen=True, slots=True, repr=False)
class BuiltFmu(Shown):
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
    unit: Unit
    backend: Backend
    platforms: tuple[str, ...]
    guid: str
    note: str = ""

    def _headline(self) -> str:
        """Return the file, and what is in it."""
        return line_of(str(self.path), self.unit.name, self.backend, *self.platforms)

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
    unit: Unit,
    target: Path,
    *,
    backend: Backend | None = None,
    platforms: Sequence[str] = (),
    told: Callable[[str], None] | None = None,
) -> BuiltFmu:
    """Build the FMU of a unit; the same unit, versions and compiler give the same bytes.

    Args:
        unit: The unit.
        target: The file, or a folder that exists: then UNIT.fmu in it.
        backend: Native or Python; None for native, or Python if native cannot be built here and no platform
            is named.
        platforms: FMI's names of platforms; by default native is for this one, Python for all it knows.
        told: Told what takes minutes: compiling for another platform.

    Raises:
        FmuError: If a compiler is missing or fails, Python cannot make the unit again, or the file cannot
            be written.
        UnitError: If a function of the unit does what cannot be traced.
    """
    chosen, missing = chosen_backend(backend, platforms)
    if chosen == "native":
        files, guid, found = _native(unit, platforms, told)
    else:
        files, guid, found = _python(unit, platforms)
    note = missing and f"{unit.name}.fmu runs on Python, as no native one can be built here: {missing}"
    path = target / f"{unit.name}.fmu" if target.is_dir() else target
    write_fmu(path, files)
    return BuiltFmu(path, unit, chosen, found, guid, note)


def chosen_backend(backend: Backend | None, platforms: Sequence[str] = ()) -> tuple[Backend, str]:
    """Return the backend that builds here, and why it is Python where nobody asked for it.

    Args:
        backend: What is asked for; None for native if it can be built here, else Python.
        platforms: FMI's names of platforms; by default this one.

    Raises:
        FmuError: If native, or platforms without a backend, are asked for and cannot be built here: who names
            a platform wants a file that runs there without Python.
    """
    from urmpipe_fmus.native import native_missing

    missing = None if backend == "python" else native_missing(platforms)
    if missing and backend == "native":
        found = f"native, which cannot be built here: {missing}"
        raise FmuError(Finding(parameter="backend", found=found, allowed="python"))
    if missing and backend is None and platforms:
        found = f"{', '.join(platforms)}, which cannot be compiled here: {missing}"
        hint = Hint("backend", "python", "packages an FMU that needs Python with NumPy")
        raise FmuError(Finding(parameter="platforms", found=found, hints=(hint,)))
    return backend or ("python" if missing else "native"), missing or ""


def _native(
    unit: Unit, platforms: Sequence[str], told: Callable[[str], None] | None
) -> tuple[dict[str, bytes], str, tuple[str, ...]]:
    """Return files, GUID and platforms of a native FMU: machine code, and the C that it is made from."""
    from urmpipe_fmus.native import guid_header, native_binaries, native_sources, this_platform
    from urmpipe_fmus.native.sources import GUID_HEADER

    chosen = tuple(dict.fromkeys(platforms)) or (this_platform(),)
    sources = native_sources(unit)
    compiled = [name.removeprefix("sources/") for name in sorted(sources) if name.endswith(".c")]
    files, guid = _described(unit, "native", {**sources, **_table(unit)}, compiled)
    files |= native_binaries(unit, sources, guid, chosen, told=told)
    return files | {GUID_HEADER: guid_header(guid)}, guid, chosen


def _python(unit: Unit, platforms: Sequence[str]) -> tuple[dict[str, bytes], str, tuple[str, ...]]:
    """Return files, GUID and platforms of a Python FMU: the unit's sources under pythonfmu's binaries."""
    from urmpipe_fmus.python_fmu.package import PLATFORMS, python_files

    chosen = tuple(dict.fromkeys(platforms)) or PLATFORMS
    files, guid = _described(unit, "python", python_files(unit, chosen, _table(unit)), [])
    return files, guid, chosen


def _table(unit: Unit) -> dict[str, bytes]:
    """Return the file of a unit's table, if it has one."""
    from urmpipe_fmus.table_file import TABLE_FILE, table_bytes

    return {} if unit.table is None else {TABLE_FILE: table_bytes(unit.table)}


def _described(
    unit: Unit, backend: Backend, files: dict[str, bytes], source_files: Sequence[str]
) -> tuple[dict[str, bytes], str]:
    """Return files with their description, documentation and arm, and the GUID of them all."""
    files = files | robot_file(unit) | {DOCUMENTATION: documentation(unit).encode()}
    without = model_description(unit, "", backend, source_files)
    guid = content_guid({**files, DESCRIPTION: without.encode()})
    described = without.replace(' guid=""', f' guid="{guid}"', 1)  # the root's: values hold no quotes
    return {**files, DESCRIPTION: described.encode()}, guid
