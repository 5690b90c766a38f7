"""Facts: names, values and a word on each, for who meets them for the first time."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from urmpipe_pipeline import text
from urmpipe_pipeline.comparison.causes import causes
from urmpipe_pipeline.comparison.change_wording import since_words
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.comparison.deviation import Deviation, Stretch
from urmpipe_pipeline.comparison.trajectory import Sync, Trajectory
from urmpipe_pipeline.comparison.wording import (
    correlation,
    out_words,
    stretch_words,
    tolerance_words,
    tool_option,
)
from urmpipe_pipeline.presentation.digits import written
from urmpipe_pipeline.runs.results import Run
from urmpipe_pipeline.solved_targets.verdict import reached


@dataclass(frozen=True, slots=True)
class Fact:
    """One fact.

    Attributes:
        name: What it is of.
        value: What it is.
        note: What that means; empty where it explains itself.
        href: Where the value leads, such as "#c1-1"; empty where it leads nowhere.
    """

    name: str
    value: str
    note: str = ""
    href: str = ""


def run_facts(run: Run) -> tuple[Fact, ...]:
    """Return what a log is: its arm, rows, grid and duration."""
    return _told(
        Fact("Robot", run.robot.name if run.robot else "none: no kinematics"),
        Fact("Source", run.log.source),
        *_time_facts(run),
        *_solved_facts(run),
        Fact("Recording", str(run.recording) if run.recording else ""),
    )


def _time_facts(run: Run) -> Iterator[Fact]:
    """Yield how many rows a log has and how far apart; single poses have no times."""
    if not run.timed:
        yield Fact("Rows", f"{run.log.rows}, without times")
        return
    yield Fact("Rows", f"{run.log.rows} every {text.seconds(run.log.period)} s")
    yield Fact("Grid", f"{len(run.t_ns)} samples every {text.seconds(run.tsp)} s")
    yield Fact("Duration", f"{text.seconds(run.duration)} s")


def _solved_facts(run: Run) -> Iterator[Fact]:
    """Yield how many targets were reached, and by which further branches; nothing of a log."""
    if run.goals is None:
        return
    yield Fact("Targets", f"{reached(run)} of {run.log.rows} with a solution")
    branches = "; ".join(f"{ghost.name}: {len(ghost.t_ns)}" for ghost in run.ghosts)
    yield Fact("Rows of other branches", branches)


def comparison_facts(comparison: Comparison) -> tuple[Fact, ...]:
    """Return what was held against what, and what was allowed."""
    return _told(
        Fact("Reference", comparison.reference.name),
        Fact("Reference samples", str(len(comparison.reference.t_ns))),
        Fact("Tolerance", tolerance_words(comparison)),
        Fact("Against the baseline", _since_baseline(comparison)),
        Fact("Recording", str(comparison.recording) if comparison.recording else ""),
        Fact("Made", made(comparison)),
    )


def made(comparison: Comparison) -> str:
    """Return when a comparison was made, to the minute."""
    return f"{comparison.provenance.created[:16].replace('T', ' ')} UTC"


def _since_baseline(comparison: Comparison) -> str:
    """Return what is worse than the baseline; nothing without one."""
    return "" if comparison.baseline is None else since_words(comparison.baseline)


def deviation_facts(deviation: Deviation, reference: Trajectory) -> tuple[Fact, ...]:
    """Return how a log was put together with the reference in time and space, and what stood out.

    Args:
        deviation: The compared log.
        reference: What it was held against.
    """
    outside = out_words(int(np.count_nonzero(deviation.outside)), len(deviation.sample))
    return _told(
        Fact("Clocks", sync_value(deviation.sync), _sync_note(deviation.sync)),
        Fact("Left out", _left_out(deviation, len(reference.t_ns)), "no counterpart, or no value"),
        Fact("Alignment", alignment_value(deviation), _alignment_note(deviation)),
        Fact("Turns", _turns(deviation), "counted apart at the start: taken out of the joints' deviation"),
        Fact("Out of tolerance", outside),
        Fact("Longest stretch out", stretch(deviation.longest_out)),
        Fact("r(‖Δ‖, speed)", speed_correlation(deviation), "1: they grow together; 0: they are unrelated"),
        *(Fact("Looks like", written(cause)) for cause in causes(deviation, reference)),
    )


def speed_correlation(deviation: Deviation) -> str:
    """Return how the norm goes with the speed; nothing where that is not known."""
    found = deviation.speed_correlation
    return "" if found is None else correlation(found)


def stretch(found: Stretch | None) -> str:
    """Return a stretch out of tolerance; nothing without one."""
    return "" if found is None else stretch_words(found)


def sync_value(sync: Sync) -> str:
    """Return how two clocks were put together."""
    if sync.mode == "start":
        return "both start together"
    within = "" if sync.precision is None else f" ± {text.standard_error(sync.precision)}"
    return f"{text.offset(sync.offset)}{within}"


def alignment_value(deviation: Deviation) -> str:
    """Return how a log was moved in space."""
    alignment = deviation.alignment
    match alignment.mode:
        case "none":
            return "none"
        case "tool":
            return f"tool moved by {text.quantity(float(np.linalg.norm(alignment.tool)), 'm')}"
    moved = f"moved by up to {text.quantity(float(alignment.moved(deviation.actual).max()), 'm')}"
    return f"{alignment.mode}: {moved}, turned by {text.quantity(alignment.angle, 'rad')}"


def _sync_note(sync: Sync) -> str:
    if sync.mode == "start":
        return "each from its first sample"
    meaning = "t of the reference = t of the log + this"
    if sync.mode == "given":
        return f"as asked for; {meaning}"
    alike = "" if sync.similarity is None else f"; likeness of the motions there: {sync.similarity:.4f} of 1"
    return f"found by the motion of the {sync.by or 'log'}; {meaning}{alike}"


def _alignment_note(deviation: Deviation) -> str:
    alignment = deviation.alignment
    if alignment.mode == "none":
        return "both stand where they say they stood"
    if alignment.mode == "tool":
        robot = deviation.run.robot
        option = f", as {tool_option(robot, alignment)} does" if robot else ""
        return f"the constant offset of the tool centre point that fits best{option}"
    return (
        "the first compared poses agree" if alignment.mode == "start" else "the rigid motion that fits best"
    )


def _left_out(deviation: Deviation, reference_samples: int) -> str:
    total = deviation.left_out + len(deviation.sample)
    return (
        f"{deviation.left_out} of {total} samples,"
        f" {deviation.reference_left_out} of {reference_samples} of the reference"
    )


def _turns(deviation: Deviation) -> str:
    counts = zip(deviation.joint_statistics, deviation.joint_turns, strict=True)
    return ", ".join(f"{name} {count:+d}" for name, count in counts if count)


def _told(*facts: Fact) -> tuple[Fact, ...]:
    """Return those that have a value."""
    return tuple(fact for fact in facts if fact.value)
