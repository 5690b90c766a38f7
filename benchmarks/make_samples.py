"""Make the sample data: a path in space, and the joint logs of four environments whose urm6 followed it.

Every environment solves its own inverse kinematics along the path and writes the joint angles that it found,
in its own format. How far its tip is from the path follows from its solver, its timing or its structure; no
file and no result has a deviation added to it.

    python benchmarks/make_samples.py [-o DIR]    write the files (by default those that are shipped)
    python benchmarks/make_samples.py --check     make them again and hold the shipped ones against them
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

import numpy as np
from samples.environments import ENVIRONMENTS, follow, urm6
from samples.path import PERIOD, SAMPLES, TIMES, SamplePath, arc_length

from urmpipe_models.elementwise import FloatArray
from urmpipe_models.kinematics.forward import positions_over_log

SHIPPED = Path(__file__).resolve().parents[1] / "datasets" / "urmpipe_datasets" / "logs"
SOLIDWORKS = tuple(f"solidworks/phi{k}.csv" for k in range(1, 7))
FILES = ("path.csv", "coppeliasim.csv", "matlab.csv", *SOLIDWORKS, "counter_rotating.csv")
HEADERS = {"coppeliasim.csv": 2}
"""Lines before the data, where there are more than one."""
TOLERANCES = {
    "path.csv": 2e-9,  # m: two units of the ninth decimal
    "coppeliasim.csv": 1.001e-3,  # rad: one unit of the fourth digit
    "matlab.csv": 1e-8,  # rad: noise of 2e-16 m in the solver was seen to change 5e-11
    "counter_rotating.csv": 1e-8,
} | dict.fromkeys(SOLIDWORKS, 2e-6)  # rad: one unit of the fourth decimal of a degree
"""What the mathematics of another machine may change."""


def wrapped(q: FloatArray) -> FloatArray:
    """Return angles in [rad] as an environment with joints limited to -pi..pi has them."""
    return q - 2.0 * np.pi * np.round(q / (2.0 * np.pi))


def path_lines(position: FloatArray) -> list[str]:
    """Return the path: time in s, coordinates in m to the nanometre."""
    rows = zip(TIMES, np.round(position, 9) + 0.0, strict=True)
    return ["t,x,y,z", *(f"{t:.3f},{x:.9f},{y:.9f},{z:.9f}" for t, (x, y, z) in rows)]


def coppeliasim_lines(q: FloatArray) -> list[str]:
    """Return a graph export: graph path, header, four significant digits, one blank line at the end."""
    header = ",".join(["Time (s)", *(f"phi{k} (rad)" for k in range(1, 7))])
    rows = zip(TIMES, wrapped(q), strict=True)
    cells = ([f"{t:.3f}", *(f"{value:+.3e}" if value else "0.0" for value in row)] for t, row in rows)
    return ["/urm6/jointGraph", header, *map(",".join, cells), ""]


def matlab_lines(q: FloatArray) -> list[str]:
    """Return what writetable makes of a table t, q1..q6: 15 significant digits."""
    rows = np.column_stack([TIMES, wrapped(q)])
    return ["t,q1,q2,q3,q4,q5,q6", *(",".join(f"{value:.15g}" for value in row) for row in rows)]


def solidworks_lines(angle: FloatArray, plot: int) -> list[str]:
    """Return one motion plot: time and one angle in deg, semicolons, decimal commas."""
    degrees = np.round(np.rad2deg(wrapped(angle)), 4) + 0.0
    rows = [f"{t:.3f};{value:.4f}" for t, value in zip(TIMES, degrees, strict=True)]
    return [f"Time (sec);Angular Displacement{plot} (deg)", *(row.replace(".", ",") for row in rows)]


def write_samples(folder: Path) -> None:
    """Make all files and write them into the folder."""
    path = SamplePath()
    files = {"path.csv": path_lines(path.at(TIMES))}
    for name, environment in ENVIRONMENTS.items():
        print(f"{name}: solving {SAMPLES} poses", file=sys.stderr)
        q = follow(environment, path)
        if name == "coppeliasim":
            files["coppeliasim.csv"] = coppeliasim_lines(q)
        elif name == "solidworks":
            files |= {file: solidworks_lines(q[:, k], k + 1) for k, file in enumerate(SOLIDWORKS)}
        else:
            files[f"{name}.csv"] = matlab_lines(q)
    for file, lines in files.items():
        (folder / file).parent.mkdir(parents=True, exist_ok=True)
        (folder / file).write_text("\n".join(lines) + "\n", encoding="utf-8", newline="\n")


def read(folder: Path, file: str) -> tuple[list[str], FloatArray]:
    """Return a file's header lines, and its values without the time in [m] or [rad], shape (n, columns)."""
    lines = (folder / file).read_text(encoding="utf-8").splitlines()
    skip = HEADERS.get(file, 1)
    if file.startswith("solidworks"):
        values = np.loadtxt([line.replace(",", ".") for line in lines[skip:]], delimiter=";")
        return lines[:skip], np.deg2rad(values[:, 1:])
    return lines[:skip], np.loadtxt(lines[skip:], delimiter=",")[:, 1:]


