"""What is stored of each kind of result: a change of it must not make an urmpipe misread a recording.

`python tests/pipeline/recording/test_schema.py` writes the file of it anew.
"""

from __future__ import annotations

from pathlib import Path

from urmpipe_pipeline.recording.codec import schema
from urmpipe_pipeline.recording.layout import LAYOUT_VERSION
from urmpipe_pipeline.results import KINDS

KEPT = Path(__file__).with_name("schema.txt")


def current() -> str:
    """Return the version, and what is stored of each kind."""
    return f"layout version {LAYOUT_VERSION}\n\n{schema([kind.cls for kind in KINDS])}"


def broken(kept: str, now: str) -> list[str]:
    """Return what recordings by the kept schema lack or have otherwise; nothing of another version."""
    (version, *before), (version_now, *after) = _fields(kept), _fields(now)
    if version != version_now:
        return []
    return [one for one in before if one not in after] + [
        one
        for one in after
        if one not in before and not one.endswith("=") and _class(one) in map(_class, before)
    ]


def _class(field: str) -> str:
    return field.split(".", 1)[0]


def _fields(text: str) -> list[str]:
    """Return the version and every field behind the name of its class."""
    found, cls = [], ""
    for line in filter(None, text.splitlines()):
        cls = cls if line.startswith(" ") else line
        found.append(f"{cls}.{line.strip()}")
    return found


def test_what_is_stored_changes_by_defaults_or_with_the_version() -> None:
    """A new field needs a default (older recordings lack it); any other change raises `LAYOUT_VERSION`."""
    assert not broken(KEPT.read_text(encoding="utf-8"), current()), "raise LAYOUT_VERSION, or give a default"
    assert KEPT.read_text(encoding="utf-8") == current(), f"write it anew: python {Path(__file__).name}"


def test_a_change_that_recordings_do_not_stand_is_seen() -> None:
    kept = "layout version 1\n\nToy\n    name: str\n    size: int\nBall\n    r: float\n"
    assert not broken(kept, kept + "    colour: str =\n")
    assert broken(kept, kept + "    colour: str\n") == ["Ball.colour: str"]
    assert broken(kept, kept.replace("size: int", "size: float")) == ["Toy.size: int", "Toy.size: float"]
    assert broken(kept, kept.replace("    size: int\n", "")) == ["Toy.size: int"]
    assert not broken(kept, kept + "New\n    colour: str\n")
    assert not broken(kept, kept.replace("size: int", "size: float").replace("version 1", "version 2"))


if __name__ == "__main__":
    KEPT.write_text(current(), encoding="utf-8")
