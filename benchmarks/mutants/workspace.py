"""The folder that mutmut works in: the package beside its tests, and what it keeps of them."""

from __future__ import annotations

import itertools
import json
import random
import shutil
from collections.abc import Sequence
from pathlib import Path

from mutants.modules import PACKAGE

BUDGET = 10.0
"""For how long tests may run on a mutant, in [s]."""

ERROR_TEXTS = r'^\s*(raise \w+\(|yield f?"|f".*"[,)]*$)'
"""Lines that are left as they are: those that begin an error or hold nothing but its text."""

PROJECT = """\
[tool.pytest.ini_options]
addopts = ["--import-mode=importlib", "-m", "not slow"]
pythonpath = ["tests/shared"]
markers = ["slow: left out here"]

[tool.mutmut]
source_paths = ["{package}"]
only_mutate = {files}
do_not_mutate_patterns = [{error_texts}]
also_copy = ["conftest.py", "docs"]
pytest_add_cli_args = ["-p", "no:cacheprovider"]
pytest_add_cli_args_test_selection = {tests}
process_isolation = "forkserver"  # a worker inherits imports, but nothing that tests have cached
timeout_constant = 2.0
timeout_multiplier = 5.0
track_dependencies = false
use_git_change_detection = false
"""


def assemble(root: Path, workspace: Path, chosen: Sequence[str], tests: Sequence[str]) -> None:
    """Lay out the package and its tests as mutmut expects them: the package beside the tests."""
    shutil.copytree(root / "models" / PACKAGE, workspace / PACKAGE)
    for folder in ("tests", "docs"):
        shutil.copytree(root / folder, workspace / folder, ignore=shutil.ignore_patterns("__pycache__"))
    (workspace / "shared").symlink_to(root.parent / "shared")  # may be missing: its tests say so then
    settings = PROJECT.format(
        package=PACKAGE,
        files=json.dumps([_path(name) for name in chosen]),
        error_texts=json.dumps(ERROR_TEXTS),
        tests=json.dumps(list(tests)),
    )
    (workspace / "pyproject.toml").write_text(settings)
    shutil.copy(Path(__file__).with_name("run_conftest.py"), workspace / "conftest.py")


def stats_file(workspace: Path) -> Path:
    """Return the file in which mutmut keeps which test reaches which function, and how long it takes."""
    return workspace / "mutants" / "mutmut-stats.json"


def codes_file(workspace: Path, module: str) -> Path:
    """Return the file in which mutmut keeps the exit code of each mutant of a module."""
    return workspace / "mutants" / f"{_path(module)}.meta"


def codes(workspace: Path, module: str) -> dict[str, int | None]:
    """Return the exit code of each mutant of a module, none of those that were not tried."""
    kept: dict[str, int | None] = json.loads(codes_file(workspace, module).read_text())["exit_code_by_key"]
    return kept


def draw(workspace: Path, module: str, sample: int | None, seed: int) -> int:
    """Leave only a random sample of a module's mutants to be tried, or all; return how many there were."""
    file = codes_file(workspace, module)
    kept = json.loads(file.read_text())
    names = sorted(kept["exit_code_by_key"])
    count = len(names)
    if sample is not None and count > sample:
        names = random.Random(f"{seed} {module}").sample(names, sample)
    kept["exit_code_by_key"] = dict.fromkeys(names)
    file.write_text(json.dumps(kept))
    return count


def limit_tests(workspace: Path) -> None:
    """Leave each function the tests that suit it best, as long as they fit in the budget."""
    file = stats_file(workspace)
    stats = json.loads(file.read_text())
    seconds: dict[str, float] = stats["duration_by_test"]
    texts = {name: (workspace / name).read_text() for name in {test.partition("::")[0] for test in seconds}}
    reached: dict[str, list[str]] = stats["tests_by_mangled_function_name"]
    for function, tests in reached.items():
        module = function.rpartition(".")[0]
        own = {name for name, text in texts.items() if f"{module} import" in text}
        reached[function] = suited(tests, seconds, own)
    file.write_text(json.dumps(stats))


def suited(tests: Sequence[str], seconds: dict[str, float], own: set[str]) -> list[str]:
    """Return the tests that run on a function: those of own files first, then the quickest, in the budget."""
    order = sorted(tests, key=lambda test: (test.partition("::")[0] not in own, seconds[test], test))
    used = itertools.accumulate(seconds[test] for test in order)
    return [
        test
        for number, (test, sum_of) in enumerate(zip(order, used, strict=True))
        if sum_of < BUDGET or not number
    ]


def _path(module: str) -> str:
    return module.replace(".", "/") + ".py"
