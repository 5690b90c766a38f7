"""FMI's names of platforms, and where in an FMU the binary for this one is.

An FMU as a file: a zip that is the same bytes for the same content, and a GUID of that content.

An FMU of any tool as it is opened: its zip and description are checked before anything is unpacked.
"""

from __future__ import annotations

import hashlib
import platform
import stat
import struct
import sys
import uuid
import zipfile
import zlib
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.parsers import expat

from urmpipe_models.errors import Finding, FmuError, format_value
from urmpipe_models.files import keep_permissions, suggest_path

X86 = ("x86_64", "amd64", "i386", "i486", "i586", "i686", "x86")
"""What processors call themselves that FMI 2.0's linux64, win64 and their like stand for."""


def this_platform() -> str:
    """Return FMI's name of the platform that this runs on: linux64, or aarch64-linux.

    FMI 2.0's short names are those of x86; FMI 2.0.4 takes the names of FMI 3.0 for all others.
    """
    system, processor = platform.system(), platform.machine().lower()
    if processor in X86:
        return _short(system)
    long = {"Windows": "windows", "Darwin": "darwin"}.get(system, "linux")
    return f"{'aarch64' if processor == 'arm64' else processor}-{long}"


def is_windows(name: str) -> bool:
    """Return whether a platform's name is one of Windows."""
    return name.startswith("win") or name.endswith("-windows")


def binary_suffix(name: str) -> str:
    """Return how a binary's name ends on a platform."""
    return ".dll" if is_windows(name) else ".dylib" if "darwin" in name else ".so"


def host_platforms() -> tuple[str, ...]:
    """Return the names under which a binary for this platform may be, the better first.

    The second of an ARM processor is the short name, which other tools of FMI 2.0 still give it.
    """
    return tuple(dict.fromkeys((this_platform(), _short(platform.system()))))


def host_binaries(identifier: str) -> tuple[str, ...]:
    """Return the paths in an FMU at which its binary for this platform may be, the better first."""
    return tuple(f"binaries/{one}/{identifier}{binary_suffix(one)}" for one in host_platforms())


def find_binary(folder: Path, identifier: str) -> Path:
    """Return the binary for this platform in the folder of an FMU; the better path, if there is none."""
    paths = [folder / one for one in host_binaries(identifier)]
    return next((one for one in paths if one.is_file()), paths[0])


def _short(system: str) -> str:
    bits = "64" if sys.maxsize > 2**32 else "32"
    return {"Windows": "win", "Darwin": "darwin"}.get(system, "linux") + bits


EARLIEST = (1980, 1, 1, 0, 0, 0)
"""The time of every entry: zip knows none before."""

UNIX = 3
"""Who made the entry, so that its permissions are read as those of a file."""


def content_guid(files: Mapping[str, bytes]) -> str:
    """Return the GUID of some files: the first 128 bits of the SHA-256 of their names and contents."""
    digest = hashlib.sha256()
    for name in sorted(files):
        for part in (name.encode(), files[name]):
            digest.update(len(part).to_bytes(8, "little") + part)
    return f"{{{uuid.UUID(bytes=digest.digest()[:16])}}}"


def write_fmu(path: Path, files: Mapping[str, bytes]) -> None:
    """Write an FMU, beside its place first, then renamed: it is whole or not there.

    Args:
        path: Where it shall stand; what stands there is replaced.
        files: Contents by their path in the FMU.

    Raises:
        OSError: If it cannot be written.
    """
    part = path.with_name(f"{path.stem[:40]}.{uuid.uuid4().hex[:12]}.part")
    try:
        with zipfile.ZipFile(part, "x") as archive:
            for name in sorted(files):
                archive.writestr(_entry(name), files[name])
        keep_permissions(part, path)
        part.replace(path)
    finally:
        with suppress(OSError):  # why it cannot be written is told
            part.unlink()


def _entry(name: str) -> zipfile.ZipInfo:
    """Return an entry without a trace of when, where and by whom it was made."""
    entry = zipfile.ZipInfo(name, EARLIEST)
    entry.compress_type = zipfile.ZIP_DEFLATED
    entry.create_system = UNIX
    entry.external_attr = (0o755 if name.startswith("binaries/") else 0o644) << 16
    return entry


DESCRIPTION = "modelDescription.xml"

UNPACKED = 4e9
"""Bytes that an FMU may unpack to: with a runtime of Python or Java inside it takes a tenth of them."""

RATIO, RATIO_FROM = 200.0, 1e8
"""So many times its own size an FMU may unpack to, where that is more than so many bytes: code is three times
its packed size, XML twenty."""

MAX_ENTRIES = 100_000
"""Entries of an FMU: those with a runtime of Python or Java inside have some ten thousand."""

XML_BYTES, XML_PARTS = 3.2e7, 1_600_000
"""Bytes of a model description, and elements and attributes in it: 130,000 variables, of which each takes
250 bytes with twelve. Read and validated they take 0.7 GB."""

