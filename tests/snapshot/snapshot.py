"""Write down what urmpipe answers: python tests/snapshot/snapshot.py CHECKOUT -o FOLDER [PATTERN ...].

Each case of cases.toml runs in a folder of its own, each command in a process of its own, as `python -m
urmpipe`. What it printed and wrote becomes FOLDER/cases/CASE.json. `compare_snapshots.py` compares two such
folders, or one with net.json: what --net keeps of a folder, valid on every machine.
"""

from __future__ import annotations

import argparse
import importlib
import json
import math
import multiprocessing
import os
import pkgutil
import re
import runpy
import shlex
import shutil
import signal
import sys
import time
import tomllib
import traceback
from collections.abc import Iterator
from contextlib import suppress
from datetime import UTC, datetime, timedelta
from functools import partial
from itertools import groupby
from pathlib import Path
from typing import Any, NamedTuple

import contents
from compare_snapshots import load, pack

ROOT = Path(__file__).resolve().parents[2]
DATA = ROOT / "datasets" / "urmpipe_datasets"
SHARED = ROOT.parent / "shared"
SPEC: dict[str, Any] = tomllib.loads((Path(__file__).parent / "cases.toml").read_text(encoding="utf-8"))
HEAVY = (
    "rerun.chunk",
    "rerun.blueprint",
    "pandas",
    "plotly",
    "pyarrow.csv",
    "pyarrow.compute",
)  # imported once

LARGE = {".rrd", ".html", ".fmu", ".csv", ".parquet", ".mat", ".tum"}
TIMEOUT = 300  # [s], of a command


class Case(NamedTuple):
    """Command lines under a name; of data that are not ours only hashes are kept."""

    name: str
    lines: list[str]
    private: bool = False


def all_cases() -> Iterator[Case]:
    """Yield the cases of cases.toml."""
    for name, lines in SPEC["cases"].items():
        yield _case(name, lines)
    for family, about in SPEC["families"].items():
        lines = (
            SPEC["families"][about["lines"]]["lines"] if isinstance(about["lines"], str) else about["lines"]
        )
        for name, given in about.get("cases", {}).items():
            yield _case(f"{family}.{name}", lines, name=name, given=given.format(**SPEC["words"]))
        yield from _cases_of_files(family, lines, about.get("files", ""))


def _cases_of_files(family: str, lines: list[str], pattern: str) -> Iterator[Case]:
    """Yield a case for each file of a pattern, or for several that are one log: NAME_1, NAME_2, ..."""
    private = pattern.startswith("../")
    paths = (ROOT.parent if private else ROOT).glob(pattern.removeprefix("../")) if pattern else []
    of_log = partial(re.sub, r"_(\d|q|t)$", "")
    for stem, group in groupby(sorted(paths), lambda path: of_log(str(path.with_suffix("")))):
        files = [
            path
            for path in group
            if path.suffix not in {".py", ".pyc", ".md"} and not path.name.startswith(".")
        ]
        if files:
            anchor = next(one for one in (ROOT / "tests", DATA, ROOT.parent) if files[0].is_relative_to(one))
            given = " ".join(f"../../in/{path.relative_to(anchor).as_posix()}" for path in files)
            robots = SPEC["families"]["specimen"]["robots"]
            robot = next((robot for part, robot in robots.items() if re.search(part, given)), "ur5e")
            name = ".".join(Path(stem).relative_to(anchor).parts[1 + private :])
            yield _case(f"{family}.{name}", lines, private, name=files[0].stem, given=given, robot=robot)


def _case(title: str, lines: list[str], private: bool = False, **words: str) -> Case:
    """Return a case with its lines filled in and written out."""
    said = [line.format(**SPEC["words"], **words) for line in lines]
    return Case(title, [one for line in said for one in _written_out(line)], private)


