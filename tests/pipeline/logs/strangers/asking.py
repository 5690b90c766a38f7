"""What somebody gets who has a file and nothing else: a log, or a question and what its answers give."""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path

import numpy as np

from urmpipe_models.arm.chain import Chain
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.errors import Hint, Message, UrmpipeError
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_pipeline.joint_log import JointLog, LogWarning
from urmpipe_pipeline.logs import LogMap, read_log
from urmpipe_pipeline.logs.log_map import read_options

LONGEST = 3
"""So many questions in a row are answered."""

READINGS = 150
"""So many readings a question may lead to: who has more answers than that has been given none."""

COLUMNS = {"joints", "layout", "time", "side"}
"""Parameters that tell which numbers are joints: until then their unit is no question."""

ABOUT = {
    "joints": {"joints", "layout", "side", "skip_bad", "poses", "source"},
    "unit": {"unit", "robot"},
    "time": {"time", "period", "poses"},
}
"""By which parameters a warning doubts what was read."""


@dataclass(frozen=True)
class Truth:
    """What a file holds, whoever reads it.

    Attributes:
        q: Joints in [rad] in the robot's order, shape (n, joints); no columns for a path of the tool.
        t: Times in [s] from the first row, shape (n,); None if the file has no clock.
        q_within: Rounding of the writer in [rad].
        t_within: Rounding of the clock in [s], or how long the rows of a chunk share a stamp.
        qd: Rates in [rad/s]: not what must be read, but what read rates must be.
        position: Tool centre point in [m], where there are no joints.
        turn: Its orientation as quaternions x, y, z, w.
        period: Between what the time between rows is in [s] that rates tell where there is no clock.
        answers: Other joints that a question may lead to as well, such as one arm of two.
    """

    q: FloatArray
    t: FloatArray | None = None
    q_within: float = 1e-9
    t_within: float = 1e-8
    qd: FloatArray | None = None
    position: FloatArray | None = None
    turn: FloatArray | None = None
    period: tuple[float, float] | None = None
    answers: tuple[FloatArray, ...] = ()


@dataclass(frozen=True)
class Reading:
    """What came of one reading, and the answers that led to it."""

    came: JointLog | UrmpipeError
    options: LogMap
    robot: Chain | None
    answers: tuple[Hint, ...] = ()
    before: Reading | None = None

    @property
    def log(self) -> JointLog | None:
        return self.came if isinstance(self.came, JointLog) else None

    @property
    def hints(self) -> list[Hint]:
        """The answers that are printed with all they need: of an error, and of warnings that ask."""
        told: Sequence[Message] = self.asking if self.log is not None else self.findings
        return [hint for one in told for hint in one.hints if hint.parameter and hint.value is not None]

    @property
    def findings(self) -> Sequence[Message]:
        return self.came.findings if isinstance(self.came, UrmpipeError) else ()

    @property
    def asking(self) -> list[LogWarning]:
        return [] if self.log is None else [w for w in self.log.warnings if w.blocks_verdict]

    @property
    def said(self) -> str:
        if self.log is None:
            return str(self.came)
        warned = "; ".join(f"{w.kind}: {w.message}" for w in self.log.warnings)
        return f"{self.log.q.shape} {', '.join(self.log.joints)}, period {self.log.period:g} s; {warned}"


@dataclass(frozen=True)
class Verdict:
    """What the reader did with a file.

    Attributes:
        kind: "right", "asked" (an answer leads to it), "no answer" (none does), "doubted" (wrong, with a
            warning about just that), or "silent" (wrong, and nothing said).
        first: The first reading.
        about: What was wrong in it: "joints", "unit", "time".
        last: The reading that was right.
    """

    kind: str
    first: Reading
    about: tuple[str, ...] = ()
    last: Reading | None = field(default=None, repr=False)

    @property
    def good(self) -> bool:
        return self.kind in ("right", "asked")

    @property
    def unit_first(self) -> bool:
        """Whether a unit was asked for before it was clear of what."""
        then, after = self.last, set[str]()
        while then is not None and then.before is not None:
            answer = then.answers[-1].parameter
            if answer == "unit" and after - {hint.parameter for hint in then.before.hints}:
                return True
            after |= {answer} & COLUMNS
            then = then.before
        return False

    def __str__(self) -> str:
        told = ", ".join(str(hint) for hint in self.last.answers) if self.last else ""
        return f"{self.kind}: {'/'.join(self.about)} {told}\n{self.first.said}"


def outcome(
    paths: Sequence[Path],
    options: LogMap,
    robot: Chain | None,
    answers: tuple[Hint, ...] = (),
    before: Reading | None = None,
) -> Reading:
    """Return what a reader makes of files: the log, or the error with its question."""
    try:
        return Reading(read_log(paths, options, robot), options, robot, answers, before)
    except UrmpipeError as error:
        return Reading(error, options, robot, answers, before)