XML_DEPTH = 100
"""How deep elements of a model description may stand in each other: FMI 2.0 needs six, annotations more."""

PACKING = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
"""How entries may be packed (FMI 2.0.4, section 2.3)."""

ENCRYPTED = 0x1
"""The bit of an entry's flags that says so (APPNOTE 6.3.10, section 4.4.4)."""

LISTED = 5
"""So many entries are named of those that are wrong in one way."""

AN_FMU = "an FMU, such as urmpipe fmu build makes of a unit"

ZIP_ERRORS = (
    zipfile.BadZipFile,
    zlib.error,
    struct.error,
    EOFError,
    ValueError,
    NotImplementedError,
    RuntimeError,
)
"""What zipfile raises for a zip that it cannot read."""


@dataclass(frozen=True, slots=True)
class FmuFile:
    """An FMU whose archive and description are within the limits.

    Attributes:
        path: The file.
        names: Paths of its entries.
        version: The version of FMI in its description; empty if none.
        kinds: The elements of its description with a modelIdentifier: CoSimulation, ModelExchange.
    """

    path: Path
    names: tuple[str, ...]
    version: str
    kinds: tuple[str, ...]

    def read_description(self) -> Any:
        """Return FMPy's reading of the description, which is not validated.

        Raises:
            FmuError: If FMPy cannot read it.
        """
        from fmpy import read_model_description

        try:
            return read_model_description(self.path, validate=False)
        except Exception as error:  # what FMPy raises for a description it does not expect is of any kind
            raise _refused(
                self.path, f"{DESCRIPTION} cannot be read: {type(error).__name__}: {error}"
            ) from error

    def unpack(self, folder: Path, *, skip: str | None = None) -> None:
        """Unpack it into a folder.

        Args:
            folder: Where; it is made if it is not there.
            skip: How the paths of the entries begin that are left out.

        Raises:
            FmuError: If an entry is damaged, or there is no room.
        """
        names = [name for name in self.names if skip is None or not name.startswith(skip)]
        try:
            with zipfile.ZipFile(self.path) as archive:
                archive.extractall(folder, names)
        except OSError as error:
            raise _refused(self.path, f"cannot be unpacked: {error.strerror or error}") from error
        except (*ZIP_ERRORS, KeyError) as error:
            raise _refused(self.path, f"cannot be unpacked: {error}") from error


def open_fmu(path: Path) -> FmuFile:
    """Check the archive of an FMU and its description; nothing is unpacked.

    Raises:
        FmuError: With all that is wrong with the archive, or else with its description.
    """
    content = _description(path)
    found = _Description(path)
    found.read(content[0])
    return FmuFile(path, content[1], found.version, tuple(found.kinds))


def _description(path: Path) -> tuple[bytes, tuple[str, ...]]:
    """Return the description of an FMU, and the paths of its entries, all checked."""
    if "\0" in str(path):
        raise FmuError(f"found {format_value(str(path))}, allowed: the name of a file")
    try:
        kind = path.stat().st_mode
        if not stat.S_ISREG(
            kind
        ):  # a pipe would be waited for, and Windows only says that folders may not be read
            raise _refused(
                path, f"found a {'folder' if stat.S_ISDIR(kind) else 'pipe or device'}, allowed: {AN_FMU}"
            )
        with zipfile.ZipFile(path) as archive:
            faults = [*_size_faults(path, archive.infolist()), *_entry_faults(archive.infolist())]
            if faults:
                raise FmuError(*(Finding(fault, file=str(path)) for fault in faults))
            names = tuple(archive.namelist())
            if DESCRIPTION not in names:
                raise _refused(path, f"found a zip without {DESCRIPTION}, allowed: {AN_FMU}")
            return archive.read(DESCRIPTION), names
    except FileNotFoundError as error:
        raise _refused(
            path, f"found no such file{suggest_path(path, ('.fmu',))}, allowed: {AN_FMU}"
        ) from error
    except OSError as error:
        raise _refused(path, f"cannot be read: {error.strerror or error}") from error
    except ZIP_ERRORS as error:
        raise _refused(path, f"found {_no_zip(path)}, allowed: {AN_FMU}") from error


def _no_zip(path: Path) -> str:
    """Return what a file is that cannot be opened as the zip that an FMU is."""
    with path.open("rb") as file:
        head = file.read(2)
    if not head:
        return "an empty file"
    return "a zip that is cut off or damaged" if head == b"PK" else "no zip, as an FMU is one"


