"""What tests of several folders share: what is said of a wrong file, and a co-simulated system."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from asserting import refusal
from urmpipe_models.arm.denavit_hartenberg import urm_chain
from urmpipe_models.errors import UrmpipeError
from urmpipe_models.kinematics.forward import positions_over_log
from urmpipe_pipeline.comparison.verdict import judge_delta_meter
from urmpipe_pipeline.joint_log import LogWarning, SourceFile
from urmpipe_pipeline.provenance import Provenance
from urmpipe_pipeline.simulations.simulation import Setting, Signal, SimulatedArm, SimulatedBlock, Simulation

LENGTHS = (0.243215, *(0.212430,) * 5, 0.042215)  # Table 1 of the paper, in m
STEP = 0.005
SVG = (
    '<svg xmlns="http://www.w3.org/2000/svg" width="640" height="80" viewBox="0 0 640 80">'
    '<rect x="5" y="5" width="200" height="70" fill="none" stroke="black"/>'
    '<text x="20" y="40">log</text></svg>'
)
SYSTEM = '[system]\nname = "log-to-delta"\n\n[connections]\n"chain.phi" = "log.q"\n'

MakeSimulation = Callable[..., Simulation]


@pytest.fixture
def wrong(read: Callable[..., object], tmp_path: Path) -> Callable[..., list[str]]:
    """Read a file that must be refused, and return what is said, one line a finding."""

    def wrong(*args: object, **options: object) -> list[str]:
        return refusal(UrmpipeError, read, *args, **options).replace(f"{tmp_path}/", "").split("\n")

    return wrong


def build_simulation(
    samples: int = 600, failed: str | None = None, tolerance: float = 0.0035, name: str = "log-to-delta"
) -> Simulation:
    """Return a simulation of three blocks; y of the meter's delta goes up to 4 mm at t = 1.25 s."""
    t_ns = np.arange(samples, dtype=np.int64) * 5_000_000
    t = t_ns / 1e9
    chain = urm_chain("urm6", LENGTHS, [math.radians(52.0)] * 6)
    q = 0.4 * np.sin(np.outer(t, [0.31, 0.23, 0.41, 0.17, 0.53, 0.37]) + np.arange(6))
    delta = np.column_stack((1e-3 * np.cos(t), 4e-3 * np.sin(0.4 * math.pi * t), np.zeros(samples)))
    norm = np.linalg.norm(delta, axis=1)
    verdict = judge_delta_meter("meter", t_ns, delta, {"axis": tolerance})
    return Simulation(
        name=name,
        description="A log through an arm",
        t_ns=t_ns,
        step=STEP,
        signals=(
            Signal("log", "q", q, "rad", "deg", description="Joints"),
            Signal("chain", "p7", positions_over_log(chain, q), "m"),
            Signal("meter", "delta", delta, "m", "mm"),
            Signal("meter", "norm", norm, "m", "mm"),
            Signal("meter", "out_of_tolerance", norm > tolerance, type="Boolean"),
        ),
        system_svg=SVG,
        system_text=SYSTEM,
        blocks=(
            SimulatedBlock("log", "file", "my_log.py", "a" * 32),
            SimulatedBlock(
                "chain", "unit", "kinematic_chain", "b" * 32, (Setting("r[1]", 0.243215, "m"),), "An arm"
            ),
            SimulatedBlock(
                "meter", "fmu", "meter.fmu", "{c}", (Setting("tolerance", tolerance, "m", from_system=True),)
            ),
        ),
        failed=failed,
        warnings=(LogWarning("gap", "the log has a gap", 7),),
        provenance=Provenance(
            "simulate", {"system": name}, (SourceFile("log.csv", "0" * 64, 123),), {"urmpipe": "0.1.0"},
            "2021-03-04T05:06:07+00:00",
        ),
        connections={"chain.phi": "log.q", "meter.actual": "chain.p7"},
        arms=(SimulatedArm("chain", chain, q),),
        verdicts=(verdict,) if verdict else (),
    )  # fmt: skip


@pytest.fixture(scope="session")
def make_simulation() -> MakeSimulation:
    return build_simulation
