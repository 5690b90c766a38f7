"""What stands in space of a simulation: its first arm, and the path of the tip of each."""

from __future__ import annotations

from urmpipe_pipeline.palette import run_colour
from urmpipe_pipeline.presentation.scene import Arm, Scene
from urmpipe_pipeline.simulations.figures import kept_rows, tip_paths
from urmpipe_pipeline.simulations.simulation import Simulation


def simulation_scene(simulation: Simulation) -> Scene | None:
    """Return the first arm of a simulation and the tips of all; None without an arm or a sample."""
    if not simulation.arms or not len(simulation.t_ns):
        return None
    first = simulation.arms[0]
    arm = Arm(first.chain, first.q, simulation.t_ns, run_colour(0), kept=kept_rows(simulation))
    whose = f"Arm of {first.block}" if len(simulation.arms) > 1 else "Arm"
    return Scene(f"{whose} and paths [m]", (arm,), tip_paths(simulation))
