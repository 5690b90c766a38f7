"""Would a test fail if the code were wrong? Mutation score of the models, by mutmut.

python benchmarks/mutation.py [--only PATTERN ...] [--tests PATH ...] [--sample N] [--seed S] [--survivors]

Each mutant is one small change of a function (an operator, a number, an argument left out, ...). It is
killed if a quick test that reaches the function fails then, or hangs; else it survives. What survives and
cannot be told from the original by any test stands in equivalent_mutants.toml, with the reason.
"""

from __future__ import annotations

import argparse
import contextlib
import fnmatch
import itertools
import json
import math
import os
import random
import shutil
import subprocess
import sys
import tempfile
import time
import tomllib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from pairs import Bound, machine, write_results

ROOT = Path(__file__).parents[1]
PACKAGE = "urmpipe_models"
EQUIVALENT = Path(__file__).with_name("equivalent_mutants.toml")

MODELS = frozenset(
    {
        "repolarizer",
        "in_between",
        "delta",
        "elementwise",
        "transform",
        "orientation",
        "continuity",
        "kinematics",
        "frames",
        "motion",
        "chain",
        "screws",
        "singularity",
        "geometric_model",
        "articulated_6r",
        "urm",
        "dh",
        "drive",
        "drive_controller",
        "set_point",
    }
)
"""The models and the repolarizer, by the last part of their names: every mutant of them is tried."""

TESTS = ("tests/models", "tests/papers")
BUDGET = 10.0
"""For how long tests of other modules may run on a mutant, in [s]: the quickest that reach it."""

PROJECT = """\
[tool.pytest.ini_options]
addopts = ["--import-mode=importlib", "-m", "not slow"]
pythonpath = ["tests/shared"]
markers = ["slow: left out here"]

[tool.mutmut]
source_paths = ["{package}"]
only_mutate = {files}
also_copy = ["conftest.py", "docs"]
pytest_add_cli_args = ["-p", "no:cacheprovider"]
pytest_add_cli_args_test_selection = {tests}
process_isolation = "forkserver"  # a worker inherits imports, but nothing that tests have cached
timeout_constant = 2.0
timeout_multiplier = 5.0
use_git_change_detection = false
"""


@dataclass(slots=True)
class Score:
    """What became of the mutants of a module.

    Attributes:
        module: Its dotted name.
        mutants: How many there are.
        tried: How many of them were tried, all or a random sample.
        killed: Because a test failed, or could not even be collected.
        timeout: Because tests took many times as long as on the original.
        no_tests: Because no quick test reaches the function.
        survivors: The names of those that are left.
        equivalent: How many of the survivors are known to be no change.
    """

    module: str
    mutants: int = 0
    tried: int = 0
    killed: int = 0
    timeout: int = 0
    no_tests: int = 0
    survivors: list[str] = field(default_factory=list)
    equivalent: int = 0

    @property
    def found(self) -> int:
        """How many tests told from the original."""
        return self.killed + self.timeout

    @property
    def share(self) -> float:
        """Share of the tried mutants, without the equivalent ones, that tests told from the original."""
        return self.found / max(self.tried - self.equivalent, 1)


@dataclass(frozen=True, slots=True)
class Known:
    """A mutant that no test can tell from the original, and why."""

    of: str
    was: str
    becomes: str
    why: str


def interval(found: int, tried: int) -> tuple[float, float]:
    """Return the 95 % interval of a share of which a sample is known (Wilson 1927)."""
    if not tried:
        return 0.0, 1.0
    z, p = 1.96, found / tried
    middle = p + z * z / (2 * tried)
    half = z * math.sqrt(p * (1 - p) / tried + z * z / (4 * tried * tried))
    return (middle - half) / (1 + z * z / tried), (middle + half) / (1 + z * z / tried)


def modules(patterns: Sequence[str]) -> list[str]:
    """Return the dotted names of the modules that match one of the patterns, by name or by its last part."""
    files = sorted((ROOT / "models" / PACKAGE).rglob("*.py"))
    names = [".".join(file.relative_to(ROOT / "models").with_suffix("").parts) for file in files]
    return [
        name
        for name in names
        if not name.endswith("__init__")
        and any(fnmatch.fnmatch(name, one) or fnmatch.fnmatch(stem(name), one) for one in patterns)
    ]


def stem(module: str) -> str:
    """Return the last part of a dotted name."""
    return module.rpartition(".")[2]


def is_model(module: str) -> bool:
    """Tell whether a module is one of those whose every mutant is tried."""
    return stem(module) in MODELS


def assemble(workspace: Path, chosen: Sequence[str], tests: Sequence[str]) -> None:
    """Lay out the package and its tests as mutmut expects them: the package beside the tests."""
    shutil.copytree(ROOT / "models" / PACKAGE, workspace / PACKAGE)
    for folder in ("tests", "docs"):
        shutil.copytree(ROOT / folder, workspace / folder, ignore=shutil.ignore_patterns("__pycache__"))
    (workspace / "shared").symlink_to(ROOT.parent / "shared")  # may be missing: its tests say so then
    files = [name.replace(".", "/") + ".py" for name in chosen]
    settings = PROJECT.format(package=PACKAGE, files=json.dumps(files), tests=json.dumps(list(tests)))
    (workspace / "pyproject.toml").write_text(settings)
    shutil.copy(Path(__file__).with_name("mutants_conftest.py"), workspace / "conftest.py")


