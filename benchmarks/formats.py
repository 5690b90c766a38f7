"""Reading of one motion in each format against the plain comma file of the same numbers, and another version.

python benchmarks/formats.py [--rows N] [--rounds N] [--before CHECKOUT] [--only NAME ...]

CHECKOUT is another version of the sources, which reads the same files in the same rounds.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np
import openpyxl
import pyarrow as pa
from mcap_ros2.writer import Writer as McapWriter
from numpy.typing import NDArray
from pairs import Bound, machine, write_results
from pyarrow import csv
from pyarrow import parquet as pq
from scipy.io import savemat

from urmpipe_models.elementwise import FloatArray

AREAS = ("models", "fmus", "pipeline", "cli", "datasets")
PERIOD_MS = 5
NAMES = ["t", *(f"q{j}" for j in range(1, 7))]
BLOCK = 20_000  # rows turned into text at a time

JOB = """
import json, sys, time
from resource import RUSAGE_CHILDREN, getrusage
from pathlib import Path
try:
    from urmpipe_pipeline.logs import LogMap, read_log
except ImportError:
    from urmpipe_pipeline.sources import LogMap, read_log
import pyarrow, pandas
def used():
    return time.process_time() + sum(getrusage(RUSAGE_CHILDREN)[:2])
wall, cpu = time.perf_counter(), used()
log = read_log([Path(sys.argv[1])], LogMap(unit={"": "rad"}))
wall, cpu = time.perf_counter() - wall, used() - cpu
peak = Path("/proc/self/status").read_text().split("VmHWM:")[1].split()[0]
print(json.dumps([wall, cpu, int(peak) / 1024, log.rows]))
"""  # files to arrays, in a process for each; without imports, whose order differs by version


@dataclass(frozen=True, slots=True)
class Format:
    """A way to write a log.

    Attributes:
        write: Writes times in [ms] and joint values in [rad] to a file.
        under: How many times the CPU time of the plain comma file it may take.
        suffix: The file's suffix.
        share: Of the rows that are written, since some writers are slow.
    """

    write: Callable[[Path, NDArray[np.int64], FloatArray], None]
    under: float = 2.0
    suffix: str = ".csv"
    share: float = 1.0


def motion(rows: int) -> tuple[NDArray[np.int64], FloatArray]:
    """Return times in [ms] and a smooth multi-turn motion of six joints in [rad], wrapped to +-pi."""
    t_ms = PERIOD_MS * np.arange(rows)
    rng = np.random.default_rng(11)
    t = t_ms / 1e3
    swings = rng.uniform((1, 0.1, 0, -0.05), (3, 0.5, 6, 0.05), (6, 4))
    q = np.column_stack([a * np.sin(w * t + p) + s * t for a, w, p, s in swings])
    return t_ms, np.round(q - 2.0 * np.pi * np.floor((q + np.pi) / (2.0 * np.pi)), 7)


def lines(pattern: str, *columns: NDArray[np.generic]) -> Iterator[str]:
    """Yield the rows as text, a block at a time: one pattern for many rows is Python's fastest."""
    rows = len(columns[0])
    together = np.empty((rows, len(columns)), dtype=object)
    for j, column in enumerate(columns):
        together[:, j] = column
    for start in range(0, rows, BLOCK):
        block = together[start : start + BLOCK]
        yield (pattern * len(block)) % tuple(block.ravel())


def separated(delimiter: str, decimal: str = ".", encoding: str = "utf-8") -> Callable[..., None]:
    """Return the writer of a table with a header."""

    def write(path: Path, t_ms: NDArray[np.int64], q: FloatArray) -> None:
        with path.open("w", encoding=encoding, newline="\r\n" if encoding != "utf-8" else "\n") as file:
            file.write(delimiter.join(["t [s]", *(f"{name} [rad]" for name in NAMES[1:])]) + "\n")
            pattern = delimiter.join(["%.3f", *["%.7f"] * 6]) + "\n"
            for text in lines(pattern, t_ms / 1e3, *q.T):
                file.write(text if decimal == "." else text.replace(".", decimal))

    return write


