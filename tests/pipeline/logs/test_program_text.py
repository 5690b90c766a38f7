"""Programs of robots and PLCs as logs: the arrays and positions that they hold, or one line."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from urmpipe_models.elementwise import FloatArray
from urmpipe_models.errors import LogError
from urmpipe_pipeline.joint_log import JointLog
from urmpipe_pipeline.logs import LogMap, read_log
from urmpipe_pipeline.logs.formats.programs import read_program
from urmpipe_pipeline.logs.formats.text import open_text
from urmpipe_pipeline.logs.targets import read_pose_table

Read = Callable[..., JointLog]
Write = Callable[..., Path]
Wrong = Callable[..., list[str]]

LOGS = Path(__file__).resolve().parents[3].parent / "shared" / "logs"
ROWS = 80
T = np.arange(ROWS) * 0.01
Q = np.round(60.0 * np.sin(2 * np.pi * 0.6 * T[:, None] + np.arange(6)), 4)  # deg; all turn back
XYZ = np.round(np.column_stack([600 + 50 * np.cos(T * 9), 50 * np.sin(T * 9), 800 - 30 * T]), 3)  # mm
ABSENT = "[9E9,9E+09,9E9,9E9,9E9,9E9]"
DEG = np.pi / 180


def found(log: JointLog, what: str) -> list[tuple[str, str]]:
    return [(one.value, one.evidence) for one in log.inferences if one.what == what]


def listed(values: Iterable[float]) -> str:
    return ", ".join(f"{value:.6f}" for value in values)


def plc(values: FloatArray = Q, name: str = "phi_{}") -> str:
    """Write an array an axis in a line, as scripts of MATLAB and Python do."""
    return "".join(
        f"{name.format(k + 1)} : ARRAY[1..{len(values)}] OF REAL := [{listed(values[:, k])}];\n"
        for k in range(values.shape[1])
    )


# PLC text


def test_plc_arrays_with_a_sample_time(read: Read) -> None:
    text = f"data_points : UDINT := {ROWS};\ndata_sample_time : LREAL := 0.010000;\n{plc()}"
    log = read(text, unit="deg")
    np.testing.assert_array_equal(log.q, Q * DEG)
    assert (log.rows, log.period, log.name) == (ROWS, 0.01, "log")
    assert found(log, "period") == [("0.01 s", "data_sample_time := 0.010000 in line 2")]
    assert not [one for one in log.warnings if one.kind == "assumed-period"]


def test_plc_variables_over_several_lines_with_comments_and_repetitions(read: Read) -> None:
    text = f"""(* made by : a script := [1, 2] *)
VAR_GLOBAL CONSTANT
    N : INT := {ROWS + 3}; // rows; all of them
    cycleTime AT %MD4 : TIME := T#4ms500us;
END_VAR
VAR
    enabled : BOOL := TRUE;
    spare : ARRAY[1..N] OF LREAL;
    zeroed : ARRAY[1..N] OF LREAL := [0.0];
    q1 : ARRAY[1..N] OF LREAL := [
        {listed(Q[:, 0])}, (* the end: *)
        3(1.5)
    ];
    q2 : array [ 0 .. {ROWS + 2} ] of lreal := [2(0, 1E0), {listed(Q[1:, 1])}];
