"""Words, facts and tables of an accuracy: how far from the path at which velocity, and what decides."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

from urmpipe_pipeline import text
from urmpipe_pipeline.accuracy.driven_motion import Diverged, DrivenMotion, Errors
from urmpipe_pipeline.accuracy.result import Accuracy
from urmpipe_pipeline.presentation.parts import columns_of
from urmpipe_pipeline.presentation.section import Cell, Event, Fact, Judged, Ref, Table, Value

SHOWN_NEAR = 0.5
"""The motion shown first is that of the velocity nearest to this, in [m/s]."""

NAMES = {"time": "Largest error", "path": "Distance from the path"}
"""What the two errors are called, by which decides."""

MEANT = {
    "time": "from the set point of the same time",
    "path": "from the nearest point of the path",
}
"""What the two errors are measured from, by which decides."""

Cells = Callable[[Errors], Cell]


def shown_motion(result: Accuracy) -> DrivenMotion:
    """Return the motion that is shown first: that nearest to 0.5 m/s which did not diverge, if any."""
    return min(result.motions, key=lambda one: (one.diverged is not None, abs(one.velocity - SHOWN_NEAR)))


def at_velocity(velocity: float) -> str:
    """Return a velocity in [m/s] in words: "0.5 m/s"."""
    return f"{velocity:.4g} m/s"


def diverged_words(one: Diverged) -> str:
    """Return where a motion left its set points."""
    return f"diverged at t = {one.t:.4g} s ({one.joint})"


def limit_words(result: Accuracy) -> str:
    """Return what is allowed, and of which error: "0.4 mm (time)"."""
    return "" if result.limit is None else f"{text.allowed(result.limit)} ({result.decides})"


def headline(result: Accuracy) -> str:
    """Return how fast the arm runs within the limit; without a limit how far it is from the path."""
    robot = result.robot.name
    if result.running_speed is not None:
        said = f"{robot} runs up to {at_velocity(result.running_speed)} within {limit_words(result)}"
    elif result.limit is not None:
        said = f"{robot} runs at no velocity within {limit_words(result)}"
    else:
        said = f"{robot} {_errors_words(result)}"
    return f"{result.name}: {said}"


def _errors_words(result: Accuracy) -> str:
    """Return the largest error, and at which velocities the arm diverged."""
    found = [(error, one) for one in result.errors if (error := result.judged(one)) is not None]
    gone = [at_velocity(one.velocity) for one in result.errors if one.diverged is not None]
    words = [f"diverges at {text.enumerated(gone)}"] if gone else []
    if found:
        error, one = max(found, key=lambda pair: pair[0])
        most = f"is up to {text.quantity(error, 'm')} off ({result.decides}) at {at_velocity(one.velocity)}"
        words.insert(0, most)
    return ", and ".join(words)


def error_cell(result: Accuracy, one: Errors, which: str) -> Cell:
    """Return an error, held against the limit if it decides; of a motion that diverged, where."""
    if one.diverged is not None:
        return diverged_words(one.diverged)
    found = one.error if which == "time" else one.path_error
    if result.limit is None or which != result.decides or found is None:
        return Value(found, "m")
    return Value(found, "m", result.limit, result.within(one), found / result.limit)


def facts(result: Accuracy) -> Iterator[Fact]:
    """Yield how fast it may run, what is allowed, how it was run and by what."""
    if result.limit is not None:
        speed = result.running_speed
        yield Fact("Running speed", "none" if speed is None else at_velocity(speed))
        yield Fact("Limit", text.allowed(result.limit))
    yield Fact("Robot", f"{result.robot.name}: {result.robot.description}".removesuffix(": "), brief=False)
    yield Fact("Error that decides", f"{result.decides}: {MEANT[result.decides]}")
    yield Fact("Acceleration", acceleration_words(result))
    if any(result.force):
        yield Fact("Force on the tool", f"({', '.join(f'{one:g}' for one in result.force)}) N")
    yield Fact("Spectral radius of the sampled loop", f"{result.loop_radius:.6g}")
    yield Fact("Ran as", "machine code" if result.compiled else "NumPy")
    yield Fact("Assumes", "; ".join(one.assumption for one in result.warnings if one.assumption))


def acceleration_words(result: Accuracy) -> str:
    """Return the acceleration, which holds at all velocities, and the law."""
    if result.acceleration is None:
        return f"that of the joints' limits, law {result.law}"
    jerk = "" if result.jerk is None else f", {result.jerk:g} m/s³"
    return f"{result.acceleration:g} m/s²{jerk} at all velocities, law {result.law}"


def velocities_table(
    result: Accuracy, title: str, rows: Sequence[Errors], *, linked: bool = False, folded: bool = False
) -> Table:
    """Return the errors by velocity; those that lead to a section are linked, those tried are folded."""
    heads: dict[str, tuple[str, Cells]] = {
        "velocity": ("Velocity", lambda one: _named(one, linked=linked)),
        "reached": ("Reached", _reached),
        "error": ("Error", lambda one: error_cell(result, one, "time")),
        "path_error": (
            "Path error",
            lambda one: Value(one.path_error, "m") if one.diverged else error_cell(result, one, "path"),
        ),
        "saturated": ("At voltage limit", lambda one: Value(one.saturated, "%")),
    }
    if result.limit is not None:
        heads["verdict"] = ("Verdict", lambda one: Judged(result.within(one)))
    note = "Error: from the set point of the same time. Path error: from the nearest point of the path."
    return Table(title, columns_of(rows, heads), note=note, brief=not folded, folded=folded)


def _named(one: Errors, *, linked: bool) -> Cell:
    return Ref(at_velocity(one.velocity)) if linked else at_velocity(one.velocity)


def _reached(one: Errors) -> Value:
    """Return the largest speed of the plan where it is not the one asked for."""
    short = one.reached < one.velocity * (1.0 - 1e-6)
    return Value(float(f"{one.reached:.4g}") if short else None, "m/s")


def motion_facts(result: Accuracy, motion: DrivenMotion) -> Iterator[Fact]:
    """Yield what decides about a motion, its other error, and how often its drives are at their limits."""
    found, other = motion.errors, "path" if result.decides == "time" else "time"
    gone = motion.diverged is not None
    yield Fact(NAMES[result.decides], error_cell(result, found, result.decides), brief=gone)
    if not gone:
        yield Fact(NAMES[other], error_cell(result, found, other), brief=False)
    if (reached := _reached(found)).number is not None:
        yield Fact("Reached", reached, brief=False)
    yield Fact("At voltage limit", Value(found.saturated, "%"), brief=False)
    each = zip(result.driven, motion.at_limit.tolist(), strict=True)
    yield Fact(
        "Of each drive", ", ".join(f"{name} {text.percent(share)}" for name, share in each), brief=False
    )
    yield Fact("Duration", Value(float(motion.t[-1]), "s"), brief=False)


def events(motion: DrivenMotion) -> Iterator[Event]:
    """Yield the corners that a motion passes, where it is furthest off, and its end if early."""
    for number, at in enumerate(motion.corner_ns.tolist(), start=1):
        if at <= motion.t_ns[-1]:
            yield Event(at, f"corner {number}")
    far = text.quantity(float(motion.delta[motion.worst, 3]), "m")
    yield Event(int(motion.t_ns[motion.worst]), f"furthest from the set point: {far}")
    if motion.diverged is not None:
        yield Event(int(motion.t_ns[-1]), diverged_words(motion.diverged), "error")
