"""Measure how often `diagnose` names the true causes, in the 1000 trials of `faulty_logs`.

The question goes through `urmpipe.ingest` and `urmpipe.diagnose`; the answer is graded (`outcome`).
Results are appended to a file, and a second run continues it; those of other code do not count.
Set OMP_NUM_THREADS=1: two processes share the trials. Needs the folder `shared` next to the checkout.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import multiprocessing
import sys
import tempfile
import time
import warnings
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from faulty_arms import AXES, Fault, matrix, segments
from faulty_logs import (
    COUNT,
    EDITS,
    LASTING,
    MOTIONS,
    MOVED,
    SHARED,
    SIZED,
    TOOL,
    Trial,
    make_trial,
    motion_of,
    plan,
    rms,
)  # fmt: skip
from pairs import Bound, machine, write_results
from scipy.spatial.transform import Rotation

import urmpipe
import urmpipe_pipeline
from urmpipe_pipeline.diagnosis.causes import Cause
from urmpipe_pipeline.diagnosis.result import Diagnosis

LOST_IN_NOISE = 30.0  # chi-square of two explanations below which these samples do not separate them
SAME = 3e-3  # share of the effect, likewise: interpolation between samples

TWIN_WORDS = {
    "joint_offset": ("offset", "zero"), "joint_scale": ("scale", "factor"), "joint_lag": ("lag", "delay"),
    "base_shift": ("shift",), "tool_shift": ("shift",), "base_rotation": ("rotation", "turn"),
    "tool_rotation": ("rotation", "turn"), "time_lag": ("time lag", "clock"), "clock_drift": ("drift",),
    "servo_lag": ("servo lag",), "link_shift": ("sideways",), "joint_unit": ("unit", "deg"),
}  # fmt: skip
"""Words of which a twin has one, of kinds whose name is not in it as it is."""

EITHER_SIGN = ("joint_lag", "servo_lag", "backlash", "sag")
"""Kinds of which a size is compared without its sign."""

UNSIZED = ("path_unit", "outliers", *EDITS)
"""Kinds that are there or not."""

NEAR = 0.25
"""A named cause is the true one if it is no further from it than this share, and three times its interval."""


def fault_of(cause: Cause, trial: Trial, sign: float = 1.0, frame: int = 0) -> Fault:
    """Return a named cause as one of the arm; `sign` and `frame` count through what is open of it."""
    chain, frames, place, at = trial.motion.chain, trial.motion.arm.frames, None, np.eye(4)
    value = tuple((sign if cause.kind in EITHER_SIGN else 1.0) * float(number) for number in cause.value)
    if cause.kind == "joint_scale":
        value = (value[0] - 1.0,)
    if cause.kind in ("link_length", "link_shift", "tilt"):
        place = int(cause.segment[1:]) + 1 if cause.segment else 1
        nearby = [
            fault
            for fault in segments(chain, "link_length") + segments(chain, "tilt")
            if fault.place == place
        ]
        named = [fault.at for fault in nearby if fault.name == cause.name]
        places = named or [frames[place], at, *(fault.at for fault in nearby)]
        at = places[frame % len(places)]
    elif cause.kind in ("base_shift", "base_rotation", "tool_shift", "tool_rotation"):
        place = 0 if cause.kind.startswith("base") else len(frames) - 1
        at = frames[place] if place else matrix(AXES, frames[0][:3, 3])
    joints = tuple(chain.coordinates.index(name) for name in cause.joints if name in chain.coordinates)
    axis = None if cause.axis is None else np.array(cause.axis)
    return Fault(cause.kind, value, joints, cause.name, axis, place, at, cause.from_sample or 0, cause.rows)


def agrees(cause: Cause, fault: Fault, trial: Trial) -> bool:
    """Return whether a named cause is a true one: what it is, what it is of, and its size."""
    named = fault_of(cause, trial)
    if cause.kind != fault.kind or not _of_the_same(cause, named, fault, len(trial.motion.t)):
        return False
    return fault.kind in UNSIZED or not fault.value or (bool(named.value) and _near(cause, named, fault))


def _of_the_same(cause: Cause, named: Fault, fault: Fault, rows: int) -> bool:
    """Return whether two causes of one kind are of the same joints, rows, segment or name."""
    if fault.kind == "outliers":
        both, either = {*named.rows} & {*fault.rows}, {*named.rows} | {*fault.rows}
        return len(both) > 0.9 * len(either)
    if fault.joints:
        ordered = named.joints if fault.kind == "joint_coupled" else tuple(sorted(named.joints))
        expected = fault.joints if fault.kind == "joint_coupled" else tuple(sorted(fault.joints))
        return ordered == expected and abs(named.first - fault.first) <= max(0.02 * rows, 2.0)
    if fault.kind in ("link_length", "tilt", "link_shift") and cause.name != fault.name:
        parallel = named.axis is not None and fault.axis is not None and abs(named.axis @ fault.axis) > 0.99
        return bool(parallel) and named.place == fault.place
    return not fault.name or cause.name == fault.name


def _near(cause: Cause, named: Fault, fault: Fault) -> bool:
    """Return whether the size of a named cause is the true one."""
    width = float(np.linalg.norm(np.subtract(cause.high, cause.low))) / 2.0 if cause.low else 0.0
    if fault.kind in ("base_rotation", "tool_rotation"):
        turn, expected = (Rotation.from_matrix(each.motion[:3, :3]) for each in (named, fault))
        off, size = float((turn * expected.inv()).magnitude()), float(expected.magnitude())
    elif fault.place is not None:
        off, size = float(np.linalg.norm(named.motion - fault.motion)), float(np.linalg.norm(fault.value))
    else:
        off, size = abs(named.value[0] - fault.value[0]), abs(fault.value[0])
        if fault.kind in EITHER_SIGN:
            off = min(off, abs(named.value[0] + fault.value[0]))
    return bool(off <= NEAR * min(size, 1.0) + 3.0 * width)


def is_among(twins: Sequence[str], fault: Fault, trial: Trial) -> bool:
    """Return whether a true cause is among the twins of a named one."""
    parts = [trial.motion.chain.coordinates[j] for j in fault.joints] or [fault.name]
    if fault.kind in ("base_shift", "base_rotation", "tool_shift", "tool_rotation"):
        parts = [fault.kind[:4], "" if fault.axis is None else "xyz"[int(np.argmax(np.abs(fault.axis)))]]
    words = ("",) if fault.name else TWIN_WORDS.get(fault.kind, (fault.kind.replace("_", " "),))
    return any(all(part in twin for part in parts) and any(w in twin for w in words) for twin in twins)


def does_the_same(named: Sequence[Cause], trial: Trial) -> bool:
    """Return whether named causes do what the true ones do, within what the data show."""
    if any(cause.kind == "base_rotation" and not cause.value for cause in named):
        return False
    hidden = {row for cause in named for row in cause.rows}
    hidden |= {row for fault in trial.truth for row in fault.rows}
    rows = [k for k in range(0, len(trial.motion.t), trial.every) if k not in hidden]
    lasting = 2.0 * LASTING / float(np.median(np.diff(trial.motion.t[rows]))) if trial.correlated else 1.0
    limit = trial.sigma * np.sqrt(LOST_IN_NOISE * max(lasting, 1.0) / len(rows)) + SAME * trial.effect
    signs = (1.0, -1.0) if {cause.kind for cause in named} & {*EITHER_SIGN} else (1.0,)
    for sign, frame in product(signs, range(6) if any(cause.segment for cause in named) else range(1)):
        faults = [fault_of(cause, trial, sign, frame) for cause in named]
        if rms(trial.distance(faults, trial.truth)[rows]) < limit:
            return True
    return False


def graded(named: Sequence[Cause], trial: Trial) -> str:
    """Return how one explanation answers a trial."""
    rest, open_causes = list(trial.truth), []
    for cause in named:
        hit = next((fault for fault in rest if agrees(cause, fault, trial)), None)
        if hit is None:
            open_causes.append(cause)
        else:
            rest.remove(hit)
    if not open_causes:
        return "partial" if rest else "right"
    if not rest:
        return "more"
    twins = [
        fault for fault in rest if any(is_among(cause.equivalents, fault, trial) for cause in open_causes)
    ]
    if len(open_causes) <= len(twins):
        return "twin" if len(twins) == len(rest) else "partial"
    return "same effect" if len(named) <= len(trial.truth) and does_the_same(named, trial) else "wrong"


def outcome(diagnosis: Diagnosis, trial: Trial) -> str:
    """Return how a diagnosis answers a trial."""
    sure = [cause for cause in diagnosis.causes if cause.kind != "own_geometry"]
    if not trial.truth:
        return "wrong" if sure else "undecided" if diagnosis.undecided else "right"
    if not diagnosis.undecided:
        return graded(sure, trial) if sure else "refused" if diagnosis.unidentifiable else "nothing"
    grades = {graded([*sure, *cause.causes], trial) for cause in diagnosis.undecided if sure or cause.causes}
    if grades & {"right", "twin", "same effect"}:
        return "twin"
    if sure and graded(sure, trial) not in ("partial", "right"):
        return "wrong"
    return "partial" if sure else "undecided"


def covered(diagnosis: Diagnosis, trial: Trial) -> list[bool]:
    """Return of each number of a single cause that is named right whether its 95 % interval has it."""
    (fault,), (cause,) = trial.truth, diagnosis.causes
    if trial.kinds[0] not in SIZED or not cause.low:
        return []
    true = np.array(fault.value) + (fault.kind == "joint_scale")
    if fault.axis is not None and cause.axis is not None:
        true = true * np.sign(fault.axis @ np.array(cause.axis))
    elif fault.axis is not None and len(cause.value) == 3:
        true = true[0] * fault.axis
    elif fault.kind in EITHER_SIGN:
        true = true * np.sign(true[0] * cause.value[0])
    if len(true) != len(cause.low):
        return []
    return [bool(each) for each in (np.array(cause.low) <= true) & (true <= np.array(cause.high))]


def run(number: int) -> dict[str, Any]:
    """Ask one trial; return what the file of results keeps of it."""
    trial, begun, diagnosis = make_trial(number), time.perf_counter(), None
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            diagnosis = urmpipe.diagnose(*trial.runs())
        except Exception as error:  # whatever stops the command is a bad answer
            answer, sentence = "error", f"{type(error).__name__}: {error}"
    if diagnosis is not None:
        answer, sentence = outcome(diagnosis, trial), diagnosis.summary
    single = (
        trial.group == "single" and answer == "right" and diagnosis is not None and len(diagnosis.causes) == 1
    )
    return {
        "number": number,
        "code": code(),
        "group": trial.group,
        "kinds": trial.kinds,
        "size": trial.size,
        "noise": "lasting" if trial.correlated else f"{1e3 * trial.sigma:g} mm",
        "truth": str(trial),
        "counts": trial.effect >= MOVED or "outliers" in {fault.kind for fault in trial.truth},
        "answer": answer,
        "said": sentence,
        "covered": covered(diagnosis, trial) if single and diagnosis is not None else [],
        "seconds": round(time.perf_counter() - begun, 3),
    }


@cache
def code() -> str:
    """Return a hash of what gives the answers: results of other code do not count."""
    package = Path(urmpipe_pipeline.__file__).parent
    files = [
        package / "runs" / "reading_errors.py",
        package / "trajectories.py",
        *(package / "diagnosis").glob("*.py"),
        *(package / "comparison").glob("*.py"),
    ]
    files = [file for file in files if file.name not in ("wording.py", "presenter.py", "facts.py")]
    files += Path(__file__).parent.glob("faulty_*.py")
    return hashlib.sha256(
        b"".join(file.read_bytes() for file in [*sorted(files), Path(__file__)])
    ).hexdigest()[:12]


GOOD = ("right", "twin", "same effect")
ANSWERS = (*GOOD, "partial", "undecided", "refused", "nothing", "more", "wrong", "error")
WRONG = ("more", "wrong")


def table(title: str, rows: Mapping[str, Sequence[Mapping[str, Any]]]) -> list[str]:
    """Return a Markdown table of the answers, a row for each name."""
    lines = ["", f"| {title} | trials | {' | '.join(ANSWERS)} |", "|---" * (len(ANSWERS) + 2) + "|"]
    for name, results in rows.items():
        count = Counter(result["answer"] for result in results)
        lines.append(
            f"| {name} | {len(results)} | {' | '.join(str(count[result] or '') for result in ANSWERS)} |"
        )
    return lines


def by(key: Callable[[Mapping[str, Any]], str], results: Sequence[Mapping[str, Any]]) -> dict[str, list[Any]]:
    """Return results by what they have in common, in the order of their names."""
    names = sorted({key(result) for result in results})
    return {name: [result for result in results if key(result) == name] for name in names}


def share(results: Sequence[Mapping[str, Any]], *answers: str) -> float:
    """Return the share of some answers, 0..1."""
    return sum(result["answer"] in answers for result in results) / max(len(results), 1)


def judged(results: Sequence[Mapping[str, Any]]) -> tuple[list[str], list[Bound]]:
    """Return the tables and bounds of results."""
    of = by(lambda result: result["group"], results)
    singles, outside, quiet = (of.get(name, []) for name in ("single", "outside", "undisturbed"))
    counted = [result for result in singles if result["counts"]]
    lines = [
        *table(f"single causes of {1e3 * MOVED:g} mm rms or more", by(_kind, counted) | {"all": counted}),
        *table(
            "single causes by their rms in mm", by(lambda result: f"{1e3 * result['size']:04.1f}", singles)
        ),
        *table("single causes by noise", by(lambda result: result["noise"], counted)),
        *table("others", {"pairs": of.get("pair", [])} | by(_kind, outside) | {"undisturbed": quiet}),
    ]
    bounds = [
        Bound("singles: right, a twin, or a cause of the same effect", share(counted, *GOOD), least=0.9),
        Bound("singles: wrong", share(counted, *WRONG), under=0.005),
        Bound("errors", sum(result["answer"] == "error" for result in results), most=0),
        Bound("outside the catalogue: named as something else", share(outside, "wrong"), under=0.05),
        Bound("undisturbed: false", sum(result["answer"] != "right" for result in quiet), most=0),
    ]
    for noise, group in by(
        lambda result: result["noise"], [result for result in singles if result["covered"]]
    ).items():
        hits = [hit for result in group for hit in result["covered"]]
        what = f"95 % intervals that hold the size, noise {noise}, of {len(hits)}"
        bounds.append(Bound(what, float(np.mean(hits)), least=0.9, most=0.98))
    return lines, bounds


def _kind(result: Mapping[str, Any]) -> str:
    return str(result["kinds"][0])


def kept(work: Path, numbers: Sequence[int]) -> dict[int, dict[str, Any]]:
    """Return the results of trials that a file has of this code."""
    lines = work.read_text("utf-8").splitlines() if work.is_file() else []
    results = [json.loads(line) for line in lines if line.endswith("}")]
    return {
        result["number"]: result
        for result in results
        if result["code"] == code() and result["number"] in {*numbers}
    }


def export(number: int, folder: Path) -> None:
    """Write a trial as files, and how to ask it."""
    import pandas as pd

    trial = make_trial(number)
    t, q, reference_t, values = trial.data()
    names = list(trial.motion.chain.coordinates)
    path = names if trial.both else ["x", "y", "z", "qx", "qy", "qz", "qw"][: values.shape[1]]
    folder.mkdir(parents=True, exist_ok=True)
    for name, when, columns, array in (("path", reference_t, path, values), ("log", t, names, q)):
        frame = pd.DataFrame(array, columns=columns)
        if not trial.motion.source.still:
            frame.insert(0, "t", when)
        frame.to_csv(folder / f"{name}.csv", index=False, float_format="%.7f")
    robot = trial.motion.source.robot
    robot = str(SHARED / "cases/diagnosis/irb120.toml") if robot == "irb120" else robot
    tool = f" --tool={TOOL}" * any(trial.motion.chain.tool.translation)
    print(f"{trial}\nurmpipe diagnose {folder}/path.csv {folder}/log.csv --robot {robot} --unit rad{tool}"
          + " --poses" * trial.motion.source.still)  # fmt: skip


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    default = Path(tempfile.gettempdir()) / "urmpipe_diagnosis_trials.jsonl"
    parser.add_argument(
        "--trials", type=int, default=COUNT, help="how many, from the first: they have all kinds"
    )
    parser.add_argument("--only", nargs="+", default=[], help="kinds or groups: joint_lag, pair, outside ...")
    parser.add_argument("--numbers", nargs="+", type=int, default=[], help="trials by their numbers")
    parser.add_argument("--jobs", type=int, default=2, help="processes")
    parser.add_argument("--work", type=Path, default=default, help="the file of results")
    parser.add_argument("--list-bad", action="store_true", help="print what was there and what was said")
    parser.add_argument("--export", nargs=2, metavar=("N", "DIR"), help="write a trial as files, no more")
    return parser.parse_args()


def main() -> None:
    """Run the trials and keep the results."""
    options = _options()
    if not SHARED.is_dir():
        sys.exit("needs the folder shared with logs of others next to the checkout")
    warnings.simplefilter("ignore")
    if options.export:
        export(int(options.export[0]), Path(options.export[1]))
        return
    only = {*options.only}
    first = [k for k, cell in enumerate(plan()[: options.trials]) if not only or only & {cell[0], *cell[1]}]
    numbers = options.numbers or first
    done = kept(options.work, numbers)
    for source, tool in product(MOTIONS, (False, True)):
        motion_of(source, tool)  # once, before the processes part
    pool = multiprocessing.get_context("fork").Pool(options.jobs)
    with options.work.open("a", encoding="utf-8") as file, pool:
        for result in pool.imap_unordered(run, [k for k in numbers if k not in done]):
            file.write(json.dumps(result) + "\n")
            file.flush()
            done[result["number"]] = result
            print(f"\r{len(done)} of {len(numbers)}", end="", file=sys.stderr)
    print(file=sys.stderr)
    results = [done[k] for k in sorted(done)]
    for result in results if options.list_bad else ():
        if result["answer"] not in GOOD:
            print(f"{result['answer']}: {result['truth']}\n    {result['said']}")
    lines, bounds = judged(results)
    if len(results) < COUNT:
        print("\n".join([*lines, "", *map(str, bounds)]))
        return
    title = [f"# Diagnosis: {COUNT} seeded trials on motions of real logs", "", *machine("scipy"), ""]
    title.append(f"All trials took {sum(result['seconds'] for result in results):.0f} s of one core.")
    title.append("Twin: the true cause is a twin of the one that is named.")
    title.append("Same effect: another cause is named that moves the arm alike.")
    write_results("diagnosis_trials", [*title, *lines], bounds)


if __name__ == "__main__":
    main()
