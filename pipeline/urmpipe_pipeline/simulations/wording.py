"""How a simulation ended, in words: the same in the recording and the report."""

from __future__ import annotations

from urmpipe_pipeline import text
from urmpipe_pipeline.simulations.simulation import Simulation


def outcome_words(simulation: Simulation) -> str:
    """Return how a simulation ended: "delta of log-to-delta out of tolerance", "one-drive: 401 samples"."""
    if simulation.failed is not None:
        return f"{simulation.name} did not reach its end"
    worst = simulation.judged_worst
    if worst is None:
        return f"{simulation.name}: {text.counted(len(simulation.t_ns), 'sample')}"
    within = "within" if worst.verdict == "pass" else "out of"
    return f"{worst.block} of {simulation.name} {within} tolerance"
