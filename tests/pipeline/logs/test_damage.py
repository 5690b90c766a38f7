"""Damaged files: read to a sound log, or refused with each damage named once."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import Phase, assume, example, given, settings
from hypothesis import strategies as st

from read_text import arm
from urmpipe_models.arm.chain import Chain
from urmpipe_models.errors import UrmpipeError
from urmpipe_pipeline.logs import LogMap, read_log
from urmpipe_pipeline.logs.formats import text_table

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
    *b"[|]|Time:|\n |=======\n|q1 = |,|;|\n|\r|\t| |.|\"|#|%|[deg]|(m)|q1|time||nan|inf|1e999".split(b"|"),
    b"Null", b"-1", b"1e99999999", b"9" * 30, b"\xff", b"\x00", b"\xe4", b"\xef\xbb\xbf",
]  # fmt: skip
OPTIONS = [
    LogMap(), LogMap(skip_bad=True), LogMap(source="path"), LogMap(source="coppeliasim"), LogMap(time="1"),
    LogMap(joints=("2", "3")), LogMap(unit={"": "deg"}), LogMap(delimiter=";", decimal=","),
]  # fmt: skip


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
@given(damaged(), st.sampled_from(OPTIONS), st.sampled_from([None, arm(1), arm(2)]))
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
        in_one = outcome(path, options)
        patch.setattr(text_table, "BLOCK_BYTES", size)
        patch.setattr(text_table, "READ_BY_ROW", 8)
        assert outcome(path, options) == in_one


@pytest.mark.slow
@settings(max_examples=5, deadline=None, phases=[Phase.generate])
@given(
    st.sets(st.integers(0, 79_999), min_size=1, max_size=12), st.sampled_from(["torn", "x,1,2", "1,2", "# a"])
)
def test_a_damaged_log_is_the_sound_one_without_its_wrong_rows(places: set[int], damage: str) -> None:
    """Over several blocks, comments between."""
    lines = [f"{0.01 * k:.2f},0.{k % 7},1.{k % 5}" for k in range(80_000)]
    for place in places:
        lines[place] = damage
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "log.csv"
        path.write_text("\n".join(["t,q1 [rad],q2 [rad]", *lines, ""]))
        log = read_log([path], LogMap(skip_bad=True))
    kept = np.delete(np.arange(80_000), sorted(places))
    np.testing.assert_array_equal(log.t_ns, (kept - kept[0]) * 10_000_000)
    np.testing.assert_array_equal(log.q, np.c_[kept % 7 / 10, (kept % 5 + 10) / 10])
