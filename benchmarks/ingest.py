"""Ingest of a 1e6 x 6 log against pandas.read_csv alone and the leanest user's script.

python benchmarks/ingest.py [--rows N] [--rounds N] [--peer PYTHON] [--before CHECKOUT]

PEER is the Python of an environment with pandas, rerun-sdk and roboticstoolbox-python, for the user's script.
CHECKOUT is another version of the sources, which ingests the same log in the same rounds.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
from pathlib import Path

from motions import write_log
from pairs import Bound, machine, median, ratio, rounds, table, write_results

HERE = Path(__file__).parent
PANDAS = "pandas.read_csv alone"
AREAS = ("models", "fmus", "pipeline", "cli", "datasets")


def ingest(checkout: Path, log: Path, output: Path) -> list[str]:
    """Return the command with the sources of a checkout."""
    path = os.pathsep.join(str(checkout / area) for area in AREAS)
    command = [
        sys.executable,
        "-m",
        "urmpipe",
        "ingest",
        str(log),
        "--robot",
        "urm6",
        "-q",
        "-o",
        str(output),
    ]
    return ["env", f"PYTHONPATH={path}", *command]


def main() -> None:
    """Measure and keep the results."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rows", type=int, default=1_000_000)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--peer")
    parser.add_argument("--before", type=Path)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "log.csv"
        write_log(log, options.rows)
        ours, theirs = Path(folder) / "ours.rrd", Path(folder) / "theirs.rrd"
        read = f"import pandas; pandas.read_csv({str(log)!r})"
        commands = {
            PANDAS: [sys.executable, "-c", read],
            "urmpipe ingest": ingest(HERE.parent, log, ours),
        }
        if options.peer:
            script = str(HERE / "users_script.py")
            commands["user's script"] = [options.peer, script, str(log), str(theirs)]
        if options.before:
            commands["urmpipe before"] = ingest(options.before, log, ours)
        taken = rounds(commands, options.rounds, outputs=(ours, theirs))
        size = log.stat().st_size / 1e6
    lines = [
        f"# Ingest of {options.rows} rows x 6 joints ({size:.0f} MB CSV): {options.rounds} rounds in turn",
        "",
        *machine("pandas", "pyarrow", "rerun-sdk"),
        "No output stands there when a run begins: replacing one of this size takes longer.",
        "",
    ]
    mine, users, before = (taken.get(name) for name in ("urmpipe ingest", "user's script", "urmpipe before"))
    assert mine is not None
    bounds = [
        Bound("urmpipe ingest / pandas.read_csv alone", ratio(mine, taken[PANDAS]), under=5.0),
        Bound("peak of urmpipe ingest, MB", median(mine, "rss"), under=600.0),
    ]
    tables = table(taken, PANDAS)
    if users:
        bounds.append(Bound("urmpipe ingest / user's script", ratio(mine, users), under=0.5))
        tables += ["", *table(taken, "user's script")]
    if before:
        bounds.append(Bound("urmpipe ingest, now / before", ratio(mine, before), under=1.1))
        tables += ["", *table(taken, "urmpipe before")]
    if users:
        lines += [
            "The user's script is `users_script.py`: pandas.read_csv, numpy.unwrap, roboticstoolbox's",
            "ETS.fkine and send_columns; it writes joints and positions. urmpipe also checks the log,",
            "lists the wraps, and writes velocities, accelerations, Euler angles and the moving arm.",
            "",
        ]
    write_results("ingest", [*lines, *tables], bounds)


main()
