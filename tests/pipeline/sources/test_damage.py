"""Damaged files: whatever is in them, they are read to a sound log or refused by an error of ours."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from urmpipe_models.chain import Chain, Joint
from urmpipe_models.errors import UrmpipeError
from urmpipe_pipeline.sources import ReadOptions, read_log

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
]
PIECES = [
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
    *(ReadOptions(), ReadOptions(source="path"), ReadOptions(source="coppeliasim"), ReadOptions(time="1")),
    *(
        ReadOptions(joints=("2", "3")),
        ReadOptions(units={"": "deg"}),
        ReadOptions(delimiter=";", decimal=","),
    ),
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


@pytest.mark.filterwarnings("error")
@settings(max_examples=300, deadline=None)
@given(damaged(), st.sampled_from(OPTIONS), st.sampled_from(ROBOTS))
def test_a_sound_log_or_an_error_of_ours(content: bytes, options: ReadOptions, robot: Chain | None) -> None:
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
