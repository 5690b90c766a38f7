"""Tables drawn at random from the classes of strangers: right, or a question whose answer leads there."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

from motion import Motion, moves, sines, times
from strange_clocks import EPOCH, chunked, two_columns
from strange_columns import grouped
from strange_layouts import savetxt, stranger
from strange_names import URS, WX, followed, mixed, numbered, other, suffixed
from stranger import (
    CSV,
    FIXED,
    PANDAS,
    SAVETXT,
    SEMICOLON,
    TABS,
    WRITERS,
    Clock,
    Stranger,
    judged,
    table,
    unit_clock,
)

TABLES = 30


@st.composite
def motions(draw: st.DrawFn, joints: Sequence[int] = (4, 5, 6, 7)) -> Motion:
    """Draw 60 to 400 rows that take 3 s or longer."""
    rows = draw(st.integers(60, 400))
    period = draw(st.sampled_from([p for p in (0.01, 0.02, 0.04, 0.05, 0.1) if rows * p >= 3.0]))
    seed, count = draw(st.integers(0, 10**6)), draw(st.sampled_from(joints))
    t = times(rows, period, draw(st.sampled_from([0.0, 0.0, 0.3, 0.8])), seed)
    if draw(st.booleans()):
        return moves(t, count, seed)
    rest, drift = draw(st.sampled_from([0.0, 0.2])), draw(st.sampled_from([0.0, 0.0, 4.0]))
    swung = sines(t, count, seed, rest * t[-1], drift)
    return swung.wrapped if drift else swung


@st.composite
def clocks(draw: st.DrawFn) -> tuple[Clock, str | tuple[str, str]]:
    """Draw a clock, and the names of its columns."""
    start = draw(st.sampled_from([0.0, 0.0, EPOCH]))
    kind = draw(st.sampled_from(["s", "s", "ms", "us", "ns", "split", "split us", "stepped", "chunk"]))
    if kind.startswith("split"):
        unit, less = (1e-6, ["usec", "usecs"]) if kind == "split us" else (1e-9, ["nanosec", "nsecs"])
        return two_columns(unit, start), (draw(st.sampled_from(["sec", "secs"])), draw(st.sampled_from(less)))
    if kind == "stepped":
        return two_columns(1e-9, start, 0.2), ("sec", "nsec")
    if kind == "chunk":
        return chunked(
            1.0, start, draw(st.sampled_from([(5, 5), (3, 9)])), draw(st.integers(0, 99))
        ), "timestamp"
    unit = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}[kind]
    return unit_clock(unit, start, whole=kind != "s"), f"time_{kind}" if not start else "stamp"


FAMILIES: Sequence[Callable[[int], list[str]]] = [
    lambda n: numbered("q{}", n),
    lambda n: numbered("joint_{}", n),
    lambda n: numbered("J{}_pos", n),
    lambda n: suffixed(WX, "_pos")[:n] if n <= 6 else numbered("A{}", n),
    lambda n: [f"{part}_joint" for part in URS] if n == 6 else numbered("q[{}]", n, 0),
    lambda n: numbered("axis{}_actual", n),
    lambda n: numbered("joint{}.position", n, 0),
    lambda n: numbered("Gelenk {}", n),
]
WITH_UNIT = ("q_{{}}_{unit}_", "J{{}} [{unit}]", "joint{{}}_{unit}", "pos_{unit}_{{}}")

BLOCKS = (
    "q", "q", "q", "q qd", "q qd", "q qd tau", "tau q qd", "q tau", "q current", "q temperature",
    "q rocking", "q wheels", "index q", "q gripper",
)  # fmt: skip
OTHERS = {
    "gripper": "gripper", "temperature": "temp{}", "current": "current_{}", "index": "seq",
    "rocking": "wheel{}", "wheels": "wheel_{}",
}  # fmt: skip


@st.composite
def tables(draw: st.DrawFn) -> Stranger:
    """Draw a table of blocks under one header line, or none."""
    motion, (clock, clock_names) = draw(motions()), draw(clocks())
    blocks = draw(st.sampled_from(["t {}", "t {}", "{} t", "{}"])).format(draw(st.sampled_from(BLOCKS)))
    unit = draw(st.sampled_from(["rad", "rad", "deg"])) if np.ptp(motion.q) > 0.6 else "rad"
    names: dict[str, str | Sequence[str]] | None = None
    if draw(st.booleans()):
        family = draw(st.one_of(st.sampled_from(FAMILIES), st.sampled_from(WITH_UNIT)))
        names = {
            **OTHERS, "t": clock_names,
            "q": family.format(unit=unit) if isinstance(family, str) else family(motion.joints),
            "qd": draw(st.sampled_from(["qd{}", "velocity_{}"])),
            "tau": draw(st.sampled_from(["tau{}", "effort_{}"])),
        }  # fmt: skip
    return table(
        motion, blocks, names, writer=draw(st.sampled_from(WRITERS)), clock=clock, unit=unit,
        arm=draw(st.sampled_from([0, 0, motion.joints])),
    )  # fmt: skip


@st.composite
def mixed_columns(draw: st.DrawFn) -> Stranger:
    """Draw joints whose values stand side by side, or that were commanded too, or two arms of them."""
    motion = draw(motions((4, 5, 6)))
    kind = draw(st.sampled_from(["rates", "torques", "targets", "arms"]))
    stems = draw(
        st.sampled_from([numbered("j{}", motion.joints), numbered("joint_{}", motion.joints), URS, WX])
    )
    writer = draw(st.sampled_from([CSV, TABS, SEMICOLON, PANDAS]))
    stems = stems[: motion.joints]
    if kind == "rates":
        ends = draw(st.sampled_from([("_pos", "_vel"), ("", "_velocity"), (".position", ".velocity")]))
        return mixed(motion, suffixed(stems, *ends), ("q", "qd"), writer=writer)
    if kind == "torques":
        names = suffixed(stems, "_pos", "_vel", "_effort")
        return mixed(motion, names, ("q", "qd", "tau"), writer=writer)
    if kind == "targets":
        before, after = draw(st.sampled_from([("_des", "_act"), ("_cmd", "_meas"), ("_ref", "_actual")]))
        _, ahead = followed(motion)
        columns = np.column_stack((ahead, motion.q))
        names = [*suffixed(stems, before), *suffixed(stems, after)]
        return other(motion, names, columns, answers=(ahead,), writer=writer)
    sides = draw(st.sampled_from([("left_", "right_"), ("l_", "r_"), ("arm1_", "arm2_")]))
    both = sines(motion.t, 2 * len(stems), motion.seed)
    halves = (both.q[:, : len(stems)], both.q[:, len(stems) :])
    names = [side + stem for side in sides for stem in stems]
    return table(both, "t q", {"t": "time", "q": names}, writer=writer, answers=halves)


@st.composite
def two_lines(draw: st.DrawFn) -> Stranger:
    """Draw a table under groups over names that come again."""
    motion = draw(motions())
    names = draw(st.sampled_from(FAMILIES))(motion.joints)
    blocks, groups = draw(
        st.sampled_from(
            [
                ("q qd", ["Position", "Velocity"]),
                ("q qd tau", ["pos", "vel", "effort"]),
                ("qd q", ["velocity", "position"]),
            ]
        )
    )
    writer = draw(st.sampled_from([CSV, SEMICOLON, TABS, PANDAS]))
    return grouped(
        motion, f"t {blocks}", groups, names, draw(st.sampled_from(["each", "once"])),
        title=draw(st.sampled_from(["", "Recorded on Tue Dec  1 18:17:21 2020\n\n"])),
        trailing=draw(st.booleans()),
        sign=writer.sign, writer=writer,
    )  # fmt: skip


@st.composite
def laid_out(draw: st.DrawFn) -> Stranger:
    """Draw numbers that do not stand as a row a sample."""
    motion = draw(motions((6, 7)))
    deg = draw(st.booleans())
    values = np.degrees(motion.q) if deg else motion.q
    layout = draw(st.sampled_from(["rows", "rows with time", "by sample", "by joint"]))
    own: dict[str, Any] = {"arm": draw(st.sampled_from([0, motion.joints]))}
    if layout == "rows with time":
        return stranger(
            motion,
            savetxt(np.vstack((motion.t, values.T)), delimiter=draw(st.sampled_from([" ", ",", ";"]))),
            **own,
        )
    if layout == "rows":
        return stranger(
            motion, savetxt(values.T, delimiter=draw(st.sampled_from([" ", ",", "\t"]))), timed=False, **own
        )
    flat = values.ravel() if layout == "by sample" else values.T.ravel()
    return stranger(motion, savetxt(flat), timed=False, **own)


@st.composite
def padded(draw: st.DrawFn) -> Stranger:
    """Draw a table whose last rows are zeros that were never sampled."""
    motion, timed = draw(motions((5, 6, 7))), draw(st.booleans())
    names = {"t": "t", "q": "q{}"} if draw(st.booleans()) else None
    return table(
        motion.padded(draw(st.sampled_from([1, 7, 40]))), "t q" if timed else "q", names,
        writer=draw(st.sampled_from([CSV, SAVETXT, FIXED, SEMICOLON])),
        unit=draw(st.sampled_from(["rad", "deg"])),
        q=motion.q, qd=None, t=motion.t if timed else None,
    )  # fmt: skip


drawn = st.one_of(tables(), tables(), tables(), mixed_columns(), two_lines(), laid_out(), padded())


@pytest.mark.slow  # thirty tables, each with its answers
@settings(
    max_examples=TABLES, derandomize=True, database=None, deadline=None, phases=[Phase.generate],
    suppress_health_check=list(HealthCheck),
)  # fmt: skip
@given(drawn)
def test_a_random_table_is_right_or_asked_about(one: Stranger) -> None:
    with tempfile.TemporaryDirectory() as folder:
        verdict = judged(one, Path(folder))
    assert verdict.good and not verdict.unit_first, verdict
