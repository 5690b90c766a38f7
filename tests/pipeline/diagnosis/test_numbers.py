"""Each number in a sentence is that of the files, by forward kinematics and interpolation of this test."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

import urmpipe
from urmpipe_models.elementwise import FloatArray
from urmpipe_pipeline.diagnosis.causes import Cause
from urmpipe_pipeline.diagnosis.result import Diagnosis

D, A = (0.3, 0.0, 0.0, 0.35, 0.0, 0.09), (0.05, 0.4, 0.03, 0.0, 0.0, 0.0)  # [m]
ALPHA = (-1.5, 0.1, -1.6, 1.5, -1.5, 0.2)  # [rad]
TOOL = (0.04, -0.03, 0.12)  # [m]
COUNT, PERIOD = 1200, 0.01  # rows of the log, and [s] between them; the path has each fourth time
NUMBER = re.compile(r"(?<![\w.])[-+]?\d+(?:\.\d+)?(?:e-\d+)?(?!\w)")
Y, Z = (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)


def offset(joint: int, value: float) -> Cause:
    return Cause("joint_offset", f"q{joint}", value=(value,), unit="rad")


CASES: dict[str, tuple[Cause, ...]] = {
    "one": (offset(3, 0.01),),
    "chain": (
        offset(2, 0.03), Cause("base_shift", "base", axis=Y, value=(0.01,), unit="m"),
        Cause("link_length", "a_2", value=(-0.006,), unit="m"), offset(5, -0.05),
    ),
    "clock": (
        Cause("time_lag", "clock", value=(-1.3034,), unit="s"), offset(4, -0.05),
        Cause("tool_shift", "tool", value=(0.011, -0.012, 0.013), unit="m"),
    ),
    "outliers": (Cause("outliers", "rows", rows=(100, 101, 102, 700)),),
    "passes": (Cause("tool_shift", "tool", axis=Z, value=(0.002,), unit="m"),),
    "undecided": (offset(2, 0.02), Cause("link_length", "d_4", value=(0.0008,), unit="m")),
}  # fmt: skip


def tcp(q: FloatArray, causes: Sequence[Cause]) -> FloatArray:
    """Return where the tool centre point is in [m], shape (n, 3), for joints in [rad], shape (n, 6)."""
    q, rows = q.copy(), {"d": [*D], "a": [*A], "alpha": [*ALPHA]}
    point, base = np.tile(TOOL, (len(q), 1)), np.zeros(3)
    for cause in causes:
        number, vector = cause.value[:1], np.array(cause.value[:3]) * (cause.axis or 1.0)
        if cause.kind == "joint_offset":
            q[:, int(cause.name[1]) - 1] += number
        elif cause.kind in ("link_length", "tilt"):
            rows[cause.name[:-2]][int(cause.name[-1]) - 1] += number[0]
        elif cause.kind == "tool_shift":
            point += vector
        elif cause.kind == "base_shift":
            base += vector
        else:
            assert cause.kind in ("time_lag", "outliers"), cause
    for k in reversed(range(6)):  # Rz(q) Tz(d) Tx(a) Rx(alpha), from the tool to the base
        point = Rotation.from_rotvec([rows["alpha"][k], 0.0, 0.0]).apply(point)
        point += np.array([rows["a"][k], 0.0, rows["d"][k]])
        point = Rotation.from_rotvec(np.outer(q[:, k], Z)).apply(point)
    return np.asarray(point + base)


def write(folder: Path, causes: Sequence[Cause], noise: float) -> None:
    """Write arm, path and log: the path is where the log's arm is with the causes, in noise in [m]."""
    rest, wide = np.array([[0.2, -1.0, 0.9, 0.3, 1.0, -0.5], [0.7, 0.4, 0.5, 0.9, 0.6, 1.0]])
    t, rates = PERIOD * np.arange(COUNT, dtype=float), np.array([0.7, 0.9, 1.1, 1.3, 0.8, 1.5])

    def moved(at: FloatArray) -> FloatArray:
        return np.asarray(rest + wide * np.sin(np.outer(at, rates) + np.arange(6.0)))

    lag = sum(cause.value[0] for cause in causes if cause.kind == "time_lag")
    path = tcp(moved(t), causes) + np.random.default_rng(4).normal(0.0, noise, (COUNT, 3))
    log = moved(t + lag)
    for cause in causes:
        log[list(cause.rows)] = 0.0
    joints = ", ".join(
        f"{{d = {d}, a = {a}, alpha = {alpha}}}" for d, a, alpha in zip(D, A, ALPHA, strict=True)
    )
    tool = f"tool = {{translation = [{', '.join(map(str, TOOL))}]}}"
    arm = f'kind = "dh"\nname = "arm"\njoints = [{joints}]\n{tool}'
    (folder / "arm.toml").write_text(arm, "utf-8")
    for name, table, head in (("path", path[::4], "x,y,z"), ("log", log, "q1,q2,q3,q4,q5,q6")):
        rows = np.column_stack([t[:: len(t) // len(table)], table])
        np.savetxt(folder / f"{name}.csv", rows, "%.9f", ",", header=f"t,{head}", comments="")


def left(folder: Path, causes: Sequence[Cause]) -> FloatArray:
    """Return how far the path, on lines, is from the log without some causes in [m], shape (n,)."""
    (t_path, *path), (t, *q) = (
        np.loadtxt(folder / name, delimiter=",", skiprows=1).T for name in ("path.csv", "log.csv")
    )
    at = t - sum(cause.value[0] for cause in causes if cause.kind == "time_lag")
    wanted = np.array([np.interp(t, t_path, column, right=np.nan) for column in path]).T
    off = np.linalg.norm(wanted - tcp(CubicSpline(t, np.array(q).T)(at), causes), axis=1)
    off[(at > t[-1] + PERIOD / 2.0) | (at < -PERIOD / 2.0)] = np.nan
    off[[row for cause in causes for row in cause.rows]] = np.nan
    return np.asarray(off[np.isfinite(off)])


def rms(off: FloatArray) -> float:
    return float(np.sqrt(np.mean(off**2)))


def numbers(cause: Cause) -> list[float]:
    """Return the numbers of a clause, in mm, deg, ms or s: a zero and a clock have no sign."""
    factor = np.degrees(1.0) if cause.unit == "rad" else 1.0 if cause.kind == "time_lag" else 1e3
    values = [factor * value for value in cause.value]
    segment = [float(cause.name.split()[1])] if cause.kind == "link_shift" else []
    return [*segment, *(map(abs, values) if cause.kind in ("joint_offset", "time_lag") else values)]


def expected(folder: Path, found: Diagnosis) -> list[float]:
    """Return the numbers of a sentence in their order."""
    causes, whole = found.causes, 1e3 * rms(left(folder, ()))
    if found.undecided:
        after, shown = 1e3 * rms(left(folder, found.undecided[0].causes)), found.undecided[:2]
        clauses = [number for one in shown for cause in one.causes for number in numbers(cause)]
        return [*clauses, len(found.undecided) - 2.0, whole, after]
    steps = [whole, *(1e3 * rms(left(folder, causes[: k + 1])) for k in range(len(causes)))]
    if causes[0].kind == "outliers":
        off = left(folder, ())
        return [101.0, 103.0, 701.0, 1e3 * off.max(), len(off) - 4.0, steps[1]]
    if found.verdict == "pass":
        return [whole - steps[-1], whole, *(number for cause in causes for number in numbers(cause))]
    chain = list[float]()
    for k, cause in enumerate(causes):
        chain += [*numbers(cause), *(steps[k + 1 : k + 2] if cause.kind == "time_lag" else steps[k : k + 2])]
        rest = [1e3 * rms(left(folder, [*causes[:k], one])) for one in causes[k:]]
        assert cause.kind == "time_lag" or steps[k + 1] == min(rest)  # what takes the most away is next
    return chain


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_each_number_of_a_sentence_is_that_of_the_files(tmp_path: Path, case: str) -> None:
    write(tmp_path, CASES[case], 2e-3 if case == "undecided" else 1e-4)
    found = urmpipe.diagnose(tmp_path / "path.csv", tmp_path / "log.csv", tmp_path / "arm.toml", unit="rad")
    named = found.undecided[0].causes if found.undecided else found.causes
    assert {(one.kind, one.name) for one in named} == {(one.kind, one.name) for one in CASES[case]}
    assert bool(found.undecided) == (case == "undecided")
    printed, right = [float(one) for one in NUMBER.findall(found.summary)], expected(tmp_path, found)
    # five digits, at most four of them decimals
    half = [0.501 * 10.0 ** -min(4, 4 - int(np.floor(np.log10(abs(one))))) for one in right]
    assert len(printed) == len(right), found.summary
    assert all(abs(p - r) <= h for p, r, h in zip(printed, right, half, strict=True)), (printed, right)
