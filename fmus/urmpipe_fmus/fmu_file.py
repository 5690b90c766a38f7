"""FMUs as files: where the binary of a platform is, how an FMU is written, and how any FMU is opened.

1. FMI's names of platforms, and the path of the binary for this one.
2. `content_guid` and `write_fmu`: a zip that has the same bytes for the same content, written atomically.
3. `open_fmu`: an FMU of any tool. Before anything is unpacked, the archive is checked against limits of size
   and for paths outside its folder, and the description for its size, depth and a document type.
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

X86 = ("x86_64", "amd64", "i386", "i486", "i586", "i686", "x86")  # processors that FMI 2.0's linux64, .. mean

DESCRIPTION = "modelDescription.xml"
ZIP_TIME = (1980, 1, 1, 0, 0, 0)  # of every entry: the earliest that zip can store
ZIP_UNIX = 3  # system of an entry whose permissions are those of a file

# Limits of an FMU. A runtime of Python or Java inside it takes a tenth of bytes and entries. Code is three
# times its packed size, XML twenty. A description of 130,000 variables, each of 250 bytes with twelve
# elements and attributes, takes 0.7 GB to be read and validated. FMI 2.0 nests six elements, annotations
# more.
MAX_UNPACKED_BYTES = 4e9
MAX_RATIO, RATIO_FROM_BYTES = 200.0, 1e8  # unpacked / packed size; from this unpacked size on
MAX_ENTRIES = 100_000
MAX_XML_BYTES, MAX_XML_PARTS = 3.2e7, 1_600_000  # of a description; parts: elements and attributes
MAX_XML_DEPTH = 100

PACKING = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)  # FMI 2.0.4, section 2.3
ENCRYPTED = 0x1  # bit of an entry's flags (APPNOTE 6.3.10, section 4.4.4)
MAX_LISTED = 5  # entries with the same error in a message
AN_FMU = "an FMU, such as urmpipe fmu build makes of a unit"

# Exceptions of zipfile for a zip that it cannot read.
ZIP_ERRORS = (
    zipfile.BadZipFile, zlib.error, struct.error, EOFError, ValueError, NotImplementedError, RuntimeError,
)  # fmt: skip


def this_platform() -> str:
    """Return FMI's name of this platform, such as linux64 or aarch64-linux.

    FMI 2.0's short names are those of x86; FMI 2.0.4 takes the names of FMI 3.0 for all others.
    """
    system, processor = platform.system(), platform.machine().lower()
    if processor in X86:
        return _short_name(system)
    long = {"Windows": "windows", "Darwin": "darwin"}.get(system, "linux")
    return f"{'aarch64' if processor == 'arm64' else processor}-{long}"


def _short_name(system: str) -> str:
    bits = "64" if sys.maxsize > 2**32 else "32"
    return {"Windows": "win", "Darwin": "darwin"}.get(system, "linux") + bits


def is_windows(name: str) -> bool:
    """Return whether a name of a platform is one of Windows."""
    return name.startswith("win") or name.endswith("-windows")


def binary_suffix(name: str) -> str:
    """Return the suffix of binaries on a platform."""
    return ".dll" if is_windows(name) else ".dylib" if "darwin" in name else ".so"


def host_platforms() -> tuple[str, ...]:
    """Return the names under which a binary for this platform may be found, the preferred one first.

    The second of an ARM processor is the short name, which other tools of FMI 2.0 still give it.
    """
    return tuple(dict.fromkeys((this_platform(), _short_name(platform.system()))))


def host_binaries(identifier: str) -> tuple[str, ...]:
    """Return the paths in an FMU at which its binary for this platform may be, the preferred one first."""
    return tuple(f"binaries/{name}/{identifier}{binary_suffix(name)}" for name in host_platforms())


def find_binary(folder: Path, identifier: str) -> Path:
    """Return the binary for this platform in the folder of an FMU; the preferred path if there is none."""
    paths = [folder / name for name in host_binaries(identifier)]
    return next((path for path in paths if path.is_file()), paths[0])


def content_guid(files: Mapping[str, bytes]) -> str:
    """Return the GUID of files: the first 128 bits of the SHA-256 of their names and contents."""
    digest = hashlib.sha256()
    for name in sorted(files):
        for part in (name.encode(), files[name]):
            digest.update(len(part).to_bytes(8, "little") + part)
    return f"{{{uuid.UUID(bytes=digest.digest()[:16])}}}"


def write_fmu(path: Path, files: Mapping[str, bytes]) -> None:
    """Write an FMU atomically: to a temporary file, which is then renamed.

    Args:
        path: The file; an existing one is replaced.
        files: Contents by their path in the FMU.

    Raises:
        OSError: If it cannot be written.
    """
    part = path.with_name(f"{path.stem[:40]}.{uuid.uuid4().hex[:12]}.part")
    try:
        with zipfile.ZipFile(part, "x") as archive:
            for name in sorted(files):
                entry = zipfile.ZipInfo(name, ZIP_TIME)  # no trace of when, where and by whom it was made
                entry.compress_type = zipfile.ZIP_DEFLATED
                entry.create_system = ZIP_UNIX
                entry.external_attr = (0o755 if name.startswith("binaries/") else 0o644) << 16
                archive.writestr(entry, files[name])
        keep_permissions(part, path)
        part.replace(path)
    finally:
        with suppress(OSError):  # the original error is already raised
            part.unlink()


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
        """Return the description as FMPy reads it, not validated.

        Raises:
            FmuError: If FMPy cannot read it.
        """
        from fmpy import read_model_description

        try:
            return read_model_description(self.path, validate=False)
        except Exception as error:  # FMPy raises errors of any kind for an unexpected description
            message = f"{DESCRIPTION} cannot be read: {type(error).__name__}: {error}"
            raise _error(self.path, message) from error

    def unpack(self, folder: Path, *, skip: str | None = None) -> None:
        """Unpack it into a folder.

        Args:
            folder: The folder; it is made if it does not exist.
            skip: Entries whose paths begin so are left out.

        Raises:
            FmuError: If an entry is damaged, or there is no room.
        """
        names = [name for name in self.names if skip is None or not name.startswith(skip)]
        try:
            with zipfile.ZipFile(self.path) as archive:
                archive.extractall(folder, names)
        except OSError as error:
            raise _error(self.path, f"cannot be unpacked: {error.strerror or error}") from error
        except (*ZIP_ERRORS, KeyError) as error:
            raise _error(self.path, f"cannot be unpacked: {error}") from error


def open_fmu(path: Path) -> FmuFile:
    """Check the archive of an FMU and its description; nothing is unpacked.

    Raises:
        FmuError: With all errors of the archive, or else of its description.
    """
    content, names = _read_archive(path)
    check = _DescriptionCheck(path)
    check.parse(content)
    return FmuFile(path, names, check.version, tuple(check.kinds))


def _read_archive(path: Path) -> tuple[bytes, tuple[str, ...]]:
    """Return the description of an FMU and the paths of its entries, after the checks of the archive."""
    if "\0" in str(path):
        raise FmuError(f"found {format_value(str(path))}, allowed: the name of a file")
    try:
        mode = path.stat().st_mode
        # Reading a pipe would wait; Windows only reports that folders cannot be read.
        if not stat.S_ISREG(mode):
            kind = "folder" if stat.S_ISDIR(mode) else "pipe or device"
            raise _error(path, f"found a {kind}, allowed: {AN_FMU}")
        with zipfile.ZipFile(path) as archive:
            faults = [*_size_faults(path, archive.infolist()), *_entry_faults(archive.infolist())]
            if faults:
                raise FmuError(*(Finding(fault, file=str(path)) for fault in faults))
            names = tuple(archive.namelist())
            if DESCRIPTION not in names:
                raise _error(path, f"found a zip without {DESCRIPTION}, allowed: {AN_FMU}")
            return archive.read(DESCRIPTION), names
    except FileNotFoundError as error:
        raise _error(path, f"found no such file{suggest_path(path, ('.fmu',))}, allowed: {AN_FMU}") from error
    except OSError as error:
        raise _error(path, f"cannot be read: {error.strerror or error}") from error
    except ZIP_ERRORS as error:
        with path.open("rb") as file:
            head = file.read(2)
        content = "a zip that is cut off or damaged" if head == b"PK" else "no zip, as an FMU is one"
        raise _error(path, f"found {content if head else 'an empty file'}, allowed: {AN_FMU}") from error


def _size_faults(path: Path, entries: Sequence[zipfile.ZipInfo]) -> Iterator[str]:
    """Yield what exceeds the limits: zipfile unpacks no more of an entry than the size in its header."""
    unpacked, packed = sum(entry.file_size for entry in entries), path.stat().st_size
    if len(entries) > MAX_ENTRIES:
        yield f"found {len(entries)} entries, allowed: {MAX_ENTRIES}"
    if unpacked > MAX_UNPACKED_BYTES:
        yield f"found {unpacked / 1e6:.6g} MB when unpacked, allowed: {MAX_UNPACKED_BYTES / 1e6:g} MB"
    elif unpacked > max(RATIO_FROM_BYTES, MAX_RATIO * packed):
        yield (
            f"found {unpacked / 1e6:.4g} MB when unpacked, {unpacked / packed:.0f} times the file, allowed:"
            f" {MAX_RATIO:g} times, from {RATIO_FROM_BYTES / 1e6:g} MB on"
        )
    for entry in entries:
        if entry.filename == DESCRIPTION and entry.file_size > MAX_XML_BYTES:
            yield f"{DESCRIPTION}: found {entry.file_size / 1e6:.4g} MB, allowed: {MAX_XML_BYTES / 1e6:g} MB"


def _entry_faults(entries: Sequence[zipfile.ZipInfo]) -> Iterator[str]:
    """Yield the entries that cannot be unpacked, or would be outside the FMU's folder or over each other."""
    counts = Counter(entry.filename for entry in entries)
    for names, what, allowed in (
        (
            [entry.orig_filename for entry in entries if _may_lead_elsewhere(entry.orig_filename)],
            "the path",
            "paths below the FMU's folder, with / between their parts",
        ),
        (
            [entry.orig_filename for entry in entries if stat.S_ISLNK(entry.external_attr >> 16)],
            "the symbolic link",
            "files and folders",
        ),
        (
            [entry.orig_filename for entry in entries if entry.flag_bits & ENCRYPTED],
            "the encrypted",
            "files without a password",
        ),
        (
            [
                f"{entry.orig_filename} (method {entry.compress_type})"
                for entry in entries
                if entry.compress_type not in PACKING
            ],
            "the packing of",
            "stored or deflated (methods 0, 8)",
        ),
        ([name for name, count in counts.items() if count > 1], "twice", "each path once"),
    ):
        if names:
            listed = [
                name if name.isprintable() and len(name) <= 60 else format_value(name)
                for name in names[:MAX_LISTED]
            ]
            more = f" and {len(names) - MAX_LISTED} more" if len(names) > MAX_LISTED else ""
            yield f"found {what} {', '.join(listed)}{more}, allowed: {allowed}"


