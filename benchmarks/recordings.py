"""A recording of 1e6 rows x 6 joints: written, read back, and opened without its arrays.

python benchmarks/recordings.py [--rows N] [--rounds N] [--before CHECKOUT]

CHECKOUT is another version of the sources, which writes and reads the same in the same rounds.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path

from motions import write_log
from pairs import Bound, machine, write_results

HERE = Path(__file__).parent
AREAS = ("models", "fmus", "pipeline", "cli", "datasets")
JOBS = ("write", "read", "open")

JOB = """
import json, sys, time
from pathlib import Path
import urmpipe
job, log, recording = sys.argv[1:]
if job == "write":
    import pandas, rerun.blueprint
    run = urmpipe.ingest(log, robot="urm6")
import rerun.chunk
wall, cpu = time.perf_counter(), time.process_time()
if job == "write":
    urmpipe.write_recording(run, recording)
elif job == "read":
    urmpipe.read_recording(recording)
else:
    run = urmpipe.read_recording(recording, lazy=True)
    middle = len(run.q) // 2
    run.q[middle : middle + 100].sum()
wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
peak = Path("/proc/self/status").read_text().split("VmHWM:")[1].split()[0]
print(json.dumps([wall, cpu, int(peak) / 1024]))
"""
"""Each job in a process of its own: what it takes without reading the log and importing others, and its peak.

When pyarrow imports pandas is chance: it does where it first makes an array of a list. The peak is that of
the process alone: getrusage counts from the parent's."""


def main() -> None:
    """Measure and keep the results."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rows", type=int, default=1_000_000)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--before", type=Path)
    options = parser.parse_args()
    versions = {"now": HERE.parent} | ({"before": options.before} if options.before else {})
    taken: dict[tuple[str, str], list[list[float]]] = {}
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "log.csv"
        write_log(log, options.rows)
        for number in range(options.rounds + 1):
            for name, checkout in versions.items():
                recording = Path(folder) / f"{name}.rrd"
                recording.unlink(missing_ok=True)
                for job in JOBS if name == "now" else JOBS[:2]:
                    found = measured(checkout, job, log, recording)
                    if number:  # the first round warms up
                        taken.setdefault((job, name), []).append(found)
        sizes = {name: (Path(folder) / f"{name}.rrd").stat().st_size / 1e6 for name in versions}
    lines = [
        f"# Recording of {options.rows} rows x 6 joints: {options.rounds} rounds in turn",
        "",
        *machine("pyarrow", "rerun-sdk"),
        "Ingested and held in memory; without the time to read the log, and to import Rerun and pandas.",
        "Opened: without reading an array, then 100 rows in the middle of one.",
        "",
        f"Size of the file: {', '.join(f'{name} {size:.0f} MB' for name, size in sizes.items())}.",
        "",
        *table(taken),
    ]
    write_results("recordings", lines, bounds(taken))


def measured(checkout: Path, job: str, log: Path, recording: Path) -> list[float]:
    """Return what a job takes with the sources of a checkout: wall and CPU in [s], its peak in [MB]."""
    path = os.pathsep.join(str(checkout / area) for area in AREAS)
    done = subprocess.run(
        [sys.executable, "-c", JOB, job, str(log), str(recording)],
        env={**os.environ, "PYTHONPATH": path}, capture_output=True, text=True, check=True, timeout=600,
    )  # fmt: skip
    found: list[float] = json.loads(done.stdout)
    return found


def table(taken: Mapping[tuple[str, str], list[list[float]]]) -> list[str]:
    """Return a row a job and version: medians, and the least wall time."""
    lines = ["| job | version | wall s (least) | CPU s | peak MB |", "|---|---|---|---|---|"]
    for (job, name), rows in sorted(taken.items(), key=lambda item: JOBS.index(item[0][0])):
        wall, cpu, peak = (statistics.median(column) for column in zip(*rows, strict=True))
        least = min(row[0] for row in rows)
        lines.append(f"| {job} | {name} | {wall:.2f} ({least:.2f}) | {cpu:.2f} | {peak:.0f} |")
    return lines


def bounds(taken: Mapping[tuple[str, str], list[list[float]]]) -> list[Bound]:
    """Return what is held: the peak of opening and, beside another version, the time of both."""
    opened = statistics.median(row[2] for row in taken["open", "now"])
    found = [Bound("peak of opening, MB", opened, under=150.0)]
    for job, under in (("write", 1.1), ("read", 1.0)):
        if (job, "before") in taken:
            pairs = zip(taken[job, "now"], taken[job, "before"], strict=True)
            ratio = statistics.median(now[1] / before[1] for now, before in pairs)
            found.append(Bound(f"CPU of {job}, now / before, median of pairs", ratio, under=under))
    return found


main()
