"""FMUs: a step native and in Python, a co-simulated log, the build and its size.

python benchmarks/fmus.py [--rounds N] [--only step|system|build|cross ...]
"""

from __future__ import annotations

import argparse
import os
import statistics
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path

import numpy as np
from bare_fmu import FloatArray, opened, run_bare
from pairs import Bound, in_turn, machine, measure, median, rounds, timed, write_results
from pairs import table as process_table

from urmpipe.systems.blocks import Blocks
from urmpipe_datasets import LOGS
from urmpipe_fmus.block import BlockModel
from urmpipe_fmus.blocks import make_block
from urmpipe_fmus.build.fmu import build_fmu
from urmpipe_fmus.cosim import Plan, load_system, prepare
from urmpipe_fmus.cosim.job import NO_CALL, Progress
from urmpipe_fmus.cosim.master import Master
from urmpipe_fmus.cosim.plan import JobBuilder
from urmpipe_fmus.cosim.worker import FmuLog
from urmpipe_fmus.process import callbacks_with
from urmpipe_models.kinematics.forward import positions_over_log
from urmpipe_models.robots.catalogue import load_robot

STEP = 0.005
"""Communication step in [s]: the period of the sample log."""

LOG = LOGS / "matlab.csv"
SYSTEM = "log-to-delta"

Part = tuple[list[str], list[Bound]]


def sample_joints() -> FloatArray:
    """Return the joints of the sample log in [rad], shape (7383, 6)."""
    return np.ascontiguousarray(np.loadtxt(LOG, delimiter=",", skiprows=1, usecols=range(1, 7)))


def chain_unit() -> BlockModel:
    """Return the chain of the paper's arm, as it is shipped."""
    return make_block("kinematic_chain", robot=load_robot("urm6"))


def ratio(taken: Sequence[float], base: Sequence[float]) -> float:
    """Return the median of the ratios, round by round."""
    return statistics.median(a / b for a, b in zip(taken, base, strict=True))


def rows_of(taken: Mapping[str, Sequence[float]], base: str, scale: float, unit: str) -> list[str]:
    """Return a Markdown table: medians in a unit, and the ratio round by round against `base`."""
    lines = [f"| | {unit}, median (min-max) | times {base}, median of rounds |", "|---|---|---|"]
    for name, found in taken.items():
        span = f"{scale * statistics.median(found):.2f} ({scale * min(found):.2f}-{scale * max(found):.2f})"
        lines.append(f"| {name} | {span} | {ratio(found, taken[base]):.2f} |")
    return lines


def tool_over(fmu: Path, q: FloatArray) -> Callable[[], FloatArray]:
    """Return a job that steps a chain's FMU over joints: six values set, three got, a step."""
    it, references = opened(fmu)
    phi, p7, found = np.zeros(6), np.zeros(3), np.empty((len(q), 3))
    set_phi = it.exchange("fmi2SetReal", [references[f"phi[{i}]"] for i in range(1, 7)], phi)
    get_p7 = it.exchange("fmi2GetReal", [references[f"p7[{i}]"] for i in range(1, 4)], p7)

    def job() -> FloatArray:
        """Set, get and step; return the tool's places in [m], shape (n, 3)."""
        for k, row in enumerate(q):
            phi[:] = row
            set_phi()
            get_p7()
            found[k] = p7
            it.do_step(k * STEP, STEP, 1)
        return found

    return job


def by_simulate_fmu(fmu: Path, q: FloatArray) -> Callable[[], object]:
    """Return a job that lets FMPy's own loop run a chain's FMU over joints."""
    from fmpy import extract, simulate_fmu

    folder = extract(str(fmu))
    names = [f"phi[{i}]" for i in range(1, 7)]
    given = np.zeros(len(q), dtype=[("time", float), *((name, float) for name in names)])
    given["time"] = STEP * np.arange(len(q))
    for name, values in zip(names, q.T, strict=True):
        given[name] = values
    return lambda: simulate_fmu(
        folder, stop_time=given["time"][-1], output_interval=STEP, input=given,
        output=[f"p7[{i}]" for i in range(1, 4)], fmi_type="CoSimulation",
    )  # fmt: skip


def step_part(count: int, folder: Path) -> Part:
    """Measure a step of the native and of the Python FMU."""
    q = sample_joints()
    native, python = (
        build_fmu(chain_unit(), folder / f"{backend}.fmu", backend=backend).path
        for backend in ("native", "python")
    )
    jobs: dict[str, Callable[[], object]] = {
        "native FMU": tool_over(native, q),
        "Python FMU": tool_over(python, q),
        "native FMU in FMPy's simulate_fmu": by_simulate_fmu(native, q),
    }
    p7 = positions_over_log(load_robot("urm6"), q)
    errors = [float(np.abs(np.asarray(jobs[name]()) - p7).max()) for name in ("native FMU", "Python FMU")]
    taken = in_turn(jobs, count)
    lines = [
        f"## A step of urm6's chain: 6 values set, 3 got, a step; {len(q)} samples",
        "",
        f"Largest difference from NumPy over the log: native {errors[0]:.1e} m, Python {errors[1]:.1e} m.",
        "simulate_fmu interpolates and checks its inputs, and collects the results.",
        "",
        *rows_of(taken, "native FMU", 1e6 / len(q), "us a step"),
        "",
    ]
    found = ratio(taken["Python FMU"], taken["native FMU"])
    return lines, [Bound("step of the Python FMU / of the native FMU", found, least=4.0)]