def read_joints(folder: Path, name: str) -> FloatArray:
    """Return a log's joint angles in [rad], shape (n, 6), as its file or files have them."""
    files = [file for file in FILES if file.startswith(name)]
    return np.hstack([read(folder, file)[1] for file in files])


def summary(folder: Path) -> str:
    """Return what the files hold, measured on the files."""
    position = read(folder, "path.csv")[1]
    speed = np.linalg.norm(np.diff(position, axis=0), axis=1) / PERIOD
    lines = [f"path: {arc_length(position)[-1]:.3f} m, at most {speed.max():.4f} m/s"]
    for name in ENVIRONMENTS:
        q = read_joints(folder, name)
        steps = np.round(np.diff(q, axis=0) / (2.0 * np.pi))
        net = (q[-1] - q[0]) / (2.0 * np.pi) - steps.sum(axis=0)
        delta = 1e3 * (position - positions_over_log(urm6(), q))
        norm = np.linalg.norm(delta, axis=1)
        up, down = (steps < 0).sum(axis=0), (steps > 0).sum(axis=0)
        lines += [
            f"{name}: wraps at +pi {up}, at -pi {down}, net turns {net.round(2)}",
            f"    delta at most {np.abs(delta).max(axis=0).round(3)} mm on x, y, z;"
            f" norm {norm.min():.4f}..{norm.max():.4f} mm",
        ]
    return "\n".join(lines)


def differences(folder: Path, other: Path) -> list[str]:
    """Return the files that differ by more than rounding."""
    found = []
    for file in FILES:
        (head, a), (other_head, b) = read(folder, file), read(other, file)
        if head != other_head or a.shape != b.shape:
            found.append(f"{file}: another header or shape")
            continue
        apart = np.abs(a - b if file == "path.csv" else wrapped(a - b)).max()
        if apart > (allowed := TOLERANCES[file]):
            found.append(f"{file}: {apart:.3g} apart; allowed: {allowed:.3g}")
    return found


def main() -> int:
    """Write the samples, or check the shipped ones."""
    parser = argparse.ArgumentParser(description="Make the sample path and the joint logs that follow it.")
    parser.add_argument("-o", "--output", type=Path, default=SHIPPED, help="folder to write into")
    parser.add_argument("--check", action="store_true", help="hold the shipped files against new ones")
    options = parser.parse_args()
    if not options.check:
        write_samples(options.output)
        print(summary(options.output))
        return 0
    with tempfile.TemporaryDirectory() as folder:
        write_samples(Path(folder))
        found = differences(SHIPPED, Path(folder))
    print("\n".join(found) or "the shipped files are the same within rounding")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
