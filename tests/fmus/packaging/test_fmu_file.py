"""FMUs as files: platforms, archives, and what is refused before anything is unpacked."""

from __future__ import annotations

import os
import platform
import stat
import struct
import tempfile
import zipfile
from collections.abc import Callable, Sequence
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from asserting import refusal
from urmpipe_fmus import fmu_file
from urmpipe_fmus.check import check_fmu
from urmpipe_fmus.fmu_file import (
    binary_suffix,
    content_guid,
    find_binary,
    host_binaries,
    host_platforms,
    open_fmu,
    this_platform,
    write_fmu,
)
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


FILES = {"sources/b.c": b"int b;", "a.xml": b"<a/>", "binaries/linux64/a.so": bytes(range(256)) * 50}


def test_the_same_files_in_any_order_are_the_same_bytes(tmp_path: Path) -> None:
    write_fmu(tmp_path / "one.fmu", FILES)
    write_fmu(tmp_path / "two.fmu", dict(reversed(FILES.items())))
    assert (tmp_path / "one.fmu").read_bytes() == (tmp_path / "two.fmu").read_bytes()
    with zipfile.ZipFile(tmp_path / "one.fmu") as archive:
        assert {name: archive.read(name) for name in archive.namelist()} == FILES
        assert {one.date_time for one in archive.infolist()} == {(1980, 1, 1, 0, 0, 0)}
        modes = {one.filename: one.external_attr >> 16 for one in archive.infolist()}
    assert modes == {"a.xml": 0o644, "binaries/linux64/a.so": 0o755, "sources/b.c": 0o644}


def test_a_file_is_replaced_and_nothing_is_left_beside_it(tmp_path: Path) -> None:
    path = tmp_path / "one.fmu"
    path.write_text("old")
    with path.open() as read:  # who reads it meanwhile reads one or the other, and no mixture
        write_fmu(path, FILES)
        assert read.read() == "old"
    assert zipfile.is_zipfile(path)
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize(
    ("place", "why"),
    [
        ("missing/one.fmu", "No such file or directory"),
        ("file/one.fmu", "Not a directory"),
        (f"{'n' * 300}/one.fmu", "File name too long"),
        (f"{'n' * 300}.fmu", "File name too long"),
    ],
)
def test_where_nothing_can_be_written_nothing_is_left(tmp_path: Path, place: str, why: str) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(OSError, match=why):
        write_fmu(tmp_path / place, FILES)
    assert [one.name for one in tmp_path.iterdir()] == ["file"]


def test_a_guid_stays_the_same_from_version_to_version() -> None:
    """The first 16 bytes of the SHA-256 of name and content, each after its length in 8 bytes."""
    assert content_guid(FILES) == "{ab89020f-ef2c-b77b-13d8-c877f8ada7a7}"


@pytest.mark.slow
@settings(deadline=None)
@given(
    st.dictionaries(st.text(st.characters(codec="utf-8"), max_size=3), st.binary(max_size=3), max_size=3),
    st.dictionaries(st.text(st.characters(codec="utf-8"), max_size=3), st.binary(max_size=3), max_size=3),
)
def test_other_content_has_another_guid(one: dict[str, bytes], other: dict[str, bytes]) -> None:
    assert (content_guid(one) == content_guid(other)) is (one == other)


@pytest.fixture
def on(monkeypatch: pytest.MonkeyPatch) -> Callable[[str, str], None]:
    """Be on a system with a processor."""

    def be(system: str, processor: str) -> None:
        monkeypatch.setattr(platform, "system", lambda: system)
        monkeypatch.setattr(platform, "machine", lambda: processor)
        monkeypatch.setattr("sys.maxsize", 2**63 - 1)

    return be


@pytest.mark.parametrize(
    ("system", "processor", "name", "suffix"),
    [
        ("Linux", "x86_64", "linux64", ".so"),
        ("Windows", "AMD64", "win64", ".dll"),
        ("Darwin", "x86_64", "darwin64", ".dylib"),
        ("Linux", "aarch64", "aarch64-linux", ".so"),
        ("Darwin", "arm64", "aarch64-darwin", ".dylib"),
        ("Windows", "ARM64", "aarch64-windows", ".dll"),
        ("Linux", "riscv64", "riscv64-linux", ".so"),
    ],
)
def test_a_platform_has_fmis_name(
    on: Callable[[str, str], None], system: str, processor: str, name: str, suffix: str
) -> None:
    on(system, processor)
    assert (this_platform(), binary_suffix(name)) == (name, suffix)


def test_on_arm_the_binary_under_its_own_name_is_taken_before_that_under_the_short_one(
    on: Callable[[str, str], None], tmp_path: Path
) -> None:
    on("Linux", "x86_64")
    assert (host_platforms(), host_binaries("arm")) == (("linux64",), ("binaries/linux64/arm.so",))
    on("Linux", "aarch64")
    own, short = (tmp_path / one for one in host_binaries("arm"))
    assert (own.parent.name, short.parent.name) == ("aarch64-linux", "linux64") == host_platforms()
    assert find_binary(tmp_path, "arm") == own
    for one in (short, own):
        one.parent.mkdir(parents=True)
        one.touch()
        assert find_binary(tmp_path, "arm") == one
