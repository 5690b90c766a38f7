"""Dynamics: inverse dynamics of a million states beside Pinocchio, an arm with its drives beside real time.

python benchmarks/dynamics.py [--rounds N]

urm6 has masses that are made up (seed 0), as the tests have. Both are run in turn in one process.
"""

from __future__ import annotations

import argparse
import statistics
import sys
import tempfile
from functools import partial
from pathlib import Path

import numpy as np
import pinocchio
from bare_fmu import opened
from pairs import Bound, in_turn, machine, timed, write_results

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "shared"))

from made_masses import with_drives, with_masses
from urmpipe_fmus.blocks import make_block
from urmpipe_fmus.build.fmu import build_fmu
from urmpipe_models.arm.chain import Chain
from urmpipe_models.dynamics.equations import torque_terms_over_log, torques_over_log
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_models.robots.urdf_writer import urdf_text

STATES = 1_000_000
SIMULATED = 10.0
"""How long the arm with drives is simulated, in [s]."""

STEP = 0.005
"""Communication step in [s]."""


def arm() -> Chain:
    """Return urm6 with masses and drives."""
    return with_drives(with_masses(load_robot("urm6")))


def model_of(chain: Chain) -> pinocchio.Model:
    """Return Pinocchio's model of an arm, by a URDF whose joints are revolute: they have limits there."""
    text = urdf_text(chain).replace('type="continuous"', 'type="revolute"')
    return pinocchio.buildModelFromXML(text)


def states() -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return random q, q' and q'', each of shape (STATES, 6)."""
    q, qd, qdd = np.random.default_rng(0).uniform(-3.0, 3.0, (3, STATES, 6))
    return q, qd, qdd


def inverse_part(count: int) -> tuple[list[str], list[Bound]]:
    """Measure the inverse dynamics of many states."""
    chain, given = arm(), states()
    model = model_of(chain)
    pool = pinocchio.ModelPool(model, 1)
    columns = [np.asfortranarray(one.T) for one in given]
    tau = np.zeros((6, STATES), order="F")
    theirs = partial(pinocchio.rneaInParallel, 1, pool, *columns, tau)
    jobs = {
        "urmpipe, one thread": partial(torques_over_log, chain, *given, threads=1),
        "Pinocchio rneaInParallel, one thread": theirs,
        "urmpipe, `torques_over_log`": partial(torques_over_log, chain, *given),
        "urmpipe, `torque_terms_over_log`": partial(torque_terms_over_log, chain, *given),
    }
    taken = in_turn(jobs, count)
    difference = float(np.abs(torques_over_log(chain, *given) - tau.T).max())
    lines = ["| of 1 000 000 states of urm6 | s, median (min-max) | states a second |", "|---|---|---|"]
    for name, times in taken.items():
        middle = statistics.median(times)
        lines.append(f"| {name} | {middle:.3f} ({min(times):.3f}-{max(times):.3f}) | {STATES / middle:.3g} |")
    lines += ["", f"Largest difference of the two: {difference:.1e} N.m."]
    own, other = (taken[name] for name in list(jobs)[:2])
    ahead = statistics.median(b / a for a, b in zip(own, other, strict=True))
    held = "Pinocchio's time over urmpipe's, one thread each, median of rounds"
    return lines, [Bound(held, ahead, least=1.0)]


def driven_part(count: int) -> tuple[list[str], list[Bound]]:
    """Measure an arm with its drives as one native FMU."""
    with tempfile.TemporaryDirectory() as folder:
        unit = make_block("driven_arm", robot=arm())
        build = timed(lambda: build_fmu(unit, Path(folder) / "arm.fmu", backend="native"))
        it, _ = opened(Path(folder) / "arm.fmu")
        begin = [0]

        def run() -> None:
            """Go on for the simulated time."""
            for k in range(round(SIMULATED / STEP)):
                it.do_step((begin[0] + k) * STEP, STEP, 1)
            begin[0] += round(SIMULATED / STEP)

        times = in_turn({"run": run}, count)["run"]
    middle = statistics.median(times)
    lines = [
        "| `driven_arm` of urm6, native, steps of 5 ms, RK4 in 0.5 ms | s, median (min-max) |",
        "|---|---|",
        f"| {SIMULATED:g} s simulated | {middle:.4f} ({min(times):.4f}-{max(times):.4f}) |",
        f"| its FMU traced and compiled | {build:.1f} |",
    ]
    return lines, [Bound("driven_arm: times as fast as real time", SIMULATED / middle, least=10.0)]


def main() -> None:
    """Measure and keep the results."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=7)
    options = parser.parse_args()
    inverse, whole = inverse_part(options.rounds), driven_part(options.rounds)
    lines = [
        f"# Dynamics: {options.rounds} rounds in turn",
        "",
        *machine("pin", "casadi"),
        *inverse[0],
        "",
        *whole[0],
    ]
    write_results("dynamics", lines, [*inverse[1], *whole[1]])


main()
