"""What changed since an earlier comparison, as JSON and back: a report of the recording says it too."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from urmpipe_pipeline.comparison.change import Absent, BaselineComparison, Change, Difference
from urmpipe_pipeline.comparison.deviation import Statistics
from urmpipe_pipeline.json_values import flat


def baseline_data(found: BaselineComparison | None) -> dict[str, Any] | None:
    """Return what changed as JSON has it; None without a baseline."""
    if found is None:
        return None
    return {
        "name": found.name,
        "recording": found.recording,
        "noise": dict(found.noise),
        "changes": [_change(one) for one in found.changes],
        "new": [flat(one) for one in found.new],
        "gone": [flat(one) for one in found.gone],
        "differences": [flat(one) for one in found.differences],
    }


def baseline_from(data: Mapping[str, Any] | None) -> BaselineComparison | None:
    """Return what changed that a JSON object tells of; None without one."""
    if data is None:
        return None
    return BaselineComparison(
        name=data["name"],
        recording=None if data["recording"] is None else Path(data["recording"]),
        noise=data["noise"],
        changes=tuple(_change_from(one) for one in data["changes"]),
        new=tuple(Absent(**one) for one in data["new"]),
        gone=tuple(Absent(**one) for one in data["gone"]),
        differences=tuple(Difference(**one) for one in data["differences"]),
    )


def _change(one: Change) -> dict[str, Any]:
    return {**flat(one), "before": flat(one.before), "now": flat(one.now)}


def _change_from(data: Mapping[str, Any]) -> Change:
    share_noise, periods = data["share_noise"], data["periods"]
    told = {
        "before": Statistics(**data["before"]),
        "now": Statistics(**data["now"]),
        "share_noise": None if share_noise is None else (share_noise[0], share_noise[1]),
        "periods": (periods[0], periods[1]),
    }
    return Change(**{**data, **told})