def _written_out(line: str) -> list[str]:
    """Return the commands that a line stands for."""
    first, _, rest = line.partition(" ")
    if first == "both":
        return [f"{rest} --json", rest]
    if first in {"leave", "leave-all"}:
        kinds = ("csv", "parquet") if first == "leave" else ("csv", "parquet", "mat", "tum")
        lines = [f"export {rest} -o {rest[:-4]}.{kind} --json" for kind in kinds]
        if first == "leave-all":
            lines += [f"export {rest} --rows file -o {rest[:-4]}-file.{kind} --json" for kind in kinds]
        return [f"report {rest} -o {rest[:-4]}.html --json", *lines]
    return [line]


def lay_inputs(folder: Path) -> None:
    """Lay the inputs into a folder: always those beside this script, whatever is run."""
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(DATA / "logs", folder / "logs")
    shutil.copytree(ROOT / "tests" / "specimens", folder / "specimens")
    shutil.copy(ROOT / "tests" / "snapshot" / "models.py", folder)
    (folder / "shared").symlink_to(SHARED)
    for name, words in SPEC["files"].items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_text(words, encoding="utf-8")
    for name, circle in SPEC["circles"].items():
        (folder / name).write_text(_circle(**circle), encoding="utf-8")


def _circle(middle: list[float], radius: float, rows: int, times: bool) -> str:
    """Return a path around a pose as CSV."""
    table = ["t,x,y,z,qx,qy,qz,qw" if times else "x,y,z,qx,qy,qz,qw"]
    for k in range(rows):
        turn = 2 * math.pi * k / (rows - 1)
        pose = (middle[0] + radius * math.cos(turn), middle[1] + radius * math.sin(turn), *middle[2:])
        table.append(",".join(f"{value:.9g}" for value in ((0.05 * k, *pose) if times else pose)))
    return "\n".join(table) + "\n"


def import_all(checkout: Path) -> None:
    """Make urmpipe that of the checkout, and import it once for all commands, which fork from here."""
    areas = [str(checkout / area) for area in ("models", "fmus", "pipeline", "cli", "datasets")]
    sys.path[:0] = areas
    os.environ |= {"PYTHONPATH": os.pathsep.join(areas), "COLUMNS": "100", "TZ": "UTC", "NO_COLOR": "1"}
    for found in pkgutil.walk_packages(areas, onerror=lambda name: None):
        if found.name.startswith("urmpipe") and not found.name.endswith("__main__"):
            with suppress(Exception):  # whoever needs it says so
                importlib.import_module(found.name)
    for name in HEAVY:
        importlib.import_module(name)
    if not str(sys.modules["urmpipe"].__file__).startswith(str(checkout)):
        raise SystemExit(f"found no urmpipe in {checkout}")


def varying(*folders: Path) -> list[tuple[str, str]]:
    """Return patterns of what differs from run to run, and what stands for it."""
    now = datetime.now(UTC)
    days = "|".join(f"{now + timedelta(days):%Y-%m-%d}" for days in (0, 1))
    return [
        ("|".join(re.escape(str(one)) for one in (*folders, ROOT, SHARED, SHARED.resolve())), "<path>"),
        (r"/tmp/[\w./-]+", "<path>"),
        (rf"({days})([T ]\d\d:\d\d(:\d\d)?(\.\d+)?)?( UTC|Z|\+00:00)?", "<now>"),
        (r"\{?[0-9a-f]{8}(-[0-9a-f]{4}){3}-[0-9a-f]{12}\}?|\b[0-9a-f]{32,}\b", "<hash>"),
        (r"(?<![\d.])\d+\.\d+\.\d+(?![\d.])\w*", "<version>"),
        (r"; in [\d.e+-]+ s(, [\d.e+-]+ times faster than real time)?", "; in <time>"),
    ]


def without(patterns: list[tuple[str, str]], words: str) -> str:
    """Return a text with what differs from run to run put alike."""
    for pattern, instead in patterns:
        words = re.sub(pattern, instead, words)
    return words


