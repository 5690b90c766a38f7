"""The result of a diagnosis, and its summary: the same in the terminal, the recording and the report.

The summary: a passed log, the causes in order, each with the rms before and after it, then what is undecided
or not determined.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from itertools import takewhile
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_pipeline import text
from urmpipe_pipeline.diagnosis.cause_texts import build_remedy, format_amount, format_cause, format_change
from urmpipe_pipeline.diagnosis.causes import (
    CLOCKS,
    NOT_CONSTANT,
    Alternative,
    Cause,
    RecordedTcpCheck,
    Unexplained,
    UnidentifiableCauses,
    UntestedCauses,
)
from urmpipe_pipeline.joint_log import LogWarning
from urmpipe_pipeline.presentation.result import Result

if TYPE_CHECKING:
    import pandas as pd

SCHEMA = 1
MAX_CAUSES = 3  # in a summary, with all that break the tolerance; a table has the others
MAX_LISTED = 2  # undecided explanations in a summary, or one if two have too many causes; a table has all
MAX_UNDECIDED = 4  # causes of two such explanations together
MIN_EXPLAINED = 1.0 / 3.0  # fraction of the rms; with less, the summary says that it explains little
NOTHING = 0.01  # fraction of an rms; less would go unnoticed
UNMOVED = 1e-6  # m; a cause that moves no position by more is not one of the rms
PASSES = "passes; "


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Diagnosis(Result):
    """Why a log deviates from its reference.

    Attributes:
        name: The log's name.
        verdict: That of the comparison; None if nothing was judged.
        samples: Number of samples.
        unit: m of positions, rad of joints alone.
        rms: Root mean square of the deviation before, in `unit`.
        causes: The causes: clocks first, then what reduces the rms most after those before.
        undecided: Explanations between which the log does not decide.
        untested: Causes that these sides cannot show, and why.
        unexplained: Deviation left after the causes.
        sample: Rows of the log, from 0, of the residual, shape (m,).
        residual: reference - log after the causes are removed: x, y, z in [m], shape (m, 3), or the joints
            in [rad] or [m], shape (m, joints).
        warnings: Warnings.
        recording: The file it was written to.
        comparison: The comparison that contains it, if `urmpipe.diagnose` made it.
        shares: In 0..1, on which the verdict and the causes rest: coverage of the reference, judged of
            the log's motion.
        unidentifiable: Explanations that this motion does not determine.
        recorded_tcp: How far each side with joints is from its recorded tool centre point.
        origin: Name of the side with the causes, by the recorded tool centre points; empty if unknown.
    """

    name: str
    verdict: Literal["pass", "fail"] | None
    samples: int
    unit: Literal["m", "rad"]
    rms: float
    causes: tuple[Cause, ...]
    undecided: tuple[Alternative, ...]
    untested: tuple[UntestedCauses, ...]
    unexplained: Unexplained
    sample: IntArray
    residual: FloatArray
    warnings: tuple[LogWarning, ...] = ()
    recording: Path | None = field(default=None, metadata={"stored": False})
    comparison: Result | None = field(default=None, metadata={"stored": False})
    shares: Mapping[str, float] = field(default_factory=dict)
    unidentifiable: tuple[UnidentifiableCauses, ...] = ()
    recorded_tcp: tuple[RecordedTcpCheck, ...] = ()
    origin: str = ""

    @property
    def summary(self) -> str:
        """The answer in one sentence."""
        return format_summary(self)

    def _headline(self) -> str:
        """Return the answer."""
        return f"{self.name}: {self.summary}"

    def _notes(self) -> list[str]:
        """Return its warnings."""
        return list(map(str, self.warnings))

    def to_frame(self) -> pd.DataFrame:
        """Return one row per cause: kind, name, value, interval and rms before and after it, in SI."""
        import pandas as pd

        rows, columns = [cause.to_dict() for cause in self.causes], list(_NO_CAUSE.to_dict())
        return pd.DataFrame(rows, columns=columns)

    def to_dict(self) -> dict[str, Any]:
        """Return the object that `urmpipe diagnose --json` prints."""
        return {
            "schema": SCHEMA,
            "name": self.name,
            "verdict": self.verdict,
            "samples": self.samples,
            **{"coverage": None, "judged": None, **self.shares},
            "unit": self.unit,
            "rms": self.rms,
            "causes": [cause.to_dict() for cause in self.causes],
            "undecided": [alternative.to_dict() for alternative in self.undecided],
            "unidentifiable": [causes.to_dict() for causes in self.unidentifiable],
            "recorded_tcp": list(map(asdict, self.recorded_tcp)),
            "origin": self.origin or None,
            "untested": list(map(asdict, self.untested)),
            "unexplained": asdict(self.unexplained),
            "warnings": [warning.to_dict() for warning in self.warnings],
            "recording": str(self.recording) if self.recording else None,
        }


_NO_CAUSE = Cause("joint_sign", "")


def format_summary(diagnosis: Diagnosis) -> str:
    """Return the answer in one sentence."""
    causes, alternatives, residual = diagnosis.causes, diagnosis.undecided, diagnosis.unexplained
    before, after = (format_amount(rms, diagnosis.unit) for rms in (diagnosis.rms, residual.rms))
    if residual.is_unrelated_motion:
        fitted = f"the causes found leave {after} of it" if causes or alternatives else "no cause found"
        return f"probably different motions: rms {before}, {fitted}"
    if not causes and not alternatives:
        few = bool(diagnosis.unidentifiable) and len(diagnosis.unidentifiable[0].causes) <= MAX_LISTED
        if diagnosis.unidentifiable and (few or diagnosis.verdict != "pass"):
            passes = PASSES if diagnosis.verdict == "pass" else ""
            return f"{passes}{format_refusal(diagnosis.unidentifiable[0])}; rms {after} remains"
        meaning = f" ({residual.interpretation})" if residual.interpretation else ""
        return f"no cause found: rms {before} remains{meaning}"
    unseen = [cause for cause in causes if _moves_nothing(cause, diagnosis.unit)]
    if unseen:
        seen = tuple(cause for cause in causes if cause not in unseen)
        rest = format_summary(replace(diagnosis, causes=seen)) if seen or alternatives else ""
        start = f"{rest}; " if rest else PASSES if diagnosis.verdict == "pass" else ""
        only_turns = all(cause.kind == "turns" for cause in unseen)
        effect = "does not move the TCP" if only_turns else "turns the TCP, but does not move it"
        return f"{start}{text.join_list(list(map(format_cause, unseen)))} (this {effect})"
    if diagnosis.verdict == "pass":
        return f"{PASSES}{_format_avoidable(diagnosis)}"
    little = diagnosis.rms - residual.rms < MIN_EXPLAINED * diagnosis.rms
    return f"{'explains little: ' if little else ''}{_format_chain(diagnosis)}{_format_origin(diagnosis)}"


def _moves_nothing(cause: Cause, unit: str) -> bool:
    """Return whether a cause changes no position: a turn about the tool centre point, whole turns."""
    still = cause.effect < UNMOVED and abs(cause.rms_after - cause.rms_before) < UNMOVED
    return unit == "m" and still and cause.kind not in ("outliers", "own_geometry")


def select_causes(causes: Sequence[Cause]) -> list[Cause]:
    """Return the causes of a summary in their order: all that break the tolerance, others up to three.

    Causes that they partly cancel are added.
    """
    listed = [cause for cause in causes if cause.exceeds_tolerance]
    listed += [cause for cause in causes if not cause.exceeds_tolerance][: max(MAX_CAUSES - len(listed), 0)]
    steps = (step for step in _split_steps(causes) if any(cause in listed for cause in step))
    return [cause for step in steps for cause in step]


def _split_steps(causes: Sequence[Cause]) -> list[list[Cause]]:
    """Return causes in steps that each lower the rms: those that partly cancel each other are one step."""
    steps: list[list[Cause]] = []
    for cause in causes:
        if steps and _is_joinable(steps[-1], cause) and not _lowers(steps[-1]):
            steps[-1].append(cause)
        else:
            steps.append([cause])
    while len(steps) > 1 and _is_joinable(steps[-2], *steps[-1]) and not _lowers(steps[-1]):
        steps[-2:] = [[*steps[-2], *steps[-1]]]
    return steps


def _is_joinable(step: Sequence[Cause], *causes: Cause) -> bool:
    return not any(cause.kind in (*CLOCKS, "outliers") for cause in (*step, *causes))


def _lowers(step: Sequence[Cause]) -> bool:
    return step[-1].rms_after < (1.0 - NOTHING) * step[0].rms_before


def _format_avoidable(diagnosis: Diagnosis) -> str:
    """Return how much of the deviation of a passed log could be removed, and how."""
    unit, listed = diagnosis.unit, select_causes(diagnosis.causes)
    before, removed = diagnosis.rms, diagnosis.rms - diagnosis.unexplained.rms
    little = "only " if removed < MIN_EXPLAINED * before else ""
    amount = f"{little}{format_amount(removed, unit)}"
    if removed < NOTHING * before:
        amount = f"less than {100.0 * NOTHING:g} %"
    amounts = f"{amount} of {format_amount(before, unit)} rms"
    undecided = format_undecided(diagnosis.undecided) if diagnosis.undecided else ""
    if not listed:
        return f"{amounts} is explained: {undecided}"
    conditions = text.join_list([build_remedy(cause).conditional() for cause in listed])
    return "; ".join(
        filter(
            None, (f"{amounts} would be removed if {conditions}", _format_more(diagnosis, listed), undecided)
        )
    )


def _format_chain(diagnosis: Diagnosis) -> str:
    """Return the causes in order, each with the rms before and after it: "A: rms 9 -> 2 mm; then B: ..."."""
    unit, listed = diagnosis.unit, select_causes(diagnosis.causes)
    clocks = list(takewhile(lambda cause: cause.kind in CLOCKS, listed))
    parts = []
    if clocks:
        clauses = text.join_list([format_cause(cause) for cause in clocks])
        if len(clocks) < len(listed):
            parts.append(f"{clauses}; after that {format_amount(clocks[-1].rms_after, unit)} rms")
        else:
            parts.append(f"{clauses}: {format_change(clocks[0].rms_before, clocks[-1].rms_after, unit)}")
    steps = [step for step in _split_steps(diagnosis.causes) if step[0] in listed[len(clocks) :]]
    for step in steps:
        if step[0].kind == "outliers":
            change = f"; {_format_others(step[0], diagnosis, is_last=step[0] is diagnosis.causes[-1])}"
        else:
            change = format_change(step[0].rms_before, step[-1].rms_after, unit)
            is_alone = len(step) == len(diagnosis.causes) and not diagnosis.undecided
            change = f": {change if is_alone else _in_chain(change, is_first=not parts)}"
        clauses = text.join_list([format_cause(cause) for cause in step])
        parts.append(f"{'then ' if parts else ''}{clauses}{change}")
    more = _format_more(diagnosis, listed)
    parts += [more] if more else []
    if diagnosis.undecided:
        change = format_change(diagnosis.rms, diagnosis.unexplained.rms, unit)
        stays = f"; rms {format_amount(diagnosis.unexplained.rms, unit)} remains" if parts else f": {change}"
        parts.append(f"{'then ' if parts else ''}{format_undecided(diagnosis.undecided)}{stays}")
    return "; ".join(parts)


def _in_chain(change: str, *, is_first: bool) -> str:
    """Return a change with its unit once, and with "rms" only before the first of a chain."""
    before, after = change.removeprefix("rms ").split(" -> ")
    return f"{'rms ' if is_first else ''}{before.split()[0]} -> {after}"


def _format_others(cause: Cause, diagnosis: Diagnosis, *, is_last: bool) -> str:
    """Return the rms of the rows that are no outliers."""
    rms = format_amount(cause.rms_after, diagnosis.unit)
    if not is_last:
        return f"without {'them' if len(cause.rows) > 1 else 'it'} {rms} rms"
    agrees = cause.rms_after < MIN_EXPLAINED * cause.rms_before
    rest = f"the other {diagnosis.samples - len(cause.rows)}"
    return f"{rest} agree within {rms} rms" if agrees else f"{rest} are off by {rms} rms"


def _format_more(diagnosis: Diagnosis, listed: Sequence[Cause]) -> str:
    more = len(diagnosis.causes) - len(listed)
    return f"{more} more in the table" if more else ""


def _format_origin(diagnosis: Diagnosis) -> str:
    """Return which side has the causes, as the recorded tool centre points show."""
    if not diagnosis.origin:
        return ""
    agreeing = [side for side in diagnosis.recorded_tcp if side.agrees and side.name != diagnosis.origin]
    reason = f"the TCP that {diagnosis.origin} recorded follows the other side"
    reason = format_own_tcp(agreeing[0]) if agreeing else reason
    causes = "that is" if len(diagnosis.causes) < 2 else "these are"
    return f"; {reason}, so {causes} in {diagnosis.origin}"


def format_own_tcp(side: RecordedTcpCheck) -> str:
    """Return how far a side is from its recorded tool centre point."""
    largest = format_amount(side.max, "m")
    if side.agrees:
        return f"{side.name} agrees with its own TCP within {largest}"
    return f"{side.name} is {format_amount(side.rms, 'm')} rms from its own TCP, {largest} at most"


def format_undecided(alternatives: Sequence[Alternative]) -> str:
    """Return what a log does not decide between: "either A or B (more motion of phi5 would decide)"."""
    listed = alternatives[:MAX_LISTED]
    listed = listed[:1] if sum(len(alternative.causes) for alternative in listed) > MAX_UNDECIDED else listed
    clauses = [format_explanation(alternative) for alternative in listed]
    more = len(alternatives) - len(listed)
    clauses += [f"{more} more" if more > 1 else "another"] if more > 0 else []
    joints = dict.fromkeys(filter(None, (each.discriminating_joint for each in alternatives)))
    decides = (
        f"more motion of {text.join_list([*joints])} would decide" if joints else "this log cannot decide"
    )
    return f"either {' or '.join(clauses)} ({decides})"


def format_explanation(explanation: Alternative | UnidentifiableCauses) -> str:
    """Return the causes of one explanation."""
    return text.join_list([format_cause(cause) for cause in explanation.causes]) or "none of these"


def format_refusal(refused: UnidentifiableCauses) -> str:
    """Return why causes are refused, and which motion would determine them."""
    if len(refused.causes) > 1 and refused.reason == NOT_CONSTANT:
        return f"not determined by this motion: {refused.reason}"
    if len(refused.causes) > MAX_LISTED:  # no motion of one joint determines them
        return f"not determined by this motion: {len(refused.causes)} causes ({refused.reason})"
    joint = refused.discriminating_joint
    remedy = f"; more motion of {joint} would determine it" if joint else ""
    return f"not determined by this motion: {format_explanation(refused)} ({refused.reason}){remedy}"


def format_residual(residual: Unexplained, unit: str) -> str:
    """Return what remains, and its interpretation."""
    meaning = f": {residual.interpretation}" if residual.interpretation else ""
    return f"rms {format_amount(residual.rms, unit)}{meaning}"
