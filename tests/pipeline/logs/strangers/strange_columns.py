"""Columns without names, and blocks of them, as strangers write them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from motion import Motion, moves, of_robot, sines, times
from stranger import (
    COMMA,
    CSV,
    FIXED,
    GERMAN,
    PANDAS,
    SAVETXT,
    SEMICOLON,
    SIX,
    TABS,
    WRITERS,
    Stranger,
    strangers,
    table,
    unit_clock,
)


@strangers
def other_columns_without_names() -> Iterator[Stranger]:
    yield table(sines(times(200, 0.03), 6, 201), "t q tau")
    yield table(sines(times(200, 0.03), 6, 202), "t q temperature", writer=SAVETXT)
    yield table(sines(times(200, 0.03), 5, 203), "q rocking gripper")
    yield table(sines(times(200, 0.03), 5, 204), "t q wheels", writer=SEMICOLON)
    yield table(sines(times(200, 0.03), 6, 205), "t q current temperature", writer=TABS)
    yield table(sines(times(200, 0.03), 6, 206), "t q gripper", writer=SIX)
    yield table(sines(times(200, 0.03), 6, 207), "t q tau", writer=CSV, unit="deg")
    yield table(sines(times(200, 0.03), 7, 208), "tau t q", writer=COMMA)
    yield table(of_robot("ur5e", times(200, 0.03), 209), "t q tip", writer=FIXED)
    yield table(of_robot("ur5e", times(200, 0.03), 210), "t q tip turn")


BLOCKS = ("q qd", "q qd tau", "tau q qd", "q tau")


@strangers
def blocks_without_header() -> Iterator[Stranger]:
    """Blocks of columns: the data prove which are rates of which."""
    k = 0
    for blocks in BLOCKS:
        for clock in ("t ", ""):
            for arm in (0, 6):
                writer = WRITERS[(3 * k) % len(WRITERS)]
                t, unit = times(300, 0.02, 0.2 * bool(clock), k), "deg" if k % 5 == 4 else "rad"
                made = (sines if k % 3 else moves)(t, 6, 220 + k)
                yield table(made, clock + blocks, writer=writer, unit=unit, arm=arm)
                k += 1
    yield table(of_robot("iiwa14", times(250, 0.03), 250), "t q qd", robot="iiwa14")
    yield table(sines(times(250, 0.03), 7, 251), "t qd q", writer=TABS)
    yield table(sines(times(250, 0.03), 4, 252, rest=1.0), "t q qd", writer=SEMICOLON)


def two_headers(groups: Sequence[str], names: Sequence[str], style: str) -> str:
    """Return two header lines: groups over names, each over each of its columns, or once."""
    if style == "once":
        groups = ["" if k and groups[k - 1] == group else group for k, group in enumerate(groups)]
    return ",".join(groups) + "\n" + ",".join(names) + "\n"


UR = [
    "shoulder_pan_joint",
    "shoulder_lift_joint",
    "elbow_joint",
    "wrist_1_joint",
    "wrist_2_joint",
    "wrist_3_joint",
]


def grouped(
    motion: Motion,
    blocks: str,
    groups: Sequence[str],
    names: Sequence[str],
    style: str = "each",
    title: str = "",
    trailing: bool = False,
    sign: str = ",",
    **own: Any,
) -> Stranger:
    """Return a table under a line of groups and a line of names that come again in each of them."""
    clock = ["Time"] if "t" in blocks.split() else []
    over = clock + [group for group in groups for _ in range(motion.joints)]
    under = (["s"] if clock else []) + list(names) * len(groups)

    def edit(text: str) -> str:
        head = two_headers(over, under, style).replace(",", sign)
        body = text.replace("\r\n", "\n")
        if trailing:
            head, body = head.replace("\n", f"{sign}\n"), body.replace("\n", f"{sign}\n")
        return title + head + body

    return table(motion, blocks, edit=edit, **own)


@strangers
def two_header_lines() -> Iterator[Stranger]:
    m = sines(times(300, 0.02, 0.2, 261), 6, 261)
    three = ["Position", "Velocity", "Effort"]
    yield grouped(m, "t q qd", three[:2], UR)
    yield grouped(m, "t q qd tau", three, UR, "once")
    yield grouped(
        m, "t q qd", three[:2], UR, title="Trajectory of Tue Dec  1 18:17:21 2020\n\n", trailing=True
    )
    yield grouped(m, "t q qd", ["pos", "vel"], [f"J{k}" for k in range(1, 7)], trailing=True)
    yield grouped(
        m, "t q tau", ["angle", "torque"], [f"A{k}" for k in range(1, 7)], "once", sign=";",
        writer=SEMICOLON, unit="deg",
    )  # fmt: skip
    yield grouped(
        m, "t qd q", ["velocity", "position"], [f"joint{k}" for k in range(1, 7)], sign="\t", writer=TABS
    )
    yield grouped(m, "q qd", ["position", "velocity"], [f"joint{k}" for k in range(1, 7)], writer=PANDAS)
    yield grouped(
        sines(times(200, 0.03), 7, 262), "t q qd", ["Actual Position", "Actual Velocity"],
        [f"Axis {k}" for k in range(1, 8)], "once", title="Robot: LBR\n", unit="deg", writer=GERMAN, sign=";",
    )  # fmt: skip


@strangers
def zero_rows_at_the_end() -> Iterator[Stranger]:
    """Padding, or an end mark: no rows of the motion."""
    m = sines(times(200, 0.03), 6, 271)
    kept: dict[str, Any] = {"q": m.q, "t": m.t, "qd": m.qd}
    yield table(m.padded(1), "q", {"q": "q{}"}, **{**kept, "t": None})
    yield table(m.padded(30), "t q", writer=SAVETXT, **kept)
    yield table(m.padded(12), "t q", {"t": "time", "q": "joint_{}"}, writer=SEMICOLON, unit="deg", **kept)
    yield table(m.padded(60), "q", writer=SIX, arm=6, **{**kept, "t": None})
    yield table(m.padded(1), "t q qd", {"t": "t", "q": "q{}", "qd": "dq{}"}, writer=TABS, **kept)
    yield table(m.padded(25), "q qd", writer=CSV, **{**kept, "t": None})
    far = unit_clock(1e-3, whole=True)
    yield table(m.padded(8), "t q", {"t": "time_ms", "q": "q[{}]"}, clock=far, writer=PANDAS, **kept)


def poses(
    motion: Motion, blocks: str, names: Mapping[str, str | Sequence[str]] | None = None, **own: Any
) -> Stranger:
    """Return poses of the tool: no joints."""
    return table(
        motion, blocks, names, q=np.empty((len(motion.t), 0)), qd=None, position=motion.tip,
        turn=motion.turn, **own,
    )  # fmt: skip


@strangers
def path_of_position_and_quaternion() -> Iterator[Stranger]:
    """TUM: t x y z qx qy qz qw. It is never joints."""
    even = of_robot("ur5e", times(150, 0.04), 281)
    uneven = of_robot("iiwa14", times(150, 0.04, 0.4, 282), 282)
    names = {"t": "timestamp", "tip": ("tx", "ty", "tz"), "turn": ("qx", "qy", "qz", "qw")}
    yield poses(even, "t tip turn", writer=SAVETXT, file="path.txt")
    yield poses(uneven, "t tip turn", writer=FIXED, file="path.tum", clock=unit_clock(start=1_679_323_262.0))
    yield poses(uneven, "t tip turn", names, writer=SAVETXT, file="groundtruth.txt")
    yield poses(even, "t tip turn", {**names, "t": "t", "tip": ("x", "y", "z")}, writer=CSV)
    yield poses(even, "tip turn", {**names, "tip": ("x", "y", "z")}, writer=SEMICOLON)
    stamped = {"t": "#timestamp [ns]", "tip": ("p_RS_R_x [m]", "p_RS_R_y [m]", "p_RS_R_z [m]")}
    euroc = {**stamped, "turn": ("q_RS_x []", "q_RS_y []", "q_RS_z []", "q_RS_w []")}
    yield poses(uneven, "t tip turn", euroc, clock=unit_clock(1e-9, 1.4e9, whole=True), file="data.csv")
    yield poses(
        uneven, "t tip turn", {**names, "tip": ("p_x", "p_y", "p_z"), "turn": ("q_x", "q_y", "q_z", "q_w")}
    )


@strangers
def path_of_twelve_numbers() -> Iterator[Stranger]:
    """KITTI: the first three rows of a 4 x 4 pose, a pose a line."""
    yield poses(of_robot("ur5e", times(150, 0.04), 291), "matrix", writer=SAVETXT, file="00.txt")
    yield poses(of_robot("iiwa14", times(100, 0.04), 292), "matrix", writer=FIXED, file="poses.txt")
    yield poses(of_robot("ur10", times(300, 0.02), 293), "matrix", writer=SAVETXT, file="path.kitti")
