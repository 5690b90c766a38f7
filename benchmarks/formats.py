"""Ingest of one motion in the formats of other tools against the plain comma file of the same numbers.

python benchmarks/formats.py [--rows N] [--rounds N] [--only NAME ...]
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray
from pairs import Bound, Usage, machine, ratio, rounds, table, write_results
from pyarrow import csv
from pyarrow import parquet as pq
from scipy.io import savemat

from urmpipe_models.elementwise import FloatArray

PERIOD_MS = 5
NAMES = ["t", *(f"q{j}" for j in range(1, 7))]
BLOCK = 20_000
"""Rows turned into text at a time."""


@dataclass(frozen=True, slots=True)
class Format:
    """A way to write a log.

    Attributes:
        write: Writes times in [ms] and joint values in [rad] to a file.
        under: How many times longer than the plain comma file it may take.
        options: What the file cannot tell.
        suffix: The file's suffix.
    """

    write: Callable[[Path, NDArray[np.int64], FloatArray], None]
    under: float = 1.5
    options: tuple[str, ...] = ()
    suffix: str = ".csv"


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


PLAIN = Format(separated(","))
FORMATS = {
    "semicolon, decimal comma": Format(separated(";", ",")),
    "tab": Format(separated("\t")),
    "runs of spaces (MATLAB save -ascii)": Format(matlab_ascii, options=("--unit", "rad")),
    "CoppeliaSim graph": Format(coppeliasim),
    "UR RTDE, spaces, 12 columns": Format(ur_rtde),
    "UTF-16": Format(separated(",", encoding="utf-16")),
    "ISO dates as clock": Format(iso_dates),
}
TEXTS = {
    "FRI text": Format(fri_text, under=4.0, options=("--unit", "rad"), suffix=".txt"),
    "array cells over two lines": Format(array_cells, under=4.0, options=("--unit", "rad")),
}
TYPED = {
    "Parquet": Format(parquet, under=1.0, suffix=".parquet"),
    "MAT": Format(mat, options=("--unit", "rad"), suffix=".mat"),
}


def ingest(log: Path, output: Path, options: Sequence[str]) -> list[str]:
    """Return the command."""
    urmpipe = [sys.executable, "-m", "urmpipe", "ingest"]
    return [*urmpipe, str(log), "--robot", "urm6", "-q", "-o", str(output), *options]


def write_apart(one: Format, path: Path, rows: int) -> None:
    """Write a log in a process of its own: the memory of this one would count for those that it starts."""
    process = get_context("fork").Process(target=lambda: one.write(path, *motion(rows)))
    process.start()
    process.join()
    if process.exitcode:
        raise RuntimeError(f"{path} was not written")


def refusal(one: Format, folder: Path) -> str | None:
    """Return the first line of what urmpipe says where it refuses a format, seen on a short log."""
    log, output = folder / f"short{one.suffix}", folder / "short.rrd"
    write_apart(one, log, 100)
    done = subprocess.run(ingest(log, output, one.options), capture_output=True, text=True, check=False)
    log.unlink()
    output.unlink(missing_ok=True)
    return done.stderr.splitlines()[0].replace(f"{folder}/", "") if done.returncode else None


def measure(name: str, one: Format, rows: int, count: int, folder: Path) -> dict[str, list[Usage]]:
    """Return what the plain file and the same numbers in a format take, in turn."""
    plain, log, output = folder / "plain.csv", folder / f"log{one.suffix}", folder / "log.rrd"
    write_apart(PLAIN, plain, rows)
    write_apart(one, log, rows)
    commands = {"plain comma": ingest(plain, output, ()), name: ingest(log, output, one.options)}
    try:
        return rounds(commands, count, outputs=(output,))
    finally:
        for path in (plain, log, output):
            path.unlink(missing_ok=True)


def main() -> None:
    """Measure and keep the results."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rows", type=int, default=1_000_000)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--only", nargs="*", default=[*FORMATS, *TEXTS, *TYPED])
    options = parser.parse_args()
    found: list[str] = []
    bounds: list[Bound] = []
    for name, one in (FORMATS | TEXTS | TYPED).items():
        if name not in options.only:
            continue
        with tempfile.TemporaryDirectory() as temporary:
            refused = refusal(one, Path(temporary))
            if refused:
                found += [f"Left out, since it is refused: {name} ({refused})", ""]
                continue
            taken = measure(name, one, options.rows, options.rounds, Path(temporary))
        found += [*table(taken, "plain comma"), ""]
        factor = ratio(taken[name], taken["plain comma"])
        bounds.append(Bound(f"{name} / plain comma", factor, under=one.under))
    title = f"# Formats: ingest of {options.rows} rows x 6 joints, {options.rounds} rounds in pairs"
    write_results("formats", [title, "", *machine("pyarrow", "rerun-sdk"), *found], bounds)


main()
