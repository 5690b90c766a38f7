"""Child processes: their command and environment, and the text of their end."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from urmpipe_models.processes import describe_exit, end_group, module_command, module_environment


def test_a_module_runs_with_the_import_path_of_this_process_alone(tmp_path: Path) -> None:
    (tmp_path / "json.py").write_text("raise SystemExit(3)")  # not imported from the working folder
    command, environment = module_command("json.tool", "--compact"), module_environment()
    output = subprocess.check_output(command, cwd=tmp_path, env=environment, input="[1, 2]", text=True)
    assert json.loads(output) == [1, 2]


@pytest.mark.skipif(sys.platform == "win32", reason="has no signals")
def test_a_group_is_killed_and_its_end_described() -> None:
    command = [sys.executable, "-c", "input()"]
    process = subprocess.Popen(command, stdin=subprocess.PIPE, start_new_session=True)
    end_group(process)
    assert process.wait(60) == -signal.SIGKILL
    end_group(process)  # has ended
    assert describe_exit(-signal.SIGKILL) == "ended the process: Killed (SIGKILL)"
    assert describe_exit(-200) == "ended the process by signal 200"


@pytest.mark.parametrize(("code", "text"), [(3, "3"), (2**16, "0x10000")])
def test_an_exit_code_is_in_the_text(code: int, text: str) -> None:
    assert describe_exit(code) == f"ended the process with the exit code {text}"
