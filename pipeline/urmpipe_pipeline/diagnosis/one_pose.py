"""What a recorded tool centre point tells of a log that hardly moves: a tool or a base that would agree."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from urmpipe_models.elementwise import FloatArray
from urmpipe_pipeline.diagnosis.causes import Alternative, Cause, Kind, rms
from urmpipe_pipeline.diagnosis.fit import Model, Rows, fitted
from urmpipe_pipeline.diagnosis.hypotheses import State, zero


def tool_hypotheses(model: Model, held: float) -> tuple[tuple[Alternative, ...], FloatArray]:
    """Return the tool that makes both sides agree, what may be instead of it, and what the tool leaves.

    Few poses name no cause, but a deviation that is constant in the tool's frame is what a missing tool
    makes. A base that agrees as well stands beside it, and so does neither of both.

    Args:
        model: What is held against what it should be.
        held: The tolerance in [m]: what leaves more does not agree.

    Returns:
        The explanations, none where no tool agrees, and reference - log in [m], shape (3, n).
    """
    every = np.arange(model.rows)
    agree = list(_agreeing(model, held))
    if not agree or agree[0][0].kind != "tool_shift":
        return (), model.deviation(zero(model.groups), every)
    causes = [Alternative((cause,)) for cause, _ in agree]
    return (*causes, Alternative(())), model.deviation(agree[0][1], every)


def _agreeing(model: Model, held: float) -> Iterator[tuple[Cause, State]]:
    """Yield the shift of the tool, then that of the base, each with its explanation if it agrees."""
    every = np.arange(model.rows)
    rows = Rows(every, np.ones(len(model.blocks)) * (model.blocks == 0))  # positions alone
    before = rms(model.deviation(zero(model.groups), every).T)
    kinds: tuple[Kind, ...] = ("tool_shift", "base_shift")
    shifts = {group.kind: group for group in model.groups if group.kind in kinds and group.axis is None}
    for kind in kinds:
        if kind in shifts:
            state = fitted(model, zero(model.groups), [shifts[kind]], rows)
            after = rms(model.deviation(state, every).T)
            if after <= held:
                value = tuple(state.of(shifts[kind]).tolist())
                yield (
                    Cause(kind, shifts[kind].name, value=value, unit="m", rms_before=before, rms_after=after,
                          rms_alone=after),
                    state,
                )  # fmt: skip
