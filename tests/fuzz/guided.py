"""Inputs that reach new code are changed further: atheris counts it, the changes are those of the kind."""

from __future__ import annotations

import os
import time
from multiprocessing.connection import Connection, wait
from pathlib import Path
from random import Random

from tests.fuzz.byte_mutators import LARGEST
from tests.fuzz.campaign import Findings
from tests.fuzz.corpus import Specimen
from tests.fuzz.examine import ABORT, AREAS, SLOW, Outcome, changed
from tests.fuzz.kinds import BY_NAME, Kind, warm
from tests.fuzz.workers import FORK, answer, last_words, settle


def run_guided(
    kinds: list[Kind], findings: Findings, folder: Path, made: Path, seed: int, seconds: float
) -> None:
    """Read inputs of each kind for the same time, one process after the other."""
    for kind in kinds:
        end = time.monotonic() + seconds / len(kinds)
        own = folder / kind.name
        own.mkdir()
        while time.monotonic() < end:
            _one(kind, findings, own, made, (seed, end))
            seed += 1


def _one(kind: Kind, findings: Findings, folder: Path, made: Path, drawn: tuple[int, float]) -> None:
    """Read inputs of a kind until a time is over, or one of them ends the process or does not return."""
    pipe, end = FORK.Pipe()
    process = FORK.Process(target=explore, args=(end, kind.name, folder, made, drawn), daemon=True)
    process.start()
    end.close()
    number, name, open_since = 0, "", 0.0
    problem, why = ABORT, ""
    while True:
        if not wait([pipe], timeout=1.0):
            if open_since and time.monotonic() - open_since > findings.limit:
                problem, why = SLOW, "did not return"
                break
            continue
        try:
            number, name, outcome = pipe.recv()
        except (EOFError, OSError):
            break
        open_since = 0.0 if outcome else time.monotonic()
        if outcome:
            findings.keep(kind.name, number, folder / name, outcome)
    process.kill()
    process.join()
    pipe.close()
    if open_since:
        spent = time.monotonic() - open_since
        found = Outcome(spent, 0, problem, f"exit code {process.exitcode}", "", f"{last_words(folder)}{why}")
        findings.keep(kind.name, number, folder / name, found)


def explore(pipe: Connection, name: str, folder: Path, made: Path, drawn: tuple[int, float]) -> None:
    """Let atheris choose inputs: what the process does.

    An input of atheris is the name of a file, NUL, and what stands in the file.
    """
    settle(folder)
    import atheris  # type: ignore[import-not-found, import-untyped, unused-ignore]

    with atheris.instrument_imports(include=list(AREAS)):
        warm()
    kind, count = BY_NAME[name], 0
    specimens = list(kind.specimens(made))
    known = folder / "known"
    known.mkdir(exist_ok=True)
    for i, one in enumerate(specimens):
        (known / str(i)).write_bytes(_joined(one))

    def read(data: bytes) -> None:
        nonlocal count
        given = _parted(data, specimens)
        answer(pipe, kind, given, count, folder, made)
        count += 1

    def mutate(data: bytes, largest: int, seed: int) -> bytes:
        return _joined(changed(kind, specimens, _parted(data, specimens), Random(seed)))[:largest]

    seed, end = drawn
    flags = {
        "seed": seed + 1,
        "max_total_time": max(1, int(end - time.monotonic())),  # imports took some of it
        "max_len": LARGEST,
        "timeout": 10**6,  # who asked for the inputs looks at the clock
        "rss_limit_mb": 0,
        "len_control": 0,
    }
    words = [f"-{key}={value}" for key, value in flags.items()]
    atheris.Setup(["fuzz", str(known), *words, "-detect_leaks=0"], read, custom_mutator=mutate)
    atheris.Fuzz()
    os._exit(0)


def _joined(given: Specimen) -> bytes:
    return given.name.encode() + b"\0" + given.data


def _parted(data: bytes, specimens: list[Specimen]) -> Specimen:
    """Return what atheris chose as a file; its first choice is nothing."""
    name, _, content = data.partition(b"\0")
    names = {one.name for one in specimens}
    text = name.decode("latin-1")
    return Specimen(text if text in names else specimens[0].name, content)
