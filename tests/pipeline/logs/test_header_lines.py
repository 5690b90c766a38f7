"""Headers of two lines: groups over names that repeat."""

from __future__ import annotations

import io
from collections.abc import Callable

import numpy as np
import pandas as pd
import pytest

from urmpipe_pipeline.joint_log import JointLog

Read = Callable[..., JointLog]

T = np.arange(40) / 100
Q = np.round(np.sin(T[:, np.newaxis] + np.arange(2)), 6)
QD = np.round(np.cos(T[:, np.newaxis] + np.arange(2)), 6)
ROWS = "\n".join(",".join(map(repr, row)) for row in np.column_stack([T, Q, QD]).tolist())


@pytest.mark.parametrize(
    "header",
    [
        "Time,Position,Position,Velocity,Velocity\ns,joint_1,joint_2,joint_1,joint_2",
        "time,Position [rad],,Velocity [rad/s],\n,joint_1,joint_2,joint_1,joint_2",  # merged cells
        "a title,of 1.2.2021\n\nt,joint_1,joint_1,joint_2,joint_2\n,pos,vel,pos,vel",
        "t,q,q,qd,qd\n,1,2,1,2",  # numbers below the groups
        "# t;pos;pos;vel;vel\n# ;J1;J2;J1;J2",
    ],
    ids=["repeated", "merged", "joints above", "numbered", "comments"],
)
def test_groups_tell_names_apart(header: str, read: Read) -> None:
    rows = ROWS
    if "joint_1,joint_1" in header:
        rows = "\n".join(",".join(row.split(",")[k] for k in (0, 1, 3, 2, 4)) for row in ROWS.split("\n"))
    if ";" in header:
        rows = ROWS.replace(",", ";")
    log = read(f"{header}\n{rows}\n")
    assert log.q.tolist() == Q.tolist()
    assert log.qd is not None
    assert log.qd.tolist() == QD.tolist()
    assert log.t.tolist() == T.tolist()
    assert not [warning for warning in log.warnings if warning.kind != "assumed-unit"]


@pytest.mark.parametrize("index", ["Time", None])
@pytest.mark.parametrize("labels", [("joint_1", "joint_2"), (1, 2)])
def test_columns_of_two_levels_as_pandas_writes_them(
    labels: tuple[object, object], index: str | None, read: Read
) -> None:
    columns = pd.MultiIndex.from_product([["position", "velocity"], labels])
    frame = pd.DataFrame(np.hstack([Q, QD]), pd.Index(T, name=index), columns)
    text = io.StringIO()
    frame.to_csv(text)
    log = read(text.getvalue())
    assert log.q.tolist() == Q.tolist()
    assert log.qd is not None
    assert log.qd.tolist() == QD.tolist()
    assert log.t.tolist() == T.tolist()


def test_a_line_of_units_below_both(read: Read) -> None:
    log = read(
        f"t,Position,Position,Velocity,Velocity\n,q1,q2,q1,q2\n[s],[deg],[deg],[deg/s],[deg/s]\n{ROWS}\n"
    )
    np.testing.assert_array_equal(log.q, Q * (np.pi / 180))
    assert log.columns[1].name == "Position/q1"


def test_names_that_do_not_repeat_stay_alone(read: Read) -> None:
    log = read(f"My,arm,of,the,lab\nt,q1,q2,qd1,qd2\n{ROWS}\n")
    assert log.joints == ("q1", "q2")
