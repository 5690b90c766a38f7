"""Changed files of every kind: each is read, or refused in words, within memory, and ends no process.

The inputs are the same in every run, but for what stands in recordings (their times). More of them:
`python -m tests.fuzz --minutes N`.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from urmpipe_models.processes import module_environment

pytestmark = pytest.mark.skipif(not hasattr(os, "fork"), reason="its workers are forks")

ROOT = Path(__file__).resolve().parents[2]

LIMIT = 300.0
"""An input that has not returned after so many seconds never does, however loaded the machine is."""

INPUTS = 10
"""Of a kind whose share is 1: five hundred of all kinds, in ten seconds."""

PLANTED = """
import os, sys, time
from pathlib import Path
from tests.fuzz import campaign, kinds
from tests.fuzz.corpus import Specimen
from tests.fuzz.__main__ import main
from urmpipe_models.errors import LogError

def read(path, made, rng):
    match int(path.read_text()):
        case 1: {}["no such key"]
        case 2: os._exit(0)
        case 3: os.abort()
        case 4: time.sleep(1000)
        case 5: bytearray(1_010_000_000)
        case 6: raise MemoryError
        case 7: raise LogError("refused")
        case 8: raise SystemExit

names = [Specimen(f"{i}.txt", str(i).encode()) for i in (0, 1, 2, 3, 6, 7, 8) * 4 + (4, 5)]
unchanged = [lambda data, rng, others: data]
kinds.KINDS = (kinds.Kind("planted", lambda made: names, unchanged, read, 1.0),)
kinds.BY_NAME["planted"] = kinds.KINDS[0]
campaign.make = lambda folder: None
words = "fuzz --inputs 30 --seed 7 --workers 1 --limit 10 --json --keep"
sys.argv = [*words.split(), sys.argv[1]]
sys.exit(main())
"""


def run(*words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, *words],
        cwd=ROOT,
        env=module_environment(),
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.mark.slow
def test_every_changed_file_is_read_or_refused_in_words(tmp_path: Path) -> None:
    size = "--inputs", str(INPUTS), "--workers", "1", "--limit", str(LIMIT)
    done = run("-m", "tests.fuzz", *size, "--json", "--keep", str(tmp_path))
    found = json.loads(done.stdout)
    assert found["findings"] == []
    assert done.returncode == 0, done.stderr
    refused = {name for name, one in found["kinds"].items() if not one["read"]}
    assert refused <= {"defaults", "recording"}, "nothing is behind what only is refused"


@pytest.mark.slow
def test_what_is_planted_is_found_and_kept_once(tmp_path: Path) -> None:
    done = run("-c", PLANTED, str(tmp_path))
    found = json.loads(done.stdout)
    problems = {(one["problem"], one["error"]) for one in found["findings"]}
    assert problems == {
        ("fault", "KeyError"),
        ("abort", "exit code 0"),
        ("abort", "exit code -6"),
        ("slow", "slow"),
        ("large", ""),
        ("large", "MemoryError"),
        ("abort", "SystemExit"),
    }
    assert found["kinds"]["planted"]["inputs"] == 30
    kept = {one.read_text() for one in tmp_path.glob("planted-*")}
    assert kept == {"1", "2", "3", "4", "5", "6", "8"}
    assert done.returncode == 1
