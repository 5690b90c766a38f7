"""Distance from a path that comes by the same place again and again, beside a look at every piece of it.

python benchmarks/nearest_path.py [--sample N] [--rounds N]

A log and a reference hold the same repetitions of the sample path; every sample has noise of its own.
The look at every piece is taken for a sample of the points, in the same run. `compare` of such files is run
as a whole process, ten times the repetitions beside one time.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path
from time import perf_counter, process_time

import numpy as np
from pairs import Bound, machine, ratio, rounds, table, write_results

from urmpipe_datasets import LOGS
from urmpipe_models.elementwise import FloatArray
from urmpipe_pipeline.comparison.path_distance import distance_from_path

CASES = [(1, 1), (1, 3), (1, 30), (10, 3), (10, 30), (10, 300)]
"""Every so many samples of the motion are taken, and it is repeated so often."""

NOISE = (0.0, 1e-5, 1e-4)
"""In [m]."""


def repeated(motion: FloatArray, times: int, noise: float, seed: int) -> FloatArray:
    """Return repetitions of a motion with noise, shape (times * n, 3)."""
    path = np.tile(motion, (times, 1))
    return path + noise * np.random.default_rng(seed).standard_normal(path.shape)


def by_hand(points: FloatArray, path: FloatArray) -> FloatArray:
    """Return the distance of points from a path, each by a look at every piece."""
    start, step = path[:-1], np.diff(path, axis=0)
    squared = (step**2).sum(axis=1)
    found = np.empty(len(points))
    for k, point in enumerate(points):
        share = ((point - start) * step).sum(axis=1) / np.where(squared > 0.0, squared, 1.0)
        foot = start + np.clip(share, 0.0, 1.0)[:, np.newaxis] * step
        found[k] = np.sqrt(((point - foot) ** 2).sum(axis=1).min())
    return found


def row(motion: FloatArray, times: int, noise: float, sample: int) -> tuple[str, float]:
    """Return a row of the table, and the error in shares of what is promised."""
    points, path = (repeated(motion, times, noise, seed) for seed in (1, 2))
    joined = np.ones(len(path) - 1, dtype=bool)
    wall, busy = perf_counter(), process_time()
    found = distance_from_path(points, path, joined)
    wall, busy = perf_counter() - wall, process_time() - busy
    rows = np.random.default_rng(3).choice(len(points), min(sample, len(points)), replace=False)
    begun = perf_counter()
    true = by_hand(points[rows], path)
    whole = (perf_counter() - begun) * len(points) / len(rows)
    wrong = found[rows] - true
    share = float((np.abs(wrong) / (1e-9 + 1e-6 * true)).max())
    cells = [f"{len(motion)} x {times}", f"{noise:g}", f"{wall:.3f}", f"{busy:.3f}", f"{whole:.0f}"]
    return "| " + " | ".join([*cells, f"{wrong.min():.1e} to {wrong.max():.1e}"]) + " |", share


def compared(motion: FloatArray, times: int, rounds_: int) -> tuple[list[str], Bound]:
    """Return how long `compare` takes of repetitions and of ten times as many, and by how much that grows."""
    with tempfile.TemporaryDirectory() as name:
        folder, commands = Path(name), {}
        for many in (times, 10 * times):
            files = [
                write(folder / f"{word}{many}.csv", repeated(motion, many, 1e-4, seed))
                for seed, word in enumerate(("reference", "log"))
            ]
            options = ["--tolerance", "1m", "-q", "-o", str(folder / f"{many}.rrd")]
            commands[f"compare, {len(motion)} x {many}"] = [
                sys.executable, "-m", "urmpipe", "compare", *map(str, files), *options,
            ]  # fmt: skip
        taken = rounds(commands, rounds_)
    once, tenfold = taken
    grown = ratio(taken[tenfold], taken[once])
    return table(taken, once), Bound(f"{tenfold} over {once}, wall", grown, most=12.0)


def write(path: Path, position: FloatArray) -> Path:
    """Write places as a path, a row each 5 ms."""
    rows = np.column_stack([0.005 * np.arange(len(position)), position])
    np.savetxt(path, rows, ["%.3f", *["%.9f"] * 3], ",", header="t [s],x [m],y [m],z [m]", comments="")
    return path


def main() -> None:
    """Measure and keep the results."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sample", type=int, default=30)
    parser.add_argument("--rounds", type=int, default=3)
    options = parser.parse_args()
    motion = np.loadtxt(LOGS / "path.csv", delimiter=",", skiprows=1)[:, 1:4]
    distance_from_path(motion, motion, np.ones(len(motion) - 1, dtype=bool))  # loads SciPy
    found = [row(motion[::every], times, noise, options.sample) for noise in NOISE for every, times in CASES]
    lines = [
        "# Distance from a path of repetitions",
        "",
        *machine("scipy"),
        "Both sides hold the repetitions, each sample with noise of its own. By hand: a look at every piece,",
        f"taken for {options.sample} points and scaled to all. Error: in [m], of these points.",
        "",
        "| samples x repetitions | noise, m | s | CPU s | by hand, s | error, m |",
        "|---|---|---|---|---|---|",
        *(line for line, _ in found),
    ]
    bounds = [Bound("error, of 1 nm and a millionth", max(share for _, share in found), under=1.001)]
    lines += ["", "Whole processes, with noise of 0.1 mm on both sides and a recording:"]
    for every, times in ((1, 3), (10, 30)):
        whole, grown = compared(motion[::every], times, options.rounds)
        lines += ["", *whole]
        bounds.append(grown)
    write_results("nearest_path", lines, bounds)


main()
