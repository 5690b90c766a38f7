"""Damaged files: read to a sound log, or refused with each damage named once."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import Phase, assume, example, given, settings
from hypothesis import strategies as st

from asserting import INCREASE, OTHER_TIME
from urmpipe_models.arm.chain import Chain, Joint
from urmpipe_models.errors import UrmpipeError
from urmpipe_pipeline.joint_log import JointLog
from urmpipe_pipeline.logs import LogMap, read_log
from urmpipe_pipeline.logs.formats import text_table

Read = Callable[..., JointLog]
Wrong = Callable[..., list[str]]

LABELLED = b"connected\nTime: 0.1 q values: [1, 2] Type: 0\nTime: 0.2 q values: [1, 3] Type: 0\n"
SPECIMENS = [
    b"t,q1,q2\n0,1,2\n0.1,2,3\n0.2,1,2\n",
    b"/g\nTime (s),a (deg),b (deg)\n0.0,+1.0e+00,Null\n0.05,0.0,0.0\n\n"
    b"/h\nTime (s),x (m),y (m),z (m)\n0.0,1,2,3\n0.05,1,2,3\n",
    "Zeit[sec];X_Act[mm];Y_Act[mm];Z_Act[mm];A_Act[°];A1[°];A2[°]\n0,0;1,5;2;3;4;5;6\n".encode("latin-1"),
    b"1740416404,5,,joint_a,joint_b,0.1,0.2,0.3,0.4,\n1740416404,1000005,,joint_a,joint_b,0.1,0.2,0.3,0.4,\n",
    "t;q1\n0;1,5\n0,1;2\n".encode("utf-16"),
    b"# t q1 q2\n0 1 2\n 0.1  3 4\n",
    b'"t","q1"\n"0,0","1,5"\n"0,1","1,5"\n',
    b"%time,field.header.seq,field.name0,field.position0\n1486559106139796569,1,a,0.5\n",
    b't,q\n0,"[ 1. 2.\n  3.]"\n0.1,"[ 1. 2.\n  3.]"\n0.2,"[ 1. 2.\n  3.]"\n',
    LABELLED,
    b"t,q1\n0,1\n<<<<<<< HEAD\n1,2\n=======\n1,3\n>>>>>>> other\nt,q1\n0,1\n",
]
PIECES = [
    *(b"[", b"]", b"Time:", b"\n ", b"=======\n", b"q1 = "),
    *(b",", b";", b"\n", b"\r", b"\t", b" ", b".", b'"', b"#", b"%", b"[deg]", b"(m)", b"q1", b"time", b""),
    *(
        b"nan",
        b"inf",
        b"Null",
        b"1e999",
        b"1e99999999",
        b"9" * 30,
        b"-1",
        b"\xff",
        b"\x00",
        b"\xe4",
        b"\xef\xbb\xbf",
    ),
]
OPTIONS = [
    *(
        LogMap(),
        LogMap(skip_bad=True),
        LogMap(source="path"),
        LogMap(source="coppeliasim"),
        LogMap(time="1"),
    ),
    *(LogMap(joints=("2", "3")), LogMap(unit={"": "deg"}), LogMap(delimiter=";", decimal=",")),
]
ROBOTS = [None, *(Chain("arm", tuple(Joint(f"j{k}") for k in range(count))) for count in (1, 2))]


@st.composite
def damaged(draw: st.DrawFn) -> bytes:
    """A specimen with pieces cut out and others put in their place."""
    text = draw(st.sampled_from(SPECIMENS))
    for _ in range(draw(st.integers(1, 4))):
        start = draw(st.integers(0, len(text)))
        stop = start + draw(st.sampled_from([0, 0, 1, 2, 5, 20]))
        text = text[:start] + draw(st.sampled_from(PIECES)) + text[stop:]
    return text


@pytest.mark.slow
@pytest.mark.filterwarnings("error")
@settings(max_examples=120, deadline=None)
@given(damaged(), st.sampled_from(OPTIONS), st.sampled_from(ROBOTS))
@example(LABELLED.replace(b"q values", b"q\r values", 1), LogMap(), None)
@example(b'connected\nTime:"]" values: [1, 3] Type: 0\n', LogMap(), None)
@example(LABELLED.replace(b"1, 2", b""), LogMap(), None)
@example(LABELLED.replace(b"1, 2", b"").replace(b"1, 3", b""), LogMap(), None)
def test_a_sound_log_or_an_error_of_ours(content: bytes, options: LogMap, robot: Chain | None) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "log.csv"
        path.write_bytes(content)
        try:
            log = read_log([path], options, robot)
        except UrmpipeError as error:
            assert error.findings
            assert all(line.isprintable() for line in str(error).split("\n"))
            return
    assert log.q.shape == (log.rows, len(log.joints))
    assert log.q.flags.c_contiguous
    assert not np.isinf(log.q).any()
    assert log.t_ns[0] == 0
    assert (np.diff(log.t_ns) > 0).all()
    assert set(log.joints) <= set(log.units)
    assert log.joints or log.tcp_position is not None
    assert robot is None or len(log.joints) in (0, len(robot.coordinates))


def outcome(path: Path, options: LogMap) -> tuple[object, ...]:
    """What is read of a file, or what is wrong with it."""
    try:
        log = read_log([path], options)
    except UrmpipeError as error:
        return (str(error),)
    return log.t_ns.tobytes(), log.q.tobytes(), log.q.shape, log.inferences, log.warnings


@pytest.mark.slow
@settings(max_examples=120, deadline=None)
@given(damaged(), st.sampled_from(OPTIONS), st.sampled_from([8, 30, 200]))
def test_a_file_reads_the_same_in_blocks_of_any_size(content: bytes, options: LogMap, size: int) -> None:
    assume(b"\r" not in content)  # alone it ends a row for the parser, and no line of the file
    with tempfile.TemporaryDirectory() as folder, pytest.MonkeyPatch.context() as patch:
        path = Path(folder) / "log.csv"
        path.write_bytes(content)
        whole = outcome(path, options)
        patch.setattr(text_table, "BLOCK_BYTES", size)
        patch.setattr(text_table, "READ_BY_ROW", 8)
        assert outcome(path, options) == whole


def rows(count: int, start: float = 0.0) -> list[str]:
    """Rows of a log of two joints at 10 ms."""
    return [f"{start + 0.01 * k:.2f},0.{k % 7},1.{k % 5}" for k in range(count)]


def joined(*lines: str) -> str:
    return "\n".join(["t,q1 [rad],q2 [rad]", *lines]) + "\n"


@pytest.mark.parametrize("behind", [30, 100_000])
def test_a_header_again_begins_a_second_log(wrong: Wrong, behind: int) -> None:
    said = "found the header again, allowed: one log per file; a second log begins here"
    said += "; --rows 1:100 or --rows 102:-1 reads these rows"
    assert wrong(joined(*rows(100), "t,q1 [rad],q2 [rad]", *rows(behind))) == [f"log.csv:102: {said}"]


@pytest.mark.parametrize("header", ["t,q1 [deg],q2 [deg]", "t,q2 [rad],q1 [rad]", "T,Q1,q2"])
def test_another_header_begins_a_second_log_that_is_not_skipped(wrong: Wrong, header: str) -> None:
    """Its rows may be in other units, or in another order, and go on in time."""
    text = joined(*rows(300), header, *rows(300, 3.0))
    said = f"found another header, {header!r}, allowed: one log per file; a second log begins here"
    said += "; --rows 1:300 reads these rows"
    assert wrong(text, skip_bad=True) == wrong(text) == [f"log.csv:302: {said}"]


@pytest.mark.parametrize("message", ["q1,paused,by hand", "[WARN],late,twice"])
def test_a_message_is_no_header(read: Read, message: str) -> None:
    assert read(joined(*rows(300), message, *rows(300, 3.0)), skip_bad=True).rows == 600


@pytest.mark.slow
@pytest.mark.parametrize("also", ["", "# paused\n"])
@pytest.mark.parametrize("encoding", ["utf-8", "utf-16"])
def test_a_last_cell_that_is_cut_is_no_value(read: Read, wrong: Wrong, encoding: str, also: str) -> None:
    """The recorder was killed while it wrote: 1.0471 became 1.0, as only the other rows tell."""
    lines = [f"{0.01 * k:.2f},{k / 70:.4f},{1 + k / 900:.4f}" for k in range(300)]
    text = joined(*lines[:150]) + also + "\n".join(lines[150:])
    assert read(text, encoding=encoding).rows == 300
    cut, line = text[:-2], 301 + bool(also)
    said = "where the file ends, allowed: as many decimals as in the other rows"
    assert wrong(cut, encoding=encoding) == [
        f"log.csv:{line}: found '{cut[-4:]}' {said}",
        "log.csv: 1 of 300 rows cannot be read; --skip-bad leaves them out",
    ]
    assert read(cut, encoding=encoding, skip_bad=True).rows == 299
    assert read(text + "\n# 0.5", encoding=encoding).rows == 300
    uneven = joined(*(f"{0.01 * k:.2f},{k / 70!r},{1 + k / 900!r}" for k in range(300)))
    assert read(uneven[:-9], encoding=encoding).rows == 300


def test_a_byte_of_no_text_has_a_line(wrong: Wrong) -> None:
    text = joined(*rows(100), "1.00,0.\0,1.5", *rows(9, 1.01))
    assert wrong(text) == ["log.csv:102: found the byte 0x00, allowed: text, as in the lines above"]
    assert wrong("GIF\0\n") == ["log.csv: found a binary file, allowed: a text table (CSV)"]


def test_a_clock_that_begins_again_begins_a_second_log(wrong: Wrong) -> None:
    assert wrong(joined(*rows(100), *rows(30))) == [
        "log.csv:102, column t: found 2 logs in one file: the clock begins again in row 101, allowed: one"
        f" log; --rows 1:100 or --rows 101:130 reads one{OTHER_TIME}"
    ]
    assert wrong(joined(*rows(100), *rows(30, 0.5))) == [
        f"log.csv:102, column t: found 0.5 s after 0.99 s, {INCREASE}"
    ]


def test_rows_on_end_that_are_wrong_alike_are_one_finding(wrong: Wrong) -> None:
    longer = [f"{row},7" for row in rows(500, 4.0)]
    assert wrong(joined(*rows(300), "paused", "by hand", *longer)) == [
        "log.csv:302: found 1 cell ('paused'), allowed: 3",
        "log.csv:303: found 1 cell ('by hand'), allowed: 3",
        "log.csv:304: found 4 cells, allowed: 3 (and so 499 more rows below it)",
    ]


@pytest.mark.parametrize(
    ("header", "said"),
    [
        ("t,q1", "found 2 names over rows of 3 cells, allowed: one name per column; add 1 name"),
        (
            "t,q1,q2,q3,q4",
            "found 5 names over rows of 3 cells, allowed: one name per column; remove 2 names",
        ),
    ],
)
def test_a_header_of_another_width(wrong: Wrong, header: str, said: str) -> None:
    text = "\n".join([header, "0.0,1.5,0.5", "0.3,1.5,0.5", "0.4,1.5,0.5"])
    without = "or delete line 1: without names the columns are taken as joints in order"
    assert wrong(text) == [f"log.csv:1: {said}, {without}"]


def test_rows_that_cannot_be_read_are_left_out_if_asked_for(read: Read, wrong: Wrong) -> None:
    lines = rows(1000)
    lines[100], lines[500], lines[501] = "torn, 0.5", "5.00,abc,1.5", "(paused)"
    said = [
        "log.csv:102: found 2 cells, allowed: 3",
        "log.csv:502, column q1 [rad]: found 'abc', allowed: a number,"
        " or an empty, Null or NaN cell where a sample is missing",
        "log.csv:503: found 1 cell ('(paused)'), allowed: 3",
    ]
    assert wrong(joined(*lines)) == [
        *said, "log.csv: 3 of 1000 rows cannot be read; --skip-bad leaves them out"
    ]  # fmt: skip
    log = read(joined(*lines), skip_bad=True)
    kept = np.delete(np.arange(1000), [100, 500, 501])
    np.testing.assert_array_equal(log.t_ns, kept * 10_000_000)
    np.testing.assert_array_equal(log.q, np.c_[kept % 7 / 10, (kept % 5 + 10) / 10])
    skipped = [(w.row, w.message) for w in log.warnings if w.kind == "skipped-row"]
    assert skipped == [
        (101, "data row 101 of the file is left out: found 2 cells, allowed: 3"),
        (501, f"data row 501 of the file is left out: {said[1].partition(', ')[2]}"),
        (502, "data row 502 of the file is left out: found 1 cell ('(paused)'), allowed: 3"),
    ]


def test_lines_stay_those_of_the_file_when_rows_are_left_out(wrong: Wrong) -> None:
    lines = rows(400)
    lines[100], lines[300] = "torn", "2.00,inf,1"
    assert wrong(joined(*lines), skip_bad=True) == [
        "log.csv:302, column q1 [rad]: found inf, allowed: finite numbers",
        f"log.csv:302, column t: found 2 s after 2.99 s, {INCREASE}",
    ]


def test_no_more_than_one_row_in_a_hundred_is_left_out(read: Read, wrong: Wrong) -> None:
    lines = rows(300)
    lines[20] = lines[120] = lines[220] = "torn"
    assert read(joined(*lines), skip_bad=True).rows == 297
    lines[221] = "torn"
    assert wrong(joined(*lines), skip_bad=True)[-1] == (
        "log.csv: skip_bad (--skip-bad): 4 of 300 rows cannot be read, allowed: 1% of them"
    )


def test_many_rows_left_out_are_counted(read: Read) -> None:
    lines = rows(10_000)
    lines[50::200] = ["torn"] * 50
    warnings = [w for w in read(joined(*lines), skip_bad=True).warnings if w.kind == "skipped-row"]
    assert len(warnings) == 21
    assert warnings[-1].message == "30 more rows are left out"
    assert warnings[0].row == 51


@pytest.mark.slow
@settings(max_examples=5, deadline=None, phases=[Phase.generate])
@given(
    st.sets(st.integers(0, 79_999), min_size=1, max_size=12), st.sampled_from(["torn", "x,1,2", "1,2", "# a"])
)
def test_a_damaged_log_is_the_sound_one_without_its_wrong_rows(places: set[int], damage: str) -> None:
    """Over several blocks, comments between."""
    lines = rows(80_000)
    for place in places:
        lines[place] = damage
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "log.csv"
        path.write_text(joined(*lines))
        log = read_log([path], LogMap(skip_bad=True))
    kept = np.delete(np.arange(80_000), sorted(places))
    np.testing.assert_array_equal(log.t_ns, (kept - kept[0]) * 10_000_000)
    np.testing.assert_array_equal(log.q, np.c_[kept % 7 / 10, (kept % 5 + 10) / 10])