END_VAR
"""
    log = read(text, unit="deg")
    np.testing.assert_array_equal(log.q[:, 0], np.append(Q[:, 0], [1.5] * 3) * DEG)
    np.testing.assert_array_equal(log.q[:, 1], np.append([0, 1, 0, 1], Q[1:, 1]) * DEG)
    assert log.period == 0.0045


@pytest.mark.parametrize(
    "declared",
    [
        f"q : ARRAY[1..{ROWS}, 1..6] OF REAL := [{listed(Q.ravel())}];",
        f"q : ARRAY[1..{ROWS}] OF ARRAY[1..6] OF REAL := [{','.join(f'[{listed(row)}]' for row in Q)}];",
        f"q : ARRAY[1..6, 1..{ROWS}] OF REAL := [{listed(Q.T.ravel())}];",
        f"q : ARRAY[1..GVL.N * 2, 1..6] OF REAL := [{listed(Q.ravel())}];",
    ],
)
def test_plc_arrays_of_two_dimensions(read: Read, declared: str) -> None:
    log = read(declared + "\nTs : REAL := 0.01;", unit="deg")
    assert log.joints == tuple(f"q_{k}" for k in range(1, 7))
    np.testing.assert_array_equal(log.q, Q * DEG)


def test_plc_array_of_times_is_the_clock(read: Read) -> None:
    text = f"period : REAL := 3.0;\nt : ARRAY[1..{ROWS}] OF LREAL := [{listed(T * 2)}];\n{plc()}"
    log = read(text, unit="deg")
    assert log.period == 0.02
    assert not found(log, "period")


def test_plc_sample_time_in_doubt_is_asked_for(read: Read, wrong: Wrong) -> None:
    """4 may be in s or in ms; what is printed reads the file."""
    text = f"Ts : LREAL := 4.0;\n{plc()}"
    assert wrong(text) == [
        "log.csv:1: found Ts := 4.0 and no unit, allowed: a time between rows in s; --period 4 reads it in s;"
        " --period 0.004 reads it in ms"
    ]
    log = read(text, unit="deg", period=0.004)
    assert log.period == 0.004
    assert not log.warnings
    assert read(text.replace("Ts ", "Ts_ms "), unit="deg").period == 0.004
    assert read(text.replace("4.0", "T#1s_4ms"), unit="deg").period == 1.004


def test_plc_sample_times_that_differ(wrong: Wrong) -> None:
    assert wrong(f"sample_time : REAL := 0.004;\ncycle_time : REAL := 0.001;\n{plc()}") == [
        "log.csv:1: found sample_time := 0.004 and cycle_time := 0.001, allowed: one time between rows;"
        " --period 0.004 takes sample_time; --period 0.001 takes cycle_time"
    ]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            "q1 : ARRAY[1..3] OF REAL := [1,2,3];\nq2 : ARRAY[1..2] OF REAL := [1,2];\n",
            ": found 3 values in q1; 2 values in q2, allowed: arrays of one length; delete the arrays that"
            " are not columns of the log",
        ),
        (
            "// two lost\nq1 : ARRAY[1..5] OF REAL := [1,2,3];\n",
            ":2: found 3 values in q1, allowed: 5, as it is declared",
        ),
        (
            "q1 : ARRAY[1..3] OF REAL := [1,2,99999999999(3)];\n",
            ":1: found 6 values in q1, allowed: 3, as it is declared",
        ),
        (
            "q1 : ARRAY[1..3] OF REAL := [1,2,3];\nq2 : ARRAY[1..3] OF REAL := [1,",
            ":2: found a list of q2 that does not end, allowed: its values, then ];",
        ),
        (
            "PROGRAM main\nVAR\n  x : INT := 3;\nEND_VAR\nx := x + 1;\nEND_PROGRAM\n",
            ": found a program in structured text without an array of numbers, allowed: name : ARRAY[1..n] OF"
            " REAL := [...]",
        ),
    ],
)
def test_plc_text_that_is_no_table(wrong: Wrong, text: str, said: str) -> None:
    assert wrong(text) == [f"log.csv{said}"]


@pytest.mark.slow
@pytest.mark.skipif(not LOGS.is_dir(), reason="the real logs in ../shared/logs are not here")
def test_plc_real_identification_run() -> None:
    """12,501 samples at 0.8 ms of six joints: the joints are phi_r, which name no unit."""
    path = LOGS / "kuka-weigand-plc" / "data_target_system.txt"
    text = path.read_text()
    lines = {line.partition(" ")[0]: line for line in text.splitlines()}
    names = [f"phi_r_{k}" for k in range(1, 7)]
    q = [
        [float(cell) for cell in lines[name].partition("[")[2].partition("[")[2][:-3].split(",")]
        for name in names
    ]
    for options in (LogMap(unit={"": "deg"}), LogMap(joints=tuple(names), unit={"": "deg"})):
        log = read_log([path], options)
        assert (log.rows, log.period, log.joints) == (12501, 0.0008, tuple(names))
        np.testing.assert_array_equal(log.q, np.transpose(q) * DEG)
        assert found(log, "period") == [("0.0008 s", "data_sample_time := 0.000800 in line 3")]


# RAPID


def jointtarget(q: FloatArray, external: str = ABSENT) -> str:
    return f"[[{','.join(f'{value:.4f}' for value in q)}],{external}]"


def robtarget(p: FloatArray) -> str:
    return f"[[{','.join(f'{value:.3f}' for value in p)}],[0,0.6,0.8,0],[0,-1,0,1],{ABSENT}]"


def module(*lines: str) -> str:
    body = "\n".join(f"  {line}" for line in lines)
    return f"MODULE paths\n  ! made with [[1,2,3,4,5,6],{ABSENT}];\n{body}\nENDMODULE\n"


TOOL = "PERS tooldata t1 := [TRUE,[[0,0,100],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];"


@pytest.mark.parametrize(
    "lines",
    [
        (TOOL, *(f"CONST jointtarget p{k}0:={jointtarget(q)};" for k, q in enumerate(Q))),
        ("PROC main()", *(f"MoveAbsJ {jointtarget(q)}\\NoEOffs, v100, z10, tool0;" for q in Q), "ENDPROC"),
        (f"LOCAL PERS jointtarget path{{{ROWS}}} := [" + ",\n".join(map(jointtarget, Q)) + "];",),
    ],
    ids=["declared", "moves", "array"],
)
def test_rapid_jointtargets(read: Read, lines: Sequence[str]) -> None:
    log = read(module(*lines), name="paths.mod", period=0.01)
    assert log.joints == tuple(f"rax_{k}" for k in range(1, 7))
    np.testing.assert_array_equal(log.q, Q * DEG)
    assert set(log.units.values()) == {"deg"}
    assert not log.warnings


def test_rapid_moves_are_followed(read: Read) -> None:
    """What is declared stands in another order than what the program moves to."""
    declared = [f"CONST jointtarget p{k}:={jointtarget(Q[k])};" for k in (2, 0, 1, 3)]
    moves = [
        f"MoveAbsJ {point}, v100, fine, tool0;" for point in ("p0", "P1\\NoEOffs", "p2", jointtarget(Q[5]))
    ]
    log = read(module(*declared, "PROC main()", *moves, "ENDPROC"), period=0.01)
    np.testing.assert_array_equal(log.q, Q[[0, 1, 2, 5]] * DEG)
    assert found(log, "program") == [("4 jointtargets", "in the order of the moves; not among them: p3")]


def test_rapid_moves_that_are_computed_leave_the_order_of_the_text(read: Read) -> None:
    declared = [f"CONST jointtarget p{k}:={jointtarget(Q[k])};" for k in (2, 0)]
    log = read(
        module(*declared, "PROC main()", "MoveAbsJ CalcJointT(p, tool0), v100, fine, tool0;"), period=0.01
    )
    np.testing.assert_array_equal(log.q, Q[[2, 0]] * DEG)


def test_rapid_external_axes_stay_columns(read: Read) -> None:
    external = [f"[{10 * k},9E9,9E9,9E9,9E9,9E9]" for k in range(ROWS)]
    lines = [f"CONST jointtarget p{k}:={jointtarget(Q[k], external[k])};" for k in range(ROWS)]
    log = read(module(*lines), period=0.01)
    np.testing.assert_array_equal(log.q, Q * DEG)
    assert found(log, "columns not used") == [("eax_a", "unknown role")]


def test_rapid_robtargets_are_a_path(read: Read, write: Write) -> None:
    text = module(f"CONST robtarget path{{{ROWS}}} := [" + ",\n".join(map(robtarget, XYZ)) + "];")
    log = read(text, period=0.01)
    assert (log.source, log.joints) == ("path", ())
    assert log.tcp_position is not None
    assert log.tcp_quat_xyzw is not None
    np.testing.assert_allclose(log.tcp_position, XYZ / 1000, rtol=1e-15)  # one rounding of mm to m
    np.testing.assert_allclose(log.tcp_quat_xyzw[0], [0.6, 0.8, 0, 0], atol=1e-15)  # w, x, y, z in RAPID
    targets = read_pose_table(write(text), LogMap())
    np.testing.assert_allclose(targets.position, XYZ / 1000, rtol=1e-15)


def test_rapid_both_side_by_side(read: Read) -> None:
    """Two arrays of one length, and positions whose names pair by number."""
    arrays = (
        f"CONST jointtarget js{{{ROWS}}} := [{','.join(map(jointtarget, Q))}];",
        f"CONST robtarget ps{{{ROWS}}} := [{','.join(map(robtarget, XYZ))}];",
    )
    singles = [
        line
        for k in range(ROWS)
        for line in (
            f"CONST jointtarget j{k}:={jointtarget(Q[k])};",
            f"CONST robtarget p{k}:={robtarget(XYZ[k])};",
        )
    ]
    for lines in (arrays, singles):
        log = read(module(*lines), period=0.01)
        np.testing.assert_array_equal(log.q, Q * DEG)
        assert log.tcp_position is not None
        np.testing.assert_allclose(log.tcp_position, XYZ / 1000, rtol=1e-15)


def test_rapid_joints_and_poses_that_are_no_rows_of_one_table(read: Read, wrong: Wrong) -> None:
    points = [f"CONST robtarget p{k}:={robtarget(XYZ[k])};" for k in range(ROWS)]
    text = module(f"CONST jointtarget home:={jointtarget(Q[0])};", *points)
    assert wrong(text) == [
        "log.csv:3: found 1 jointtarget and 80 robtargets, which are not rows of one table, allowed: one of"
        " the two; --source table takes the 1 jointtarget; --source path takes the 80 robtargets"
    ]
    path = read(text, source="path", period=0.01)
    assert path.tcp_position is not None
    np.testing.assert_allclose(path.tcp_position, XYZ / 1000, rtol=1e-15)
    np.testing.assert_array_equal(read(text, source="table", period=0.01).q, Q[:1] * DEG)


@pytest.mark.parametrize(
    ("lines", "said"),
    [
        (
            (
                f"CONST jointtarget a{{2}} := [{','.join(map(jointtarget, Q[:2]))}];",
                f"CONST jointtarget b{{3}} := [{','.join(map(jointtarget, Q[:3]))}];",
            ),
            ": found a of 2 jointtargets, b of 3 jointtargets, allowed: one array, or several of one length;"
            " delete the others",
        ),
        (
            ("CONST jointtarget a := [[1,2,3],[9E9]];",),
            ":3: found '[[1,2,3],[9E9]]', allowed: numbers, such as [[0,0,0,0,30,0],[9E9,...]]",
        ),
        (
            (TOOL, "PROC main()", 'TPWrite "hi";', "ENDPROC"),
            ": found a RAPID program without positions, allowed: a jointtarget or robtarget with its numbers",
        ),
    ],
)
def test_rapid_text_that_is_no_table(wrong: Wrong, lines: Sequence[str], said: str) -> None:
    assert wrong(module(*lines)) == [f"log.csv{said}"]


# KRL, and what is not read


def e6axis(q: FloatArray) -> str:
    return "{" + ",".join(f"A{k} {value:.4f}" for k, value in enumerate(q, 1)) + ",E1 0.0,E2 0.0}"


@pytest.mark.parametrize(
    "text",
    [
        "&ACCESS RVP\nDEFDAT p PUBLIC\nDECL FRAME TOOL_A={X 0,Y 0,Z 100,A 0,B 0,C 0}\n"
        + "".join(f"DECL E6AXIS XP{k}={e6axis(q)} ; A1 5\n" for k, q in enumerate(Q))
        + "ENDDAT\n",
        "DEF p( )\n" + "".join(f"PTP {e6axis(q)} C_PTP\n" for q in Q) + "END\n",
        f"DECL E6AXIS PATH[{ROWS}]\n" + "".join(f"PATH[{k}]={e6axis(q)}\n" for k, q in enumerate(Q, 1)),
    ],
    ids=["dat", "src", "array"],
)
def test_krl_axes(read: Read, text: str) -> None:
    log = read(text, name="p.dat", period=0.01)
    assert log.joints == ("A1", "A2", "A3", "A4", "A5", "A6")
    np.testing.assert_array_equal(log.q, Q * DEG)
    assert not log.warnings


def test_krl_positions_are_a_path(read: Read) -> None:
    lines = "".join(f"LIN {{X {x}, Y {y}, Z {z}, A 30, B 0, C 0, S 2, T 10}}\n" for x, y, z in XYZ)
    log = read(f"DEF p()\n{lines}END\n", period=0.01)
    assert log.tcp_position is not None
    assert log.tcp_quat_xyzw is not None
    np.testing.assert_allclose(log.tcp_position, XYZ / 1000, rtol=1e-15)
    turned = [0, 0, np.sin(np.pi / 12), np.cos(np.pi / 12)]  # A turns about z
    np.testing.assert_allclose(log.tcp_quat_xyzw[0], turned, atol=1e-15)


def test_krl_part_of_a_position(wrong: Wrong) -> None:
    assert wrong("DEF p()\nPTP {A1 10}\nEND\n") == [
        "log.csv:2: found 'PTP {A1 10}', allowed: all of A1 to A6, or X, Y, Z, A, B, C"
    ]


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("/PROG  PICK\n/ATTR\n/POS\nP[1]{\n   GP1:\n};\n/END\n", "a Fanuc program (/PROG)"),
        ("/JOB\r\n//NAME PICK\r\n//POS\r\nC00000=1,2,3,4,5,6\r\n", "a Yaskawa job (/JOB)"),
        ("def pick():\n  movej([0,0,0,0,0,0], a=1.4, v=1.05)\nend\n", "a program in URScript"),
    ],
)
def test_programs_that_are_not_read(wrong: Wrong, text: str, what: str) -> None:
    assert wrong(text) == [
        f"log.csv: found {what}, allowed: a text table; write its positions as a table, such as J1 [deg],"
        "J2 [deg],... one row per position"
    ]


@pytest.mark.parametrize(
    "text",
    [
        "t,q1,q2\n0,1,2\n1,2,3\n",
        "Module 3\ntime (s),q1 (rad),q2 (rad)\n0,1,2\n",
        "VAR\n(1)\n(2)\n",
        "program x\nwas := printed\nvar\n",
        "t: 0.1 q: {1, 2}\n",
        "pos x y z (mm)\n1 2 3 4\n",
        "/time,/joint(1)\n0,1\n",
        "def f(a):\n    return {}\n",
        "",
    ],
)
def test_other_text_is_no_program(write: Write, text: str) -> None:
    assert read_program(open_text(write(f"{text}\n")), LogMap()) is None


@given(
    st.lists(
        st.lists(st.floats(-400, 400).map(lambda v: round(v, 5)), min_size=2, max_size=2),
        min_size=2,
        max_size=9,
    ),
    st.sampled_from([", ", ",", ",\n\t", " , (* x := [1]; *)\r\n"]),
    st.booleans(),
)
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_plc_values_come_through(write: Write, rows: list[list[float]], comma: str, packed: bool) -> None:
    """Written by rows or by columns, however they are parted, with runs of equal values packed or not."""
    values = np.array(rows)

    def text(column: FloatArray) -> str:
        parts = [f"{value!r}" for value in column.tolist()]
        if packed and len(set(parts)) == 1:
            return f"[{len(parts)}({parts[0]})]"
        return f"[{comma.join(parts)}]"

    lines = [f"q{k + 1} : ARRAY[0..{len(rows) - 1}] OF LREAL := {text(values[:, k])};" for k in range(2)]
    held = read_program(open_text(write("\n".join(lines))), LogMap())
    assert held is not None
    assert held.columns.column_names == ["q1", "q2"]
    np.testing.assert_array_equal(np.column_stack([column.to_numpy() for column in held.columns]), values)
    held = read_program(
        open_text(write(f"q : ARRAY[1..{len(rows)},1..2] OF LREAL := {text(values.ravel())};")), LogMap()
    )
    assert held is not None
    np.testing.assert_array_equal(np.column_stack([column.to_numpy() for column in held.columns]), values)


@pytest.mark.parametrize("kept", [0.2, 0.5, 0.9, 0.99])
@pytest.mark.parametrize(
    "text",
    [
        plc(),
        f"VAR\n{plc()}END_VAR\n",
        module(f"CONST jointtarget a{{{ROWS}}} := [" + ",\n".join(map(jointtarget, Q)) + "];"),
        module(*(f"CONST jointtarget p{k} := {jointtarget(q)};" for k, q in enumerate(Q))),
        "DEFDAT p\n" + "".join(f"DECL E6AXIS XP{k}={e6axis(q)}\n" for k, q in enumerate(Q)) + "ENDDAT\n",
    ],
    ids=["arrays", "VAR", "array", "positions", "KRL"],
)
def test_truncated_programs(write: Write, text: str, kept: float) -> None:
    """Cut within a list, or between two: what began does not end."""
    cut = text[: int(kept * len(text))]
    for end in (cut, cut[: cut.rindex("\n") + 1]):
        if end.startswith(("VAR", "MODULE", "DEFDAT")) or end is cut:
            with pytest.raises(LogError):
                read_program(open_text(write(end.rstrip(";\n"))), LogMap())
