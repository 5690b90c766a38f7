"""What the repolarizer's audit is made of."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

AuditKind = Literal["wrap", "in-between", "repaired", "unexplained", "ambiguous"]


@dataclass(frozen=True, slots=True)
class AuditEntry:
    """One thing that the repolarizer did to a joint, or could not decide.

    kind says which:
        wrap: a jump of a period that was undone.
        in-between: a sample that a linear resampling left on a wrap; it stands as it is.
        repaired: such a sample, put on the line through its neighbours.
        unexplained: a step above a quarter period that is no wrap; it stays.
        ambiguous: a gap in which the joint can have turned more than half a period; the nearest is taken.

    Attributes:
        joint: Name of the joint.
        row: Data row of the file, from 1: the first row after the step, or the sample itself.
        t: Instant in [s]: of a step t_r, half way between its two samples; of a sample its time.
        half_period: t is known to +- this, in [s].
        step: The step as it stands in the file, in [rad]; of a sample how far it lies from the line
            through its repolarized neighbours.
        before: Turns k added before it.
        after: Turns k added from it on.
        kind: What it is.
    """

    joint: str
    row: int
    t: float
    half_period: float
    step: float
    before: int
    after: int
    kind: AuditKind = "wrap"

    @property
    def sample(self) -> int:
        """Index of the row, from 0."""
        return self.row - 1

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON object of the audit."""
        return {
            "kind": self.kind, "joint": self.joint, "row": self.row, "sample": self.sample,
            "t": self.t, "half_period": self.half_period, "step": self.step,
            "from": self.before, "to": self.after,
        }  # fmt: skip
