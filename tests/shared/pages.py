"""What pages show: their commands and their code, and commands run in this process."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from functools import cache
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.signal import bilinear, lfilter
from scipy.spatial.transform import Rotation

from urmpipe.main import run
from urmpipe_datasets import LOGS
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.kinematics.forward import forward
from urmpipe_models.robots.catalogue import load_robot

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"


def text_of(page: str) -> str:
    """Return the text of a page, named from the root of the checkout."""
    return (ROOT / page).read_text(encoding="utf-8")


def script(path: Path) -> Any:
    """Return a script of docs/ as a module."""
    spec = spec_from_file_location(path.stem, path)
    assert spec is not None and spec.loader is not None
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def pages() -> list[str]:
    """Return all pages that people read."""
    return ["README.md", *sorted(path.relative_to(ROOT).as_posix() for path in DOCS.rglob("*.md"))]


def command_lines(page: str) -> list[str]:
    """Return the commands that a page shows: lines of indented or fenced blocks, without their comments."""
    return [
        match[1].strip()
        for match in re.finditer(r"^ {4}(urmpipe [a-z].*?)(?: {2,}.*| # .*)?$", text_of(page), re.MULTILINE)
    ] + [line for block in snippets(page, "sh") for line in block.splitlines() if line.startswith("urmpipe ")]


def commands_in_text(page: str) -> list[str]:
    """Return the commands that a page names in its sentences and tables, each on one line."""
    return [" ".join(one.split()) for one in re.findall(r"`(urmpipe [a-z][^`]*)`", text_of(page))]


def files_told(page: str, line: str) -> set[str]:
    """Return the files that a page tells behind a command that it shows, as what it writes."""
    behind = re.findall(rf"^ {{4}}{re.escape(line)} +(.*)$", text_of(page), re.MULTILINE)
    return {name for one in behind for name in re.findall(r"\b[\w-]+\.(?:rrd|html|fmu|csv|svg)\b", one)}


def snippets(page: str, language: str) -> list[str]:
    """Return the fenced code of a language in a page."""
    found = re.findall(rf"^ *```{language}\n(.*?)^ *```$", text_of(page), re.DOTALL | re.MULTILINE)
    return ["\n".join(line.removeprefix("  ") for line in one.splitlines()) for one in found]


def indented(page: str, first: str) -> str:
    """Return the indented block of a page that begins with a line, without its indent."""
    lines = text_of(page).split(f"    {first}", 1)[1].splitlines()
    return "\n".join([first + lines[0], *_while_indented(lines[1:])])


def _while_indented(lines: list[str]) -> Iterator[str]:
    """Yield lines up to the first that stands at the margin, without their indent."""
    for line in lines:
        if line and not line.startswith("    "):
            return
        yield line[4:]


EVERY = 8
"""Of so many rows of a bundled log one is laid: of 7400, 900 go through a command as well, and sooner."""


def lay_files(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Make a folder the working one, with the files that pages name."""
    monkeypatch.chdir(folder)
    lay(folder, files_of_pages() | repeated_files())


def lay(folder: Path, files: dict[str, str]) -> None:
    """Write files into a folder."""
    for name, text in files.items():
        (folder / name).write_text(text, encoding="utf-8")


@cache
def files_of_pages() -> dict[str, str]:
    """Return the files that pages name, other than those of repeated motion, by their names."""
    named = {"coppelia": "coppeliasim", "path": "path", **dict.fromkeys(("log", "a", "b", "other"), "matlab")}
    networks = zip(("boom", "timing", "five-bar", "door"), snippets("docs/networks.md", "toml"), strict=True)
    systems = snippets("docs/simulate.md", "toml")
    return {
        **{f"{name}.csv": thinned(LOGS / f"{source}.csv") for name, source in named.items()},
        **dict.fromkeys(("robot_data.csv", "monday.csv", "tracker.csv"), rtde_log()),
        "targets.csv": "x,y,z,rz,ry,rx\n0.1,0.05,0.25,0.3,0.4,0.1\n0,0,0.3,0,0,0\n",
        "contour.csv": "x,y,z,corner_r\n0.4,0.1,0.3,\n0.5,0.1,0.3,0.02\n0.5,-0.1,0.3,\n",
        "poses.csv": "x,y,z,qx,qy,qz,qw\n0.4,0.1,0.3,1,0,0,0\n",
        "legs.csv": leg_log(),
        "other.toml": 'robot = "urm6"\n',
        "my_unit.py": text_of("docs/examples/low_pass.py"),
        "arm.urdf": "\n".join(snippets("docs/robots.md", "xml")),
        "my-arm.toml": snippets("docs/robots.md", "toml")[0],
        "planar.toml": snippets("docs/dynamics.md", "toml")[0],
        **{f"{name}.toml": text for name, text in networks},
        "my-system.toml": next(one for one in systems if one.startswith("[system]")),
    }


def leg_log() -> str:
    """Return a log of six legs that become longer than 0.8 m one after the other."""
    rows = [[0.005 * i, *(0.8 + 1e-4 * k * i for k in range(6))] for i in range(21)]
    head = ",".join(["t [s]", *(f"leg{k} [m]" for k in range(1, 7))])
    return "\n".join([head, *(",".join(f"{value:.4f}" for value in row) for row in rows), ""])


