"""Cases of public functions and commands, each with its answer, in the `.cases` files beside the tests.

    from urmpipe_models.robots.toml import read_robot_file  # Python, once: names for calls
    @ base.toml                                             # a file that all cases may change
    kind = "urm"
    lengths = [0.3]
    # a case by its title, and below it the files it needs
    @ arm.toml = changed("base.toml", {"0.3": "none"})
    $ read_robot_file("arm.toml")
    > RobotError: arm.toml: key lengths: found 'none', allowed: ...
    $ urmpipe robot arm.toml
    > exit 2
    > ...

Calls of a case run one after the other in its folder. `$ urmpipe ...` is a command, anything else an
expression. Lines with `>` are answers: `pytest --accept FILES` writes them as they come out now, and
`git diff` is the review.
A title that ends in "(slow)" is of a slow test. A line of a file that begins as one of these marks (`# `,
`$ `, `> `, `@ `) has a `\\` in front.
"""

from __future__ import annotations

import contextlib
import dataclasses
import io
import os
import re
import shlex
import warnings
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from urmpipe.main import run
from urmpipe_models.errors import UrmpipeError

SAME = "> ~"  # the rest of this answer is that of the call above
WIDTH = 110


@dataclasses.dataclass
class Case:
    """A title, files as (name, expression or None, lines), and calls, each with the lines of its answer."""

    title: str
    files: list[tuple[str, str | None, list[str]]] = dataclasses.field(default_factory=list)
    calls: list[tuple[str, list[str]]] = dataclasses.field(default_factory=list)


class CaseFile:
    """A file of cases: its Python code, the files of all cases, and the cases."""

    def __init__(self, path: Path) -> None:
        self.path, self.code, self.common, self.cases = path, "", Case(""), list[Case]()
        case, is_code = self.common, True
        for line in path.read_text(encoding="utf-8").splitlines():
            is_code = is_code and not line.startswith(("# ", "@ "))
            if is_code:
                self.code += line + "\n"
            elif line.startswith("# "):
                titles = [one.title for one in self.cases]
                if line[2:] in titles:
                    raise ValueError(f"{path}: two cases have the title {line[2:]!r}")
                case = Case(line[2:])
                self.cases.append(case)
            elif line.startswith("@ "):
                name, _, expression = line[2:].partition(" = ")
                case.files.append((name, expression or None, []))
            elif line.startswith("$ "):
                case.calls.append((line[2:], []))
            elif line.startswith(">") and case.calls:
                answer = case.calls[-1][1]
                answer += case.calls[-2][1][len(answer) :] if line == SAME else [line[2:]]
            else:
                case.files[-1][2].append(line)
        if idle := [one.title for one in self.cases if not one.calls]:
            raise ValueError(f"{path}: cases without a call: {', '.join(idle)}")

    def names(self) -> dict[str, Any]:
        """Run the Python code of the file, and return what it defines."""
        names: dict[str, Any] = {"__name__": self.path.stem}
        exec(compile(self.code, self.path.name, "exec", dont_inherit=True), names)
        return names

    def text(self) -> str:
        """Return the file as text, with the answers that it has now."""
        lines = [*self.code.splitlines(), *_file_lines(self.common)]
        for case in self.cases:
            lines += [f"# {case.title}", *_file_lines(case)]
            before: list[str] = []
            for call, answer in case.calls:
                end = next((k for k in range(len(answer)) if answer[k:] == before[k:]), len(answer))
                own, shared = (answer[:end], [SAME]) if len(answer) - end > 1 else (answer, [])
                lines += [f"$ {call}", *(f"> {line}".rstrip() for line in own), *shared]
                before = answer
        return "\n".join(lines) + "\n"


def answers(file: CaseFile, case: Case, folder: Path) -> list[list[str]]:
    """Run the calls of a case in a folder, and return what each answers."""
    names, texts = file.names(), dict[str, str]()

    def changed(name: str, changes: Mapping[str, str]) -> str:
        """Return a text of the case with changes, each of a part that it has once."""
        text = texts[name]
        for old, new in changes.items():
            if text.count(old) != 1:
                raise ValueError(
                    f"{file.path}: {case.title}: {name} has {old!r} {text.count(old)} times, not once"
                )
            text = text.replace(old, new)
        return text

    names |= {"changed": changed}
    with contextlib.chdir(folder):
        for name, expression, lines in (*file.common.files, *case.files):
            made = eval(expression, names) if expression else "".join(f"{_plain(line)}\n" for line in lines)
            if isinstance(made, str):
                texts[name] = made
            Path(name).parent.mkdir(parents=True, exist_ok=True)
            Path(name).write_bytes(made.encode() if isinstance(made, str) else made)
        return [_answer(call, names, folder) for call, _ in case.calls]


