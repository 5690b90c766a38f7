"""What a command answers in JSON."""

import io
import json
import shlex
from contextlib import redirect_stderr, redirect_stdout
from typing import Any

from urmpipe.main import run


def json_answer(line: str, *keys: str) -> dict[str, Any]:
    """Return these keys of the answer of `urmpipe LINE --json`, which must not be refused."""
    with redirect_stdout(io.StringIO()) as out, redirect_stderr(io.StringIO()) as err:
        code = run([*shlex.split(line), "--json"])
    assert code != 2, err.getvalue()
    answer = json.loads(out.getvalue())
    return {key: answer[key] for key in keys}
