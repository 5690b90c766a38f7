"""Runs of mutmut, watched: it says how far it is, is ended when it hangs, and goes on where it died."""

from __future__ import annotations

import contextlib
import json
import os
import re
import resource
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from mutants.modules import PACKAGE
from mutants.results import outcome
from mutants.workspace import codes, stats_file

ATTEMPTS = 4
"""How often mutmut is started for mutants that are left when it has ended."""

WHEEL = re.compile(r"^[\u2800-\u28ff].*\n?", re.MULTILINE)
"""A line of its progress: a character of Braille, and what is done."""

LOOKED_AT = 30.0
"""How often it is looked at, in [s]."""

HANGS = 600.0
"""It is ended if nothing has come of it for so long, in [s]: its own limit for a mutant is below 150 s."""

MEMORY = 12 << 30
"""Address space of a process, in bytes: a mutant that asks for more fails, and takes no other with it."""


def prepare(workspace: Path, processes: int) -> None:
    """Write all mutants and find out which test reaches which function, without trying a mutant."""
    _watched(workspace, processes, ["none"], ())
    if not stats_file(workspace).exists():
        raise SystemExit(said(workspace))


def try_all(workspace: Path, modules: Sequence[str], processes: int) -> None:
    """Try the mutants that are left in the modules; what is left after all attempts stays without a code."""
    names = [f"{PACKAGE}.*"]
    left = _left(workspace, modules)
    for _ in range(ATTEMPTS):
        if not left:
            return
        _watched(workspace, processes, names, modules)
        before, left = left, _left(workspace, modules)
        if left == before:
            raise SystemExit(f"mutmut tried no mutant:\n{said(workspace)}")
        names = left
    print(f"{len(left)} mutants are left after {ATTEMPTS} attempts", flush=True)


def _watched(workspace: Path, processes: int, names: Sequence[str], modules: Sequence[str]) -> None:
    """Run mutmut on some mutants to its end, or until it hangs."""
    program = Path(sys.executable).with_name("mutmut")
    if not program.exists():
        raise SystemExit(f"found no {program.name} beside {sys.executable}: pip install -e '.[bench]'")
    command = [str(program), "run", "--max-children", str(processes), *names]
    variables = {**os.environ, "CI": "true", "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    with _log(workspace).open("a") as log:
        process = subprocess.Popen(
            command,
            cwd=workspace,
            env=variables,
            stdout=log,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )
        resource.prlimit(process.pid, resource.RLIMIT_AS, (MEMORY, MEMORY))
        try:
            _watch(process, workspace, modules)
        finally:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)  # workers, too, if any is left
            process.wait()


def _watch(process: subprocess.Popen[bytes], workspace: Path, modules: Sequence[str]) -> None:
    """Say how far mutmut is until it ends, or nothing has come of it for too long."""
    start = changed = time.monotonic()
    last: Counter[str] = Counter()
    while True:
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(LOOKED_AT)
            return
        with contextlib.suppress(json.JSONDecodeError):  # just being written
            now = Counter(outcome(code) for module in modules for code in codes(workspace, module).values())
            if now != last:
                changed, last = time.monotonic(), now
                found = ", ".join(f"{count} {what}" for what, count in sorted(now.items()))
                print(f"{time.monotonic() - start:6.0f} s: {found}", flush=True)
        if modules and time.monotonic() - changed > HANGS:
            print(f"nothing for {HANGS:g} s: ended", flush=True)
            return


def _left(workspace: Path, modules: Sequence[str]) -> list[str]:
    """Return the mutants that have no exit code."""
    return [name for module in modules for name, code in codes(workspace, module).items() if code is None]


def _log(workspace: Path) -> Path:
    return workspace / "mutmut.log"


def said(workspace: Path) -> str:
    """Return the last that mutmut printed, without the wheel that it turns while it waits."""
    said = _log(workspace).read_text(encoding="utf-8", errors="replace")
    return WHEEL.sub("", said)[-5000:]
