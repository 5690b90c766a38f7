"""Criteria after ISO 9283 of 30 cycles of 7383 samples: as files, and as one file, beside `compare` alone.

python benchmarks/iso9283.py [--rounds N]

No open package has criteria of paths to stand beside; `compare` of the same files log by log shows what
reading, kinematics and deviations take of it.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

import numpy as np
from pairs import Bound, machine, median, rounds, table, write_results

from urmpipe_models.elementwise import FloatArray

URMPIPE = [sys.executable, "-m", "urmpipe"]

CYCLES, ROWS = 30, 7383

REST = 100
"""Rows at rest at either end of a cycle: 0.5 s."""

NOISE = 2e-5
"""Standard deviation of the joint values in [rad]."""

HEADER = "t," + ",".join(f"phi{k}" for k in range(1, 7))


def cycle() -> FloatArray:
    """Return joint values of urm6 from rest to rest in [rad], shape (7383, 6), that end where they begin."""
    moving = np.linspace(0.0, 1.0, ROWS - 2 * REST)
    share = np.concatenate([np.zeros(REST), moving, np.ones(REST)])[:, np.newaxis]
    joint = np.arange(6)
    swing = np.sin(2.0 * np.pi * share * (joint % 3 + 1) + joint) - np.sin(joint)
    return np.asarray(0.5 * swing * (0.5 - 0.5 * np.cos(2.0 * np.pi * share)))


def write(path: Path, q: FloatArray) -> Path:
    """Write joint values as a log, a row each 5 ms."""
    rows = np.column_stack([0.005 * np.arange(len(q)), q])
    np.savetxt(path, rows, ["%.3f", *["%.9f"] * 6], ",", header=HEADER, comments="")
    return path


def command(name: str, reference: Path, logs: list[Path], output: Path, tolerance: str) -> list[str]:
    """Return the command that compares logs, or evaluates them as cycles."""
    options = ["--robot", "urm6", "--unit", "rad", "--tolerance", tolerance, "-q", "-o", str(output)]
    return [*URMPIPE, name, str(reference), *map(str, logs), *options]


def main(count: int) -> None:
    """Write the logs, run the commands in turn, and write the results."""
    rng = np.random.default_rng(1)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        wanted = cycle()
        reference = write(folder / "reference.csv", wanted)
        done = [wanted + NOISE * rng.standard_normal(wanted.shape) for _ in range(CYCLES)]
        files = [write(folder / f"cycle{k}.csv", q) for k, q in enumerate(done, 1)]
        whole = write(folder / "all.csv", np.vstack(done))
        outputs = {name: folder / f"{name}.rrd" for name in ("files", "one", "plain")}
        commands = {
            f"iso, {CYCLES} files": command("iso", reference, files, outputs["files"], "AT=1mm,RT=1mm"),
            f"iso, one file of {CYCLES * ROWS} rows": command(
                "iso", reference, [whole], outputs["one"], "AT=1mm,RT=1mm"
            ),
            f"compare, {CYCLES} files": command("compare", reference, files, outputs["plain"], "3.5mm"),
        }
        taken = rounds(commands, count)
        sizes = [f"{key} {path.stat().st_size / 1e6:.0f} MB" for key, path in outputs.items()]
    several, one, plain = commands
    bounds = [
        Bound("30 files, wall s", median(taken[several], "wall"), under=5.0),
        Bound("one file, wall s", median(taken[one], "wall"), under=10.0),
    ]
    lines = [
        f"# Criteria after ISO 9283 of {CYCLES} cycles of {ROWS} samples: {count} rounds in turn",
        "",
        *machine("rerun-sdk", "scipy"),
        "Joint logs of urm6, each with noise of 20 urad, against the motion without it, with a recording.",
        "",
        *table(taken, plain),
        "",
        f"Recordings: {', '.join(sizes)}.",
    ]
    write_results("iso9283", lines, bounds)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=5)
    main(parser.parse_args().rounds)
