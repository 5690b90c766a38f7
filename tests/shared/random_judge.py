"""The judge of random logs: what a reader makes of a file, against its truth.

    right     the values of the file, to the last place; warnings about rows alone
    assumed   right, and a warning says what was assumed
    asked     an error whose printed choices, followed verbatim, lead to the truth
    filled    an error whose choices lead to it if the user fills in the columns
    refused   an error with the line of the damage
    warned    wrong, and a warning is about what is wrong
    silent    wrong, and no warning says so
    stuck     an error, and no choice leads to the truth

Source of the rules: docs/logs.md. The judge uses the public doors alone.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from random_writer import Log
from urmpipe import JointLog
from urmpipe.parameters.comparing import Ingest
from urmpipe.parameters.param import params_of, read_parameters
from urmpipe.reading import resolve_reading
from urmpipe_models.arm.chain import Chain
from urmpipe_models.errors import Hint, UrmpipeError
from urmpipe_models.math3d import to_quaternions
from urmpipe_pipeline.logs import read_log

UNIT = "assumed-unit doubted-unit unit-contradiction "
SAYS = {  # kinds of warnings that are about what is wrong
    "joints": "columns-not-read assumed-joints",
    "order": "plot-order columns-not-read",
    "rows": "end-rows skipped-row other-lines",
    "unit": UNIT,
    "time": UNIT + "assumed-period clock-rebuilt clock-spread clock-rounded over-midnight repeated-time",
    "rates": UNIT + "recorded-rates columns-passed-over",
    "position": UNIT + "tcp-not-read columns-passed-over columns-not-read",
    "rotation": UNIT + "tcp-not-read orientation assumed-form assumed-rotation columns-not-read",
}
PRINTED = 20  # choices that are followed at most, those of later questions among them


@dataclass
class Verdict:
    """What came out, what is wrong, and the messages."""

    outcome: str
    wrong: list[str]
    messages: list[str]


def judge(log: Log, folder: Path, *, with_robot: bool) -> Verdict:
    """Read a log, follow what it asks, and compare the data with the truth."""
    path = folder / log.name
    path.write_bytes(log.data)
    robot = log.chain if with_robot else None
    try:
        return assess(log, read_log([path], None, robot))
    except UrmpipeError as error:
        messages = [str(finding) for finding in error.findings]
        if answer := follow(log, path, robot, error, fill=False):
            return Verdict("asked", [], [*messages, f"answer: {answer}"])
        if any(finding.line in log.truth.damaged_lines for finding in error.findings):
            return Verdict("refused", [], messages)
        if answer := follow(log, path, robot, error, fill=True):
            return Verdict("filled", [], [*messages, f"answer: {answer}"])
        return Verdict("stuck", [], messages)


def follow(
    log: Log, path: Path, robot: Chain | None, error: UrmpipeError, *, fill: bool
) -> dict[str, Any] | None:
    """Return the options that lead to the truth: all choices of an error, then those of the errors behind."""
    queue, seen = [(error, dict[str, Any]())], set[str]()
    while queue:
        error, given = queue.pop(0)
        for parameter, value in _choices(log, error, given, fill=fill):
            options = given | {parameter: value}
            if repr(options) in seen or len(seen) == PRINTED:
                continue
            seen.add(repr(options))
            try:
                values = read_parameters(params_of(Ingest), options)
                read = read_log([path], resolve_reading(values).options, robot)
            except UrmpipeError as next_error:
                queue.append((next_error, options))
                continue
            if assess(log, read, asked=True).outcome != "silent":
                return options
    return None


def _choices(
    log: Log, error: UrmpipeError, given: dict[str, Any], *, fill: bool
) -> Iterator[tuple[str, Any]]:
    for hint in (hint for finding in error.findings for hint in finding.hints):
        value = _value(log, hint, fill)
        if hint.parameter not in params_of(Ingest) or hint.parameter == "map" or value is None:
            continue
        if isinstance(value, dict) and isinstance(given.get(hint.parameter), dict):
            value = given[hint.parameter] | value
        yield hint.parameter, value


def _value(log: Log, hint: Hint, fill: bool) -> Any:
    if isinstance(hint.value, dict) and None in hint.value.values():
        units = log.truth.answers["unit"]
        return {key: units.get(key, log.truth.answers["angle"]) for key in hint.value} if fill else None
    return log.truth.answers.get(hint.parameter) if hint.value is None and fill else hint.value


def assess(log: Log, read: JointLog, *, asked: bool = False) -> Verdict:
    """Compare a log that was read with the truth, and what is wrong with the warnings."""
    wrong = list(_iter_wrong(log, read, asked=asked))
    messages = [f"{warning.kind}: {warning}" for warning in read.warnings]
    if not wrong:
        return Verdict("assumed" if any(w.assumption for w in read.warnings) else "right", wrong, messages)
    is_said = all(_is_said(log, read, re.split("[ :]", what)[0], what) for what in wrong)
    return Verdict("warned" if is_said else "silent", wrong, messages)


def _is_said(log: Log, read: JointLog, role: str, what: str) -> bool:
    """Return whether a warning is about it; of columns that are not read, it has the name of one of them."""
    said = [str(warning) for warning in read.warnings if warning.kind in SAYS.get(role, "").split()]
    names = log.truth.names["joint"] if role in ("joints", "order") and "header" not in log.unsaid else []
    if "not read" in what:
        names = log.truth.names["position"] + log.truth.names["rotation"]
    return bool(said) and (not names or any(_plain(name) in _plain(text) for name in names for text in said))


def _plain(text: str) -> str:
    return re.sub("[^a-z0-9.]", "", text.lower())


def _iter_wrong(log: Log, read: JointLog, *, asked: bool) -> Iterator[str]:
    """Yield what differs from the truth, each with a word of `SAYS` first."""
    truth, used = log.truth, sorted(read.columns, key=lambda column: column.index)
    joints = [column.number for column in used if column.role == "joint"]
    groups = [truth.joints, *([truth.sides] if asked and truth.sides else [])]
    group = next((group for group in groups if set(group) == set(joints)), None)
    if group is None:
        yield f"joints {joints} for {list(truth.joints)}"
        return
    if joints not in (list(group), sorted(group)):
        yield f"order {joints} for {list(group)}"
    count = len(next(iter(group.values())))
    mask = next((mask for mask in (np.ones(count, bool), *truth.masks) if mask.sum() == len(read.q)), None)
    if mask is None:
        yield f"rows {len(read.q)} of {count}"
        return
    for k, number in enumerate(joints):
        if not (asked and "slide unit" in log.unsaid):  # a choice is one unit, and there are two
            yield from _differ(f"unit joint {number}", read.q[:, k], group[number][mask])
    yield from _iter_wrong_times(log, read, mask)
    yield from _iter_wrong_poses(log, read, mask)
    rates = [column.number for column in used if column.role == "rate"]
    if read.qd is not None and not set(rates) <= set(truth.rates):
        yield f"rates {rates} for {list(truth.rates)}"
    elif read.qd is not None:
        for k, number in enumerate(rates):
            yield from _differ(f"rates {number}", read.qd[:, k], truth.rates[number][mask])


def _iter_wrong_times(log: Log, read: JointLog, mask: np.ndarray) -> Iterator[str]:
    truth = log.truth
    if not read.timed:
        if truth.t_ns is not None or "poses" not in log.unsaid:
            yield "poses for a motion"
    elif truth.t_ns is None:
        period = float(np.median(np.diff(read.t_ns))) / 1e9 / truth.answers["period"]
        if abs(period - 1) > 0.01:  # of rates: a mean of uneven rows
            yield f"time: period {period:.4g} times the true one"
    else:
        kept = np.array(truth.t_ns, object)[mask]
        off = np.abs(read.t_ns.astype(object) - (kept - kept[0])) > truth.tick
        if off.any():
            row = int(np.flatnonzero(off)[0])
            yield f"time: {off.sum()} rows, row {row + 1}: {read.t_ns[row]} for {kept[row] - kept[0]}"


def _iter_wrong_poses(log: Log, read: JointLog, mask: np.ndarray) -> Iterator[str]:
    truth = log.truth  # without a header, nobody can know the pose; of another topic it is on other rows
    is_named = (
        "header" not in log.unsaid and truth.position is not None and np.isfinite(truth.position[mask]).any()
    )
    if read.tcp_position is None or truth.position is None:
        if read.tcp_position is not None or is_named:
            yield "position not read" if read.tcp_position is None else "position read where there is none"
    elif not read.externally_measured:
        for axis in range(3):
            yield from _differ(f"position {axis}", read.tcp_position[:, axis], truth.position[mask][:, axis])
    if read.tcp_rotation is None or read.rotation_form is None or truth.rotation is None:
        if read.tcp_rotation is not None or (truth.rotation is not None and is_named):
            yield "rotation not read" if read.tcp_rotation is None else "rotation read where there is none"
    else:
        inner = to_quaternions(read.tcp_rotation, read.rotation_form) * truth.rotation[mask]
        apart = float(np.nanmax(1 - np.abs(inner.sum(axis=1)), initial=0.0))
        if apart > 1e-9:  # rounding of 1 - cos
            yield f"rotation as {read.rotation_form}, {apart:.2g} apart"


def _differ(what: str, values: np.ndarray, truth: np.ndarray) -> Iterator[str]:
    """Compare values to a few units of the last place."""
    if (np.isnan(values) != np.isnan(truth)).any():
        yield f"{what}: {np.isnan(values).sum()} missing for {np.isnan(truth).sum()}"
    elif (off := np.abs(values - truth) > 1e-15 * np.abs(truth)).any():
        row = int(np.flatnonzero(off)[0])
        yield f"{what}: {off.sum()} rows, row {row + 1}: {values[row]:.17g} for {truth[row]:.17g}"