def _may_lead_elsewhere(name: str) -> bool:
    """Return whether a path may be another one when it is unpacked, here or on another system."""
    return (
        name.startswith("/")
        or ".." in name.split("/")
        or any(sign in name for sign in "\\:")
        or not name.isprintable()
    )


class _DescriptionCheck:
    """Check of a description before a library reads it.

    Attributes:
        version: Its version of FMI.
        kinds: Its elements with a modelIdentifier.
    """

    def __init__(self, path: Path) -> None:
        self._path, self._depth, self._parts = path, 0, 0
        self._faults: dict[str, None] = {}
        self.version = ""
        self.kinds: list[str] = []

    def parse(self, content: bytes) -> None:
        """Parse a description.

        Raises:
            FmuError: If it is no XML, has a document type, is nested too deep, or names binaries elsewhere.
        """
        parser = expat.ParserCreate()
        parser.StartElementHandler, parser.EndElementHandler = self._begin, self._end
        parser.StartDoctypeDeclHandler = self._reject_doctype
        try:
            parser.Parse(content, True)
        except (expat.ExpatError, LookupError, ValueError) as error:
            message = f"{DESCRIPTION} cannot be read: {error}; allowed: XML as FMI 2.0 has it"
            raise _error(self._path, message) from error
        if self._faults:
            raise FmuError(*(Finding(fault, file=str(self._path)) for fault in self._faults))

    def _begin(self, tag: str, attributes: dict[str, str]) -> None:
        self._depth += 1
        self._parts += 1 + len(attributes)
        if self._depth > MAX_XML_DEPTH:
            self._reject(f"found more than {MAX_XML_DEPTH} elements in each other, allowed: {MAX_XML_DEPTH}")
        if self._parts > MAX_XML_PARTS:
            self._reject(f"found more than {MAX_XML_PARTS} elements and attributes, allowed: {MAX_XML_PARTS}")
        if self._depth == 1:
            self.version = attributes.get("fmiVersion", "")
        name = attributes.get("modelIdentifier")
        if self._depth == 2 and name is not None:
            self.kinds.append(tag)
            if not name or name == "." or "/" in name or _may_lead_elsewhere(name):
                allowed = "the name of its binaries, without / \\ and :"
                self._faults[f"modelIdentifier: found {format_value(name)}, allowed: {allowed}"] = None

    def _end(self, _: str) -> None:
        self._depth -= 1

    def _reject_doctype(self, *_: object) -> None:
        """Reject declarations of entities, which expand few bytes to many."""
        self._reject(
            "found a document type (<!DOCTYPE ...>), allowed: XML without document type and entities"
        )

    def _reject(self, message: str) -> None:
        raise _error(self._path, f"{DESCRIPTION}: {message}")


def _error(path: Path, message: str) -> FmuError:
    return FmuError(Finding(message, file=str(path)))