def readings(paths: Sequence[Path], first: Reading, depth: int = LONGEST) -> Iterator[Reading]:
    """Yield what the printed answers to a question lead to, each given verbatim, question by question."""
    for hint in first.hints if depth else []:
        options, robot = answered(first.options, first.robot, hint)
        if (options, robot) == (first.options, first.robot):
            continue
        then = outcome(paths, options, robot, (*first.answers, hint), first)
        yield then
        if isinstance(then.came, UrmpipeError) or then.asking:
            yield from readings(paths, then, depth - 1)


def answered(options: LogMap, robot: Chain | None, hint: Hint) -> tuple[LogMap, Chain | None]:
    """Return options and robot with an answer added, as the printed one would be given; as they are if it is
    none that reading takes.
    """
    if hint.robot or hint.parameter == "robot":
        robot = load_robot(hint.robot or str(hint.value))
    if hint.call or hint.parameter not in {one.name for one in fields(LogMap)}:
        return options, robot
    return read_options({hint.parameter: hint.value}, options), robot


def judge(paths: Sequence[Path], truth: Truth, options: LogMap, robot: Chain | None) -> Verdict:
    """Return what the reader did with files that hold this."""
    first = outcome(paths, options, robot)
    about = () if first.log is None else differing(first.log, truth)
    if first.log is not None and not about:
        return Verdict("right", first)
    if (written := commanded(paths, first)) is not None:
        return judge([written], truth, options, robot)
    if first.log is None or first.asking:
        for count, then in enumerate(readings(paths, first)):
            if then.log is not None and not then.asking and _among_answers(then.log, truth):
                return Verdict("asked", first, about, then)
            if count == READINGS:
                break
        return Verdict("no answer", first, about)
    return Verdict("doubted" if all(_doubts(first.log, one) for one in about) else "silent", first, about)


def commanded(paths: Sequence[Path], first: Reading) -> Path | None:
    """Return what the printed command makes of a file whose format is not read; None if there is none."""
    told = re.search(r'python -c "(.*)"', str(first.came)) if first.log is None else None
    if told is None:
        return None
    folder = paths[0].parent
    before = set(folder.iterdir())
    subprocess.run([sys.executable, "-c", told[1].replace('\\"', '"')], cwd=folder, check=False, timeout=60)
    return next(iter(set(folder.iterdir()) - before), None)


def differing(log: JointLog, truth: Truth) -> tuple[str, ...]:
    """Return what a log has otherwise than the file: "joints", "unit", "time"; nothing if it is right."""
    wrong = []
    if not _same_joints(log, truth):
        only_unit = _same(np.degrees(log.q), truth.q, 60 * truth.q_within) or _same(
            np.radians(log.q), truth.q, truth.q_within
        )
        wrong.append("unit" if only_unit else "joints")
    if not _same_times(log, truth):
        wrong.append("time")
    return tuple(wrong)


def _among_answers(log: JointLog, truth: Truth) -> bool:
    """Whether an answer led to what it may: the joints, or others of the file that it names."""
    wrong = differing(log, truth)
    return not wrong or (
        "time" not in wrong and any(_same(log.q, other, truth.q_within) for other in truth.answers)
    )


def _same_joints(log: JointLog, truth: Truth) -> bool:
    if not _same(log.q, truth.q, truth.q_within):
        return False
    if truth.position is not None:
        return (
            log.tcp_position is not None
            and _same(log.tcp_position, truth.position, 1e-6)
            and _turned(log, truth)
        )
    # Rates are rounded as the joints are, and derived rates are none that were recorded.
    return log.qd is None or truth.qd is None or _same(log.qd, truth.qd, 2 * truth.q_within)


def _turned(log: JointLog, truth: Truth) -> bool:
    """Whether the orientation is that of the file: a quaternion and its negative are one."""
    if truth.turn is None:
        return True
    cosines = None if log.tcp_quat_xyzw is None else np.abs(np.sum(log.tcp_quat_xyzw * truth.turn, axis=1))
    return cosines is not None and bool((cosines > 1 - 1e-9).all())


def _same_times(log: JointLog, truth: Truth) -> bool:
    if truth.t is not None:
        return _same(log.t, truth.t, truth.t_within)
    told = truth.period is not None and truth.period[0] < log.period < truth.period[1]
    return told or any(w.kind == "assumed-period" for w in log.warnings) or not log.timed


def _same(read: FloatArray, true: FloatArray, within: float) -> bool:
    if read.shape != true.shape or (np.isnan(read) != np.isnan(true)).any():
        return False
    return not (np.abs(read - true) > within).any()


def _doubts(log: JointLog, about: str) -> bool:
    """Whether a warning doubts this: it names what to give instead, or is about the clock."""
    return any(
        hint.parameter in ABOUT[about] or (about == "time" and warning.kind.startswith("clock"))
        for warning in log.warnings
        for hint in (*warning.hints, Hint(""))
    )
