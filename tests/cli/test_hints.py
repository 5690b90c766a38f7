"""Hints with a value are followed, as option and as keyword: then the complaint is gone."""

from __future__ import annotations

import json
import shlex
import warnings
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import urmpipe
from answered import json_answer
from make_specimens import paths
from repeated import written
from specimen import SPECIMENS
from urmpipe.main import cli, run
from urmpipe_models.arm.chain import Chain
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.errors import Hint, Message
from urmpipe_models.kinematics.forward import poses_over_log
from urmpipe_models.math3d import from_offset, to_quaternions
from urmpipe_models.robots.catalogue import load_robot

ROBOTS = (None, "ur5e")

TRUTH = 0.4 + np.arange(6) * 0.3 + 0.5 * np.sin(np.linspace(0, 1, 60)[:, None] * (1 + 0.4 * np.arange(6)))
"""Joint values of a UR5e in [rad], shape (60, 6)."""

MOST_USUAL = "--unit deg"
"""What 70 specimens are advised, typed for one of them: it is followed as a keyword for each."""


def ingested(name: str, robot: str | None, **given: Any) -> list[Message]:
    """Return all that is wrong or worth knowing of a specimen."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", urmpipe.UrmpipeWarning)
        try:
            return list(urmpipe.ingest(paths(SPECIMENS[name]), robot, **given).warnings)
        except urmpipe.UrmpipeError as error:
            return list(error.findings)


def of_message(one: Message) -> tuple[Any, ...]:
    """Return what distinguishes a message from others, without what it offers."""
    told = one.to_dict()
    return (*(told[name] for name in ("kind", "row", "column", "parameter", "found", "allowed")), one.message)


def given_by(hint: Hint) -> dict[str, Any]:
    """Return the keywords of a hint."""
    return {hint.parameter: hint.value} | ({"robot": hint.robot} if hint.robot else {})


def offers(name: str, robot: str | None) -> list[tuple[Message, Hint]]:
    """Return every hint that a specimen provokes and that leaves no value to the reader, with its message."""
    found = [(one, hint) for one in ingested(name, robot) for hint in one.hints]
    held = [hint.value.values() if isinstance(hint.value, Mapping) else [hint.value] for _, hint in found]
    return [
        (one, hint)
        for (one, hint), values in zip(found, held, strict=True)
        if hint.parameter and not hint.call and None not in values
    ]


PROVOKED = {
    "pandas_default": "unit", "numpy_savetxt_default": "time", "csv_twelve_columns": "joints",
    "cad_path_no_header": "source", "abb": "tsp", "in_between_on_wrap": "repair",
    "tcp_from_another_base": "base",
}  # fmt: skip
"""Parameters of hints that specimens provoke, of many kinds."""


@pytest.mark.slow
@pytest.mark.parametrize("name", SPECIMENS)
def test_hints_that_are_followed_help(name: str, capfd: pytest.CaptureFixture[str]) -> None:
    files = [*map(str, paths(SPECIMENS[name]))]
    followed, typed = set[tuple[Any, ...]](), set[Hint]()
    for robot in ROBOTS:
        for message, hint in offers(name, robot):
            if (of_message(message), hint) in followed:
                continue
            followed.add((of_message(message), hint))
            given: Any = {"robot": robot} | given_by(hint)
            told = ingested(name, given.pop("robot"), **given)
            assert of_message(message) not in map(of_message, told)

            spelled = str(hint)
            if hint in typed or (spelled == MOST_USUAL and name != "pandas_default"):
                continue
            typed.add(hint)
            words = [*(["--robot", robot] if robot else []), *shlex.split(spelled)]
            run(["ingest", *files, *words, "--explain", "--json", "-q"])
            answer = json.loads(capfd.readouterr().out)
            printed = answer.get("errors", answer.get("warnings", []))
            assert [one["message"] for one in printed] == [one.sentence() for one in told]
    assert PROVOKED.get(name, "") in {"", *(hint.parameter for _, hint in followed)}


NAMES = [f"q{k} [rad]" for k in range(1, 7)]


def test_smoothing_brings_a_noisy_log_within_its_efforts(tmp_path: Path) -> None:
    q = [0.1, -1.2, 1.0, -0.5, 0.3, 0.2] + 0.3 * np.sin(0.01 * np.arange(300)[:, None] + np.arange(6))
    noise = np.random.default_rng(1).normal(0.0, 3e-4, q.shape)
    log = written(tmp_path / "noisy.csv", q + noise, names=NAMES)

    def told(*words: str) -> list[Any]:
        line = shlex.join(["ingest", str(log), "--robot", "ur10", *words, "--explain", "-q"])
        found = json_answer(line, "warnings")["warnings"]
        return [one for one in found if one["kind"] == "effort-limit"]

    (warning,) = told()
    (hint,) = warning["hints"]
    words = str(Hint(**hint))
    assert warning["message"].endswith(f"; {words} smooths the accelerations")
    assert told(*shlex.split(words)) == []


def recorded_beside(path: Path, q: FloatArray, held: Chain) -> Path:
    """Write a log of joint values in [rad], with the poses in which an arm is truly held."""
    position, rotation = poses_over_log(held, TRUTH)
    names = [*NAMES, *(f"tcp_{axis} [m]" for axis in "xyz"), "tcp_qx", "tcp_qy", "tcp_qz", "tcp_qw"]
    quat = to_quaternions(rotation.reshape(-1, 9), "matrix")
    return written(path, np.column_stack((q, position, quat)), 0.008 * np.arange(len(q)), names)


UR5E = load_robot("ur5e")
TURNED = UR5E.placed(tool=from_offset((0.02, 0.0, 0.15, 0.3, -0.2, 1.5)))
SHIFTED = UR5E.placed(base=from_offset((0.0, 0.02, -0.005)))
BEHIND = UR5E.placed(base=from_offset((0.5, -0.3, 0.8, 0.0, 0.0, 1.2)))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("order", "held", "robot", "kind", "parameter"),
    [
        ([0, 1, 2, 3, 4, 5], TURNED, None, "recorded-tcp-tool", "tool"),
        ([0, 1, 2, 3, 4, 5], TURNED, "ur5e", "recorded-tcp-tool", "tool"),
        ([0, 1, 2, 3, 4, 5], SHIFTED, "ur5e", "recorded-tcp-tool", "base"),
        ([0, 1, 2, 3, 4, 5], BEHIND, "ur5e", "recorded-tcp-far", "base"),
        ([0, 1, 2, 3, 4, 5], TURNED, "ur5", "recorded-tcp-far", "robot"),
        ([0, 2, 1, 3, 4, 5], TURNED, "ur5e", "recorded-tcp-far", "joints"),
    ],
)
def test_what_a_comparison_with_the_recorded_poses_advises_helps(
    order: list[int], held: Chain, robot: str | None, kind: str, parameter: str,
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    monkeypatch.chdir(tmp_path)  # where the recording goes
    log = recorded_beside(tmp_path / "log.csv", TRUTH[:, order], held)
    words = ["--robot", robot] if robot else []
    for step in range(3):
        line = shlex.join(["compare", str(log), *words, "--tolerance", "axis=1mm,angle=0.2deg", "-q"])
        answer = json_answer(line, "verdict", "runs", "warnings")
        told = [*answer["runs"][0]["warnings"], *answer["warnings"]]
        advised = [
            (one, hint) for one in told for hint in one["hints"] if one["kind"].startswith("recorded-tcp")
        ]
        if not advised:
            break
        (message, hint), *_ = advised
        if step == 0:
            assert (message["kind"], hint["parameter"]) == (kind, parameter)
        spelled = str(Hint(**hint))
        assert spelled in message["message"]
        words += shlex.split(spelled)
    assert answer["verdict"] == "pass"


def test_the_tool_of_a_recorded_run_is_advised_with_its_robot(tmp_path: Path) -> None:
    log = recorded_beside(tmp_path / "log.csv", TRUTH, TURNED)
    run_of = urmpipe.ingest(log, "ur5e")
    (told,) = urmpipe.compare(run_of).warnings
    (hint,) = told.hints
    assert urmpipe.compare(run_of, **given_by(hint)).warnings == ()


def test_a_robot_that_was_singled_out_is_named_with_its_tool(tmp_path: Path) -> None:
    log = recorded_beside(tmp_path / "log.csv", TRUTH, UR5E.placed(tool=from_offset((0.02, 0.0, 0.15))))
    (found,) = [one for one in urmpipe.ingest(log).log.inferences if one.kind == "robot"]
    assert found.alternatives() == ("--robot NAME|FILE, or --robot ur5e --tool 0.02,0,0.15 applies it")


def test_the_same_call_gives_the_same_message_on_any_thread_and_within_a_command(tmp_path: Path) -> None:
    log = tmp_path / "log.csv"
    log.write_text("t,q1,q2\n0,1,2\n1,1.1,2.1\n", encoding="utf-8")

    def said() -> tuple[str, list[str]]:
        """Return the error of one call, and the warnings of another."""
        with pytest.raises(urmpipe.LogError) as error:
            urmpipe.ingest(log, joints=["q1", "q3"])
        with pytest.warns(urmpipe.UrmpipeWarning) as caught:
            urmpipe.ingest(log)
        return str(error.value), [str(one.message) for one in caught]

    here = said()
    assert here[0].startswith("joints (--joints): found no column 'q3'")
    assert "--unit deg" in here[1][-1]
    with ThreadPoolExecutor(1) as pool:
        assert pool.submit(said).result() == here
    with cli.make_context("urmpipe", ["ingest", str(log)]):
        assert said() == here
