"""Verdict and report on ten logs, the report of a long log, and evo_ape on the poses of the ten.

python benchmarks/compare_report.py [--rows N] [--rounds N]

evo_ape stands beside this Python (the extra `bench`). It takes two trajectories, gives the position error and
draws nothing; `urmpipe compare` reads joints, runs the kinematics and writes a recording.
"""

from __future__ import annotations

import argparse
import shlex
import sys
import tempfile
from pathlib import Path

import numpy as np
from motions import write_log
from pairs import Bound, machine, measure, median, rounds, table, write_results

from urmpipe_datasets import LOGS
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.kinematics.forward import positions_over_log
from urmpipe_models.robots.catalogue import load_robot

URMPIPE = [sys.executable, "-m", "urmpipe"]
LOG_COUNT = 10
APART = 1e-4
"""Each log has every joint so much further in [rad] than the one before: no two are the same."""


def write_logs(folder: Path) -> list[Path]:
    """Write logs that follow the sample path, and the poses of all as TUM for evo."""
    names = [f"log{k}" for k in range(LOG_COUNT)]
    values = np.loadtxt(LOGS / "matlab.csv", delimiter=",", skiprows=1)
    path = np.loadtxt(LOGS / "path.csv", delimiter=",", skiprows=1)
    write_tum(folder / "reference.tum", path[:, 0], path[:, 1:])
    for k, name in enumerate(names):
        q = values[:, 1:] + APART * k
        rows = np.column_stack([values[:, 0], q])
        header = "t,q1,q2,q3,q4,q5,q6"
        np.savetxt(folder / f"{name}.csv", rows, "%.15g", ",", header=header, comments="")
        write_tum(folder / f"{name}.tum", values[:, 0], positions_over_log(load_robot("urm6"), q))
    return [folder / f"{name}.csv" for name in names]


def write_tum(path: Path, t: FloatArray, position: FloatArray) -> None:
    """Write t [s], x, y, z [m] and the quaternion of no rotation."""
    turns = np.tile([0.0, 0.0, 0.0, 1.0], (len(t), 1))
    np.savetxt(path, np.column_stack([t, position, turns]), "%.9f")


def compare(logs: list[Path], output: Path) -> list[str]:
    """Return the command that holds the logs against the path; whether they pass is no matter here."""
    options = ["--robot", "urm6", "--tolerance", "1m", "-q", "-o", str(output)]
    return [*URMPIPE, "compare", str(LOGS / "path.csv"), *map(str, logs), *options]


def report(recording: Path, output: Path) -> list[str]:
    """Return the command that writes the report of a recording."""
    return [*URMPIPE, "report", str(recording), "-q", "-o", str(output)]


def evo(logs: list[Path]) -> list[str]:
    """Return the command that runs evo_ape on the poses, one call a log."""
    ape = Path(sys.executable).parent / "evo_ape"
    reference = logs[0].with_name("reference.tum")
    calls = [[str(ape), "tum", str(reference), str(log.with_suffix(".tum"))] for log in logs]
    return ["sh", "-c", " && ".join(map(shlex.join, calls))]


def main() -> None:
    """Measure and keep the results."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rows", type=int, default=1_000_000)
    parser.add_argument("--rounds", type=int, default=5)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        logs = write_logs(folder)
        long = folder / "long.csv"
        write_log(long, options.rows)
        measure([*URMPIPE, "ingest", str(long), "--robot", "urm6", "-q", "-o", str(folder / "long.rrd")])
        measure(compare(logs, folder / "ten.rrd"))
        outputs = [folder / name for name in ("new.rrd", "ten.html", "long.html")]
        commands = {
            "urmpipe compare path, 10 logs": compare(logs, outputs[0]),
            "urmpipe report of it": report(folder / "ten.rrd", outputs[1]),
            f"urmpipe report of {options.rows} samples": report(folder / "long.rrd", outputs[2]),
            "evo_ape, 10 calls": evo(logs),
        }
        taken = rounds(commands, options.rounds, outputs=outputs)
    compared, reported, of_long, _ = taken.values()
    lines = [
        f"# Compare and report of {LOG_COUNT} logs of 7383 samples: {options.rounds} rounds in turn",
        "",
        *machine("rerun-sdk", "plotly", "evo"),
        "The logs are the sample log of MATLAB, each with all joints 0.1 mrad further than the one before.",
        "evo_ape reads the positions of the same logs as TUM and prints the statistics of their error;",
        "urmpipe reads joints, runs the kinematics, and writes a recording and a report.",
        "No output stands there when a run begins.",
        "",
    ]
    together = median(compared, "wall") + median(reported, "wall")
    bounds = [
        Bound("compare of 10 logs and report of it, s", together, under=6.0),
        Bound(f"report of {options.rows} samples, s", median(of_long, "wall"), under=10.0),
    ]
    write_results("compare_report", [*lines, *table(taken, "evo_ape, 10 calls")], bounds)


main()
