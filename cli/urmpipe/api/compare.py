"""`urmpipe.compare`: logs against a reference, and the result against an earlier one."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, Unpack

from urmpipe.api.iso_options import Cycles, iso_options
from urmpipe.arm_placing import Frame, Robot
from urmpipe.keyword_checks import (
    PathLike,
    one_or_many,
    paths,
    public_reading,
    refuse_foreign,
    refuse_others,
    refuse_warnings,
)
from urmpipe.output_files import guarded_outputs
from urmpipe.reading import Reading, map_files, resolved
from urmpipe_models import DEFAULT_TOLERANCE
from urmpipe_models.errors import Finding, Hint, OptionError, RecordingError, map_collecting_errors
from urmpipe_pipeline.comparison.baseline import against_baseline, complete_noise
from urmpipe_pipeline.comparison.compare import CompareOptions, Tcp, compare_recorded, compare_runs
from urmpipe_pipeline.comparison.comparison import Comparison, FailedLog, judge_others
from urmpipe_pipeline.comparison.sync import SyncOption
from urmpipe_pipeline.comparison.verdict import parse_tolerance
from urmpipe_pipeline.comparison.warnings import CLOCKS_DIFFER, LARGE_NOISE, SWAPPED, large_noises
from urmpipe_pipeline.operands import (
    BASELINE_HINT,
    RUN_LIKE,
    RunLike,
    is_log,
    load_comparison,
    load_runs,
    reject_reading_options,
)
from urmpipe_pipeline.outputs import OutputKind
from urmpipe_pipeline.results import present, read_recording, result_kind
from urmpipe_pipeline.runs.derivatives import Method
from urmpipe_pipeline.runs.recorded_tcp import MISSING_TOOL
from urmpipe_pipeline.runs.run import Run
from urmpipe_pipeline.simulations.simulation import Simulation
from urmpipe_pipeline.solved_targets.given_targets import TargetsLike
from urmpipe_pipeline.sources import Held, TableLike, held_of, is_table
from urmpipe_pipeline.tables.csv_files import write_table
from urmpipe_pipeline.tables.junit import errors_in_junit, write_junit
from urmpipe_pipeline.trajectories import AlignMode

Operand = PathLike | TableLike | RunLike | Simulation

EARLIER = Hint("baseline", None, "sets one")

OPERANDS = (
    "a log, a path, a recording, a DataFrame or Arrow table, a Run, SolvedTargets, PlannedPath or Simulation;"
    " arrays are ingested first: urmpipe.ingest(t=t, q=q)"
)


@public_reading(Reading)
def compare(
    reference: Operand | Comparison,
    logs: Operand | Sequence[Operand] = (),
    robot: Robot | None = None,
    *,
    base: Frame | None = None,
    tool: Frame | None = None,
    base_link: str | None = None,
    tip_link: str | None = None,
    tsp: float | None = None,
    derivative: Method | None = None,
    tolerance: float | str | Mapping[str, float] | None = None,
    tcp: Tcp = "fk",
    sync: SyncOption | None = None,
    align: AlignMode = "none",
    sides: tuple[str, str] | None = None,
    block: str | Sequence[str] | None = None,
    diagnose: bool = False,
    iso: bool = False,
    cycles: Cycles | None = None,
    planes: int | None = None,
    band: float | None = None,
    targets: TargetsLike | None = None,
    baseline: PathLike | Comparison | None = None,
    noise: float | str | Mapping[str, float] | None = None,
    strict: bool = False,
    keep_going: bool = False,
    output: PathLike | None = None,
    junit: PathLike | None = None,
    csv: PathLike | None = None,
    inputs: Sequence[PathLike] = (),
    defaults: Sequence[str] = (),
    progress: Callable[[float], None] | None = None,
    **reading: Unpack[Reading],
) -> Comparison:
    """Hold logs against a reference, and write what is named: all or none. docs/python.md has the keywords.

    Args:
        reference: A path, a log, a recording, a run or a simulation; alone, held against the TCP that it
            recorded itself. With a `baseline` alone: a comparison, which stands as it was made.
        logs: What to judge: logs, recordings, runs and simulations, or one of them.
        robot: The arm; a recording or a run that has another one is computed anew with it.
        base: Where the arm stands in the world, in [m] and [rad]; as a matrix of shape (4, 4).
        tool: The tool centre point in the frame of the arm's tip, likewise.
        base_link: Link of a URDF where the arm begins; default: its root.
        tip_link: Link of a URDF where the arm ends; default: its end.
        tsp: Period of a log's grid in [s].
        derivative: How a log is differentiated: central or savgol.
        tolerance: Largest deviation allowed of an axis in [m], or in [m] and [rad] by kind, or as a text with
            units, such as "axis=3.5mm,angle=0.5deg"; default: 3.5 mm an axis. Likewise the least shares to be
            seen: coverage of the reference (0.9), judged of the log's motion (0.5). With `iso` of criteria,
            such as "AP=0.4mm,AV=5%"; default: none.
        tcp: Where a log was: fk or recorded.
        sync: How the clocks are put together: stamps, start, auto, or t_reference - t_log in [s]; default:
            stamps where both sides have Unix times or dates that overlap, else start; with `iso` auto.
        align: How a log is moved in space first: none, start, rigid, tool or base+tool.
        sides: Two words in the names of the columns of one log, such as ("target", "actual"): what was asked
            for is the reference of what was done; "rest" for the columns without the other word.
        block: The block of a simulation whose motion is meant; of several simulations one for all, or one for
            each in their order; default: the only block that has a motion.
        diagnose: Whether the `diagnosis` of each run says why it deviates. Base and tool are causes then: not
            with `align`.
        iso: Whether the logs are the cycles of a test after ISO 9283, or one log in which the motion repeats:
            its criteria are judged, see docs/iso.md. Not with `align` or `diagnose`.
        cycles: First and last row of each cycle of one log, from 1, as "1:1477,1478:2955" or pairs; default:
            found by its returns to the start.
        planes: How many planes cut the command path; default: 50.
        band: Half of the width of the band round a final pose in [m]; default: 0.1 mm.
        targets: The poses to judge, as `ik` takes them; default: those in which the reference rests.
        baseline: An earlier comparison, to tell what changed since.
        noise: Changes since then that mean nothing, in [m], or in [m] and [rad] by kind, or as a text
            with units; default: 1 um and 1 urad.
        strict: Whether a warning is an error.
        keep_going: Whether logs are judged even if others cannot be: these are then the result's `unjudged`,
            and its `verdict` is None, or fail. Not with `iso`.
        output: The recording (.rrd) to write.
        junit: A JUnit file (XML) to write.
        csv: A table to write, one row a log and quantity.
        inputs: Files besides the operands that are never replaced.
        defaults: Options that a file set, for the line of the verdict: "sync=auto from ../urmpipe.toml".
        progress: Told the share of the recording that is written, 0..1.
        **reading: How to read the logs where they cannot tell by themselves: unit, time, joints, log_map and
            the others of `urmpipe.Reading`; it holds for every log.

    Raises:
        UrmpipeError: With everything that is wrong with the input or the output.

    Source: [UrmArm2021]_ eq. 19-23.
    """
    several = one_or_many(logs)
    operands = operands_of({"reference": [reference]} | ({"logs": several} if several else {}), Comparison)
    reference = operands[0]
    kept = [*_files([*operands, baseline]), *map_files(reading), *paths(inputs)]
    outputs: dict[OutputKind, PathLike | None] = {
        "recording": output, "junit": junit, "statistics": csv,
    }  # fmt: skip
    told = None if junit is None else Path(junit)
    with errors_in_junit(told, kept), guarded_outputs(outputs, kept) as written:
        level = _noise_level(noise, baseline)
        given = resolved(reading, robot, base, tool, base_link, tip_link)
        test = iso_options(
            reference, iso=iso, cycles=cycles, planes=planes, band=band, targets=targets, read=given.options
        )
        options = CompareOptions(
            _allowed(tolerance, iso=iso), tcp, _clocks(sync, iso=iso),
            align, isinstance(tolerance, str), diagnose, test, tuple(defaults),
        )  # fmt: skip
        if keep_going and iso:
            raise OptionError(Finding(parameter="keep_going", found="with iso", allowed="one of the two"))
        _refuse_unused(operands, {**reading, "tsp": tsp, "derivative": derivative, "sides": sides})
        earlier = None if baseline is None else _earlier(baseline)
        load = partial(
            load_runs, sides=sides, robot=given.arm, read=given.options, tsp=tsp, derivative=derivative,
            block=block, comparison_hints=() if diagnose else (BASELINE_HINT,),
        )  # fmt: skip

        def checked(made: Comparison) -> Comparison:
            """Return a comparison with the doubts about a noise, if no doubt is an error."""
            made = made if earlier is None else _with_noise(made, level)
            _refuse_doubts(strict, made)
            return made

        made = None if operands[1:] or earlier is None else _made_before(reference, output)
        unjudged: list[FailedLog] | None = [] if keep_going else None
        made = checked(made) if made else _compared(operands, load, options, checked, unjudged)
        result = made if earlier is None else replace(made, baseline=against_baseline(made, earlier, level))
        shown = present(result)
        written.write("junit", lambda part, path: write_junit(shown, part, path))
        if (rows := shown.rows) is not None:
            written.write("statistics", lambda part, path: write_table(rows(), part, path))
        return written.recorded(result, progress)


def operands_of(given: Mapping[str, Sequence[Any]], *further: type) -> list[Any]:
    """Return what was given by keyword, tables as logs called so.

    Args:
        given: Operands by keyword.
        *further: What is allowed besides what stands for a run.

    Raises:
        OptionError: With everything that is no operand.
    """
    kinds = (*RUN_LIKE, Simulation, Held, *further)
    named = {name: list(_with_tables(name.removesuffix("s"), operands)) for name, operands in given.items()}
    map_collecting_errors(lambda one: refuse_others(*one, kinds, OPERANDS), named.items())
    return [one for operands in named.values() for one in operands]


def _with_tables(name: str, operands: Sequence[Any]) -> Iterator[Any]:
    """Yield operands, the tables among them as logs with this name, and a number if there are several."""
    for k, one in enumerate(operands, start=1):
        yield held_of(one, f"{name} {k}" if len(operands) > 1 else name) if is_table(one) else one


def _allowed(tolerance: float | str | Mapping[str, float] | None, *, iso: bool) -> Mapping[str, float]:
    """Return what is allowed by kind, in [m] and [rad], or of criteria in their units."""
    if tolerance is None:
        return {} if iso else {"axis": DEFAULT_TOLERANCE}
    if isinstance(tolerance, str):
        return parse_tolerance(tolerance, iso=iso)
    return tolerance if isinstance(tolerance, Mapping) else {"axis": tolerance}


def _clocks(sync: SyncOption | None, *, iso: bool) -> SyncOption | None:
    """Return how clocks are put together: as given, else each cycle for itself; None for logs."""
    return "auto" if iso and sync is None else sync


def _refuse_unused(operands: Sequence[Operand | Comparison], given: Mapping[str, Any]) -> None:
    """Raise an `OptionError` with all that says how logs are read, if every operand was ingested before."""
    logs = (Path(one) if isinstance(one, str) else one for one in operands)
    if not any(map(is_log, logs)):
        reject_reading_options(given)


def _noise_level(
    noise: float | str | Mapping[str, float] | None, baseline: PathLike | Comparison | None
) -> Mapping[str, float]:
    """Return what changes mean nothing, by kind.

    Raises:
        OptionError: If it is no such mapping, or there is no baseline.
    """
    if noise is not None and baseline is None:
        allowed = "with an earlier comparison"
        raise OptionError(Finding(parameter="noise", found="no baseline", allowed=allowed, hints=(EARLIER,)))
    return complete_noise(noise)


def _compared(
    operands: Sequence[Path | str | Held | RunLike | Simulation | Comparison],
    load: Callable[..., list[Run]],
    options: CompareOptions,
    checked: Callable[[Comparison], Comparison],
    unjudged: list[FailedLog] | None,
) -> Comparison:
    """Return the comparison of some logs with a reference, or of one log with what it recorded itself."""
    if any(isinstance(one, Comparison) for one in operands):
        raise OptionError("found a comparison as the reference, allowed: with a baseline, and without logs")
    given = (Path(one) if isinstance(one, (str, Path)) else one for one in operands)
    first, *others = load([one for one in given if not isinstance(one, Comparison)], failed=unjudged)
    if options.iso is not None and not others:
        raise OptionError(Finding(parameter="iso", found="no log", allowed="a reference and its cycles"))
    if not others:
        return checked(compare_recorded(first, options))

    def judge(runs: Sequence[Run]) -> Comparison:
        return checked(compare_runs(first, runs, options))

    if unjudged is None:
        return judge(others)
    return replace(judge_others(judge, others, unjudged), failed_logs=tuple(unjudged))


def _made_before(reference: Operand | Comparison, output: PathLike | None) -> Comparison | None:
    """Return the comparison that the reference is; None if it is a log, a path or a run.

    Raises:
        OptionError: If it is to be recorded again.
    """
    if not isinstance(reference, (str, Path, Comparison)):
        return None
    made = reference if isinstance(reference, Comparison) else load_comparison(Path(reference))
    if made is not None and output is not None:
        found = f"{output} with an existing comparison"
        raise OptionError(Finding(parameter="output", found=found, allowed="without"))
    return made


def _earlier(baseline: PathLike | Comparison) -> Comparison:
    """Return the comparison that a baseline is."""
    if isinstance(baseline, Comparison):
        return baseline
    path = Path(baseline)
    if not path.exists():
        said = "found no such file, allowed: the recording of an earlier comparison"
        raise RecordingError(Finding(said, str(path), parameter="baseline"))
    refuse_foreign([path])
    result = read_recording(path)
    if not isinstance(result, Comparison):
        found = f"found a recording ({result_kind(result).name})"
        raise RecordingError(
            Finding(f"{found}, allowed: that of a comparison", str(path), parameter="baseline")
        )
    return result


def _with_noise(made: Comparison, noise: Mapping[str, float]) -> Comparison:
    """Return a comparison with the doubts about a noise, and without those about one of an earlier time."""
    others = [one for one in made.warnings if one.kind != LARGE_NOISE]
    return replace(made, warnings=(*others, *large_noises(noise, made.tolerance)))


def _refuse_doubts(strict: bool, result: Comparison) -> None:
    """Raise a `LogError` with the warnings of the logs and the comparison, if they are to be errors."""
    of_logs = [w.of(one.name) for one in result.runs for w in one.run.warnings]
    explaining = (MISSING_TOOL, SWAPPED, CLOCKS_DIFFER)  # a result, and no doubts about it
    doubts = [w for w in result.warnings if w.kind not in explaining]
    refuse_warnings(strict, (*of_logs, *doubts))


def _files(operands: Sequence[Operand | Comparison | None]) -> list[Path]:
    """Return the files that no output may replace: operands, and the recordings of those that are results."""
    found = [one if isinstance(one, (str, Path)) else getattr(one, "recording", None) for one in operands]
    return [Path(one) for one in found if one is not None]
