"""Changes of XML and of zips."""

from __future__ import annotations

import io
import re
import struct
import warnings
import zipfile
import zlib
from collections.abc import Sequence
from random import Random
from xml.etree import ElementTree as ET

from tests.fuzz.byte_mutators import Mutator
from tests.fuzz.text_mutators import NUMBERS, WORDS, number, word

DEEP = "deep-nest"
"""An element that is replaced by many in each other: a writer of trees ends at some depth."""

PREAMBLES = (
    b'<!DOCTYPE r [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;&a;&a;">]>',
    b'<!DOCTYPE r [<!ENTITY a SYSTEM "file:///etc/hostname">]>', b'<?xml version="1.0" encoding="utf-7"?>',
    b'<?xml version="1.1"?>', b'<?xml version="1.0" encoding="x"?>', b"<!--", b"<?", b"<![CDATA[",
)  # fmt: skip

ENTRIES = (
    "../x", "/x", "..\\x", "C:\\x", "a/../../x", "modelDescription.xml", "resources/../../../x",
    "binaries/linux64/x.so", "a\0b", "x" * 300, "", "binaries/", "sources/model.c", "\u202ex",
    "MODELDESCRIPTION.XML", "./modelDescription.xml",
)  # fmt: skip

LOCAL, CENTRAL, END = b"PK\x03\x04", b"PK\x01\x02", b"PK\x05\x06"

FIELDS = {
    LOCAL: ((6, 2), (8, 2), (14, 4), (18, 4), (22, 4), (26, 2), (28, 2)),
    CENTRAL: (
        (8, 2),
        (10, 2),
        (16, 4),
        (20, 4),
        (24, 4),
        (28, 2),
        (30, 2),
        (32, 2),
        (34, 2),
        (38, 4),
        (42, 4),
    ),
    END: ((4, 2), (6, 2), (8, 2), (10, 2), (12, 4), (16, 4), (20, 2)),
}
"""Where the flags, method, checksum, sizes and lengths of a record of a zip stand, and their bytes."""

VALUES = (0, 1, 2, 8, 9, 12, 14, 93, 97, 99, 0x801, 0xFFFF, 0x7FFFFFFF, 0xFFFFFFFF, 1000, 10**9)


def xml(data: bytes, rng: Random, others: Sequence[bytes]) -> bytes:
    """Delete, repeat, move, rename or nest an element, or change an attribute."""
    try:
        root = ET.fromstring(data)
    except (ET.ParseError, ValueError, LookupError):
        return data
    parents = [(parent, child) for parent in root.iter() for child in parent]
    if len(parents) > 5000 or not parents:
        return data
    parent, child = rng.choice(parents)
    match rng.randrange(8):
        case 0:
            parent.remove(child)
        case 1:
            parent.extend([child] * int(10.0 ** rng.uniform(0.0, 2.0)))
        case 2:
            parent.append(ET.Element(child.tag, dict(rng.choice(parents)[1].attrib)))
        case 3:
            child.tag = rng.choice(parents)[1].tag
        case 4:
            child.append(ET.Element(DEEP))
        case 5:
            parent.insert(0, ET.Element(rng.choice(parents)[1].tag))
        case _:
            _attribute(child, rng)
    try:
        return _nested(ET.tostring(root, "utf-8"), rng, child.tag)
    except (ValueError, TypeError, RecursionError, UnicodeError):
        return data


def _attribute(element: ET.Element, rng: Random) -> None:
    """Delete, add or change an attribute, or the text."""
    if not element.attrib or rng.random() < 0.1:
        element.text = rng.choice(NUMBERS).decode("latin-1")
        return
    key = rng.choice(list(element.attrib))
    if rng.random() < 0.2:
        del element.attrib[key]
    elif rng.random() < 0.7:
        element.set(key, rng.choice((*NUMBERS, *WORDS)).decode("latin-1"))
    else:
        element.set(key, " ".join([element.get(key) or ""] * rng.randint(2, 300)))


def _nested(data: bytes, rng: Random, tag: str) -> bytes:
    """Return XML with a mark replaced by elements in each other."""
    mark, times = f"<{DEEP} />".encode(), int(10.0 ** rng.uniform(1.0, 4.5))
    begin, end = f"<{tag}>".encode(), f"</{tag}>".encode()
    return data.replace(mark, begin * times + end * times, 1)


def preamble(data: bytes, rng: Random, others: Sequence[bytes]) -> bytes:
    """Put something before the root, or in the place of the declaration; use an entity."""
    body = re.sub(rb"^\s*<\?xml[^>]*\?>", b"", data) if rng.random() < 0.7 else data
    if rng.random() < 0.3:
        body = body.replace(b'"', b'"&a;&b;', rng.randint(1, 5))
    return rng.choice(PREAMBLES) + body


XML: tuple[Mutator, ...] = (xml, xml, xml, xml, preamble, number, word)


def record(data: bytes, rng: Random, others: Sequence[bytes]) -> bytes:
    """Change a field of a record of a zip: flags, method, sizes, counts, offsets."""
    signature = rng.choice(tuple(FIELDS))
    places = [one.start() for one in re.finditer(re.escape(signature), data)]
    if not places:
        return data
    changed = bytearray(data)
    offset, size = rng.choice(FIELDS[signature])
    for at in rng.choice((places, [rng.choice(places)])):
        value = rng.choice(VALUES) & (2 ** (8 * size) - 1)
        changed[at + offset : at + offset + size] = value.to_bytes(size, "little")
    return bytes(changed)


def entries(data: bytes, rng: Random, others: Sequence[bytes]) -> bytes:
    """Pack a zip anew: an entry renamed, left out, there twice, empty, large, or a link."""
    found = unpacked(data)
    if not found:
        return data
    i = rng.randrange(len(found))
    name, content = found[i]
    match rng.randrange(6):
        case 0:
            found[i] = rng.choice(ENTRIES), content
        case 1:
            del found[i]
        case 2:
            found.append((name, rng.choice(found)[1]))
        case 3:
            found[i] = name, rng.choice((b"", content * 2, b"\0" * 20_000_000))
        case 4:
            found += [(rng.choice(ENTRIES), b"x")] * rng.choice((1, 1000))
        case _:
            found.insert(0, found.pop(i))
    return packed(found)


def within(name: str, mutators: Sequence[Mutator]) -> Mutator:
    """Return what changes one entry of a zip."""

    def changed(data: bytes, rng: Random, others: Sequence[bytes]) -> bytes:
        found = unpacked(data)
        return packed(
            [
                (one, rng.choice(mutators)(content, rng, [content]) if one == name else content)
                for one, content in found
            ]
        )

    return changed


def unpacked(data: bytes) -> list[tuple[str, bytes]]:
    """Return the entries of a zip; none if it is none."""
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            if sum(one.file_size for one in archive.filelist) > 50_000_000:
                return []
            return [(one.filename, archive.read(one)) for one in archive.filelist]
    except (
        zipfile.BadZipFile,
        zlib.error,
        ValueError,
        OSError,
        RuntimeError,
        NotImplementedError,
        struct.error,
        EOFError,
        LookupError,
    ):
        return []


def packed(found: Sequence[tuple[str, bytes]]) -> bytes:
    """Return a zip of some entries, in their order."""
    buffer = io.BytesIO()
    with warnings.catch_warnings(), zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        warnings.simplefilter("ignore")  # names that are there twice are the point
        for name, content in found:
            archive.writestr(zipfile.ZipInfo(name or "-"), content, zipfile.ZIP_DEFLATED)
    return buffer.getvalue()


ZIP: tuple[Mutator, ...] = (record, record, entries, entries)
