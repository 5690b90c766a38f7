"""Poses written in random spellings come back as they were; damage to a row is a fault of that row alone."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from urmpipe_models.elementwise import FloatArray
from urmpipe_pipeline.solved_targets.target_file import TargetFile, read_targets

STYLES = ((",", "."), (";", ","), (";", "."), ("\t", "."), ("\t", ","), (" ", "."), ("|", "."))
ENCODINGS = ("utf-8", "utf-8-sig", "utf-16", "latin-1")
POSITIONS = ("{}", "{}_act", "tcp_{}", "pos_{}", "/tool/position/{}")
LENGTHS = {"": 1.0, " [m]": 1.0, "(m)": 1.0, " [mm]": 1e3, " (cm)": 1e2, "_mm": 1e3}
ANGLES = {"": 1.0, " [rad]": 1.0, " [deg]": 180 / np.pi, "_deg": 180 / np.pi, " (°)": 180 / np.pi}
EXTRAS = {"note": "taught", "speed": "0.25", "nr": "7"}


@dataclass(frozen=True)
class Written:
    """Poses and how they are written: columns by title, and the text around them."""

    position: FloatArray
    rotation: FloatArray | None
    columns: dict[str, list[str]]
    style: tuple[str, str]
    encoding: str
    newline: str

    @property
    def used(self) -> list[str]:
        """The titles of the columns of the poses."""
        return [title for title in self.columns if title not in EXTRAS]

    def rows(self) -> list[list[str]]:
        """Return the cells of each row."""
        return [list(cells) for cells in zip(*self.columns.values(), strict=True)]

    def read(self, rows: Sequence[Sequence[str]]) -> TargetFile:
        """Write rows below the titles and read them."""
        delimiter, decimal = self.style
        titles = [title.replace(" ", "") if delimiter == " " else title for title in self.columns]
        lines = [titles, *([cell.replace(".", decimal) for cell in row] for row in rows)]
        text = "".join(delimiter.join(line) + self.newline for line in lines)
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "targets.csv"
            path.write_bytes(text.encode(self.encoding))
            return read_targets(path)


def cells(values: FloatArray) -> list[str]:
    return [repr(value) for value in values.tolist()]


@st.composite
def orientations(draw: st.DrawFn, rotation: Rotation) -> dict[str, list[str]]:
    """Columns of an orientation: angles about Z, Y, X or a quaternion, neither of a known sign or order."""
    if draw(st.booleans()):
        unit, factor = draw(st.sampled_from(sorted(ANGLES.items())))
        euler = rotation.as_euler("ZYX") * factor
        return {f"r{axis}{unit}": cells(euler[:, k]) for k, axis in enumerate("zyx")}
    sign = draw(st.sampled_from([1.0, -1.0]))
    off = draw(st.floats(-9e-4, 9e-4))  # as printed digits leave it
    quat = rotation.as_quat() * sign * (1 + off)
    return {f"q{axis}": cells(quat[:, k]) for k, axis in draw(st.permutations(list(enumerate("xyzw"))))}


@st.composite
def poses(draw: st.DrawFn, least: int = 1) -> Written:
    """Random poses within 2 m of the base in a random spelling."""
    count = draw(st.integers(least, 9))
    number = st.floats(-2, 2, allow_subnormal=False)
    position = np.array(draw(st.lists(st.tuples(number, number, number), min_size=count, max_size=count)))
    pattern, (unit, factor) = draw(st.sampled_from(POSITIONS)), draw(st.sampled_from(sorted(LENGTHS.items())))
    columns = {
        f"{pattern.format(axis)}{unit}": cells(position[:, k] * factor) for k, axis in enumerate("xyz")
    }
    rotation = None
    if draw(st.booleans()):
        turn = st.tuples(*(st.floats(-3.1, 3.1, allow_subnormal=False) for _ in range(3)))
        vectors = draw(st.lists(turn, min_size=count, max_size=count))
        rotation = Rotation.from_rotvec(np.array(vectors))
        turned = draw(orientations(rotation))
    extras = draw(st.lists(st.sampled_from(sorted(EXTRAS)), unique=True))
    columns |= {title: [EXTRAS[title]] * count for title in extras}
    if rotation is None:
        columns = {title: columns[title] for title in draw(st.permutations(list(columns)))}
    else:  # rz, ry, rx stay in this order, in which they are no rotation vector
        titles = draw(st.permutations([*columns, *[""] * len(turned)]))
        behind = iter(turned.items())
        columns = dict((title, columns[title]) if title else next(behind) for title in titles)
    return Written(
        position=position,
        rotation=None if rotation is None else rotation.as_matrix(),
        columns=columns,
        style=draw(st.sampled_from(STYLES)),
        encoding=draw(st.sampled_from(ENCODINGS)),
        newline=draw(st.sampled_from(["\n", "\r\n"])),
    )


def assert_poses(targets: TargetFile, written: Written, kept: Sequence[int]) -> None:
    """Hold the rows that are kept against the poses that were written."""
    # Two roundings of a length; the products of sines of angles that are themselves rounded.
    np.testing.assert_allclose(targets.position[kept], written.position[kept], rtol=4e-16, atol=1e-300)
    assert (targets.rotation is None) == (written.rotation is None)
    if targets.rotation is not None and written.rotation is not None:
        np.testing.assert_allclose(targets.rotation[kept], written.rotation[kept], rtol=0, atol=1e-14)


@pytest.mark.slow
@settings(max_examples=50)
@given(written=poses())
def test_poses_come_back_whatever_the_spelling(written: Written) -> None:
    targets = written.read(written.rows())
    assert (targets.faults, targets.t_ns) == ({}, None)
    assert [warning.message for warning in targets.warnings] == []
    assert targets.row.tolist() == list(range(1, len(written.position) + 1))
    assert_poses(targets, written, range(len(written.position)))


@st.composite
def damaged(draw: st.DrawFn) -> tuple[Written, list[list[str]], dict[int, str]]:
    """Poses, their rows of which all but one may be damaged, and the reason of each."""
    written = draw(poses(least=2))
    titles, rows = list(written.columns), written.rows()
    reasons: dict[int, str] = {}
    for k in draw(st.lists(st.integers(0, len(rows) - 1), min_size=1, max_size=len(rows) - 1, unique=True)):
        title = draw(st.sampled_from(written.used))
        shown = title.replace(" ", "") if written.style[0] == " " else title
        said = {"abc": "found 'abc'", "nan": "found no number", "inf": "found inf", "1-2": "found '1-2'"}
        if written.style[0] != " ":
            said[""] = "found no number"
        kind = draw(st.sampled_from([*said, "short", "long"]))
        if kind == "short":
            rows[k] = rows[k][:-1]
            reasons[k + 1] = f"found {len(titles) - 1} cells, allowed: {len(titles)}"
        elif kind == "long":
            rows[k] = [*rows[k], "0.5"]
            reasons[k + 1] = f"found {len(titles) + 1} cells, allowed: {len(titles)}"
        else:
            rows[k][titles.index(title)] = kind
            reasons[k + 1] = f"column {shown}: {said[kind]}, allowed: a finite number"
    return written, rows, dict(sorted(reasons.items()))


@pytest.mark.slow
@settings(max_examples=50)
@given(case=damaged())
def test_damage_to_a_row_is_its_fault_alone(case: tuple[Written, list[list[str]], dict[int, str]]) -> None:
    written, rows, reasons = case
    targets = written.read(rows)
    assert targets.faults == reasons
    kept = [k for k in range(len(rows)) if k + 1 not in reasons]
    assert_poses(targets, written, kept)
    lost = [row - 1 for row in reasons]
    assert np.isnan(targets.position[lost]).all()
    assert targets.rotation is None or bool(np.isnan(targets.rotation[lost]).all())


@pytest.mark.slow
@settings(max_examples=50)
@given(written=poses(least=6), rows=st.permutations(range(6)))
def test_the_order_of_the_rows_is_that_of_the_file(written: Written, rows: list[int]) -> None:
    """Each row stands for itself: no row's pose depends on the others'."""
    count = len(written.position)
    order = [*rows, *range(6, count)]
    cells = written.rows()
    moved = replace(
        written,
        position=written.position[order],
        rotation=None if written.rotation is None else written.rotation[order],
    )
    assert_poses(written.read([cells[k] for k in order]), moved, range(count))