def _size_faults(path: Path, entries: Sequence[zipfile.ZipInfo]) -> Iterator[str]:
    """Yield what is too much: entries, bytes, bytes of the description.

    zipfile unpacks no more of an entry than the size that the entry tells.
    """
    unpacked, packed = sum(one.file_size for one in entries), path.stat().st_size
    if len(entries) > MAX_ENTRIES:
        yield f"found {len(entries)} entries, allowed: {MAX_ENTRIES}"
    if unpacked > UNPACKED:
        yield f"found {unpacked / 1e6:.6g} MB when unpacked, allowed: {UNPACKED / 1e6:g} MB"
    elif unpacked > max(RATIO_FROM, RATIO * packed):
        yield (
            f"found {unpacked / 1e6:.4g} MB when unpacked, {unpacked / packed:.0f} times the file, allowed:"
            f" {RATIO:g} times, from {RATIO_FROM / 1e6:g} MB on"
        )
    for one in entries:
        if one.filename == DESCRIPTION and one.file_size > XML_BYTES:
            yield f"{DESCRIPTION}: found {one.file_size / 1e6:.4g} MB, allowed: {XML_BYTES / 1e6:g} MB"


def _entry_faults(entries: Sequence[zipfile.ZipInfo]) -> Iterator[str]:
    """Yield which entries would not be unpacked, or outside the folder of the FMU, or over each other."""
    odd = [one.orig_filename for one in entries if _leads_elsewhere(one.orig_filename)]
    yield from _listed(odd, "the path", "paths below the FMU's folder, with / between their parts")
    links = [one.orig_filename for one in entries if stat.S_ISLNK(one.external_attr >> 16)]
    yield from _listed(links, "the symbolic link", "files and folders")
    secret = [one.orig_filename for one in entries if one.flag_bits & ENCRYPTED]
    yield from _listed(secret, "the encrypted", "files without a password")
    packed = [
        f"{one.orig_filename} (method {one.compress_type})"
        for one in entries
        if one.compress_type not in PACKING
    ]
    yield from _listed(packed, "the packing of", "stored or deflated (methods 0, 8)")
    twice = [name for name, count in Counter(one.filename for one in entries).items() if count > 1]
    yield from _listed(twice, "twice", "each path once")


def _listed(names: Sequence[str], what: str, allowed: str) -> Iterator[str]:
    """Yield a line with the first of some names, if there are any."""
    if names:
        more = f" and {len(names) - LISTED} more" if len(names) > LISTED else ""
        yield f"found {what} {', '.join(map(_written, names[:LISTED]))}{more}, allowed: {allowed}"


def _written(name: str) -> str:
    """Return a path as a message shows it."""
    return name if name.isprintable() and len(name) <= 60 else format_value(name)


def _leads_elsewhere(name: str) -> bool:
    """Return whether a path might be another one when it is unpacked here, or on another system."""
    return (
        name.startswith("/")
        or ".." in name.split("/")
        or any(sign in name for sign in "\\:")
        or not name.isprintable()
    )


class _Description:
    """What is asked of a description before a library reads it.

    Attributes:
        version: The version of FMI that it tells.
        kinds: Its elements with a modelIdentifier.
    """

    def __init__(self, path: Path) -> None:
        self._path, self._depth, self._parts = path, 0, 0
        self._faults: dict[str, None] = {}
        self.version = ""
        self.kinds: list[str] = []

    def read(self, content: bytes) -> None:
        """Read a description.

        Raises:
            FmuError: If it is no XML, has a document type, is nested too deep, or tells binaries elsewhere.
        """
        parser = expat.ParserCreate()
        parser.StartElementHandler, parser.EndElementHandler = self._begin, self._end
        parser.StartDoctypeDeclHandler = self._doctype
        try:
            parser.Parse(content, True)
        except (expat.ExpatError, LookupError, ValueError) as error:
            said = f"{DESCRIPTION} cannot be read: {error}; allowed: XML as FMI 2.0 has it"
            raise _refused(self._path, said) from error
        if self._faults:
            raise FmuError(*(Finding(fault, file=str(self._path)) for fault in self._faults))

    def _begin(self, tag: str, attributes: dict[str, str]) -> None:
        self._depth += 1
        self._parts += 1 + len(attributes)
        if self._depth > XML_DEPTH:
            self._refuse(f"found more than {XML_DEPTH} elements in each other, allowed: {XML_DEPTH}")
        if self._parts > XML_PARTS:
            self._refuse(f"found more than {XML_PARTS} elements and attributes, allowed: {XML_PARTS}")
        if self._depth == 1:
            self.version = attributes.get("fmiVersion", "")
        name = attributes.get("modelIdentifier")
        if self._depth == 2 and name is not None:
            self.kinds.append(tag)
            if not name or name == "." or "/" in name or _leads_elsewhere(name):
                allowed = "the name of its binaries, without / \\ and :"
                self._faults[f"modelIdentifier: found {format_value(name)}, allowed: {allowed}"] = None

    def _end(self, _: str) -> None:
        self._depth -= 1

    def _doctype(self, *_: object) -> None:
        """Refuse what could declare entities, of which few bytes become many."""
        self._refuse(
            "found a document type (<!DOCTYPE ...>), allowed: XML without document type and entities"
        )

    def _refuse(self, said: str) -> None:
        raise _refused(self._path, f"{DESCRIPTION}: {said}")


def _refused(path: Path, said: str) -> FmuError:
    return FmuError(Finding(said, file=str(path)))