def matlab_ascii(path: Path, t_ms: NDArray[np.int64], q: FloatArray) -> None:
    """Write what `save -ascii` writes of q: no header, no time, 8 digits, runs of spaces, CRLF."""
    with path.open("w", newline="\r\n") as file:
        file.writelines(lines("  %14.7e" * 6 + "\n", *q.T))


def coppeliasim(path: Path, t_ms: NDArray[np.int64], q: FloatArray) -> None:
    """Write what CoppeliaSim exports of a graph: its path, a header with units, 4 digits, a blank line."""
    with path.open("w") as file:
        file.write("/arm/graph\nTime (s)," + ",".join(f"q{j} (rad)" for j in range(1, 7)) + "\n")
        file.writelines(lines("%.3f" + ",%+.3e" * 6 + "\n", t_ms / 1e3, *q.T))
        file.write("\n")


def ur_rtde(path: Path, t_ms: NDArray[np.int64], q: FloatArray) -> None:
    """Write what the RTDE recorder writes: spaces, CRLF, the joints and the pose as a rotation vector."""
    names = [f"actual_q_{j}" for j in range(6)] + [f"actual_TCP_pose_{k}" for k in range(6)]
    angle = t_ms / 1e3 * 0.1
    pose = [0.3 * np.cos(angle), 0.3 * np.sin(angle), 0.2 + 0.0 * angle]
    vector = [np.sin(angle), np.cos(angle), 0.5 + 0.0 * angle]
    with path.open("w", newline="\r\n") as file:
        file.write(" ".join(["timestamp", *names]) + "\n")
        file.writelines(lines("%.3f" + " %.7f" * 12 + "\n", t_ms / 1e3, *q.T, *pose, *vector))


def iso_dates(path: Path, t_ms: NDArray[np.int64], q: FloatArray) -> None:
    """Write a clock of dates and times, as pandas and databases do."""
    stamps = np.datetime64("2021-04-11T22:27:21.000", "ms") + t_ms.astype("timedelta64[ms]")
    arrays = [pa.array(stamps), *(pa.array(column) for column in q.T)]
    names = ["time", *(f"{name} [rad]" for name in NAMES[1:])]
    csv.write_csv(pa.table(arrays, names=names), path, csv.WriteOptions(quoting_style="none"))


def fri_text(path: Path, t_ms: NDArray[np.int64], q: FloatArray) -> None:
    """Write what a KUKA iiwa's FRI client prints: words between the numbers."""
    with path.open("w") as file:
        pattern = "Time: %.6f  q values: [" + ", ".join(["%.7f"] * 6) + "]\n"
        file.writelines(lines(pattern, t_ms / 1e3, *q.T))


def array_cells(path: Path, t_ms: NDArray[np.int64], q: FloatArray) -> None:
    """Write what pandas dumps of a column of arrays: quoted cells over two lines."""
    with path.open("w") as file:
        file.write("time,q\n")
        pattern = '%.3f,"[ %.7f  %.7f  %.7f\n  %.7f  %.7f  %.7f]"\n'
        file.writelines(lines(pattern, t_ms / 1e3, *q.T))


def parquet(path: Path, t_ms: NDArray[np.int64], q: FloatArray) -> None:
    """Write the same columns as Parquet, doubles with the settings of pandas."""
    names = ["t [s]", *(f"{name} [rad]" for name in NAMES[1:])]
    pq.write_table(pa.table([pa.array(column) for column in (t_ms / 1e3, *q.T)], names=names), path)


def mat(path: Path, t_ms: NDArray[np.int64], q: FloatArray) -> None:
    """Write what SciPy, or MATLAB's `save -v6`, writes of a vector and a matrix."""
    savemat(path, {"t": t_ms / 1e3, "q": q})


