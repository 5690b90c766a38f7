"""Accuracy of irb60 on the paper's contour: beside Fig. 7, counterweight against spring, times.

python benchmarks/accuracy.py [--rounds 3] [--numpy]          --numpy: in NumPy, too
"""

from __future__ import annotations

import argparse
import os
import statistics
import tempfile
from collections.abc import Iterator

import numpy as np
from pairs import Bound, in_turn, machine, timed, write_results

from urmpipe.api.accuracy import accuracy
from urmpipe.systems.units import Backend
from urmpipe_models.drives import DrivenJoint
from urmpipe_pipeline.accuracy.published import FIG7, fig7_rows
from urmpipe_pipeline.accuracy.result import AccuracyResult

LIMIT = 0.4e-3
"""What the paper's manufacturer states, in [m]."""

ROBOTS = ("irb60", "irb60-spring")


def sweep(robot: str, backend: Backend, limit: float | None = LIMIT) -> AccuracyResult:
    """Return the accuracy at the ten velocities of Fig. 7."""
    return accuracy(fig7_rows(), robot, limit=limit, backend=backend)


def paper_part(found: AccuracyResult) -> tuple[list[str], list[Bound]]:
    """Return Fig. 7 beside what is simulated."""
    by_velocity = {one.velocity: one for one in found.errors}
    lines = [
        "| velocity, m/s | paper, mm | simulated, mm | ratio | to the path, mm | at a voltage limit |",
        "|---|---|---|---|---|---|",
    ]
    bounds = []
    for point in FIG7:
        one = by_velocity[point.velocity]
        assert one.error is not None and one.path_error is not None
        ratio = one.error / point.error
        more = "> " if point.least else ""
        lines.append(
            f"| {point.velocity:g} | {more}{1e3 * point.error:g} | {1e3 * one.error:.3g} | {ratio:.2f}"
            f" | {1e3 * one.path_error:.3g} | {one.saturated_share:.1%} |"
        )
        low = 1.0 if point.least else 1.0 / 1.5
        bounds.append(Bound(f"simulated over paper at {point.velocity:g} m/s", ratio, least=low, most=1.5))
    speed = found.running_speed
    assert speed is not None
    bounds.append(Bound("running speed within 0.4 mm, m/s", speed, least=0.07, most=0.13))
    bounds.append(Bound("spectral radius of the sampled loop", found.loop_radius, under=1.0))
    return lines, bounds


def variants_part(found: dict[str, AccuracyResult]) -> Iterator[str]:
    """Yield the counterweight beside the spring."""
    yield "| velocity, m/s | " + " | ".join(f"{name}, mm" for name in found) + " |"
    yield "|---" * (1 + len(found)) + "|"
    for rows in zip(*(one.errors for one in found.values()), strict=True):
        errors = (f"{1e3 * one.error:.3g}" if one.error is not None else "diverged" for one in rows)
        yield f"| {rows[0].velocity:g} | " + " | ".join(errors) + " |"
    yield (
        "| running speed within 0.4 mm, m/s | "
        + " | ".join(
            "none" if one.running_speed is None else f"{one.running_speed:.3g}" for one in found.values()
        )
        + " |"
    )


def time_part(rounds: int, numpy: bool) -> tuple[list[str], list[Bound]]:
    """Return how long sweeps take, the FMU built each time."""

    def compiled() -> None:
        """Run a sweep that finds no FMU in its cache."""
        with tempfile.TemporaryDirectory() as folder:
            os.environ["URMPIPE_CACHE"] = folder
            sweep("irb60", "native", None)
            del os.environ["URMPIPE_CACHE"]

    taken = in_turn({"compiled": compiled}, rounds)["compiled"]
    middle = statistics.median(taken)
    lines = [
        "| ten velocities of irb60, 0.1 to 1.0 m/s | s, median (min-max) |",
        "|---|---|",
        f"| compiled, its FMU built each time | {middle:.1f} ({min(taken):.1f}-{max(taken):.1f}) |",
    ]
    bounds = [Bound("compiled sweep, s", middle, under=60.0)]
    if numpy:
        results: list[AccuracyResult] = []
        alone = timed(lambda: results.append(sweep("irb60", "python", None)))
        theirs, ours = sweep("irb60", "native", None).errors, results[0].errors
        apart = max(
            abs((a.error or np.nan) / (b.error or np.nan) - 1.0) for a, b in zip(ours, theirs, strict=True)
        )
        lines += [f"| in NumPy, once | {alone:.0f} |", "", f"Errors of both differ by {apart:.1e} at most."]
        bounds += [Bound("sweep in NumPy, s", alone, under=900.0)]
        bounds += [Bound("compiled and NumPy, relative difference / 1e-6", apart / 1e-6, most=1.0)]
    return lines, bounds


def main() -> None:
    """Measure and keep the results."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--numpy", action="store_true")
    options = parser.parse_args()
    found = {name: sweep(name, "native") for name in ROBOTS}
    paper, held = paper_part(found["irb60"])
    times, quick = time_part(options.rounds, options.numpy)
    driven = [one for one in found["irb60"].robot.drives if isinstance(one, DrivenJoint)]
    lines = [
        "# Accuracy of irb60 on the contour of the paper's section 5",
        "",
        *machine("casadi"),
        "",
        f"Fig. 7 beside the simulation, a = 6 m/s2, controllers sampled each {1e3 * driven[0].period:g} ms:",
        "",
        *paper,
        "",
        "Counterweight (irb60) and spring (irb60-spring):",
        "",
        *variants_part(found),
        "",
        *times,
    ]
    write_results("accuracy", lines, [*held, *quick])


if __name__ == "__main__":
    main()
