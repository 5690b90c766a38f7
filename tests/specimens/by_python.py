"""Logs as people's Python scripts and spreadsheets write them."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd

from specimen import DEG, Made, Truth, degrees, made, motion, rounding, specimen
from urmpipe_models.elementwise import FloatArray

Q6 = tuple(f"q{k}" for k in range(1, 7))


def frame(truth: Truth, time: str = "t", names: Sequence[str] = Q6) -> pd.DataFrame:
    """Return a data frame of times and joint values in [rad]."""
    return pd.DataFrame(np.column_stack((truth.t, truth.q)), columns=[time, *names])


def to_csv(table: pd.DataFrame, encoding: str = "utf-8", **options: Any) -> bytes:
    """Return what pandas.to_csv writes; line feeds, so that the bytes are the same on every system."""
    text = io.StringIO()
    table.to_csv(text, lineterminator="\n", **options)
    return text.getvalue().encode(encoding)


def savetxt(values: FloatArray, **options: Any) -> bytes:
    """Return what numpy.savetxt writes."""
    content = io.BytesIO()
    np.savetxt(content, values, **options)
    return content.getvalue()


def writer(rows: Sequence[Sequence[object]], **options: Any) -> str:
    """Return what csv.writer writes: lines end with CR LF."""
    text = io.StringIO()
    csv.writer(text, **options).writerows(rows)
    return text.getvalue()


def comma(value: float, decimals: int) -> str:
    """Return a number with a decimal comma."""
    return f"{value:.{decimals}f}".replace(".", ",")


@specimen
def pandas_default() -> Made:
    """pandas.to_csv as it is: an unnamed index column before t, q1..q6 in rad."""
    truth = motion()
    return made("pandas_default.csv", to_csv(frame(truth)), truth)


@specimen
def pandas_no_index() -> Made:
    """pandas.to_csv(index=False): t, q1..q6 in rad."""
    truth = motion()
    return made("pandas_no_index.csv", to_csv(frame(truth), index=False), truth)


@specimen
def pandas_time_index() -> Made:
    """pandas.to_csv of a frame whose index is the time: time, joint_1..joint_6 in rad."""
    truth = motion()
    table = frame(truth, "time", [f"joint_{k}" for k in range(1, 7)]).set_index("time")
    return made("pandas_time_index.csv", to_csv(table), truth)


@specimen
def pandas_index_counts_from_filter() -> Made:
    """pandas.to_csv of every second row of a frame: the unnamed index counts 0, 2, 4, ... beside t."""
    truth = motion(60, 0.01)
    table = frame(truth)[::2]
    return made(
        "pandas_index_counts_from_filter.csv",
        to_csv(table),
        replace(truth, t=truth.t[::2], q=truth.q[::2], turned=truth.turned[::2], qd=None),
    )


@specimen
def pandas_semicolon() -> Made:
    """pandas.to_csv(sep=";"): decimal points between semicolons."""
    truth = motion()
    return made("pandas_semicolon.csv", to_csv(frame(truth), sep=";", index=False), truth)


@specimen
def pandas_german() -> Made:
    """pandas.to_csv(sep=";", decimal=",", encoding="cp1252"): Zeit [s], Gelenk 1 [°], -180..180."""
    truth = motion().limited(-np.pi, np.pi)
    table = frame(replace(truth, q=degrees(truth.q)), "Zeit [s]", [f"Gelenk {k} [°]" for k in range(1, 7)])
    text = to_csv(table, "cp1252", sep=";", decimal=",", index=False)
    return made("pandas_german.csv", text, replace(truth, q_within=rounding(6, DEG)))


@specimen
def pandas_tabs_comma() -> Made:
    """pandas.to_csv(sep="\\t", decimal=","): tabs and decimal commas."""
    truth = motion()
    return made("pandas_tabs_comma.txt", to_csv(frame(truth), sep="\t", decimal=",", index=False), truth)


@specimen
def pandas_float_format() -> Made:
    """pandas.to_csv(float_format="%.4f"): four decimals, time too."""
    truth = replace(motion(), q_within=rounding(4))
    return made("pandas_float_format.csv", to_csv(frame(truth), float_format="%.4f", index=False), truth)


@specimen
def pandas_float_format_g() -> Made:
    """pandas.to_csv(float_format="%.3g"): three digits, some without a point, some as 1e-05."""
    truth = motion()
    q = truth.q * np.array([1.0, 1.0, 1.0, 1.0, 1.0, 1e-5])
    truth = replace(truth, q=q, turned=q, q_within=(*[rounding(2)] * 5, 1e-7), t_within=1e-3)
    return made("pandas_float_format_g.csv", to_csv(frame(truth), float_format="%.3g", index=False), truth)


@specimen
def pandas_all_digits() -> Made:
    """pandas.to_csv of rad made from degrees: all 17 digits of a double."""
    q = degrees(motion().q) * DEG
    truth = replace(motion(), q=q, turned=q, q_within=1e-15)
    return made("pandas_all_digits.csv", to_csv(frame(truth), index=False), truth)


@specimen
def pandas_missing() -> Made:
    """pandas.to_csv with NaN, which it writes as empty cells: q3 in rows 5 and 6, q1 in the last."""
    truth = motion()
    q = truth.q.copy()
    q[4:6, 2] = q[-1, 0] = np.nan
    return made(
        "pandas_missing.csv", to_csv(frame(replace(truth, q=q)), index=False), replace(truth, q=q, turned=q)
    )


@specimen
def pandas_na_rep() -> Made:
    """pandas.to_csv(na_rep="NaN"): the same gaps, in words."""
    truth = pandas_missing().truth
    assert truth is not None
    return made("pandas_na_rep.csv", to_csv(frame(truth), index=False, na_rep="NaN"), truth)


@specimen
def pandas_unnamed_columns() -> Made:
    """pandas.DataFrame(q).to_csv(): the header is ,0,1,2,3,4,5 and there is no time."""
    truth = motion()
    return made("pandas_unnamed_columns.csv", to_csv(pd.DataFrame(truth.q)), truth)


@specimen
def pandas_two_header_lines() -> Made:
    """pandas.to_csv of columns with two levels, name and unit: two header lines, q in deg."""
    truth = replace(motion(), q_within=rounding(6, DEG))
    table = frame(replace(truth, q=degrees(truth.q)))
    table.columns = pd.MultiIndex.from_tuples([("t", "s"), *((name, "deg") for name in Q6)])
    return made("pandas_two_header_lines.csv", to_csv(table, index=False), truth)


@specimen
def pandas_utf16() -> Made:
    """pandas.to_csv(sep="\\t", encoding="utf-16"): tabs, byte order mark."""
    truth = motion(20)
    text = b"\xff\xfe" + to_csv(frame(truth), "utf-16-le", sep="\t", index=False)
    return made("pandas_utf16.txt", text, truth)


@specimen
def pandas_bom() -> Made:
    """pandas.to_csv(encoding="utf-8-sig"): what Excel needs to know UTF-8."""
    truth = motion()
    return made("pandas_bom.csv", to_csv(frame(truth, "Zeit"), "utf-8-sig", index=False), truth)


@specimen
def pandas_quoted() -> Made:
    """pandas.to_csv(quoting=csv.QUOTE_ALL): every cell in quotes."""
    truth = motion()
    return made("pandas_quoted.csv", to_csv(frame(truth), quoting=csv.QUOTE_ALL, index=False), truth)


@specimen
def pandas_array_cells() -> Made:
    """pandas.to_csv of a column of arrays: "[ 0.38 ... ]" over two lines, seven joints in one cell."""
    truth = replace(motion(joints=7), q_within=rounding(8))
    cells = [str(row) for row in truth.q]
    return made(
        "pandas_array_cells.csv", to_csv(pd.DataFrame({"time": truth.t, "q": cells}), index=False), truth
    )


@specimen
def pandas_two_array_cells() -> Made:
    """pandas.to_csv of positions and velocities, each an array in a cell, velocities first."""
    truth = replace(motion(), q_within=rounding(8))
    cells = {
        "time": truth.t,
        "velocity": [str(row) for row in truth.rates],
        "position": [str(row) for row in truth.q],
    }
    return made("pandas_two_array_cells.csv", to_csv(pd.DataFrame(cells), index=False), truth)


@specimen
def pandas_list_cells() -> Made:
    """pandas.to_csv of a column of lists: "[0.38, -1.41, ...]" in one cell."""
    truth = motion()
    cells = [row.tolist() for row in truth.q]
    return made("pandas_list_cells.csv", to_csv(pd.DataFrame({"t": truth.t, "q": cells}), index=False), truth)


@specimen
def numpy_savetxt_default() -> Made:
    """numpy.savetxt(file, c_[t, q]): %.18e between spaces, no header."""
    truth = motion(25)
    return made("numpy_savetxt_default.txt", savetxt(np.column_stack((truth.t, truth.q))), truth)


@specimen
def numpy_savetxt_header() -> Made:
    """numpy.savetxt(fmt="%.6f", delimiter=",", header="t,q1,..."): the header behind a #."""
    truth = replace(motion(), q_within=rounding(6))
    values = np.column_stack((truth.t, truth.q))
    text = savetxt(values, fmt="%.6f", delimiter=",", header=",".join(["t", *Q6]))
    return made("numpy_savetxt_header.csv", text, truth)