def thinned(log: Path) -> str:
    """Return the header of a log, and some of its rows."""
    lines = log.read_text(encoding="utf-8").splitlines(keepends=True)
    head = next(i for i, line in enumerate(lines) if line[0].isdigit())
    return "".join([*lines[:head], *lines[head::EVERY]])


SQUARE = np.array([[0.4, -0.1, 0.3], [0.6, -0.1, 0.3], [0.6, 0.1, 0.3], [0.4, 0.1, 0.3], [0.4, -0.1, 0.3]])
"""Corners of a path in [m]: it rests in the third and the last, and runs through the others."""

MARKS = np.array([[0.5, 0.0, 0.3], [0.6, 0.1, 0.4], [0.4, 0.1, 0.2], [0.4, -0.1, 0.2], [0.6, -0.1, 0.4]])
"""Five poses in [m]: the middle of a cube, and four of its corners."""

SPAN = 0.4
"""Length of the path from rest to rest in [m]."""


@cache
def repeated_files() -> dict[str, str]:
    """Return a path round a square, logs in which it is repeated, and poses that were measured 30 times."""
    visits = np.tile(MARKS, (30, 1)) + np.random.default_rng(4).normal([2e-4, -1e-4, 5e-5], 3e-5, (150, 3))
    runs = (("test", 10, 0), ("run1", 1, 1), ("run2", 1, 2), ("run3", 1, 3))
    return {
        "square.csv": table_of(around(1, 150)[1], timed=True),
        "square-rows.csv": snippets("docs/iso.md", "csv")[0],
        **{f"{name}.csv": table_of(repeated(cycles, seed), timed=True) for name, cycles, seed in runs},
        "marks.csv": table_of(MARKS),
        "visits.csv": table_of(visits),
    }


def around(cycles: int, steady: int) -> tuple[FloatArray, FloatArray]:
    """Return the way in [m], shape (n,), and the place in [m], shape (n, 3), every 10 ms.

    Args:
        cycles: How often it goes round.
        steady: Rows at constant speed from rest to rest: 150 make 0.25 m/s.
    """
    rise = np.linspace(0.05, 0.95, 10)
    speed = np.concatenate((np.zeros(30), rise, np.ones(steady), rise[::-1], np.zeros(30)))
    way = SPAN * np.cumsum(np.tile(speed / speed.sum(), 2 * cycles))
    at = np.linspace(0.0, 2.0 * SPAN, len(SQUARE))
    return way, np.column_stack([np.interp(way % (2.0 * SPAN), at, one) for one in SQUARE.T])


def repeated(cycles: int, seed: int) -> FloatArray:
    """Return where an arm was that went round the square, in [m], shape (n, 3), every 10 ms.

    It is 1 % slow and swings with 60 rad/s; it is off by 0.23 mm, by 0.03 mm of chance at each rest, and by
    5 um of noise.
    """
    chance = np.random.default_rng(seed)
    way, asked = around(cycles, 152)
    swung = lfilter(*bilinear([3600.0], [1.0, 84.0, 3600.0], 100.0), asked - asked[0], axis=0)
    rests = chance.normal([2e-4, -1e-4, 5e-5], 3e-5, (2 * cycles + 1, 3))
    off = [np.interp(way / SPAN, np.arange(len(rests)), one) for one in rests.T]
    return np.asarray(asked[0] + swung + np.column_stack(off) + chance.normal(0.0, 5e-6, asked.shape))


def table_of(place: FloatArray, *, timed: bool = False) -> str:
    """Return places in [m], shape (n, 3), as a log: rows every 10 ms, or still poses."""
    columns = np.column_stack((0.01 * np.arange(len(place)), place)) if timed else place
    rows = [",".join(f"{value:.6f}" for value in row) for row in columns.tolist()]
    return "\n".join(["t [s]," * timed + "x [m],y [m],z [m]", *rows]) + "\n"


def rtde_log() -> str:
    """Return what a UR5e that turns its joints records in half a second: joints and its own TCP."""
    arm = load_robot("ur5e")
    t = 0.008 * np.arange(60)
    q = np.array([0.3, -1.2, 1.1, -0.7, -1.5, 0.4]) + 0.3 * np.sin(2.0 * t)[:, None]
    tip = [forward(arm, row)[-1] for row in q]
    poses = [(*one.translation, *Rotation.from_matrix(one.rotation).as_rotvec()) for one in tip]
    kinds = ("target_q", "actual_q", "actual_TCP_pose")
    names = ["timestamp", *(f"{kind}_{i}" for kind in kinds for i in range(6))]
    rows = [" ".join(f"{value:.9g}" for value in row) for row in np.column_stack([t, q, q, poses]).tolist()]
    return "\n".join([" ".join(names), *rows]) + "\n"


def run_in_process(line: str) -> int:
    """Run a command of urmpipe quietly in this process, and return its exit code."""
    name, *arguments = shlex.split(line)
    assert name == "urmpipe", line
    return run([*arguments, "-q"])


def run_lines(lines: str, folder: Path) -> None:
    """Run the commands of a page in a folder: those of this Python, wherever they are installed."""
    programs = {"urmpipe": ["-m", "urmpipe"], "fmpy": ["-m", "fmpy"]}
    for line in lines.splitlines():
        name, *arguments = shlex.split(line)
        done = subprocess.run(
            [sys.executable, *programs[name], *arguments],
            cwd=folder,
            env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
            capture_output=True,
            text=True,
            check=False,
        )
        assert (done.returncode, done.stderr) == (0, ""), line