def record(folder: Path, keep: bool, case: Case) -> str:
    """Run a case, write down what it left, and return its name."""
    at = folder / "cases" / case.name
    shutil.rmtree(at, ignore_errors=True)
    at.mkdir(parents=True)
    if (folder / "in" / case.name).is_dir():
        shutil.copytree(folder / "in" / case.name, at, dirs_exist_ok=True)
    os.chdir(at)
    os.environ["URMPIPE_CACHE"] = str(folder / "cache")
    exits = [str(run_apart(f"{number:03}", line)) for number, line in enumerate(case.lines)]
    found = {"exits": {"kind": "numbers", "values": exits}, "commands": contents.column("words", case.lines)}
    for path in sorted(one for one in at.rglob("*") if one.is_file()):
        name = path.relative_to(at).as_posix()
        try:
            read = contents.contents(path)
        except Exception as error:  # whatever a later urmpipe writes, the other files are recorded
            read = {"cannot be read": contents.column("words", [repr(error)])}
        found |= {f"{name}|{column}": values for column, values in read.items()}
        if case.private or (path.suffix in LARGE and not keep):
            path.unlink()
    for values in found.values() if case.private else ():
        if "hash" in values:
            values.pop("values", None)
    at.with_name(f"{case.name}.json").write_text(json.dumps(found), encoding="utf-8")
    return case.name


def run_apart(name: str, line: str) -> int:
    """Run a command in a process of its own, its output in files of that name; return its exit code."""
    child = os.fork()
    if child:
        return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    code: object = 99  # what went wrong here, not in urmpipe
    try:
        for stream, suffix in ((1, "out"), (2, "err")):
            os.dup2(os.open(f"{name}.{suffix}", os.O_WRONLY | os.O_CREAT), stream)
        signal.alarm(TIMEOUT)
        sys.argv = ["urmpipe", *shlex.split(line)]
        if line.startswith("python "):
            run_script(Path(sys.argv[2]))
        else:
            runpy.run_module("urmpipe", run_name="__main__")
        code = 0
    except SystemExit as error:
        code = error.code or 0
    except BaseException:
        traceback.print_exc()
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code if isinstance(code, int) else 98)


def run_script(path: Path) -> None:
    """Run a script, and write down what its variables hold, results also as notebooks show them."""
    found: contents.Columns = {}
    for name, value in runpy.run_path(str(path)).items():
        if name.startswith("_") or type(value).__name__ == "module":
            continue
        found |= contents.tree(value, name)
        if hasattr(value, "to_frame"):
            frame = value.to_frame()
            found |= {f"{name}.to_frame.{key}": contents.array(frame[key].to_numpy()) for key in frame}
            shown = contents.text(f"{value!r}\n{re.sub('<[^>]*>', ' ', value._repr_html_())}")
            found |= {f"{name}.shown.{key}": one for key, one in shown.items()}
    Path("results.columns").write_text(json.dumps(found), encoding="utf-8")


def main() -> None:
    """Run the cases."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("checkout", type=lambda given: Path(given).resolve())
    parser.add_argument("patterns", nargs="*", help="names of cases, as ik.*")
    parser.add_argument("-o", "--output", type=lambda given: Path(given).resolve(), required=True)
    parser.add_argument("-j", "--jobs", type=int, default=1)
    parser.add_argument("--keep", action="store_true", help="keep the large files, too")
    parser.add_argument("--net", type=Path, help="write what is kept of the whole snapshot into this file")
    given = parser.parse_intermixed_args()
    began = time.monotonic()
    lay_inputs(given.output / "in")
    import_all(given.checkout)
    contents.normal = partial(without, varying(given.output, given.checkout))
    cases = [
        one for one in all_cases() if not given.patterns or any(map(Path(one.name).match, given.patterns))
    ]
    with multiprocessing.get_context("fork").Pool(given.jobs, maxtasksperchild=1) as pool:
        for done, name in enumerate(pool.imap_unordered(partial(record, given.output, given.keep), cases), 1):
            print(f"\r{done}/{len(cases)} {name:60}", end="", file=sys.stderr, flush=True)
    print(f"\n{len(cases)} cases in {time.monotonic() - began:.0f} s", file=sys.stderr)
    if given.net:
        given.net.write_text(pack(load(given.output)), encoding="utf-8")


if __name__ == "__main__":
    main()