@specimen
def numpy_savetxt_two_header_lines() -> Made:
    """numpy.savetxt(header="...\\nt, q1, ..."): a remark behind a #, then the names behind a #, tabs."""
    truth = replace(motion(), q_within=rounding(6))
    values = np.column_stack((truth.t, truth.q))
    header = "pick and place, run 3, 2 kg\n" + ", ".join(["t", *Q6])
    text = savetxt(values, fmt="%.6f", delimiter="\t", header=header)
    return made("numpy_savetxt_two_header_lines.txt", text, truth)


@specimen
def numpy_savetxt_fixed_width() -> Made:
    """numpy.savetxt(fmt="%12.5f", comments=""): columns of one width, spaces before the first."""
    truth = replace(motion(), q_within=rounding(5))
    values = np.column_stack((truth.t, truth.q))
    text = savetxt(values, fmt="%12.5f", header=" ".join(["time", *Q6]), comments="")
    return made("numpy_savetxt_fixed_width.txt", text, truth)


@specimen
def numpy_savetxt_degrees() -> Made:
    """numpy.savetxt(degrees(q), delimiter=","): six columns, no header, no time, -180..180."""
    truth = replace(motion().limited(-np.pi, np.pi), q_within=rounding(6, DEG))
    return made("numpy_savetxt_degrees.csv", savetxt(degrees(truth.q), fmt="%.6f", delimiter=","), truth)


