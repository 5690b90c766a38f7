"""What a command answers: its JSON, its exit code, and what it prints."""

import io
import json
import re
import shlex
from contextlib import redirect_stderr, redirect_stdout
from typing import Any

from urmpipe.main import run


def ran(line: str) -> tuple[int, str, str]:
    """Return the exit code of `urmpipe LINE`, its output, and what it prints on standard error."""
    with redirect_stdout(io.StringIO()) as out, redirect_stderr(io.StringIO()) as err:
        code = run(shlex.split(line))
    return code, out.getvalue(), err.getvalue()


def json_answer(line: str, *keys: str) -> dict[str, Any]:
    """Return these keys, or all, of the answer of `urmpipe LINE --json`, which must not be refused."""
    code, out, err = ran(f"{line} --json")
    assert code != 2, err
    answer = json.loads(out)
    return {key: answer[key] for key in keys or answer}


def full_answer(line: str, *keys: str) -> tuple[int, dict[str, Any], list[str]]:
    """Return the exit code of `urmpipe LINE --json`, these keys, and its errors and warnings."""
    code, out, err = ran(f"{line} --json")
    answer = json.loads(out)
    errors = [one for one in err.splitlines() if not one.startswith("note: ")]
    return code, {key: answer[key] for key in keys}, errors


def printed(line: str) -> list[str]:
    """Return what `urmpipe LINE` prints, without the time that it took and the program that opens a file."""
    lines = ran(line)[1].splitlines()
    return [re.sub(r"(?<=^Simulated in ).*|  \(open it: .*", "", one.rstrip()) for one in lines]
