"""Measure what `--diagnose` adds to `compare`, whole process: logs of 7383 and 1,000,000 rows of urm6.

A path with +-3.5 mm of noise and a log with a zero 0.1 deg off, as files of columns.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

import numpy as np
from pairs import Bound, machine, median, rounds, table, write_results

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "shared"))

from altered_arm import PERIOD, poses, rich_motion
from urmpipe_models.robots.catalogue import load_robot

LIMITS = {7383: 0.5, 1_000_000: 8.0}
"""Bounds in [s] of wall time by rows."""


def write_logs(rows: int, folder: Path) -> tuple[Path, Path]:
    """Write a path and a log with so many rows; return their files."""
    chain, t = load_robot("urm6"), np.arange(rows) * PERIOD
    moved = rich_motion(chain)
    q = np.asarray(moved(t % moved.x[-1] if rows <= len(moved.x) else np.abs((t % 72.0) - 36.0)))
    noise = np.random.default_rng(0).uniform(-3.5e-3, 3.5e-3, (rows, 3))
    position = poses(chain, q, oriented=False)[0].T + noise
    q[:, 1] += np.radians(0.1)
    files = folder / f"path-{rows}.csv", folder / f"log-{rows}.csv"
    names = "t [s],x [m],y [m],z [m]", ",".join(["t [s]", *(f"q{k} [rad]" for k in range(1, 7))])
    for file, header, values in zip(files, names, (position, q), strict=True):
        np.savetxt(file, np.column_stack((t, values)), "%.7g", ",", header=header, comments="")
    return files


def main() -> None:
    """Run the pairs and keep the results."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--rows", type=int, nargs="+", default=[*LIMITS])
    options = parser.parse_args()
    lines, bounds = ["# Time of a diagnosis", "", *machine()], list[Bound]()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        output = folder / "out.rrd"
        for rows in options.rows:
            files = map(str, write_logs(rows, folder))
            command = [sys.executable, "-m", "urmpipe", "compare", *files, "--robot", "urm6"]
            command += ["--tolerance", "axis=12mm", "-q", "-o", str(output)]  # passes: exit code 0
            taken = rounds(
                {"compare": command, "compare --diagnose": [*command, "--diagnose"]}, options.rounds, [output]
            )
            lines += ["", f"## {rows} rows", "", *table(taken, "compare")]
            added = median(taken["compare --diagnose"], "wall") - median(taken["compare"], "wall")
            bounds.append(
                Bound(f"s that a diagnosis of {rows} rows adds", added, most=LIMITS.get(rows, np.inf))
            )
    write_results("diagnosis_time", lines, bounds)


if __name__ == "__main__":
    main()
