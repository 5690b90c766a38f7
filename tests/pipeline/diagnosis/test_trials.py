"""Each kind of cause on a motion of a real robot: the clear single ones of benchmarks/diagnosis_trials.py."""

from __future__ import annotations

from pathlib import Path

import pytest

BENCHMARKS = Path(__file__).resolve().parents[3] / "benchmarks"


@pytest.mark.slow
@pytest.mark.usefixtures("shared")
def test_a_clear_cause_of_each_kind_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of each kind one that moves the tool centre point by 4 mm, or has no size, in noise of 0.05 mm."""
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    from diagnosis_trials import GOOD, run
    from faulty_logs import plan

    clear = {
        kinds: number
        for number, (group, kinds, size, noise) in enumerate(plan())
        if group == "single" and size in (0.0, 4e-3) and noise == 5e-5
    }
    assert len(clear) == 32
    results = [run(number) for number in clear.values()]
    assert [one for one in results if one["answer"] not in GOOD] == []
