"""FMUs whose archive or description would fill a disk or a memory, or leave its folder, are refused."""

from __future__ import annotations

import os
import stat
import struct
import tempfile
import zipfile
from collections.abc import Sequence
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from asserting import refusal
from urmpipe_fmus import fmu_file
from urmpipe_fmus.check import check_fmu
from urmpipe_fmus.fmu_file import open_fmu
from urmpipe_models.errors import FmuError

DESCRIPTION = (
    '<fmiModelDescription fmiVersion="2.0" modelName="m" guid="g"><CoSimulation modelIdentifier="m"/>'
    "<ModelVariables/><ModelStructure/></fmiModelDescription>"
)


def packed(path: Path, *entries: tuple[str | zipfile.ZipInfo, bytes | str], xml: str = DESCRIPTION) -> Path:
    """An FMU with a description and further entries."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("modelDescription.xml", xml)
        for entry, content in entries:
            archive.writestr(entry, content)
    return path


def written(path: Path, *changes: tuple[int, bytes]) -> None:
    """Change the last record of a zip's central directory: bytes at offsets in it."""
    content = bytearray(path.read_bytes())
    start = content.rindex(b"PK\x01\x02")
    for offset, value in changes:
        content[start + offset : start + offset + len(value)] = value
    path.write_bytes(content)


FLAGS, METHOD, SIZE = 8, 10, 24
"""Offsets in a record of the central directory (APPNOTE 6.3.10, section 4.3.12)."""

PATHS = ", allowed: paths below the FMU's folder, with / between their parts"


@pytest.mark.parametrize(
    "name",
    ["../out.txt", "/out.txt", "a/../../out.txt", "C:/out.txt", "C:out.txt", "..\\out.txt", "a\\b.txt"],
)
def test_entries_that_lead_out_of_the_folder_are_refused_and_nothing_is_unpacked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    path = packed(tmp_path / "m.fmu", (name, "out"))
    (tmp_path / "temporary").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "temporary"))
    assert refusal(FmuError, check_fmu, path) == f"{path}: found the path {name}{PATHS}"
    assert list((tmp_path / "temporary").iterdir()) == []


def test_all_that_is_wrong_with_the_entries_is_told_at_once_the_first_five_of_each_kind(
    tmp_path: Path,
) -> None:
    link = zipfile.ZipInfo("link")
    link.external_attr = (stat.S_IFLNK | 0o777) << 16
    with pytest.warns(UserWarning, match="Duplicate name"):
        path = packed(
            tmp_path / "m.fmu",
            *((f"../{k}", "") for k in range(7)),
            (link, "/etc"),
            ("a", "1"),
            ("a", "2"),
            ("z", "3"),
        )
    written(path, (FLAGS, struct.pack("<H", 1)), (METHOD, struct.pack("<H", 97)))
    assert refusal(FmuError, open_fmu, path).splitlines() == [
        f"{path}: found the path ../0, ../1, ../2, ../3, ../4 and 2 more{PATHS}",
        f"{path}: found the symbolic link link, allowed: files and folders",
        f"{path}: found the encrypted z, allowed: files without a password",
        f"{path}: found the packing of z (method 97), allowed: stored or deflated (methods 0, 8)",
        f"{path}: found twice a, allowed: each path once",
    ]


def test_the_name_of_an_entry_breaks_no_line(tmp_path: Path) -> None:
    path = packed(tmp_path / "m.fmu", ("a\nerror: b", ""))
    assert refusal(FmuError, open_fmu, path) == f"{path}: found the path 'a\\nerror: b'{PATHS}"


@pytest.mark.slow
def test_what_unpacks_to_many_times_its_size_is_refused(tmp_path: Path) -> None:
    path = packed(tmp_path / "m.fmu", ("resources/zeros", bytes(110_000_000)))
    times = round((110e6 + len(DESCRIPTION)) / path.stat().st_size)
    said = f"found 110 MB when unpacked, {times} times the file, allowed: 200 times, from 100 MB on"
    assert refusal(FmuError, check_fmu, path) == f"{path}: {said}"
    small = packed(tmp_path / "small.fmu", ("resources/zeros", bytes(90_000_000)))
    assert "resources/zeros" in open_fmu(small).names


def test_what_unpacks_to_too_much_is_refused_by_what_its_entries_tell(tmp_path: Path) -> None:
    path = packed(tmp_path / "m.fmu", *((f"resources/{k}", b"") for k in range(2)))
    content = path.read_bytes()
    parts = content.split(b"PK\x01\x02")
    huge = [parts[0], parts[1], *(part[:20] + struct.pack("<I", 3 * 10**9) + part[24:] for part in parts[2:])]
    path.write_bytes(b"PK\x01\x02".join(huge))
    size = (6e9 + len(DESCRIPTION)) / 1e6
    assert (
        refusal(FmuError, check_fmu, path) == f"{path}: found {size:.6g} MB when unpacked, allowed: 4000 MB"
    )


