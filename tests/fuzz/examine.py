"""One input: read, and held against what is promised of every input."""

from __future__ import annotations

import time
import traceback
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from random import Random
from typing import Any

from tests.fuzz.byte_mutators import mutate
from tests.fuzz.corpus import Specimen
from tests.fuzz.kinds import Kind

from urmpipe.answers import OWN_ERROR, error_to_findings

FAULT, ABORT, SLOW, LARGE = "fault", "abort", "slow", "large"
"""What can be wrong: an error that is none of urmpipe's, an end of the process, too long, too much memory."""

MEMORY = 10**9
"""Bytes that the process may use at most while it reads an input below 1 MB."""

AREAS = ("urmpipe", "urmpipe_models", "urmpipe_pipeline", "urmpipe_fmus", "urmpipe_datasets")
"""The packages of ours, by which places in a traceback are known."""


@dataclass(frozen=True)
class Outcome:
    """What came of an input.

    Attributes:
        seconds: How long it took.
        peak: The most memory that the process had meanwhile in bytes; 0 where the system does not tell.
        problem: What is wrong; empty if nothing is.
        error: The type of the error.
        where: The innermost places of ours in its traceback.
        text: The traceback.
    """

    seconds: float
    peak: int = 0
    problem: str = ""
    error: str = ""
    where: str = ""
    text: str = ""

    def to_dict(self) -> dict[str, Any]:
        """Return all of it as JSON has it."""
        return asdict(self)


def specimen_of(kind: Kind, specimens: list[Specimen], seed: int, number: int) -> Specimen:
    """Return the input of a number: the same one for the same specimens, seed and number."""
    rng = Random(f"{seed} {kind.name} {number}")
    chosen = rng.choice(specimens)
    return changed(kind, specimens, chosen, rng)


def changed(kind: Kind, specimens: list[Specimen], chosen: Specimen, rng: Random) -> Specimen:
    """Return a specimen after some changes; the others of its kind may be mixed in."""
    others = [one.data for one in specimens if one.name.rpartition(".")[2] == chosen.name.rpartition(".")[2]]
    return Specimen(chosen.name, mutate(chosen.data, rng, others or [chosen.data], kind.mutators))


def examine(kind: Kind, path: Path, made: Path, rng: Random) -> Outcome:
    """Read a file as its kind is read, and return what came of it."""
    _reset_peak()
    error: BaseException | None = None
    begin = time.perf_counter()
    try:
        kind.read(path, made, rng)
    except BaseException as raised:  # what ends a process is a finding, too
        error = raised
    seconds, peak = time.perf_counter() - begin, _peak()
    if error is None:
        return Outcome(seconds, peak, LARGE if peak > MEMORY else "")
    try:
        lines = [str(one) for one in error_to_findings(error)]
    except Exception as second:  # an error that cannot be told
        lines, error = [OWN_ERROR], second
    text = "".join(traceback.format_exception(error))[-20_000:]
    problem = _problem(error, lines, peak)
    return Outcome(seconds, peak, problem, type(error).__name__, _where(error), text)


def _problem(error: BaseException, lines: list[str], peak: int) -> str:
    """Return what is wrong with an error and its lines; empty if nothing is."""
    if not isinstance(error, Exception):  # the command line would end with a traceback, as of a panic in Rust
        return ABORT
    if any(OWN_ERROR in line or not line.isprintable() for line in lines):
        return FAULT
    return LARGE if isinstance(error, MemoryError) or peak > MEMORY else ""


def _where(error: BaseException) -> str:
    """Return the innermost three places of ours."""
    frames = traceback.extract_tb(error.__traceback__)
    ours = [one for one in frames if any(f"/{area}/" in one.filename for area in AREAS)]
    return " < ".join(f"{_short(one.filename)}:{one.lineno} {one.name}" for one in reversed(ours[-3:]))


def _short(name: str) -> str:
    """Return a file by its package."""
    parts = Path(name).parts
    return "/".join(parts[next(i for i, part in enumerate(parts) if part in AREAS) :])


def _reset_peak() -> None:
    """Let the system count the peak of memory anew, where it can."""
    with suppress(OSError):
        Path("/proc/self/clear_refs").write_text("5")


def _peak() -> int:
    """Return the peak of memory in bytes since it is counted."""
    try:
        lines = Path("/proc/self/status").read_text().splitlines()
    except OSError:
        return 0
    return next((int(line.split()[1]) * 1024 for line in lines if line.startswith("VmHWM")), 0)
