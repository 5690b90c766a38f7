"""FMUs as files: written whole or not at all, and read or refused whatever their bytes."""

from __future__ import annotations

import tempfile
import zipfile
from collections.abc import Sequence
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from urmpipe_fmus.fmu_file import content_guid, open_fmu, write_fmu
from urmpipe_models.errors import FmuError

XML = (
    b'<fmiModelDescription fmiVersion="2.0" modelName="m" guid="g"><CoSimulation modelIdentifier="m"/>'
    b"<ModelVariables/><ModelStructure/></fmiModelDescription>"
)
FILES = {"sources/b.c": b"int b;", "a.xml": b"<a/>", "binaries/linux64/a.so": bytes(range(256)) * 50}
contents = st.dictionaries(
    st.text(st.characters(codec="utf-8"), max_size=3), st.binary(max_size=3), max_size=3
)
changed_bytes = st.tuples(st.floats(0, 1, exclude_max=True), st.integers(0, 255))


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """The bytes of an FMU."""
    path = tmp_path_factory.mktemp("sound") / "m.fmu"
    write_fmu(path, {"modelDescription.xml": XML, "a": b"text " * 30, "b/c": b"more " * 30})
    return path.read_bytes()


@pytest.mark.slow
@settings(deadline=None, max_examples=300)
@given(changes=st.lists(changed_bytes, min_size=1, max_size=6))
def test_changed_bytes_are_read_or_refused(sound: bytes, changes: Sequence[tuple[float, int]]) -> None:
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


def test_the_same_files_in_any_order_are_the_same_bytes_that_replace_a_file_at_once(tmp_path: Path) -> None:
    write_fmu(tmp_path / "one.fmu", FILES)
    path = tmp_path / "two.fmu"
    path.write_text("old")
    with path.open() as read:  # who reads it meanwhile reads one or the other, and no mixture
        write_fmu(path, dict(reversed(FILES.items())))
        assert read.read() == "old"
    assert path.read_bytes() == (tmp_path / "one.fmu").read_bytes()
    assert sorted(one.name for one in tmp_path.iterdir()) == ["one.fmu", "two.fmu"]
    with zipfile.ZipFile(path) as archive:
        assert {name: archive.read(name) for name in archive.namelist()} == FILES
        assert {one.date_time for one in archive.infolist()} == {(1980, 1, 1, 0, 0, 0)}
        modes = {one.filename: one.external_attr >> 16 for one in archive.infolist()}
    assert modes == {"a.xml": 0o644, "binaries/linux64/a.so": 0o755, "sources/b.c": 0o644}


def test_a_guid_stays_the_same_from_version_to_version() -> None:
    """The first 16 bytes of the SHA-256 of name and content, each after its length in 8 bytes."""
    assert content_guid(FILES) == "{ab89020f-ef2c-b77b-13d8-c877f8ada7a7}"


@pytest.mark.slow
@settings(deadline=None)
@given(contents, contents)
def test_other_content_has_another_guid(one: dict[str, bytes], other: dict[str, bytes]) -> None:
    assert (content_guid(one) == content_guid(other)) is (one == other)
