"""What became of the mutants: by module, and which of them are known to be no change."""

from __future__ import annotations

import contextlib
import signal
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from mutants.modules import inner

EQUIVALENT = Path(__file__).with_name("equivalent.toml")

OUTCOMES = {0: "survived", 1: "killed", 5: "no tests", 33: "no tests", -signal.SIGXCPU: "timeout"}
"""What exit codes of pytest and mutmut mean, and the signal by which mutmut ends what takes too long."""


@dataclass(frozen=True, slots=True)
class Known:
    """A mutant that no test can tell from the original, and why."""

    of: str
    was: str
    becomes: str
    why: str


@dataclass(frozen=True, slots=True)
class Score:
    """What became of the mutants of a module.

    Attributes:
        module: Its dotted name.
        mutants: How many there are.
        codes: The exit code of each that was to be tried, all or a random sample.
        equivalent: Those of the survivors that are known to be no change.
    """

    module: str
    mutants: int
    codes: Mapping[str, int | None]
    equivalent: frozenset[str] = frozenset()

    def names(self, what: str) -> list[str]:
        """Return the mutants with an outcome."""
        return [name for name, code in self.codes.items() if outcome(code) == what]

    def count(self, what: str) -> int:
        """Return how many mutants have an outcome."""
        return len(self.names(what))

    @property
    def tried(self) -> int:
        """How many were tried."""
        return len(self.codes) - self.count("untried")

    @property
    def found(self) -> int:
        """How many tests told from the original: they failed, or took many times as long."""
        return self.count("killed") + self.count("timeout")

    @property
    def meaningful(self) -> int:
        """How many of the tried ones are not known to be no change."""
        return self.tried - len(self.equivalent)

    @property
    def left(self) -> list[str]:
        """The survivors that are not known to be no change."""
        return [name for name in self.names("survived") if name not in self.equivalent]


def outcome(code: int | None) -> str:
    """Return what an exit code says: what broke, as by a segmentation fault, was not killed by a test."""
    return "untried" if code is None else OUTCOMES.get(code, "broken")


def diffs(workspace: Path, names: Iterable[str]) -> dict[str, str]:
    """Return what each mutant changes: its lines that begin with - or +."""
    from mutmut.mutation.diff_apply import get_diff_for_mutant

    found = {}
    with contextlib.chdir(workspace):
        for name in names:
            diff = get_diff_for_mutant(name, path=name.rpartition(".")[0].replace(".", "/") + ".py")
            found[name] = "\n".join(line for line in diff.splitlines()[2:] if line[:1] in {"-", "+"})
    return found


def known_mutants(file: Path = EQUIVALENT) -> list[Known]:
    """Return the mutants that are known to be no change."""
    return [Known(**one) for one in tomllib.loads(file.read_text(encoding="utf-8"))["mutant"]]


def equivalent(changes: Mapping[str, str], known: Sequence[Known]) -> frozenset[str]:
    """Return those of some mutants that are known, by their function and the lines that they change."""
    allowed = {(one.of, one.was, one.becomes) for one in known}
    return frozenset(
        name
        for name, diff in changes.items()
        if (function(name), _lines(diff, "-"), _lines(diff, "+")) in allowed
    )


def stale(changes: Mapping[str, str], known: Sequence[Known], scores: Iterable[Score]) -> list[Known]:
    """Return those known mutants that are none any more, of functions whose every mutant was tried."""
    whole = [score.module for score in scores if score.tried == score.mutants]
    found = {(function(name), _lines(diff, "-"), _lines(diff, "+")) for name, diff in changes.items()}
    return [
        one
        for one in known
        if (one.of, one.was, one.becomes) not in found
        and any(one.of.startswith(f"{inner(module)}.") for module in whole)
    ]


def function(name: str) -> str:
    """Return the function that a mutant is of, inside the package: `chains.chain.Chain.placed`."""
    module, _, mangled = name.partition("__mutmut_")[0].rpartition(".")
    return f"{inner(module)}.{mangled.removeprefix('x_').removeprefix('xǁ').replace('ǁ', '.')}"


def _lines(diff: str, sign: str) -> str:
    """Return the removed or the added lines as one."""
    return " ".join(line[1:].strip() for line in diff.splitlines() if line.startswith(sign))
