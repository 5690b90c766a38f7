"""Robot files that urmpipe wrote are replaced, and no others."""

from __future__ import annotations

from pathlib import Path

import pytest

from urmpipe_models.errors import OutputError
from urmpipe_models.files import EXPORT_MARK, is_robot_export, write_export, write_text_atomic

NO_EXPORT = (
    "found a file that is not a robot export of urmpipe, allowed: a new name, or such an export to replace"
)


def assert_refused(path: Path, source: Path, finding: str) -> None:
    before = path.read_bytes() if path.is_file() else None
    with pytest.raises(OutputError) as caught:
        write_export(path, f"# {EXPORT_MARK}\n", source)
    assert str(caught.value) == f"{path}: {finding}"
    assert before is None or path.read_bytes() == before


def test_a_file_is_an_export_by_the_mark_at_its_start(tmp_path: Path) -> None:
    file = tmp_path / "arm.toml"
    assert not is_robot_export(file)
    assert not is_robot_export(tmp_path)
    room = 200 - len(EXPORT_MARK)
    file.write_text(" " * room + EXPORT_MARK, encoding="utf-8")
    assert is_robot_export(file)
    file.write_text(" " * (room + 1) + EXPORT_MARK, encoding="utf-8")
    assert not is_robot_export(file)


def test_a_new_file_and_an_export_are_written(tmp_path: Path) -> None:
    file = tmp_path / "arm.toml"
    for name in ("Größe", "size"):
        write_export(file, f"# {EXPORT_MARK}\n{name}\n", Path("urm6"))
        assert file.read_bytes() == f"# {EXPORT_MARK}\n{name}\n".encode()
    assert [one.name for one in tmp_path.iterdir()] == ["arm.toml"]
    other = tmp_path / "other.toml"
    write_export(other, f"# {EXPORT_MARK}\n", file)
    write_export(other, f"# {EXPORT_MARK} again\n", file)
    assert other.read_text(encoding="utf-8") == f"# {EXPORT_MARK} again\n"


def test_what_is_no_export_and_the_input_itself_stay(tmp_path: Path) -> None:
    file = tmp_path / "arm.toml"
    assert_refused(tmp_path, Path("urm6"), "found a folder, allowed: the name of a file")
    file.write_text("name = 'arm'\n", encoding="utf-8")
    assert_refused(file, Path("urm6"), NO_EXPORT)
    assert_refused(file, tmp_path / "missing.toml", NO_EXPORT)
    file.write_text(f"# {EXPORT_MARK}\n", encoding="utf-8")
    assert_refused(file, file, "found the input of this command, allowed: any other name")


def test_where_nothing_can_be_written_nothing_is_left(tmp_path: Path) -> None:
    with pytest.raises(OutputError) as caught:
        write_text_atomic(tmp_path / "missing" / "arm.toml", "text")
    missing = tmp_path / "missing" / "arm.toml"
    assert str(caught.value) == f"{missing}: cannot be written: No such file or directory"
    (tmp_path / "folder").mkdir()
    with pytest.raises(OutputError) as caught:
        write_text_atomic(tmp_path / "folder", "text")
    assert str(caught.value).startswith(f"{tmp_path / 'folder'}: cannot be written: ")
    assert [one.name for one in tmp_path.iterdir()] == ["folder"]
