"""Logs as simulators, CAD and MATLAB write them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from specimen import DEG, EXACT, Made, Truth, degrees, lines, made, motion, rounding, specimen
from urmpipe_models.elementwise import FloatArray


def graph_cell(value: float) -> str:
    """Return a value as CoppeliaSim's graph export writes it: four digits, 0.0 for zero, Null for none."""
    if np.isnan(value):
        return "Null"
    return "0.0" if value == 0 else f"{value:+.3e}"


def graph(path: str, streams: Sequence[str], t: FloatArray, values: FloatArray) -> list[str]:
    """Return the lines of one graph: its path, its header, its rows."""
    rows = [f"{at:.3f}," + ",".join(map(graph_cell, row)) for at, row in zip(t, values, strict=True)]
    return [path, ",".join(["Time (s)", *streams]), *rows]


def _four_digits(values: FloatArray, unit: float) -> float:
    """Return half a step of %+.3e at the largest value, in SI."""
    return float(0.5 * 10.0 ** (np.floor(np.log10(np.abs(values).max())) - 3) * unit + EXACT)


@specimen
def coppeliasim_one_graph() -> Made:
    """CoppeliaSim, File > Export > selected graphs: phi_1 (deg).. as %+.3e, 50 ms, wraps at 180."""
    moved = motion(24, 0.05)
    still = moved.q.copy()
    still[0, 0] = 0.0
    truth = replace(moved, q=still, turned=still).limited(-np.pi, np.pi)
    q = degrees(truth.q)
    names = [f"phi_{k} (deg)" for k in range(1, 7)]
    text = lines(*graph("/URM6/graph", names, truth.t, q), "")
    return made("coppeliasim_one_graph.csv", text, replace(truth, q_within=_four_digits(q, DEG)))


@specimen
def coppeliasim_three_graphs() -> Made:
    """CoppeliaSim: joints (rad), tip (m) and joint velocities in three graphs, blank lines between, Null."""
    truth = motion(20, 0.05, robot="urm6")
    q = truth.q.copy()
    q[7, 3] = np.nan
    joints, rates = (
        [f"{word}{k} ({unit})" for k in range(1, 7)] for word, unit in (("J", "rad"), ("dJ", "rad/s"))
    )
    text = lines(
        *graph("/URM6/angles", joints, truth.t, q),
        "",
        *graph("/URM6/tip", ["x (m)", "y (m)", "z (m)"], truth.t, truth.tool),
        "",
        *graph("/URM6/rates", rates, truth.t, truth.rates),
        "",
    )
    within, tool_within = _four_digits(truth.q, 1.0), _four_digits(truth.tool, 1.0)
    truth = replace(truth, q=q, turned=q, q_within=within, position_within=tool_within, rotation=None)
    return made("coppeliasim_three_graphs.csv", text, truth)


def _plots(name: str, header: str, cells: tuple[str, str], truth: Truth) -> Made:
    """Return one file a joint; cells are the formats of time and angle."""
    files = {}
    german = ";" in header
    for k, values in enumerate(np.degrees(truth.q).T, 1):
        rows = [(format(t, cells[0]), format(v, cells[1])) for t, v in zip(truth.t, values, strict=True)]
        texts = [";".join(row).replace(".", ",") if german else ",".join(row) for row in rows]
        encoding = "cp1252" if german else "utf-8"
        files[f"{name}_{k}.csv"] = lines(header.format(k), *texts, end="\r\n").encode(encoding)
    return Made(files, replace(truth, q_within=rounding(int(cells[1][1]), DEG)))


@specimen
def solidworks_en() -> Made:
    """SolidWorks Motion, plot export, English (by its documentation): a file a joint, -180..180 deg."""
    return _plots(
        "solidworks_en",
        "Time (sec),Angular Displacement{} (deg)",
        (".2f", ".4f"),
        motion(20).limited(-np.pi, np.pi),
    )


@specimen
def solidworks_de() -> Made:
    """SolidWorks Motion, plot export, German (by its documentation): a file a joint, ; and decimal commas."""
    return _plots(
        "solidworks_de",
        "Zeit (s);Winkelverschiebung{} (Grad)",
        (".2f", ".4f"),
        motion(20).limited(-np.pi, np.pi),
    )


@specimen
def matlab_writetable() -> Made:
    """MATLAB writetable: t,q1..q6,dq1..dq6 with 15 digits, rad, no unit said."""
    truth = motion(20)
    names = ["t", *(f"q{k}" for k in range(1, 7)), *(f"dq{k}" for k in range(1, 7))]
    values = np.column_stack((truth.t, truth.q, truth.rates))
    rows = [",".join(f"{v:.15g}" for v in row) for row in values]
    return made("matlab_writetable.csv", lines(",".join(names), *rows), truth)


@specimen
def matlab_timetable() -> Made:
    """MATLAB writetimetable: row times as cells of `0.02 sec`."""
    truth = motion()
    rows = [
        f"{t:.15g} sec," + ",".join(f"{v:.15g}" for v in q) for t, q in zip(truth.t, truth.q, strict=True)
    ]
    return made("matlab_timetable.csv", lines("Time,q1,q2,q3,q4,q5,q6", *rows), truth)


@specimen
def matlab_save_ascii() -> Made:
    """MATLAB save -ascii: %16.7e, CR LF, no header, no time, seven joints in rad."""
    truth = replace(motion(joints=7), q_within=rounding(7))
    rows = ["".join(f"{v:16.7e}" for v in q) for q in truth.q]
    return made("matlab_save_ascii.txt", lines(*rows, end="\r\n"), truth)


@specimen
def matlab_save_ascii_with_time() -> Made:
    """MATLAB save -ascii of [t q]: the first column runs in even steps."""
    truth = replace(motion(), q_within=rounding(7), t_within=1e-8)
    values = np.column_stack((truth.t, truth.q))
    rows = ["".join(f"{v:16.7e}" for v in row) for row in values]
    return made("matlab_save_ascii_with_time.txt", lines(*rows, end="\r\n"), truth)


@specimen
def matlab_writematrix_time_row() -> Made:
    """MATLAB writematrix, twice: q without header, and t in a second file as one row."""
    truth = motion(25, 0.016)
    q = lines(*(",".join(f"{v:.15g}" for v in row) for row in truth.q))
    t = lines(",".join(f"{v:.15g}" for v in truth.t))
    name = "matlab_writematrix_time_row"
    return Made({f"{name}_q.csv": q.encode(), f"{name}_t.csv": t.encode()}, truth)


@specimen
def simscape_suffixes() -> Made:
    """A Simscape log through pandas: unnamed index, time_s, c_arm_lateral_m, ..., c_arm_swivel_deg."""
    truth = motion(joints=5)
    q = truth.q.copy()
    q[:, :2] = np.round(0.1 * q[:, :2], 6)  # two slides in m, then three joints that turn
    written = np.column_stack((truth.t, q[:, :2], degrees(q[:, 2:])))
    names = "time_s,c_arm_lateral_m,c_arm_vertical_m,c_arm_wigwag_deg,c_arm_tilt_deg,c_arm_swivel_deg"
    rows = [f"{i}," + ",".join(f"{v:.9g}" for v in row) for i, row in enumerate(written)]
    truth = replace(truth, q=q, turned=q, q_within=rounding(6, DEG), qd=None)
    return made("simscape_suffixes.csv", lines("," + names, *rows), truth)