def system_part(count: int, folder: Path) -> Part:
    """Measure `urmpipe simulate log-to-delta`, with FMUs to build and from the cache, and the loop in it."""
    output = folder / "run.rrd"
    command = [sys.executable, "-m", "urmpipe", "simulate", SYSTEM, "-q", "-o", str(output)]
    os.environ["URMPIPE_CACHE"] = str(folder / "cache")  # of this process and what it starts: empty at first
    cold = measure(command)
    taken = rounds({"FMUs from the cache": command}, count, outputs=[output])
    plan = planned()
    length = plan.count * plan.step
    loops = in_turn(loops_of(plan, folder), count)
    wall = median(taken["FMUs from the cache"], "wall")
    lines = [
        f"## `urmpipe simulate {SYSTEM}`: {plan.count + 1} samples, {length:.1f} s of motion",
        "",
        f"The first run, which builds the FMUs: {cold.wall:.2f} s.",
        "",
        *process_table(taken, "FMUs from the cache"),
        "",
        "Its loop, from the first instance to the last free, and the same C calls without any care:",
        "",
        *rows_of(loops, "bare ctypes loop", 1e3, "ms"),
        "",
    ]
    return lines, [
        Bound(f"real time / `urmpipe simulate {SYSTEM}`, whole process", length / wall, least=15.0),
        Bound(
            "its loop / the bare ctypes loop", ratio(loops["urmpipe"], loops["bare ctypes loop"]), under=2.0
        ),
    ]


def planned() -> Plan:
    """Return the shipped system, ready to run."""
    system = load_system(SYSTEM)
    blocks = Blocks(system, bundled=[one for one in system.arguments.values() if isinstance(one, str)])
    return prepare(system, blocks.make, column=blocks.column, duration=blocks.end, period=blocks.period)


def loops_of(plan: Plan, folder: Path) -> dict[str, Callable[[], object]]:
    """Return a job that runs a plan in urmpipe's loop, and one that makes the same calls bare."""
    from fmpy import extract

    folders = {
        name: Path(extract(str(one.path), unzipdir=str(folder / f"fmu_{name}")))
        for name, one in plan.interfaces.items()
    }
    job = JobBuilder(plan).job(folders)
    progress = Progress(rows=0, k=0, call=NO_CALL)
    callbacks = callbacks_with(FmuLog(folder / "log.txt", job, progress).write)
    ours, theirs = np.zeros((job.rows, job.columns)), np.zeros((job.rows, job.columns))
    odd = np.zeros((3, job.recorded["Real"]))
    warned = np.zeros((2, job.calls))
    Master(job, progress, ours, odd, warned, callbacks).run()
    run_bare(job, theirs)
    if not np.array_equal(ours, theirs):
        raise RuntimeError("the two loops differ")
    return {
        "bare ctypes loop": lambda: run_bare(job, theirs),
        "urmpipe": lambda: Master(job, progress, ours, odd, warned, callbacks).run(),
    }


def build_part(count: int, folder: Path) -> Part:
    """Measure the build of a chain for this platform, whole process and build alone, and its size."""
    target = folder / "build" / "kinematic_chain.fmu"
    target.parent.mkdir()
    command = [sys.executable, "-m", "urmpipe", "fmu", "build", "kinematic_chain", "--robot", "urm6",
               "-o", str(target.parent)]  # fmt: skip
    taken = rounds({"urmpipe fmu build kinematic_chain": command}, count, outputs=[target])
    (found,) = taken.values()
    size = target.stat().st_size / 1e3
    lines = [
        "## A six-joint chain built for this platform",
        "",
        *process_table(taken, "urmpipe fmu build kinematic_chain"),
        "",
        f"The FMU has {size:.0f} KB, C sources and documentation included.",
        "",
    ]
    return lines, [
        Bound("build of urm6's chain, whole process, s", median(found, "wall"), under=5.0),
        Bound("size of its FMU, KB", size, under=200.0),
    ]


def cross_part(count: int, folder: Path) -> Part:
    """Measure the build by zig for two platforms, zig's own cache being warm, and its size."""

    def build(number: int) -> Path:
        """Build into a file of its own."""
        target = folder / f"cross{number}.fmu"
        return build_fmu(chain_unit(), target, platforms=["linux64", "win64"]).path

    first = timed(partial(build, -1))
    taken = {"linux64 and win64 by zig": [timed(partial(build, number)) for number in range(count)]}
    size = (folder / "cross0.fmu").stat().st_size / 1e3
    lines = [
        "## The same chain built by zig for Linux and Windows",
        "",
        f"The first build took {first:.1f} s: zig makes its C libraries once, and keeps them in its cache.",
        "",
        *rows_of(taken, "linux64 and win64 by zig", 1.0, "s"),
        "",
    ]
    return lines, [Bound("size of the FMU for two platforms, KB", size, under=200.0)]


PARTS: dict[str, Callable[[int, Path], Part]] = {
    "step": step_part,
    "system": system_part,
    "build": build_part,
    "cross": cross_part,
}


def main() -> None:
    """Measure and keep the results."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--only", nargs="+", choices=PARTS, default=list(PARTS))
    options = parser.parse_args()
    packages = machine("fmpy", "pythonfmu", "casadi", "ziglang")
    lines, bounds = [f"# FMUs: {options.rounds} rounds in turn", "", *packages], list[Bound]()
    for name in options.only:
        with tempfile.TemporaryDirectory() as folder:
            told, held = PARTS[name](options.rounds, Path(folder))
        lines += told
        bounds += held
    write_results("fmus", lines, bounds)


if __name__ == "__main__":
    main()
