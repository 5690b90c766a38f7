"""The facts, tables and texts of an accuracy: its errors over velocity, and the error that decides."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

from urmpipe_pipeline import text
from urmpipe_pipeline.accuracy.driven_motion import Divergence, DrivenMotion, TrackingErrors
from urmpipe_pipeline.accuracy.result import AccuracyResult
from urmpipe_pipeline.presentation.parts import columns_of
from urmpipe_pipeline.presentation.section import Cell, Event, Fact, Judged, Ref, Table, Value

FIRST_VELOCITY = 0.5  # m/s: the motion at the velocity nearest to it is shown first

NAMES = {"time": "Largest error", "path": "Distance from the path"}
"""The names of both errors, by which decides."""

ERROR_DEFINITIONS = {
    "time": "from the set point of the same time",
    "path": "from the nearest point of the path",
}

Cells = Callable[[TrackingErrors], Cell]


def select_shown_motion(result: AccuracyResult) -> DrivenMotion:
    """Return the motion that is shown first: nearest to 0.5 m/s, of those that did not diverge if any."""
    return min(
        result.motions,
        key=lambda motion: (motion.diverged is not None, abs(motion.velocity - FIRST_VELOCITY)),
    )


def format_velocity(velocity: float) -> str:
    """Return a velocity in [m/s] as text: "0.5 m/s"."""
    return f"{velocity:.4g} m/s"


def format_divergence(diverged: Divergence) -> str:
    """Return when a motion left its set points, and the joint."""
    return f"diverged at t = {diverged.t:.4g} s ({diverged.joint})"


def format_limit(result: AccuracyResult) -> str:
    """Return the limit, and its error: "0.4 mm (time)"."""
    return "" if result.limit is None else f"{text.format_stated(result.limit)} ({result.limited_error})"


def headline(result: AccuracyResult) -> str:
    """Return the largest velocity within the limit; without a limit the largest error."""
    robot = result.robot.name
    if result.running_speed is not None:
        summary = f"{robot} runs up to {format_velocity(result.running_speed)} within {format_limit(result)}"
    elif result.limit is not None:
        summary = f"{robot} runs at no velocity within {format_limit(result)}"
    else:
        summary = f"{robot} {_format_errors(result)}"
    return f"{result.name}: {summary}"


def _format_errors(result: AccuracyResult) -> str:
    """Return the largest error, and the velocities at which the arm diverged."""
    known = [(error, e.velocity) for e in result.errors if (error := result.judged_error(e)) is not None]
    diverged = [format_velocity(errors.velocity) for errors in result.errors if errors.diverged is not None]
    parts = []
    if known:
        error, velocity = max(known, key=lambda pair: pair[0])
        off = f"is up to {text.format_quantity(error, 'm')} off ({result.limited_error})"
        parts.append(f"{off} at {format_velocity(velocity)}")
    if diverged:
        parts.append(f"diverges at {text.join_list(diverged)}")
    return ", and ".join(parts)


def error_cell(result: AccuracyResult, errors: TrackingErrors, which: str) -> Cell:
    """Return an error, with the limit if it decides; if the motion diverged, where."""
    if errors.diverged is not None:
        return format_divergence(errors.diverged)
    error = errors.error if which == "time" else errors.path_error
    if result.limit is None or which != result.limited_error or error is None:
        return Value(error, "m")
    return Value(error, "m", result.limit, result.judge(errors), error / result.limit)


def facts(result: AccuracyResult) -> Iterator[Fact]:
    """Yield the running speed, the limit, and the conditions of the motions."""
    if result.limit is not None:
        speed = result.running_speed
        yield Fact("Running speed", "none" if speed is None else format_velocity(speed))
        yield Fact("Limit", text.format_stated(result.limit))
    yield Fact("Robot", f"{result.robot.name}: {result.robot.description}".removesuffix(": "), brief=False)
    yield Fact("Error that decides", f"{result.limited_error}: {ERROR_DEFINITIONS[result.limited_error]}")
    yield Fact("Acceleration", _format_acceleration(result))
    if any(result.force):
        yield Fact("Force on the tool", f"({', '.join(f'{component:g}' for component in result.force)}) N")
    yield Fact("Spectral radius of the sampled loop", f"{result.loop_radius:.6g}")
    yield Fact("Ran as", "machine code" if result.compiled else "NumPy")
    yield Fact("Assumes", "; ".join(w.assumption for w in result.warnings if w.assumption))


def _format_acceleration(result: AccuracyResult) -> str:
    """Return the acceleration, the same at all velocities, and the law."""
    if result.acceleration is None:
        return f"that of the joints' limits, law {result.law}"
    jerk = "" if result.jerk is None else f", {result.jerk:g} m/s³"
    return f"{result.acceleration:g} m/s²{jerk} at all velocities, law {result.law}"


def velocities_table(
    result: AccuracyResult,
    title: str,
    rows: Sequence[TrackingErrors],
    *,
    linked: bool = False,
    folded: bool = False,
) -> Table:
    """Return the errors by velocity; `linked` if each has a section, `folded` for those that were tried."""
    heads: dict[str, tuple[str, Cells]] = {
        "velocity": ("Velocity", lambda errors: _velocity_cell(errors, linked=linked)),
        "reached": ("Reached", _reached),
        "error": ("Error", lambda errors: error_cell(result, errors, "time")),
        "path_error": (
            "Path error",
            lambda errors: (
                Value(errors.path_error, "m") if errors.diverged else error_cell(result, errors, "path")
            ),
        ),
        "saturated_share": ("At voltage limit", lambda errors: Value(errors.saturated_share, "%")),
    }
    if result.limit is not None:
        heads["verdict"] = ("Verdict", lambda errors: Judged(result.judge(errors)))
    note = "Error: from the set point of the same time. Path error: from the nearest point of the path."
    return Table(title, columns_of(rows, heads), note=note, brief=not folded, folded=folded)


def _velocity_cell(errors: TrackingErrors, *, linked: bool) -> Cell:
    velocity = format_velocity(errors.velocity)
    return Ref(velocity) if linked else velocity


def _reached(errors: TrackingErrors) -> Value:
    """Return the largest speed of the plan, if it is less than the commanded one."""
    is_less = errors.reached < errors.velocity * (1.0 - 1e-6)
    return Value(float(f"{errors.reached:.4g}") if is_less else None, "m/s")


def motion_facts(result: AccuracyResult, motion: DrivenMotion) -> Iterator[Fact]:
    """Yield the error that decides, the other one, and how often the drives are at their limits."""
    errors, other = motion.errors, "path" if result.limited_error == "time" else "time"
    has_diverged = motion.diverged is not None
    yield Fact(
        NAMES[result.limited_error], error_cell(result, errors, result.limited_error), brief=has_diverged
    )
    if not has_diverged:
        yield Fact(NAMES[other], error_cell(result, errors, other), brief=False)
    if (reached := _reached(errors)).number is not None:
        yield Fact("Reached", reached, brief=False)
    yield Fact("At voltage limit", Value(errors.saturated_share, "%"), brief=False)
    by_drive = zip(result.driven, motion.at_limit.tolist(), strict=True)
    fractions = ", ".join(f"{name} {text.format_percent(fraction)}" for name, fraction in by_drive)
    yield Fact("Of each drive", fractions, brief=False)
    yield Fact("Duration", Value(float(motion.t[-1]), "s"), brief=False)


def events(motion: DrivenMotion) -> Iterator[Event]:
    """Yield the corners that a motion passes, its largest error, and its end if it diverged."""
    for number, t_ns in enumerate(motion.corner_times_ns.tolist(), start=1):
        if t_ns <= motion.t_ns[-1]:
            yield Event(t_ns, f"corner {number}")
    distance = text.format_quantity(float(motion.delta[motion.worst, 3]), "m")
    yield Event(int(motion.t_ns[motion.worst]), f"furthest from the set point: {distance}")
    if motion.diverged is not None:
        yield Event(int(motion.t_ns[-1]), format_divergence(motion.diverged), "error")
