"""Merge conflicts: each marker is named, wherever it stands, and what only looks like one is read."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from urmpipe_models.errors import LogError
from urmpipe_pipeline.joint_log import JointLog
from urmpipe_pipeline.logs import LogMap, read_log
from urmpipe_pipeline.logs.formats import labels
from urmpipe_pipeline.solved_targets.target_file import read_targets

Read = Callable[..., JointLog]
Wrong = Callable[..., list[str]]
Write = Callable[..., Path]

SIGNS = {
    "<<<<<<< HEAD": "the beginning of a merge conflict",
    "||||||| merged common ancestors": "the common ancestor in a merge conflict",
    "=======": "the middle of a merge conflict",
    ">>>>>>> branch (what it changed)": "the end of a merge conflict",
}
BEGIN, BASE, MIDDLE, END = SIGNS
TIMES = [0.01 * k for k in range(300)]
TABLES = {
    "comma": ["t,q1,q2", *(f"{t:.2f},{t / 9:.4f},0.25" for t in TIMES)],
    "semicolon": ["t;q1;q2", *(f"{t:.2f};{t / 9:.4f};0,25".replace(".", ",") for t in TIMES)],
    "tab": ["t\tq1\tq2", *(f"{t:.2f}\t{t / 9:.4f}\t0.25" for t in TIMES)],
    "bar": ["t|q1|q2", *(f"{t:.2f}|{t / 9:.4f}|0.25" for t in TIMES)],
    "spaces": [f"{t:.2f} {np.sin(t):.4f} 0.25" for t in TIMES],
    "quoted": ['"t","q1","q2"', *(f'"{t:.2f}","{t / 9:.4f}","0.25"' for t in TIMES)],
    "one column": ["q1", *(f"{t / 9:.4f}" for t in TIMES)],
    "labels": [f"Time: {t:.2f}  q values: [{t / 9:.4f}, 0.25] Type: 0" for t in TIMES],
    "json": [f'{{"t": {t:.2f}, "q": [{t / 9:.4f}, 0.25]}}' for t in TIMES],
    "signs": [f"t={t:.2f} q1={t / 9:.4f} q2=0.25" for t in TIMES],
    "arrays": ["t,q", *(f'{t:.2f},"[{t / 9:.4f} 0.25]"' for t in TIMES)],
    "ros2": [f"17,{round(t * 1e9)},,a,b,{t / 9:.4f},0.25,0.0,0.0," for t in TIMES],
}


def said(*found: tuple[int, str]) -> list[str]:
    """What is told of some markers, by their lines."""
    allowed = "allowed: one version, without git's markers"
    return [f"log.csv:{line}: found {text!r}, {SIGNS[text]}, {allowed}" for line, text in found]


@pytest.mark.slow
@pytest.mark.parametrize("skip_bad", [False, True])
@pytest.mark.parametrize("place", [0, 1, 2, 150, -1, None])
@pytest.mark.parametrize("table", TABLES)
def test_each_marker_is_named_wherever_the_conflict_stands(
    wrong: Wrong, table: str, place: int | None, skip_bad: bool
) -> None:
    """Also where the rows of one version go on from those of the other."""
    lines = TABLES[table]
    before, after = lines[:place], lines[place:] if place is not None else []
    one, other = after[:1], after[1:3]
    marked = [*before, BEGIN, *one, BASE, *one, MIDDLE, *other, END, *after[3:]]
    expected = said(*((marked.index(sign) + 1, sign) for sign in SIGNS))
    assert wrong("\n".join(marked) + "\n", skip_bad=skip_bad) == expected


@pytest.mark.slow
@pytest.mark.parametrize("marker", SIGNS)
@pytest.mark.parametrize("place", [2, 150, 300])
@pytest.mark.parametrize("table", TABLES)
def test_a_marker_that_is_left_alone_is_named(wrong: Wrong, table: str, place: int, marker: str) -> None:
    lines = [*TABLES[table][:place], marker, *TABLES[table][place:]]
    assert wrong("\n".join(lines), skip_bad=True) == said((lines.index(marker) + 1, marker))


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "utf-16-be", "latin-1"])
@pytest.mark.parametrize("end", ["\r\n", "\r"])
@pytest.mark.parametrize("size", [5, 64, 1 << 20])
def test_markers_are_found_in_any_encoding_and_across_blocks(
    wrong: Wrong, monkeypatch: pytest.MonkeyPatch, encoding: str, end: str, size: int
) -> None:
    monkeypatch.setattr(labels, "_READ_BYTES", size)
    lines = ["t,q1 [°]", BEGIN, "0,1", MIDDLE, "0,2", END, *(f"{k},{k}" for k in range(1, 30))]
    assert wrong(end.join(lines), encoding=encoding) == said((2, BEGIN), (4, MIDDLE), (6, END))


def test_markers_that_a_spreadsheet_or_an_editor_touched_are_still_some(wrong: Wrong) -> None:
    rows = TABLES["comma"]
    marks = f"{BEGIN},,", "=======,,", '">>>>>>> other",,'
    touched = [*rows[:9], marks[0], *rows[9:20], marks[1], *rows[20:30], marks[2], *rows[30:]]
    assert [line.partition(", allowed")[0] for line in wrong("\n".join(touched), skip_bad=True)] == [
        "log.csv:10: found '<<<<<<< HEAD', the beginning of a merge conflict",
        "log.csv:22: found '=======', the middle of a merge conflict",
        "log.csv:33: found '>>>>>>> other', the end of a merge conflict",
    ]
    commented = [*rows[:9], f"# {BEGIN}", *rows[9:20], f"# {MIDDLE}", *rows[20:30], f"# {END}", *rows[30:]]
    assert len(wrong("\n".join(commented))) == 3
    assert wrong("\n".join([*rows[:9], *rows[9:20], "=======,,", *rows[20:]]), skip_bad=True) == said(
        (21, MIDDLE)
    )


def test_many_markers_are_counted(wrong: Wrong) -> None:
    rows = TABLES["comma"]
    lines = [line for k in range(10) for line in (BEGIN, rows[2 * k + 1], MIDDLE, rows[2 * k + 2], END)]
    found = wrong("\n".join([rows[0], *lines]))
    assert len(found) == 21
    assert found[-1] == "log.csv: 10 more findings"


def test_each_file_of_a_log_and_of_targets_is_looked_through(write: Write) -> None:
    rows = [BEGIN, "t,q1", "0,1", MIDDLE, "t,q1", "0,2", END, "0.1,3"]
    files = [write("\n".join(rows), name) for name in ("plot1.csv", "plot2.csv")]
    with pytest.raises(LogError) as error:
        read_log(files, LogMap())
    assert [(one.file, one.line) for one in error.value.findings] == [
        (str(file), line) for file in files for line in (1, 4, 7)
    ]
    with pytest.raises(LogError) as error:
        read_targets(write(f"x,y,z\n{BEGIN}\n1,2,3\n{MIDDLE}\n1,2,4\n{END}\n5,6,7\n"))
    assert [one.line for one in error.value.findings] == [2, 4, 6]


@pytest.mark.parametrize(
    "above",
    [
        "UR5 log\n=======",
        "# =======\n# UR5 log\n# =======",
        "# >>>>>>> UR5 log <<<<<<<",
        "#<<<<<<<<<<<<<<<<<<<<<<<<<",
        "# a <<<<<<< b",
        "note|||||||x",
    ],
)
def test_a_title_is_no_marker(read: Read, above: str) -> None:
    assert read(f"{above}\n" + "\n".join(TABLES["comma"])).rows == 300


def test_a_ruler_among_comments_and_a_row_of_empty_cells_are_no_markers(read: Read) -> None:
    rows = TABLES["comma"]
    assert read("\n".join([*rows[:100], "# =======", "# ======= pause", *rows[100:]])).rows == 300
    header = "t|" + "|".join(f"q{k}" for k in range(1, 8))
    wide = [f"{t:.2f}|1|2|3|4|5|6|{t:.2f}" for t in TIMES]
    assert read("\n".join([header, *wide, "|||||||", "|||||||"])).rows == 300


@pytest.mark.slow
def test_a_row_of_many_empty_cells_between_bars_is_looked_at_once(read: Read) -> None:
    began = time.perf_counter()
    row = f"{'|' * 1000}0.1|0.2"
    assert read("\n".join([f"{'|'.join(f'e{k}' for k in range(1000))}|q1|q2", *[row] * 20])).rows == 20
    assert time.perf_counter() - began < 5.0  # it took 20 s
