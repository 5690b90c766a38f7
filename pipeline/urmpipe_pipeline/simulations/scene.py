"""What stands in space of a simulation: its arms, and the path of the tip of each."""

from __future__ import annotations

from urmpipe_pipeline.presentation.palette import run_colour
from urmpipe_pipeline.presentation.scene import Arm, Scene
from urmpipe_pipeline.simulations.figures import kept_rows, tip_paths
from urmpipe_pipeline.simulations.simulation import Simulation


def simulation_scene(simulation: Simulation) -> Scene | None:
    """Return the arms of a simulation, the first as solids, and their tips; None without arm or sample."""
    if not simulation.arms or not len(simulation.t_ns):
        return None
    kept = kept_rows(simulation)
    arms = tuple(
        Arm(one.chain, one.q, simulation.t_ns, run_colour(i), ghost=i > 0, kept=kept)
        for i, one in enumerate(simulation.arms)
    )
    title = " and ".join(one.block for one in simulation.arms) if len(arms) == 2 else f"{len(arms)} arms"
    whose = "Arm" if len(arms) == 1 else f"Arms of {title}" if len(arms) == 2 else title
    return Scene(f"{whose} and paths [m]", arms, tip_paths(simulation))
