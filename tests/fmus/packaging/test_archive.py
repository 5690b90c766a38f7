"""FMU files: the same content is the same bytes, and a GUID."""

from __future__ import annotations

import zipfile
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from urmpipe_fmus.fmu_file import content_guid, write_fmu

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