def mutmut(workspace: Path, processes: int, pattern: str) -> str:
    """Run mutmut on the mutants of a pattern, and return what it printed."""
    command = [
        str(Path(sys.executable).with_name("mutmut")),
        "run",
        "--max-children",
        str(processes),
        pattern,
    ]
    variables = {**os.environ, "CI": "true", "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    with (workspace / "mutmut.log").open("a+") as log:
        start = log.tell()
        subprocess.run(
            command, cwd=workspace, env=variables, stdout=log, stderr=subprocess.STDOUT, check=False
        )
        log.seek(start)
        return log.read()


def prepare(workspace: Path, processes: int) -> None:
    """Write all mutants and find out which test reaches which function, without trying a mutant."""
    said = mutmut(workspace, processes, "none")
    if not (workspace / "mutants" / "mutmut-stats.json").exists():
        raise SystemExit(said[-5000:])


def results_file(workspace: Path, module: str) -> Path:
    """Return the file in which mutmut keeps the exit code of each mutant of a module."""
    return workspace / "mutants" / (module.replace(".", "/") + ".py.meta")


def draw(workspace: Path, module: str, sample: int | None, seed: int) -> int:
    """Leave only a random sample of a module's mutants to be tried, or all; return how many there were."""
    file = results_file(workspace, module)
    kept = json.loads(file.read_text())
    names = sorted(kept["exit_code_by_key"])
    if sample is not None and len(names) > sample:
        names = random.Random(f"{seed} {stem(module)}").sample(names, sample)
    count = len(kept["exit_code_by_key"])
    kept["exit_code_by_key"] = dict.fromkeys(names)
    file.write_text(json.dumps(kept))
    return count


def limit_tests(workspace: Path) -> None:
    """Leave each function the tests of its module's own files, and of the others the quickest."""
    file = workspace / "mutants" / "mutmut-stats.json"
    stats = json.loads(file.read_text())
    seconds: dict[str, float] = stats["duration_by_test"]
    reached: dict[str, list[str]] = stats["tests_by_mangled_function_name"]
    for function, tests in reached.items():
        own = [test for test in tests if f"/test_{stem(function.rpartition('.')[0])}" in test]
        others = sorted(set(tests) - set(own), key=lambda test: (seconds[test], test))
        used = itertools.accumulate(seconds[test] for test in others)
        reached[function] = own + [test for test, sum_of in zip(others, used, strict=True) if sum_of < BUDGET]
    file.write_text(json.dumps(stats))


def read_score(workspace: Path, module: str, mutants: int) -> Score:
    """Return what became of a module's mutants, by the exit code of pytest or the signal that ended it."""
    codes: dict[str, int | None] = json.loads(results_file(workspace, module).read_text())["exit_code_by_key"]
    score = Score(module, mutants, len(codes))
    for name, code in codes.items():
        if code == 0:
            score.survivors.append(name)
        elif code in {33, 5}:
            score.no_tests += 1
        elif code in {-24, 24, 36, 152}:  # SIGXCPU, by which mutmut ends what takes too long
            score.timeout += 1
        elif code is None:
            raise SystemExit(f"{name} was not tried: see {workspace / 'mutmut.log'}")
        else:
            score.killed += 1
    return score


def diffs(workspace: Path, names: Iterable[str]) -> dict[str, str]:
    """Return what each mutant changes, as a unified diff."""
    from mutmut.mutation.diff_apply import get_diff_for_mutant

    with contextlib.chdir(workspace):
        return {
            name: get_diff_for_mutant(name, path=name.rpartition(".")[0].replace(".", "/") + ".py")
            for name in names
        }


def known_mutants() -> list[Known]:
    """Return the mutants that are known to be no change."""
    return [Known(**one) for one in tomllib.loads(EQUIVALENT.read_text(encoding="utf-8"))["mutant"]]


def is_known(name: str, diff: str, known: Iterable[Known]) -> bool:
    """Tell whether a survivor is one of the known ones: by its module, its function and the changed line."""
    module, _, function = name.partition("__mutmut_")[0].rpartition(".")
    of = f"{stem(module)}.{function.removeprefix('x_').lstrip('xǁ').replace('ǁ', '.')}"
    lines = diff.splitlines()[2:]
    was = " ".join(line[1:].strip() for line in lines if line.startswith("-"))
    becomes = " ".join(line[1:].strip() for line in lines if line.startswith("+"))
    return any((one.of, one.was, one.becomes) == (of, was, becomes) for one in known)


def row(score: Score) -> str:
    """Return the line of the table."""
    low, high = interval(score.found, score.tried - score.equivalent)
    whole = score.tried == score.mutants
    cells = (
        score.module.removeprefix(f"{PACKAGE}."),
        score.mutants,
        "all" if whole else score.tried,
        score.killed,
        score.timeout,
        score.no_tests,
        len(score.survivors),
        score.equivalent,
        f"{100 * score.share:.1f} %" + ("" if whole else f" ({100 * low:.0f} to {100 * high:.0f} %)"),
    )
    return f"| {' | '.join(map(str, cells))} |"


def total(scores: Sequence[Score]) -> float:
    """Return the share of all mutants that tests find, each module by how many mutants it has."""
    return sum(one.mutants * one.share for one in scores) / max(sum(one.mutants for one in scores), 1)


def table(title: str, scores: Sequence[Score]) -> list[str]:
    """Return a Markdown table, the lowest score first."""
    if not scores:
        return []
    return [
        "", f"## {title}: {100 * total(scores):.1f} %", "",
        "| module | mutants | tried | killed | timeout | no tests | survived | of these equivalent | score |",
        "|---|---|---|---|---|---|---|---|---|",
        *(row(one) for one in sorted(scores, key=lambda one: (one.share, one.module))),
    ]  # fmt: skip


def left_over(scores: Sequence[Score], shown: dict[str, str], known: Sequence[Known]) -> list[str]:
    """Return the survivors that are not known to be equivalent, each with what it changes."""
    lines = []
    for score in scores:
        for name in score.survivors:
            if not is_known(name, shown[name], known):
                changes = [line for line in shown[name].splitlines()[2:] if line[:1] in {"+", "-"}]
                lines += [f"{name}", *(f"    {line}" for line in changes)]
    return lines


def arguments() -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--only", nargs="+", metavar="PATTERN", help="modules, as repolarizer or '*.inverse.*'"
    )
    parser.add_argument(
        "--tests", nargs="+", default=TESTS, metavar="PATH", help="tests to hold them against"
    )
    parser.add_argument(
        "--sample", type=int, default=25, help="mutants tried of a module that is not a model"
    )
    parser.add_argument("--models", type=int, metavar="N", help="mutants tried of a model (default: all)")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--survivors", action="store_true", help="print what each survivor changes")
    return parser.parse_args()