def hdf5(path: Path, t_ms: NDArray[np.int64], q: FloatArray) -> None:
    """Write two datasets."""
    with h5py.File(path, "w") as file:
        file["t"], file["q"] = t_ms / 1e3, q


def numpy_archive(path: Path, t_ms: NDArray[np.int64], q: FloatArray) -> None:
    """Write what numpy.savez writes of two arrays."""
    np.savez(path, t=t_ms / 1e3, q=q)


def json_lines(path: Path, t_ms: NDArray[np.int64], q: FloatArray) -> None:
    """Write an object a line."""
    with path.open("w") as file:
        pattern = '{"t": %.3f, "q": [' + ", ".join(["%.7f"] * 6) + "]}\n"
        file.writelines(lines(pattern, t_ms / 1e3, *q.T))


def workbook(path: Path, t_ms: NDArray[np.int64], q: FloatArray) -> None:
    """Write a sheet of numbers."""
    book = openpyxl.Workbook(write_only=True)
    sheet = book.create_sheet("log")
    sheet.append(NAMES)
    for row in np.column_stack([t_ms / 1e3, q]).tolist():
        sheet.append(row)
    book.save(path)


def mcap(path: Path, t_ms: NDArray[np.int64], q: FloatArray) -> None:
    """Write messages of the type JointState."""
    names = [f"joint_{j}" for j in range(1, 7)]
    definition = (
        "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort\n"
        + "=" * 80
        + "\nMSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n"
        + "=" * 80
        + "\nMSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n"
    )
    with path.open("wb") as file, McapWriter(file) as bag:
        schema = bag.register_msgdef("sensor_msgs/msg/JointState", definition)
        for ms, position in zip(t_ms.tolist(), q.tolist(), strict=True):
            stamp = {"sec": ms // 1000, "nanosec": ms % 1000 * 10**6}
            message = {"header": {"stamp": stamp, "frame_id": ""}, "name": names, "position": position}
            message |= {"velocity": [], "effort": []}
            bag.write_message("/joint_states", schema, message, ms * 10**6)


PLAIN = Format(separated(","))
FORMATS = {
    "semicolon, decimal comma": Format(separated(";", ",")),
    "tab": Format(separated("\t")),
    "runs of spaces (MATLAB save -ascii)": Format(matlab_ascii),
    "CoppeliaSim graph": Format(coppeliasim),
    "UR RTDE, spaces, 12 columns": Format(ur_rtde, under=3.0),
    "UTF-16": Format(separated(",", encoding="utf-16")),
    "ISO dates as clock": Format(iso_dates),
    "FRI text": Format(fri_text, under=8.0, suffix=".txt"),
    "array cells over two lines": Format(array_cells, under=8.0),
    "JSON lines": Format(json_lines, under=16.0, suffix=".jsonl", share=0.1),
    "Parquet": Format(parquet, under=1.0, suffix=".parquet"),
    "MAT": Format(mat, under=4.0, suffix=".mat"),
    "HDF5": Format(hdf5, under=4.0, suffix=".h5"),
    "NumPy": Format(numpy_archive, under=1.0, suffix=".npz"),
    "workbook (.xlsx)": Format(workbook, under=16.0, suffix=".xlsx", share=0.05),
    "MCAP, JointState": Format(mcap, under=64.0, suffix=".mcap", share=0.05),
}

Key = tuple[str, str]
"""Name of the format and of the version."""


def read(checkout: Path, log: Path) -> list[float]:
    """Return what reading takes with the sources of a checkout: wall and CPU in [s], peak in [MB], rows."""
    path = os.pathsep.join(str(checkout / area) for area in AREAS)
    command, env = [sys.executable, "-c", JOB, str(log)], {**os.environ, "PYTHONPATH": path}
    done = subprocess.run(command, env=env, capture_output=True, text=True, check=False, timeout=600)
    if done.returncode:
        raise RuntimeError(f"{log.name} is not read with {checkout}: {done.stderr.splitlines()[-1]}")
    taken: list[float] = json.loads(done.stdout)
    return taken


def measure(
    names: Sequence[str], options: argparse.Namespace, versions: Mapping[str, Path]
) -> dict[Key, list[list[float]]]:
    """Return what the files, and plain ones of the same numbers, take in turn, by version."""
    taken: dict[Key, list[list[float]]] = {}
    with tempfile.TemporaryDirectory() as folder:
        logs: dict[str, tuple[Path, int]] = {}
        for name in names:
            form = FORMATS[name]
            t_ms, q = motion(round(form.share * options.rows))
            for key, writer in ((plain_name(form), PLAIN), (name, form)):
                if key not in logs:
                    path = Path(folder) / f"log{len(logs)}{writer.suffix}"
                    writer.write(path, t_ms, q)
                    logs[key] = path, len(q)
        for number in range(options.rounds + 1):
            for key, (path, rows) in logs.items():
                for version, checkout in versions.items():
                    figures = read(checkout, path)
                    assert figures[3] == rows, (key, version, figures)
                    if number:  # the first round warms up
                        taken.setdefault((key, version), []).append(figures)
    return taken


def plain_name(form: Format) -> str:
    """Return what the plain file of the same numbers is called."""
    return "plain comma" if form.share == 1.0 else f"plain comma, {form.share:g} of the rows"


def cpu_ratio(taken: Sequence[Sequence[float]], base: Sequence[Sequence[float]]) -> float:
    """Return the median of the ratios of CPU times, pair by pair."""
    return statistics.median(a[1] / b[1] for a, b in zip(taken, base, strict=True))


def main() -> None:
    """Measure and keep the results."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rows", type=int, default=1_000_000)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--before", type=Path)
    parser.add_argument("--only", nargs="*", default=[*FORMATS])
    options = parser.parse_args()
    versions = {"now": Path(__file__).parents[1]} | ({"before": options.before} if options.before else {})
    taken = measure(options.only, options, versions)
    plains = {name: plain_name(FORMATS[name]) for name in options.only}
    rows: list[str] = []
    for (key, version), figures in taken.items():
        wall, cpu, peak, count = (statistics.median(column) for column in zip(*figures, strict=True))
        plain = cpu_ratio(figures, taken[plains.get(key, key), version])
        is_compared = options.before and version == "now"
        before = f"{cpu_ratio(figures, taken[key, 'before']):.2f}" if is_compared else ""
        cells = f"{count:.0f} | {wall:.3f} ({min(figures)[0]:.3f}) | {cpu:.3f} | {peak:.0f} | {plain:.2f}"
        rows.append(f"| {key} | {version} | {cells} | {before} |")
    bounds = []
    for name, plain_key in plains.items():
        against = cpu_ratio(taken[name, "now"], taken[plain_key, "now"])
        bounds.append(Bound(f"CPU of {name} / {plain_key}", against, under=FORMATS[name].under))
    for key in dict.fromkeys(key for key, _ in taken) if options.before else ():
        against = cpu_ratio(taken[key, "now"], taken[key, "before"])
        bounds.append(Bound(f"CPU of {key}, now / before", against, under=1.15))
    lines = [
        f"# Formats: files of {options.rows} rows x 6 joints to arrays, {options.rounds} rounds in turn",
        "",
        *machine("pyarrow", "pandas", "h5py", "mcap", "rosbags", "python-calamine"),
        "Each file is read in a process of its own, without the time of imports; CPU with that of children.",
        "Ratios are medians of pairs. Formats whose writers are slow have fewer rows, as has a plain file.",
        "",
        "| format | version | rows | wall s (least) | CPU s | peak MB | CPU / plain comma | CPU / before |",
        "|---|---|---|---|---|---|---|---|",
        *rows,
    ]
    write_results("formats", lines, bounds)


main()
