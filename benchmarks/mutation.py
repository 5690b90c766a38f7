"""Would a test fail if the code were wrong? Mutation score of the models, by mutmut.

python benchmarks/mutation.py [--only PATTERN ...] [--tests PATH ...] [--models N] [--sample N] [--survivors]

Each mutant is one small change of a function (an operator, a number, an argument left out, ...). It is
killed if a quick test that reaches the function fails then, or takes many times as long; else it survives.
What survives and cannot be told from the original by any test stands in mutants/equivalent.toml, with the
reason. Results are kept only if all modules were asked, with all tests.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from textwrap import dedent, wrap

from mutants.modules import PACKAGE, is_model, modules
from mutants.results import Score, diffs, equivalent, known_mutants, stale
from mutants.runner import prepare, try_all
from mutants.tables import survivors, table, total, unclear
from mutants.workspace import BUDGET, assemble, codes, codes_file, draw, limit_tests
from pairs import Bound, machine, write_results

ROOT = Path(__file__).parents[1]
TESTS = ("tests/models", "tests/papers")


def arguments() -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--only", nargs="+", metavar="PATTERN", help="as repolarizer or 'inverse.*'")
    parser.add_argument("--tests", nargs="+", metavar="PATH", help="tests to hold them against")
    parser.add_argument(
        "--models", type=int, default=60, metavar="N", help="mutants tried of a model; 0: all"
    )
    parser.add_argument("--sample", type=int, default=5, metavar="N", help="and of any other module")
    parser.add_argument("--seed", type=int, default=1, help="of the samples")
    parser.add_argument("--processes", type=int, default=2, help="mutants tried side by side")
    parser.add_argument("--survivors", action="store_true", help="print what each survivor changes")
    return parser.parse_args()


def main() -> None:
    """Try the mutants, and keep the results if all modules were asked."""
    options = arguments()
    start = time.perf_counter()
    with tempfile.TemporaryDirectory(prefix="mutation_", ignore_cleanup_errors=True) as folder:
        scores, changes = tried(Path(folder), options)
    known = known_mutants()
    for one in stale(changes, known, scores):
        print(f"equivalent.toml: {one.of} has no such survivor: {one.becomes}")
    if options.survivors:
        print("\n".join(survivors(scores, changes)))
    lines = [*head(options, time.perf_counter() - start), *tables(scores)]
    if options.only or options.tests:
        print("\n".join(lines))
        return
    found = total([score for score in scores if is_model(score.module)]).found
    write_results("mutation", lines, [Bound("score of models and repolarizer, %", 100 * found, least=90.0)])


def tried(workspace: Path, options: argparse.Namespace) -> tuple[list[Score], dict[str, str]]:
    """Try the mutants, and return what became of them, and what each survivor changes."""
    chosen = modules(ROOT / "models", options.only or ["*"])
    assemble(ROOT, workspace, chosen, options.tests or TESTS)
    start = time.perf_counter()
    prepare(workspace, options.processes)
    chosen = [name for name in chosen if codes_file(workspace, name).exists() and codes(workspace, name)]
    sizes = {name: (options.models or None) if is_model(name) else options.sample for name in chosen}
    counts = {name: draw(workspace, name, sizes[name], options.seed) for name in chosen}
    asked = sum(len(codes(workspace, name)) for name in chosen)
    limit_tests(workspace)
    seconds = time.perf_counter() - start
    print(f"{sum(counts.values())} mutants, {asked} to be tried; prepared in {seconds:.0f} s", flush=True)
    try_all(workspace, chosen, options.processes)
    found = {name: Score(name, counts[name], codes(workspace, name)) for name in chosen}
    changes = diffs(workspace, [name for score in found.values() for name in score.names("survived")])
    same = equivalent(changes, known_mutants())
    scores = [
        Score(score.module, score.mutants, score.codes, same.intersection(score.codes))
        for score in found.values()
    ]
    return scores, changes


def tables(scores: Sequence[Score]) -> list[str]:
    """Return the tables, models first, and what is neither killed nor survived."""
    models = [score for score in scores if is_model(score.module)]
    others = [score for score in scores if not is_model(score.module)]
    return [
        *table("Models and repolarizer", models),
        *table("Inverse, readers and helpers", others),
        *unclear(scores),
    ]


def head(options: argparse.Namespace, seconds: float) -> list[str]:
    """Return what the results begin with: machine, versions and method."""
    what = """
        A mutant is one small change of a function. It is killed if a test fails that reaches the function, or
        takes many times as long (timeout). `raw` is the share that is found so, `score` the same without
        mutants that are no change, each with its reason in mutants/equivalent.toml. mutmut changes neither
        decorated functions (properties, cached ones) nor what stands outside of functions, nor docstrings;
        lines that begin an error or hold nothing but its text are left out too.
        """
    how = f"""
        Tests: {" and ".join(options.tests or TESTS)}, of those that reach the function {BUDGET:g} s of them,
        those of files that import its module first, and the quickest first; none that is marked slow; with
        the cases that Hypothesis draws for CI. Samples are random (seed {options.seed}), with the 95 %
        interval. It took {seconds / 60:.0f} minutes on {options.processes} processes.
        """
    method = [line for text in (what, how) for line in (*wrap(dedent(text).strip(), 105), "")]
    title = f"# Mutation score of {PACKAGE}: would a test fail if the code were wrong?"
    return [title, "", *machine("mutmut", "pytest", "hypothesis"), *method[:-1]]


if __name__ == "__main__":
    main()
