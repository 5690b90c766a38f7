"""What a comparison's verdict takes for granted: readings that nothing proves, of what it rests on."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

from urmpipe_models.errors import LogError
from urmpipe_pipeline.joint_log import Role
from urmpipe_pipeline.provenance import list_assumptions
from urmpipe_pipeline.runs.run import Run
from urmpipe_pipeline.trajectories import run_label


def assumptions(sides: Sequence[tuple[Run, Collection[Role]]]) -> tuple[str, ...]:
    """Return what the verdict on some runs assumes, each once, with the runs where it is not all of them.

    Args:
        sides: The runs that are compared, the reference among them, each with the roles of what is compared.

    Raises:
        LogError: With each reading that has to be told before a verdict rests on it.
    """
    rests_on = [(run, one) for run, roles in sides for one in run.warnings if one.role in roles]
    asked = [(run, one) for run, one in rests_on if one.asks]
    if asked:
        raise LogError(*(replace(one.as_finding(), file=run_label(run)) for run, one in asked))
    found = [(one.assumption, run.name) for run, one in rests_on if one.assumption]
    return list_assumptions(found, {run.name for run, _ in sides})