def test_too_many_entries_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fmu_file, "MAX_ENTRIES", 100)  # 100,000 take seconds to be packed
    path = packed(tmp_path / "m.fmu", *((f"r/{k}", b"") for k in range(100)))
    assert refusal(FmuError, check_fmu, path) == f"{path}: found 101 entries, allowed: 100"


def test_a_description_that_is_too_large_is_refused_unread(tmp_path: Path) -> None:
    path = packed(tmp_path / "m.fmu", xml=DESCRIPTION + " " * 32_000_000)
    assert refusal(FmuError, check_fmu, path) == f"{path}: modelDescription.xml: found 32 MB, allowed: 32 MB"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("xml", "said"),
    [
        (
            f'<!DOCTYPE x [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;">]>{DESCRIPTION}',
            "found a document type (<!DOCTYPE ...>), allowed: XML without document type and entities",
        ),
        (
            DESCRIPTION.replace("<ModelVariables/>", "<a>" * 200_000 + "</a>" * 200_000),
            "found more than 100 elements in each other, allowed: 100",
        ),
        (
            DESCRIPTION.replace("<ModelVariables/>", '<a b="" c="" d=""/>' * 400_000),
            "found more than 1600000 elements and attributes, allowed: 1600000",
        ),
    ],
)
def test_xml_that_grows_when_it_is_read_is_refused(tmp_path: Path, xml: str, said: str) -> None:
    path = packed(tmp_path / "m.fmu", xml=xml)
    assert refusal(FmuError, check_fmu, path) == f"{path}: modelDescription.xml: {said}"


@pytest.mark.parametrize(
    "name", ["../../../m", "..", ".", "", "/tmp/m", "a/../m", "a//b", "a\\m", "C:m", "..//m", "a&#10;b"]
)
def test_binaries_are_never_looked_for_outside_of_the_fmu(tmp_path: Path, name: str) -> None:
    path = packed(
        tmp_path / "m.fmu", xml=DESCRIPTION.replace('modelIdentifier="m"', f'modelIdentifier="{name}"')
    )
    found = repr(name.replace("&#10;", "\n"))
    said = f"modelIdentifier: found {found}, allowed: the name of its binaries, without / \\ and :"
    assert refusal(FmuError, check_fmu, path) == f"{path}: {said}"


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs named pipes")
def test_a_pipe_is_refused_and_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "m.fmu")
    said = "found a pipe or device, allowed: an FMU, such as urmpipe fmu build makes of a unit"
    assert refusal(FmuError, check_fmu, tmp_path / "m.fmu") == f"{tmp_path / 'm.fmu'}: {said}"


def test_unpacking_leaves_out_what_it_is_asked_to(tmp_path: Path) -> None:
    path = packed(tmp_path / "m.fmu", ("sources/a.c", "int a;"), ("binaries/linux64/m.so", b"\x7fELF"))
    open_fmu(path).unpack(tmp_path / "all")
    open_fmu(path).unpack(tmp_path / "some", skip="sources/")
    names = {
        one.name: {p.name for p in one.rglob("*") if p.is_file()}
        for one in tmp_path.iterdir()
        if one.is_dir()
    }
    assert names == {
        "all": {"modelDescription.xml", "a.c", "m.so"},
        "some": {"modelDescription.xml", "m.so"},
    }


def test_an_entry_that_is_damaged_or_cannot_be_written_is_told(tmp_path: Path) -> None:
    path = packed(tmp_path / "m.fmu", ("a", b"0" * 1000), ("a/b", b""))
    assert (
        refusal(FmuError, open_fmu(path).unpack, tmp_path / "m")
        == f"{path}: cannot be unpacked: Not a directory"
    )
    content = path.read_bytes()
    start = content.index(b"PK\x03\x04", 4) + 31
    path.write_bytes(content[:start] + b"\xff\xff" + content[start + 2 :])
    said = refusal(FmuError, open_fmu(path).unpack, tmp_path / "n")
    assert said.startswith(f"{path}: cannot be unpacked: Error -3 while decompressing data: ")


@pytest.fixture(scope="module")
def sound() -> bytes:
    """The bytes of an FMU."""
    with tempfile.TemporaryDirectory() as folder:
        return packed(Path(folder, "m.fmu"), ("a", b"text " * 30), ("b/c", b"more " * 30)).read_bytes()


@pytest.mark.slow
@settings(deadline=None, max_examples=300)
@given(
    changes=st.lists(
        st.tuples(st.floats(0, 1, exclude_max=True), st.integers(0, 255)), min_size=1, max_size=6
    )
)
def test_whatever_bytes_are_changed_it_is_read_or_refused_with_its_name(
    sound: bytes, changes: Sequence[tuple[float, int]]
) -> None:
    content = bytearray(sound)
    for place, value in changes:
        content[int(place * len(content))] = value
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "m.fmu")
        path.write_bytes(content)
        try:
            open_fmu(path).unpack(Path(folder, "m"))
        except FmuError as error:
            assert str(error).startswith(f"{path}: ")
        assert {one.name for one in Path(folder).iterdir()} <= {"m.fmu", "m"}