@specimen
def csv_writer() -> Made:
    """csv.writer: lines end with CR LF; timestamp, joint1..joint6 in rad."""
    truth = motion()
    rows = np.column_stack((truth.t, truth.q)).tolist()
    return made("csv_writer.csv", writer([["timestamp", *(f"joint{k}" for k in range(1, 7))], *rows]), truth)


@specimen
def csv_dictwriter_order() -> Made:
    """csv.DictWriter with joints in the order 4, 5, 3, 1, 2, 6, 7."""
    truth = motion(joints=7)
    text = io.StringIO()
    order = [f"joint_{k}" for k in (4, 5, 3, 1, 2, 6, 7)]
    out = csv.DictWriter(text, ["time", *order])
    out.writeheader()
    for t, row in zip(truth.t.tolist(), truth.q.tolist(), strict=True):
        out.writerow({"time": t, **{f"joint_{k + 1}": value for k, value in enumerate(row)}})
    return made("csv_dictwriter_order.csv", text.getvalue(), truth)


@specimen
def csv_comma_in_name() -> Made:
    """csv.writer with commas in quoted names: "Joint 1, position (deg)"."""
    truth = replace(motion(), q_within=rounding(6, DEG))
    header = ["Time (s)", *(f"Joint {k}, position (deg)" for k in range(1, 7))]
    rows = np.column_stack((truth.t, degrees(truth.q))).tolist()
    return made("csv_comma_in_name.csv", writer([header, *rows]), truth)


@specimen
def csv_trailing_comma() -> Made:
    """print(..., sep=",", end=",\\n"): every row ends with a comma, the header does not."""
    truth = replace(motion(), q_within=rounding(6))
    rows = [f"{t:.2f}," + "".join(f"{v:.6f}," for v in q) for t, q in zip(truth.t, truth.q, strict=True)]
    return made("csv_trailing_comma.csv", "\n".join([",".join(["t", *Q6]), *rows, ""]), truth)


@specimen
def csv_twelve_columns() -> Made:
    """csv.writer without header: six joints, then six columns that are something else; no time."""
    truth = motion()
    torques = np.round(5 * np.cos(3 * truth.q[:, ::-1]), 6)
    return made("csv_twelve_columns.csv", writer(np.column_stack((truth.q, torques)).tolist()), truth)


