"""Hints with a value are followed, as option and as keyword: then the complaint is gone."""

from __future__ import annotations

import json
import shlex
import warnings
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, NamedTuple

import pytest

import urmpipe
from make_specimens import paths
from specimen import SPECIMENS
from urmpipe.main import cli, run
from urmpipe_models.messages import Hint, Message

ROBOTS = (None, "ur5e")


class Offer(NamedTuple):
    """A hint with a value, and the complaint that it comes with."""

    specimen: str
    robot: str | None
    complaint: tuple[Any, ...]
    hint: Hint


def ingested(name: str, robot: str | None, **given: Any) -> list[Message]:
    """Return all that is wrong or worth knowing of a specimen."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", urmpipe.UrmpipeWarning)
        try:
            return list(urmpipe.ingest(paths(SPECIMENS[name]), robot, **given).warnings)
        except urmpipe.UrmpipeError as error:
            return list(error.findings)


def complaint(told: Mapping[str, Any], sentence: str) -> tuple[Any, ...]:
    """Return what tells a message from others, without what it offers."""
    return (*(told[name] for name in ("kind", "row", "column", "parameter", "found", "allowed")), sentence)


def of_message(one: Message) -> tuple[Any, ...]:
    return complaint(one.to_dict(), one.message)


def has_value(hint: Hint) -> bool:
    """Tell whether a hint can be followed as it stands: nothing in it is the reader's own."""
    held = hint.value.values() if isinstance(hint.value, Mapping) else [hint.value]
    return bool(hint.parameter) and not hint.call and None not in held


def offers() -> list[Offer]:
    """Return every hint with a value that the specimens provoke."""
    return [
        Offer(name, robot, of_message(one), hint)
        for name in SPECIMENS
        for robot in ROBOTS
        for one in ingested(name, robot)
        for hint in one.hints
        if has_value(hint)
    ]


OFFERS = offers()


def test_the_specimens_provoke_hints_of_many_kinds() -> None:
    assert {one.hint.parameter for one in OFFERS} >= {
        "base",
        "joints",
        "repair",
        "rotation",
        "source",
        "time",
        "tsp",
        "unit",
    }


@pytest.mark.parametrize("offer", OFFERS, ids=lambda one: f"{one.specimen}-{one.robot}-{one.hint.parameter}")
def test_a_hint_that_is_followed_helps(
    offer: Offer, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    given: Any = {offer.hint.parameter: offer.hint.value}
    told = ingested(offer.specimen, offer.robot, **given)
    assert offer.complaint not in map(of_message, told)

    robot = ["--robot", offer.robot] if offer.robot else []
    files = map(str, paths(SPECIMENS[offer.specimen]))
    words = shlex.split(offer.hint.spelled("command line"))
    run(["ingest", *files, *robot, *words, "--explain", "--json", "-q"])
    answer = json.loads(capfd.readouterr().out)
    printed = answer.get("errors", answer.get("warnings", []))
    assert [one["message"] for one in printed] == [one.sentence("command line") for one in told]


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
    assert here[0].startswith("joints: found no column 'q3'")
    assert 'unit="deg"' in here[1][-1]
    with ThreadPoolExecutor(1) as pool:
        assert pool.submit(said).result() == here
    with cli.make_context("urmpipe", ["ingest", str(log)]):
        assert said() == here
