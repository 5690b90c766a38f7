"""The repolarizer on the sample motion of urm6 beside numpy.unwrap and what the paper tried before it.

python benchmarks/repolarizer.py [--rows N] [--rounds N]

The alternatives are those of [UrmArm2021] 2.4: a rate limiter, dropping the sample, averaging, a low-pass.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
from pairs import Bound, machine, write_results
from scipy.signal import butter, lfilter

from urmpipe_datasets import LOGS
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.kinematics.forward import positions_over_log
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_models.wraps import repolarize
from urmpipe_pipeline.joint_log import JointLog, LogColumn
from urmpipe_pipeline.repolarization.audit import audit_log

Method = Callable[[FloatArray], FloatArray]

TSP = 0.005
PI, TURN = np.pi, 2.0 * np.pi
WINDOW = 5
CUTOFF = 10.0
DELAYS = np.arange(0.0, 0.1, 0.0005)


def wrap(q: FloatArray) -> FloatArray:
    """Limit to -pi..pi, as an environment does."""
    return np.asarray(q - TURN * np.floor((q + PI) / TURN))


def urmpipe(q: FloatArray, *, repaired: bool = False) -> FloatArray:
    """Repolarize as `urmpipe ingest` does, with its audit."""
    names = tuple(f"phi{j + 1}" for j in range(q.shape[1]))
    columns = tuple(LogColumn(name, name, "joint", j, "rad") for j, name in enumerate(names))
    times = round(TSP * 1e9) * np.arange(len(q))
    log = JointLog("log", "table", (), times, names, q, columns=columns)
    return audit_log(log, repaired=repaired).q


def numpy_unwrap(q: FloatArray) -> FloatArray:
    """Take every step above half a turn for a wrap."""
    return np.unwrap(q, axis=0)


def rate_limiter(q: FloatArray) -> FloatArray:
    """Follow no faster than twice the fastest motion in the log."""
    steps = np.abs(wrap(np.diff(q, axis=0)))
    most = 2.0 * np.nanquantile(steps, 0.999, axis=0)
    out = q.copy()
    for i in range(1, len(q)):
        wanted = np.where(np.isnan(q[i]), out[i - 1], q[i])
        out[i] = out[i - 1] + np.clip(wanted - out[i - 1], -most, most)
    return out


def dropped(q: FloatArray) -> FloatArray:
    """Leave out each sample after a jump and draw a line over it."""
    out, index = q.copy(), np.arange(len(q))
    for j in range(q.shape[1]):
        good = ~np.isnan(q[:, j])
        good[1:] &= ~(np.abs(np.diff(q[:, j])) > PI)
        out[:, j] = np.interp(index, index[good], q[good, j])
    return out


def averaged(q: FloatArray) -> FloatArray:
    """Average over the last samples."""
    padded = np.concatenate((np.repeat(q[:1], WINDOW - 1, axis=0), q))
    return np.asarray(np.lib.stride_tricks.sliding_window_view(padded, WINDOW, axis=0).mean(axis=2))


def low_passed(q: FloatArray) -> FloatArray:
    """Filter with a Butterworth low-pass of second order, from the first sample on."""
    b, a = butter(2, CUTOFF, fs=1.0 / TSP)
    return np.asarray(lfilter(b, a, q - q[0], axis=0) + q[0])


METHODS: dict[str, Method] = {
    "urmpipe": urmpipe,
    "urmpipe --repair": lambda q: urmpipe(q, repaired=True),
    "numpy.unwrap": numpy_unwrap,
    "rate limiter (2 x the fastest motion)": rate_limiter,
    "sample dropped": dropped,
    f"average of {WINDOW} samples": averaged,
    f"low-pass {CUTOFF:g} Hz": low_passed,
}


def logs(x: FloatArray) -> dict[str, tuple[FloatArray, FloatArray]]:
    """Return some logs of a motion as an environment writes them, each with the truth."""
    q = wrap(x)
    low = q[:, 5] < -1.0  # for two samples, so that the jump of 4 rad stays within -pi..pi
    jumped, row = x.copy(), 2001 + int(np.argmax(low[2000:-1] & low[2001:]))
    jumped[row:, 5] += 4.0
    gaps, wraps = q.copy(), np.unique(np.nonzero(np.abs(np.diff(q, axis=0)) > PI)[0])
    for at in wraps[::3]:
        gaps[at - 10 : at + 20] = np.nan
    # From sample 10 on: of a log's first sample nobody can tell that it lies on a jump, and here it would.
    late, late_x = (one[10:-1] + 0.4 * np.diff(one[10:], axis=0) for one in (q, x))
    return {
        "clean wraps": (q, x),
        "a real jump of 4 rad": (wrap(jumped), jumped),
        "gaps without values over the wraps": (gaps, np.where(np.isnan(gaps), np.nan, x)),
        "in-between samples (resampled 2 ms off)": (late, late_x),
    }


def delay_of(method: Method, q: FloatArray, path: FloatArray) -> float:
    """Return by how much p7 comes late in [s]: the shift with the least median distance."""
    p = positions_over_log(load_robot("urm6"), method(q))
    t = TSP * np.arange(len(q))
    distances = []
    for delay in DELAYS:
        shifted = np.column_stack([np.interp(t - delay, t, axis) for axis in path.T])
        distances.append(float(np.nanmedian(np.linalg.norm(p - shifted, axis=1))))
    return float(DELAYS[int(np.argmin(distances))])


def errors(method: Method, q: FloatArray, x: FloatArray) -> tuple[float, float, float, int]:
    """Return largest and rms error at p7 in [mm], the largest of a joint in [rad], and samples lost."""
    robot = load_robot("urm6")
    got = method(q)
    known = ~np.isnan(x).any(axis=1)
    x = x - TURN * np.rint((x[0] - q[0]) / TURN)  # turns before a log begins are not in it
    off = np.linalg.norm(positions_over_log(robot, got[known]) - positions_over_log(robot, x[known]), axis=1)
    joint = float(np.nanmax(np.abs(got[known] - x[known])))
    valid = off[~np.isnan(off)]
    return 1e3 * valid.max(), 1e3 * float(np.sqrt(np.mean(valid**2))), joint, int(np.isnan(off).sum())


def timed(rows: int, rounds: int) -> Mapping[str, list[float]]:
    """Return how long the repolarizer and numpy.unwrap take over many rows in [s]."""
    t = TSP * np.arange(rows)
    rng = np.random.default_rng(11)
    parts = rng.uniform((1, 0.1, 0, -0.05), (3, 0.5, 6, 0.05), (6, 4))
    q = wrap(np.column_stack([a * np.sin(w * t + p) + s * t for a, w, p, s in parts]))
    dt = np.full(rows, TSP)
    taken: dict[str, list[float]] = {"urmpipe repolarize": [], "numpy.unwrap": []}
    for _ in range(rounds):
        for name, job in (
            ("urmpipe repolarize", lambda: repolarize(q, dt)), ("numpy.unwrap", lambda: numpy_unwrap(q)),
        ):  # fmt: skip
            start = time.perf_counter()
            job()
            taken[name].append(time.perf_counter() - start)
    return taken


def sample_motion(file: Path) -> FloatArray:
    """Return the joints of a bundled log without their wraps, which are clean."""
    return urmpipe(np.loadtxt(file, delimiter=",", skiprows=1, usecols=range(1, 7)))


def main() -> None:
    """Measure and keep the results."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rows", type=int, default=1_000_000)
    parser.add_argument("--rounds", type=int, default=7)
    options = parser.parse_args()
    x = sample_motion(LOGS / "matlab.csv")
    q = wrap(x)
    path = positions_over_log(load_robot("urm6"), x)
    delays = {name: delay_of(method, q, path) for name, method in METHODS.items()}
    lines = [
        f"# Undoing the wraps of the sample motion (urm6, {len(x)} samples at 5 ms)",
        "",
        *machine("scipy"),
        "Errors are of what a method makes of the wrapped log, against the motion before it was wrapped.",
        "p7 is the same for whole turns, so a turn too much shows in the joint only: there numpy.unwrap",
        "takes a real jump above pi for a wrap. It also loses all that follows a missing sample. The delay",
        "is that of the clean log: the shift with the least median distance.",
    ]
    found = {}
    for title, (wrapped, true) in logs(x).items():
        lines += [
            "", f"## {title}", "",
            "| method | p7 max mm | p7 rms mm | joint max rad | samples lost | delay ms |",
            "|---|---|---|---|---|---|",
        ]  # fmt: skip
        for name, method in METHODS.items():
            largest, rms, joint, lost = found[title, name] = errors(method, wrapped, true)
            lines.append(
                f"| {name} | {largest:.4f} | {rms:.4f} | {joint:.4f} | {lost} | {1e3 * delays[name]:.1f} |"
            )
    taken = timed(options.rows, options.rounds)
    lines += ["", f"## Time for {options.rows} x 6 values, {options.rounds} rounds in turn", "",
              "| what | s, median (min-max) |", "|---|---|"]  # fmt: skip
    for name, seconds in taken.items():
        span = f"{statistics.median(seconds):.3f} ({min(seconds):.3f}-{max(seconds):.3f})"
        lines.append(f"| {name} | {span} |")
    pairs = zip(*taken.values(), strict=True)
    bounds = [
        Bound("urmpipe on a clean log, p7 max mm", found["clean wraps", "urmpipe"][0], under=1e-6),
        Bound("urmpipe on a real jump, joint max rad",
              found["a real jump of 4 rad", "urmpipe"][2], under=1e-6),
        Bound("numpy.unwrap on a real jump, joint max rad",
              found["a real jump of 4 rad", "numpy.unwrap"][2], least=6.28),
        Bound("urmpipe --repair on in-between samples, p7 max mm",
              found["in-between samples (resampled 2 ms off)", "urmpipe --repair"][0], under=0.1),
        Bound("urmpipe over gaps, samples lost",
              found["gaps without values over the wraps", "urmpipe"][3], under=1.0),
        Bound("time of urmpipe / numpy.unwrap, median of pairs",
              statistics.median(a / b for a, b in pairs), under=1.0),
    ]  # fmt: skip
    write_results("repolarizer", lines, bounds)


main()
