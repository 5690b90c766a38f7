"""Ingest of a 1e6 x 6 log against pandas.read_csv alone and the leanest user's script.

python benchmarks/ingest.py [--rows N] [--rounds N] [--peer PYTHON]

PEER is the Python of an environment with pandas, rerun-sdk and roboticstoolbox-python (default: this one).
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

from motions import write_log
from pairs import Bound, machine, median, ratio, rounds, table, write_results

HERE = Path(__file__).parent


def main() -> None:
    """Measure and keep the results."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rows", type=int, default=1_000_000)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--peer", default=sys.executable)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "log.csv"
        write_log(log, options.rows)
        ours, theirs = Path(folder) / "ours.rrd", Path(folder) / "theirs.rrd"
        urmpipe = str(Path(sys.executable).parent / "urmpipe")
        read = f"import pandas; pandas.read_csv({str(log)!r})"
        commands = {
            "pandas.read_csv alone": [sys.executable, "-c", read],
            "urmpipe ingest": [
                urmpipe,
                "ingest",
                str(log),
                "--robot",
                "urm6",
                "-q",
                "-o",
                str(ours),
            ],
            "user's script": [options.peer, str(HERE / "users_script.py"), str(log), str(theirs)],
        }
        taken = rounds(commands, options.rounds, outputs=(ours, theirs))
        size = log.stat().st_size / 1e6
    lines = [
        f"# Ingest of {options.rows} rows x 6 joints ({size:.0f} MB CSV): {options.rounds} rounds in turn",
        "",
        *machine("pandas", "pyarrow", "rerun-sdk"),
        "The user's script is `users_script.py`: pandas.read_csv, numpy.unwrap, roboticstoolbox ETS.fkine",
        "and send_columns; it writes joints and positions. urmpipe also checks the log, lists the wraps, and",
        "writes velocities, accelerations, Euler angles and the moving arm.",
        "No output stands there when a run begins: replacing one of this size takes longer.",
        "",
    ]
    pandas, mine, users = taken.values()
    bounds = [
        Bound("urmpipe ingest / pandas.read_csv alone", ratio(mine, pandas), under=5.0),
        Bound("urmpipe ingest / user's script", ratio(mine, users), under=0.5),
        Bound("peak of urmpipe ingest, MB", median(mine, "rss"), under=600.0),
    ]
    tables = [*table(taken, "pandas.read_csv alone"), "", *table(taken, "user's script")]
    write_results("ingest", [*lines, *tables], bounds)


main()
