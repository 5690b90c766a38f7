"""Measure how often `diagnose` names what is there, in the 1000 trials of `faulty_logs`.

The question goes through `urmpipe.ingest` and `urmpipe.diagnose`; the answer is graded (`outcome`).
Results are appended to a file, and a second run goes on from there; those of other code do not count.
Set OMP_NUM_THREADS=1: two processes share the trials. Needs the folder `shared` beside the checkout.
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
from faulty_logs import (
    AXES,
    COUNT,
    EDITS,
    LASTING,
    MOTIONS,
    SHARED,
    SIZED,
    TOOL,
    Fault,
    Trial,
    matrix,
    motion_of,
    plan,
    rms,
    segments,
    trial,
)  # fmt: skip
from pairs import Bound, machine, write_results
from scipy.spatial.transform import Rotation

import urmpipe
import urmpipe_pipeline
from urmpipe_pipeline.diagnosis.result import Cause, Diagnosis

MOVED = 1e-3  # m rms: what singles have to move to count
LOST_IN_NOISE = 30.0  # chi-square of two explanations below which these samples do not separate them
SAME = 3e-3  # share of the effect, likewise: interpolation between samples

TWIN_WORDS = {
    "joint_offset": ("offset", "zero"), "joint_scale": ("scale", "factor"), "joint_lag": ("lag", "delay"),
    "base_shift": ("shift",), "tool_shift": ("shift",), "base_rotation": ("rotation", "turn"),
    "tool_rotation": ("rotation", "turn"), "time_lag": ("time lag", "clock"), "clock_drift": ("drift",),
    "servo_lag": ("servo lag",), "joint_unit": ("unit", "deg"),
}  # fmt: skip
"""Words of which a twin has one, of kinds whose name is not in it as it is."""

EITHER_SIGN = ("joint_lag", "servo_lag", "backlash", "sag")
"""Kinds of which a size is compared without its sign."""

UNSIZED = ("path_unit", "outliers", *EDITS)
"""Kinds that are there or not."""

NEAR = 0.25
"""A named cause is the true one if it is no further from it than this share, and three times its interval."""


def fault_of(cause: Cause, made: Trial, sign: float = 1.0, frame: int = 0) -> Fault:
    """Return a named cause as one of the arm; `sign` and `frame` count through what is open of it."""
    chain, frames, place, at = made.motion.chain, made.motion.arm.frames, None, np.eye(4)
    value = tuple((sign if cause.kind in EITHER_SIGN else 1.0) * float(one) for one in cause.value)
    if cause.kind == "joint_scale":
        value = (value[0] - 1.0,)
    if cause.kind in ("link_length", "link_shift", "tilt"):
        place = int(cause.segment[1:]) + 1 if cause.segment else 1
        own = [one for one in segments(chain, "link_length") + segments(chain, "tilt") if one.place == place]
        named = [one.at for one in own if one.name == cause.name]
        places = named or [frames[place], at, *(one.at for one in own)]
        at = places[frame % len(places)]
    elif cause.kind in ("base_shift", "base_rotation", "tool_shift", "tool_rotation"):
        place = 0 if cause.kind.startswith("base") else len(frames) - 1
        at = frames[place] if place else matrix(AXES, frames[0][:3, 3])
    joints = tuple(chain.coordinates.index(one) for one in cause.joints if one in chain.coordinates)
    axis = None if cause.axis is None else np.array(cause.axis)
    return Fault(cause.kind, value, joints, cause.name, axis, place, at, cause.from_sample or 0, cause.rows)


def agrees(cause: Cause, one: Fault, made: Trial) -> bool:
    """Return whether a named cause is a true one: what it is, what it is of, and its size."""
    named = fault_of(cause, made)
    if cause.kind != one.kind or not _of_the_same(cause, named, one, len(made.motion.t)):
        return False
    return one.kind in UNSIZED or not one.value or (bool(named.value) and _near(cause, named, one))


def _of_the_same(cause: Cause, named: Fault, one: Fault, rows: int) -> bool:
    """Return whether two causes of one kind are of the same joints, rows, segment or name."""
    if one.kind == "outliers":
        both, either = {*named.rows} & {*one.rows}, {*named.rows} | {*one.rows}
        return len(both) > 0.9 * len(either)
    if one.joints:
        ordered = named.joints if one.kind == "joint_coupled" else tuple(sorted(named.joints))
        wanted = one.joints if one.kind == "joint_coupled" else tuple(sorted(one.joints))
        return ordered == wanted and abs(named.first - one.first) <= max(0.02 * rows, 2.0)
    if one.kind in ("link_length", "tilt", "link_shift") and cause.name != one.name:
        parallel = named.axis is not None and one.axis is not None and abs(named.axis @ one.axis) > 0.99
        return bool(parallel) and named.place == one.place
    return not one.name or cause.name == one.name


def _near(cause: Cause, named: Fault, one: Fault) -> bool:
    """Return whether the size of a named cause is the true one."""
    width = float(np.linalg.norm(np.subtract(cause.high, cause.low))) / 2.0 if cause.low else 0.0
    if one.kind in ("base_rotation", "tool_rotation"):
        turn, wanted = (Rotation.from_matrix(each.motion[:3, :3]) for each in (named, one))
        off, size = float((turn * wanted.inv()).magnitude()), float(wanted.magnitude())
    elif one.place is not None:
        off, size = float(np.linalg.norm(named.motion - one.motion)), float(np.linalg.norm(one.value))
    else:
        off, size = abs(named.value[0] - one.value[0]), abs(one.value[0])
        if one.kind in EITHER_SIGN:
            off = min(off, abs(named.value[0] + one.value[0]))
    return bool(off <= NEAR * min(size, 1.0) + 3.0 * width)


def told_among(twins: Sequence[str], one: Fault, made: Trial) -> bool:
    """Return whether a true cause is among the twins of a named one."""
    parts = [made.motion.chain.coordinates[j] for j in one.joints] or [one.name]
    if one.kind.startswith(("base", "tool")):
        parts = [one.kind[:4], "" if one.axis is None else "xyz"[int(np.argmax(np.abs(one.axis)))]]
    words = ("",) if one.name else TWIN_WORDS.get(one.kind, (one.kind.replace("_", " "),))
    return any(all(part in twin for part in parts) and any(w in twin for w in words) for twin in twins)


def does_the_same(named: Sequence[Cause], made: Trial) -> bool:
    """Return whether named causes do what the true ones do, as far as the data can tell."""
    if any(
        one.kind.startswith(("base", "tool")) and not one.value and one.kind != "base_mirrored"
        for one in named
    ):
        return False
    hidden = {row for rows in (one.rows for one in named) for row in rows}
    hidden |= {row for one in made.truth for row in one.rows}
    rows = [k for k in range(0, len(made.motion.t), made.every) if k not in hidden]
    lasting = 2.0 * LASTING / float(np.median(np.diff(made.motion.t[rows]))) if made.correlated else 1.0
    limit = made.sigma * np.sqrt(LOST_IN_NOISE * max(lasting, 1.0) / len(rows)) + SAME * made.effect
    signs = (1.0, -1.0) if {one.kind for one in named} & {*EITHER_SIGN} else (1.0,)
    for sign, frame in product(signs, range(6) if any(one.segment for one in named) else range(1)):
        faults = [fault_of(one, made, sign, frame) for one in named]
        if rms(made.apart(faults, made.truth)[rows]) < limit:
            return True
    return False


def graded(named: Sequence[Cause], made: Trial) -> str:
    """Return how one explanation answers a trial."""
    rest, open_causes = list(made.truth), []
    for cause in named:
        hit = next((one for one in rest if agrees(cause, one, made)), None)
        if hit is None:
            open_causes.append(cause)
        else:
            rest.remove(hit)
    if not open_causes:
        return "partial" if rest else "right"
    if not rest:
        return "more"
    twins = [one for one in rest if any(told_among(cause.twins, one, made) for cause in open_causes)]
    if len(open_causes) <= len(twins):
        return "told twin" if len(twins) == len(rest) else "partial"
    return "same effect" if len(named) <= len(made.truth) and does_the_same(named, made) else "wrong"


def outcome(found: Diagnosis, made: Trial) -> str:
    """Return how a diagnosis answers a trial."""
    sure = [one for one in found.causes if one.kind != "own_geometry"]
    if not made.truth:
        return "wrong" if sure else "undecided" if found.undecided else "right"
    if not found.undecided:
        return graded(sure, made) if sure else "refused" if found.refused else "nothing"
    grades = {graded([*sure, *one.causes], made) for one in found.undecided if sure or one.causes}
    if grades & {"right", "told twin", "same effect"}:
        return "told twin"
    if sure and graded(sure, made) not in ("partial", "right"):
        return "wrong"
    return "partial" if sure else "undecided"


def covered(found: Diagnosis, made: Trial) -> list[bool]:
    """Return of each number of a single cause that is named right whether its 95 % interval has it."""
    (one,), (cause,) = made.truth, found.causes
    if made.kinds[0] not in SIZED or not cause.low:
        return []
    true = np.array(one.value) + (one.kind == "joint_scale")
    if one.axis is not None and cause.axis is not None:
        true = true * np.sign(one.axis @ np.array(cause.axis))
    elif one.axis is not None and len(cause.value) == 3:
        true = true[0] * one.axis
    elif one.kind in EITHER_SIGN:
        true = true * np.sign(true[0] * cause.value[0])
    if len(true) != len(cause.low):
        return []
    return [bool(each) for each in (np.array(cause.low) <= true) & (true <= np.array(cause.high))]


def run(number: int) -> dict[str, Any]:
    """Ask one trial; return what the file of results keeps of it."""
    made, begun, found = trial(number), time.perf_counter(), None
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            found = urmpipe.diagnose(*made.runs())
        except Exception as error:  # whatever stops the command is a bad answer
            answer, said = "error", f"{type(error).__name__}: {error}"
    if found is not None:
        answer, said = outcome(found, made), found.sentence
    single = made.group == "single" and answer == "right" and found is not None and len(found.causes) == 1
    return {
        "number": number,
        "code": code(),
        "group": made.group,
        "kinds": made.kinds,
        "size": made.size,
        "noise": "lasting" if made.correlated else f"{1e3 * made.sigma:g} mm",
        "truth": str(made),
        "counts": made.effect >= MOVED or "outliers" in {one.kind for one in made.truth},
        "answer": answer,
        "said": said,
        "covered": covered(found, made) if single and found is not None else [],
        "seconds": round(time.perf_counter() - begun, 3),
    }


@cache
def code() -> str:
    """Return a hash of what gives the answers: results of other code do not count."""
    own = Path(urmpipe_pipeline.__file__).parent
    files = [own / "log_edits.py", *(own / "diagnosis").glob("*.py"), *(own / "comparison").glob("*.py")]
    files = [one for one in files if one.name not in ("wording.py", "presenter.py", "facts.py")]
    files += Path(__file__).parent.glob("*_logs.py")
    return hashlib.sha256(b"".join(one.read_bytes() for one in [*sorted(files), Path(__file__)])).hexdigest()[
        :12
    ]


GOOD = ("right", "told twin", "same effect")
ANSWERS = (*GOOD, "partial", "undecided", "refused", "nothing", "more", "wrong", "error")
FALSE = ("more", "wrong")


def table(title: str, rows: Mapping[str, Sequence[Mapping[str, Any]]]) -> list[str]:
    """Return a Markdown table of the answers, one row a name."""
    lines = ["", f"| {title} | trials | {' | '.join(ANSWERS)} |", "|---" * (len(ANSWERS) + 2) + "|"]
    for name, results in rows.items():
        count = Counter(one["answer"] for one in results)
        lines.append(f"| {name} | {len(results)} | {' | '.join(str(count[one] or '') for one in ANSWERS)} |")
    return lines


def by(key: Callable[[Mapping[str, Any]], str], results: Sequence[Mapping[str, Any]]) -> dict[str, list[Any]]:
    """Return results by what they have in common, in the order of their names."""
    names = sorted({key(one) for one in results})
    return {name: [one for one in results if key(one) == name] for name in names}


def share(results: Sequence[Mapping[str, Any]], *answers: str) -> float:
    """Return the share of some answers, 0..1."""
    return sum(one["answer"] in answers for one in results) / max(len(results), 1)


def judged(results: Sequence[Mapping[str, Any]]) -> tuple[list[str], list[Bound]]:
    """Return the tables and bounds of results."""
    of = by(lambda one: one["group"], results)
    singles, outside, quiet = (of.get(name, []) for name in ("single", "outside", "undisturbed"))
    counted = [one for one in singles if one["counts"]]
    lines = [
        *table(f"single causes of {1e3 * MOVED:g} mm rms or more", by(_kind, counted) | {"all": counted}),
        *table("singles, mm rms", by(lambda one: f"{1e3 * one['size']:04.1f}", singles)),
        *table("singles, noise", by(lambda one: one["noise"], counted)),
        *table("others", {"pairs": of.get("pair", [])} | by(_kind, outside) | {"undisturbed": quiet}),
    ]
    bounds = [
        Bound("singles: right, a told twin, or a cause that does the same", share(counted, *GOOD), least=0.9),
        Bound("singles: wrong", share(counted, *FALSE), under=0.005),
        Bound("errors", sum(one["answer"] == "error" for one in results), most=0),
        Bound("outside the catalogue: named as something else", share(outside, "wrong"), under=0.05),
        Bound("undisturbed: false", sum(one["answer"] != "right" for one in quiet), most=0),
    ]
    for noise, own in by(lambda one: one["noise"], [one for one in singles if one["covered"]]).items():
        hits = [hit for one in own for hit in one["covered"]]
        what = f"95 % intervals that hold the size, noise {noise}, of {len(hits)}"
        bounds.append(Bound(what, float(np.mean(hits)), least=0.9, most=0.98))
    return lines, bounds


def _kind(one: Mapping[str, Any]) -> str:
    return str(one["kinds"][0])


def kept(work: Path, numbers: Sequence[int]) -> dict[int, dict[str, Any]]:
    """Return the results of trials that a file has of this code."""
    lines = work.read_text("utf-8").splitlines() if work.is_file() else []
    found = [json.loads(line) for line in lines if line.endswith("}")]
    return {one["number"]: one for one in found if one["code"] == code() and one["number"] in {*numbers}}


def export(number: int, folder: Path) -> None:
    """Write a trial as files, and how to ask it."""
    import pandas as pd

    made = trial(number)
    t, q, reference_t, values = made.data()
    names = list(made.motion.chain.coordinates)
    path = names if made.both else ["x", "y", "z", "qx", "qy", "qz", "qw"][: values.shape[1]]
    folder.mkdir(parents=True, exist_ok=True)
    for name, when, columns, array in (("path", reference_t, path, values), ("log", t, names, q)):
        frame = pd.DataFrame(array, columns=columns)
        if not made.motion.source.still:
            frame.insert(0, "t", when)
        frame.to_csv(folder / f"{name}.csv", index=False, float_format="%.7f")
    robot = made.motion.source.robot
    robot = str(SHARED / "cases/diagnosis/irb120.toml") if robot == "irb120" else robot
    tool = f" --tool={TOOL}" * any(made.motion.chain.tool.translation)
    print(f"{made}\nurmpipe diagnose {folder}/path.csv {folder}/log.csv --robot {robot} --unit rad{tool}"
          + " --poses" * made.motion.source.still)  # fmt: skip


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    own = Path(tempfile.gettempdir()) / "urmpipe_diagnosis_trials.jsonl"
    parser.add_argument("--trials", type=int, default=COUNT, help="the first so many: they have all kinds")
    parser.add_argument("--only", nargs="+", default=[], help="kinds or groups: joint_lag, pair, outside ...")
    parser.add_argument("--numbers", nargs="+", type=int, default=[], help="trials by their numbers")
    parser.add_argument("--jobs", type=int, default=2, help="processes")
    parser.add_argument("--work", type=Path, default=own, help="the file of results")
    parser.add_argument("--list-bad", action="store_true", help="print what was there and what was said")
    parser.add_argument("--export", nargs=2, metavar=("N", "DIR"), help="write a trial as files, no more")
    return parser.parse_args()


def main() -> None:
    """Run the trials and keep the results."""
    options = _options()
    if not SHARED.is_dir():
        sys.exit("needs the folder shared with logs of others beside the checkout")
    warnings.simplefilter("ignore")
    if options.export:
        export(int(options.export[0]), Path(options.export[1]))
        return
    asked = {*options.only}
    first = [k for k, cell in enumerate(plan()[: options.trials]) if not asked or asked & {cell[0], *cell[1]}]
    wanted = options.numbers or first
    done = kept(options.work, wanted)
    for source, tool in product(MOTIONS, (False, True)):
        motion_of(source, tool)  # once, before the processes part
    pool = multiprocessing.get_context("fork").Pool(options.jobs)
    with options.work.open("a", encoding="utf-8") as file, pool:
        for result in pool.imap_unordered(run, [k for k in wanted if k not in done]):
            file.write(json.dumps(result) + "\n")
            file.flush()
            done[result["number"]] = result
            print(f"\r{len(done)} of {len(wanted)}", end="", file=sys.stderr)
    print(file=sys.stderr)
    results = [done[k] for k in sorted(done)]
    for one in results if options.list_bad else ():
        if one["answer"] not in GOOD:
            print(f"{one['answer']}: {one['truth']}\n    {one['said']}")
    lines, bounds = judged(results)
    if len(results) < COUNT:
        print("\n".join([*lines, "", *map(str, bounds)]))
        return
    title = [f"# Diagnosis: {COUNT} seeded trials on motions of real logs", "", *machine("scipy")]
    took = f"{sum(one['seconds'] for one in results):.0f} s of one core."
    same = "Same effect: what is named does what the truth does, and does not have it as a twin."
    write_results("diagnosis_trials", [*title, f"{took} {same}", *lines], bounds)


if __name__ == "__main__":
    main()