def main() -> None:
    """Try the mutants, and keep the results if all modules were asked."""
    options = arguments()
    chosen = modules(options.only or ["*"])
    start = time.perf_counter()
    with tempfile.TemporaryDirectory(prefix="mutation_") as folder:
        workspace = Path(folder)
        assemble(workspace, chosen, options.tests)
        prepare(workspace, options.processes)
        chosen = [name for name in chosen if results_file(workspace, name).exists()]
        counts = {
            name: draw(workspace, name, options.models if is_model(name) else options.sample, options.seed)
            for name in chosen
        }
        limit_tests(workspace)
        print(f"{sum(counts.values())} mutants, prepared in {time.perf_counter() - start:.0f} s", flush=True)
        mutmut(workspace, options.processes, f"{PACKAGE}.*")
        scores = [read_score(workspace, name, counts[name]) for name in chosen if counts[name]]
        shown = diffs(workspace, [name for score in scores for name in score.survivors])
    known = known_mutants()
    for score in scores:
        score.equivalent = sum(is_known(name, shown[name], known) for name in score.survivors)
    report(options, scores, left_over(scores, shown, known), time.perf_counter() - start)


def head(options: argparse.Namespace, seconds: float) -> list[str]:
    """Return what the results begin with: machine, versions and method."""
    return [
        f"# Mutation score of {PACKAGE}: would a test fail if the code were wrong?",
        "",
        *machine("mutmut", "pytest", "hypothesis"),
        "A mutant is one small change of a function. It is killed if a test fails that reaches the",
        "function, or takes many times as long (timeout). The score is the share that is found so, without",
        "mutants that are no change, each with its reason in equivalent_mutants.toml. mutmut ",
        "changes neither decorated",
        "functions (properties, cached ones) nor what stands outside of functions, nor docstrings.",
        "",
        f"Tests: of {' and '.join(options.tests)} those of the module's own files, of the others the",
        f"quickest that reach the function, {BUDGET:g} s of them; none that is slow; with the cases that",
        f"Hypothesis draws for CI. Samples are random (seed {options.seed}), with the 95 % interval. It took",
        f"{seconds / 60:.0f} minutes on {options.processes} processes.",
    ]


def report(options: argparse.Namespace, scores: list[Score], left: list[str], seconds: float) -> None:
    """Print the tables, and keep them if no module was left out."""
    models = [score for score in scores if is_model(score.module)]
    others = [score for score in scores if not is_model(score.module)]
    lines = [
        *head(options, seconds),
        *table("Models and repolarizer", models),
        *table("All other modules, by samples", others),
    ]
    if options.survivors:
        print("\n".join(left))
    if options.only:
        print("\n".join(lines))
        return
    bounds = [Bound("score of models and repolarizer, %", 100 * total(models), least=90.0)]
    write_results("mutation", lines, bounds)


if __name__ == "__main__":
    main()
