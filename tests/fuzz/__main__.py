"""Read changed files of every kind, and tell which are not answered as promised.

    python -m tests.fuzz --minutes 5
    python -m tests.fuzz --inputs 300 --kind robot --kind urdf --seed 7
    python -m tests.fuzz --again FOLDER

Promised of every input below 1 MB: no fault line, no end of the process, 20 s and 1 GB at most.
Exit codes: 0 all was, 1 something was not, 2 usage.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tests.fuzz.campaign import Findings
    from tests.fuzz.kinds import Kind
    from tests.fuzz.workers import Batch


def main() -> int:
    """Run what the command line asks for and return the exit code."""
    asked = arguments()
    os.environ |= {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "ARROW_DEFAULT_MEMORY_POOL": "system"}
    keep = Path(asked.keep or tempfile.mkdtemp(prefix="urmpipe-fuzz-")).resolve()
    with tempfile.TemporaryDirectory(prefix="urmpipe-fuzz-", ignore_cleanup_errors=True) as name:
        folder = Path(name)
        os.environ["URMPIPE_CACHE"] = str(folder / "cache")
        findings = fuzz(asked, keep, folder)
    print(json.dumps(findings.to_dict(), indent=1) if asked.json else findings.table())
    if findings.seen:
        print(f"{len(findings.seen)} kinds of findings are kept in {keep}", file=sys.stderr)
    return 1 if findings.seen else 0


def arguments() -> argparse.Namespace:
    """Return what the command line says."""
    from tests.fuzz.kinds import KINDS

    parser = argparse.ArgumentParser(
        prog="python -m tests.fuzz", description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    size = parser.add_mutually_exclusive_group(required=True)
    size.add_argument("--minutes", type=float, help="for how long; every kind has the same time")
    size.add_argument(
        "--inputs", type=int, help="how many of a kind whose share is 1; others by their shares"
    )
    size.add_argument("--again", metavar="FOLDER", type=Path, help="read what was kept in a folder again")
    parser.add_argument("--seed", type=int, default=0, help="the same seed, the same inputs (default 0)")
    parser.add_argument(
        "--kind", action="append", choices=[one.name for one in KINDS], help="only this; may be repeated"
    )
    parser.add_argument(
        "--workers", type=int, default=os.cpu_count() or 1, help="processes (default: as many as processors)"
    )
    parser.add_argument(
        "--limit", type=float, default=20.0, help="time in s that an input may take (default 20)"
    )
    parser.add_argument("--keep", metavar="FOLDER", help="where findings are kept (default: a new folder)")
    parser.add_argument(
        "--guided", action="store_true", help="keep inputs that reach new code, by atheris (extra `fuzz`)"
    )
    parser.add_argument("--json", action="store_true", help="print JSON instead of a table")
    asked = parser.parse_args()
    if asked.guided and (asked.minutes is None or find_spec("atheris") is None):
        parser.error('--guided is with --minutes, and needs atheris: pip install "urmpipe[fuzz]"')
    return asked


def fuzz(asked: argparse.Namespace, keep: Path, folder: Path) -> Findings:
    """Return what is found."""
    from tests.fuzz.campaign import Findings, made_in, run_all
    from tests.fuzz.guided import run_guided
    from tests.fuzz.kinds import KINDS, warm

    if not asked.guided:  # else atheris must see the imports
        warm()
    wanted = asked.kind or [one.name for one in KINDS if one.share or asked.again]
    kinds = [one for one in KINDS if one.name in wanted]
    findings = Findings(keep, asked.seed, asked.limit)
    made = made_in(folder / "made")
    if asked.guided:
        run_guided(kinds, findings, folder, made, asked.seed, 60.0 * asked.minutes)
    else:
        run_all(_batches(asked, kinds, findings), findings, folder, made, asked.seed, asked.workers)
    return findings


def _batches(asked: argparse.Namespace, kinds: Sequence[Kind], findings: Findings) -> Iterator[Batch]:
    """Return which inputs are read."""
    from tests.fuzz.campaign import kept_in, shared_out, until

    if asked.again:
        return kept_in(asked.again, [one.name for one in kinds])
    if asked.inputs:
        return shared_out({one.name: max(1, round(asked.inputs * (one.share or 1.0))) for one in kinds})
    return until(time.monotonic() + 60.0 * asked.minutes, [one.name for one in kinds], findings)


if __name__ == "__main__":
    sys.exit(main())
