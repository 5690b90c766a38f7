"""Well-written files: columns with names, and a clock. Nobody has to be asked about them."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from motion import moves, of_robot, sines, times
from strange_clocks import two_columns
from stranger import (
    COMMA,
    FIXED,
    GERMAN,
    PANDAS,
    QUOTED,
    SAVETXT,
    SEMICOLON,
    SIX,
    TABS,
    WRITERS,
    Stranger,
    table,
    unit_clock,
)

UR = [f"{part}_joint" for part in ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3")]
NAMES = [
    ("t", "q{}", "rad"),
    ("time", "joint_{}", "rad"),
    ("Time [s]", "J{} [deg]", "deg"),
    ("timestamp", "joint{}", "rad"),
    ("t_s", "A{} (rad)", "rad"),
    ("time (s)", "Axis {} [rad]", "rad"),
    ("t[s]", "theta{}[deg]", "deg"),
    ("seconds", "q_{}", "rad"),
    ("Timestamp", "joint_{}_position", "rad"),
    ("time_s", "phi{}_deg", "deg"),
]
"""Names of clock and joints, and the unit of the joints."""


def well_written() -> Iterator[Stranger]:
    """Yield thirty of them."""
    for k, (t, q, unit) in enumerate(NAMES):
        moved = sines(times(150 + 20 * k, 0.02, 0.1 * (k % 3), k), 6 + k % 2, 500 + k)
        yield table(moved, "t q", {"t": t, "q": q}, unit=unit, writer=WRITERS[k])
        with_rates = {"t": t, "q": q, "qd": f"v{{}}_{k}", "tau": "tau{}"}
        with_rates["qd"] = "velocity_{}"
        after = WRITERS[(k + 3) % 10]
        if after.sign != " " or " " not in t + q:
            yield table(moves(times(250, 0.02), 6, 520 + k), "t q tau", with_rates, unit=unit, writer=after)
    ur = of_robot("ur5e", times(150, 0.04), 541)
    tip = {"t": "time", "q": "q{}", "tip": ("x", "y", "z"), "turn": ("qx", "qy", "qz", "qw")}
    yield table(ur, "t q tip", tip, robot="ur5e")
    yield table(ur, "t q tip turn", tip, robot="ur5e", writer=TABS)
    yield table(ur, "t q", {"t": "time", "q": UR}, writer=PANDAS)
    yield table(
        ur, "t q qd tau",
        {"t": "time", "q": "actual_q_{}", "qd": "actual_qd_{}", "tau": "target_moment_{}"}, writer=SAVETXT,
    )  # fmt: skip
    yield table(
        sines(times(200), 7, 542),
        "t q qd tau",
        {"t": "time", "q": "q[{}]", "qd": "dq[{}]", "tau": "tau_J[{}]"},
    )
    yield table(
        sines(times(200, 0.02, 0.2, 543), 6, 543), "t q", {"t": ("sec", "nanosec"), "q": "position_{}"},
        clock=two_columns(1e-9, 1.6e9), writer=SEMICOLON,
    )  # fmt: skip
    ms = unit_clock(1e-3, whole=True)
    yield table(
        sines(times(200), 6, 544), "t q", {"t": "time_ms", "q": "joint{}_deg"}, clock=ms, unit="deg",
        writer=COMMA,
    )  # fmt: skip
    ns = unit_clock(1e-9, 1.6e9, whole=True)
    yield table(
        sines(times(200), 6, 545), "t q", {"t": "stamp_ns", "q": "joint{}_rad"}, clock=ns, writer=TABS
    )
    yield table(
        sines(times(200), 6, 546).wrapped, "index t q", {"index": "", "t": "t", "q": "q{}"}, writer=PANDAS
    )
    drifting = sines(times(300), 6, 547, drift=9.0).wrapped
    yield table(drifting, "t q", {"t": "t", "q": "J{} [deg]"}, unit="deg", writer=QUOTED)
    yield table(
        sines(times(200), 6, 548), "t q temperature current",
        {"t": "Zeit [s]", "q": "Achse {} [°]", "temperature": "Temp. {} [°C]", "current": "Strom {} [A]"},
        unit="deg", writer=GERMAN,
    )  # fmt: skip
    yield table(
        sines(times(200), 6, 549), "t q gripper",
        {"t": "time", "q": "joint_{}", "gripper": "gripper_width"}, writer=FIXED,
    )  # fmt: skip
    yield table(sines(times(200), 6, 550).rising(2), "t q", {"t": "time", "q": "joint_{}"}, writer=SIX)
    assert np.isfinite(ur.tip).all()