@specimen
def csv_rates_beside() -> Made:
    """csv.writer: t, then q1, dq1, q2, dq2, ... in rad and rad/s side by side."""
    truth = motion()
    beside = np.stack((truth.q, truth.rates), axis=2).reshape(len(truth.t), 12)
    names = [name for k in range(1, 7) for name in (f"q{k}", f"dq{k}")]
    rows = np.column_stack((truth.t, beside)).tolist()
    return made("csv_rates_beside.csv", writer([["t", *names], *rows]), truth)


@specimen
def csv_commanded_first() -> Made:
    """csv.writer: q1_cmd..q6_cmd before q1_meas..q6_meas; measured values lag by 0.04 s."""
    truth, asked = motion(), motion(begin=0.04)
    names = [f"q{k}_{kind}" for kind in ("cmd", "meas") for k in range(1, 7)]
    rows = np.column_stack((truth.t, asked.q, truth.q)).tolist()
    return made("csv_commanded_first.csv", writer([["t", *names], *rows]), truth)


@specimen
def fstring_spaces() -> Made:
    """print(f"{t:.3f}, {q[0]:.4f}, ..."): comma and blank, rad."""
    truth = replace(motion(), q_within=rounding(4))
    lines = [f"{t:.3f}, " + ", ".join(f"{v:.4f}" for v in q) for t, q in zip(truth.t, truth.q, strict=True)]
    return made("fstring_spaces.csv", "\n".join(["time, J1, J2, J3, J4, J5, J6", *lines, ""]), truth)


@specimen
def fstring_degree_sign() -> Made:
    """f-strings with J1 (°) in UTF-8, values 0..360."""
    truth = replace(motion().limited(0, 2 * np.pi), q_within=rounding(3, DEG))
    header = ",".join(["Time (ms)", *(f"J{k} (°)" for k in range(1, 7))])
    rows = zip(truth.t, degrees(truth.q, 3), strict=True)
    lines = [f"{1000 * t:.0f}," + ",".join(f"{v:.3f}" for v in q) for t, q in rows]
    return made("fstring_degree_sign.csv", "\n".join([header, *lines, ""]), truth)


@specimen
def tip_and_angles() -> Made:
    """A simulation script's log: Time,Tip_X,Tip_Y,Tip_Z,J1_Angle,... in m and deg, no unit said (urm6)."""
    truth = replace(motion(robot="urm6").limited(-np.pi, np.pi), q_within=rounding(6, DEG), rotation=None)
    header = ["Time", "Tip_X", "Tip_Y", "Tip_Z", *(f"J{k}_Angle" for k in range(1, 7))]
    rows = np.column_stack((truth.t, truth.tool, degrees(truth.q))).tolist()
    return made("tip_and_angles.csv", writer([header, *rows]), truth)


@specimen
def excel_german() -> Made:
    """Excel, German, saved as CSV UTF-8: byte order mark, sep=;, decimal commas, CR LF."""
    truth = replace(motion(), q_within=rounding(5))
    rows = [[comma(t, 2), *(comma(v, 5) for v in q)] for t, q in zip(truth.t, truth.q, strict=True)]
    text = "sep=;\r\n" + writer(
        [["Zeit [s]", *(f"Achse {k} [rad]" for k in range(1, 7))], *rows], delimiter=";"
    )
    return made("excel_german.csv", text, truth, "utf-8-sig")


@specimen
def excel_unicode_text() -> Made:
    """Excel, German, saved as Unicode text: UTF-16 with byte order mark, tabs, decimal commas, CR LF."""
    truth = replace(motion(20), q_within=rounding(5))
    rows = [[comma(t, 2), *(comma(v, 5) for v in q)] for t, q in zip(truth.t, truth.q, strict=True)]
    text = writer([["Zeit", *(f"Winkel {k} [rad]" for k in range(1, 7))], *rows], delimiter="\t")
    return made("excel_unicode_text.txt", b"\xff\xfe" + text.encode("utf-16-le"), truth)


@specimen
def spreadsheet_trailing_rows() -> Made:
    """A spreadsheet's export with empty rows at the end: nothing but commas."""
    truth = motion(20)
    rows = np.column_stack((truth.t, truth.q)).tolist()
    text = writer([["t", *Q6, "", ""], *([*row, "", ""] for row in rows), *[[""] * 9] * 4])
    return made("spreadsheet_trailing_rows.csv", text, truth)