def _answer(call: str, names: dict[str, Any], folder: Path) -> list[str]:
    lines: list[str] = []
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("ignore")
        warnings.simplefilter("always", UserWarning)
        try:
            lines += _command(call[8:]) if call.startswith("urmpipe ") else show(eval(call, names))
        except UrmpipeError as error:
            lines += [f"{type(error).__name__}: {line}".rstrip() for line in str(error).splitlines()]
    lines = [f"{type(one.message).__name__}: {one.message}" for one in caught] + lines
    return [line.replace(f"{folder}{os.sep}", "").replace(str(folder), ".") for line in lines]


def _command(line: str) -> list[str]:
    """Run a command. A refused command must print nothing, write no file, and report only errors."""
    before = {path for path in Path().rglob("*") if path.is_file()}
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = run(shlex.split(line))
    new = sorted(str(path) for path in {path for path in Path().rglob("*") if path.is_file()} - before)
    errors = [re.sub(r"[\d.]+ m?s\b", "TIME", one) for one in err.getvalue().splitlines()]
    if code == 2 and "--json" not in line:
        assert not out.getvalue(), "a refused command printed"
        assert not new, f"a refused command left {new}"
        assert all(one.startswith("error: ") for one in errors), errors
    printed = [
        re.sub(r"\b\d[\d.e+-]* m?s\b(?= *$)", "TIME", one.rstrip()) for one in out.getvalue().splitlines()
    ]
    return [f"exit {code}" + "".join(f", writes {one}" for one in new), *printed, *errors]


def show(value: object) -> list[str]:
    """Return lines that show a value: texts as they are, numbers by nine digits, records without defaults."""
    if value is None or isinstance(value, str):
        return [line.rstrip() for line in (value or "").splitlines()]
    if isinstance(value, tuple) and all(isinstance(one, str) for one in value) and "\n" in "".join(value):
        return [line.rstrip() for one in value for line in one.splitlines()]
    line = _inline(value)
    if len(line) > WIDTH and isinstance(value, Mapping):
        return [f"{key}: {_inline(one)}" for key, one in value.items()]
    if len(line) > WIDTH and (dataclasses.is_dataclass(value) or hasattr(value, "_fields")):
        return [type(value).__name__, *(f"  {name}={_inline(one)}" for name, one in _fields(value))]
    if len(line) > WIDTH and isinstance(value, (tuple, list, np.ndarray)):
        return [_inline(one) for one in value]
    return [line]


def _inline(value: Any) -> str:
    if isinstance(value, (np.ndarray, np.generic)):
        return _inline(value.tolist())
    if isinstance(value, float):
        return f"{round(value, 12) + 0.0:.9g}"
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{_inline(key)}: {_inline(one)}" for key, one in value.items()) + "}"
    if dataclasses.is_dataclass(value) or hasattr(value, "_fields"):
        return (
            f"{type(value).__name__}({', '.join(f'{name}={_inline(one)}' for name, one in _fields(value))})"
        )
    if isinstance(value, (tuple, list)):
        inner = ", ".join(map(_inline, value))
        return f"[{inner}]" if isinstance(value, list) else f"({inner}{',' if len(value) == 1 else ''})"
    return re.sub(r" at 0x\w+", "", repr(value))


def _fields(value: Any) -> Iterator[tuple[str, object]]:
    """The fields of a record that differ from their defaults."""
    if hasattr(value, "_fields"):
        defaults = value._field_defaults
    else:
        defaults = {one.name: one.default for one in dataclasses.fields(value)}
    for name, one in (
        (name, getattr(value, name)) for name in defaults | dict.fromkeys(getattr(value, "_fields", ()))
    ):
        default = defaults.get(name, dataclasses.MISSING)
        if default is dataclasses.MISSING or _inline(one) != _inline(default):
            yield name, one


def _file_lines(case: Case) -> Iterator[str]:
    for name, expression, lines in case.files:
        yield f"@ {name} = {expression}" if expression else f"@ {name}"
        yield from lines


def _plain(line: str) -> str:
    return line[1:] if re.match(r"\\[#$>@]", line) else line
