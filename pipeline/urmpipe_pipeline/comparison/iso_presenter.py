"""How a test after ISO 9283 shows itself: its verdict and criteria, then poses, path, corners and speed."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from functools import partial

import numpy as np

from urmpipe_pipeline import text
from urmpipe_pipeline.comparison.align import placed
from urmpipe_pipeline.comparison.baseline_section import baseline_section, criterion_checks, worse_facts
from urmpipe_pipeline.comparison.comparison import BaselineComparison, Comparison
from urmpipe_pipeline.comparison.deviation import Deviation
from urmpipe_pipeline.comparison.verdict import UNITS
from urmpipe_pipeline.iso9283.criteria import Criterion, combine_verdicts
from urmpipe_pipeline.iso9283.figures import (
    CYCLES_COLOUR,
    TUBE_COLOUR,
    command_path,
    corner_drawing,
    deviation_figure,
    enlarged,
    mean_of,
    path_figure,
    pose_drawing,
    speed_figure,
    tube_of,
)
from urmpipe_pipeline.iso9283.result import AttainedPoses, CutPath, IsoTest
from urmpipe_pipeline.iso9283.tables import (
    amount_words,
    check_words,
    corner_table,
    criteria_rows,
    criteria_tables,
    criteria_words,
    cycles_table,
    decisive,
    failed_cycles_words,
    failed_table,
    format_failed_cycle,
    leg_table,
    meaning,
    not_judged_findings,
    overall_of,
    plane_table,
    pose_tables,
    tolerance_words,
    value_of,
    where,
    worst_first,
)
from urmpipe_pipeline.joint_log import LogWarning
from urmpipe_pipeline.presentation.palette import DEVIATION_COLOUR, REFERENCE_COLOUR
from urmpipe_pipeline.presentation.parts import (
    inputs_table,
    minute,
    minute_of,
    provenance_table,
    recording_fact,
)
from urmpipe_pipeline.presentation.scene import Arm, Balls, Path, Scene
from urmpipe_pipeline.presentation.section import (
    Block,
    Cell,
    Check,
    Fact,
    Judged,
    Presentation,
    Ref,
    Section,
    Table,
    Value,
)
from urmpipe_pipeline.provenance import format_assumptions, format_defaults
from urmpipe_pipeline.runs.figures import times_of


def present_test(result: Comparison, test: IsoTest) -> Presentation:
    """Return what a comparison shows that is a test after ISO 9283."""
    return Presentation(
        name=result.name,
        headline=headline(result, test),
        verdict=result.verdict,
        facts=(*_decisive_facts(test), *_against(result, test)),
        body=_body(result, test),
        word="" if result.verdict else "incomplete" if test.not_judged else "measured",
        scene=partial(iso_scene, result, test),
        lines=(_line(result, test),),
        rows=partial(criteria_rows, test),
        created=result.provenance.created,
    )


def headline(result: Comparison, test: IsoTest) -> str:
    """Return which cycles failed, which criteria are out of tolerance or how close to it; against what."""
    against = f"against {result.reference.name}"
    worst = decisive(test)
    failed = [one for one in worst_first(test.overall) if one.verdict == "fail"]
    if worst is None:
        said = f"{against}: no criterion is judged, none has a tolerance"
    elif failed:
        said = f"out of tolerance {against}: {criteria_words(failed)}"
    else:
        said = f"within tolerance {against}: {amount_words(worst)}"
    if test.failed_cycles:
        count = text.counted(len(test.failed_cycles), "cycle")
        named = failed_cycles_words(test.failed_cycles)
        said = f"followed {result.reference.name}; {count} failed: {named}; the others {said}"
    said = f"{_cycles(result, test)} {said}"
    if test.not_judged:
        said += f"; not judged: {', '.join(one.name for one in test.not_judged)}"
    if result.baseline is not None:
        worse = f"{'and' if failed else 'but'} worse" if result.baseline.verdict == "fail" else "not worse"
        said += f", {worse} than the baseline {result.baseline.name}"
    return said + format_assumptions(result.assumptions) + format_defaults(result.provenance)


def _cycles(result: Comparison, test: IsoTest) -> str:
    """Return how many cycles there are, and of which log if they are of one."""
    count = test.cycle_count
    files = {one.run.log.files for one in result.runs}
    name = result.name.removesuffix(f"-against-{result.reference.name}")
    return f"{count} of {name}" if len(files) == 1 and name else count


def _decisive_facts(test: IsoTest) -> Iterator[Fact]:
    """Yield which criterion decided, how much of its tolerance it uses up, and where."""
    if test.failed_cycles:
        yield Fact("Failed cycles", Value(len(test.failed_cycles)))
    one = decisive(test)
    if one is not None and (one.verdict == "fail" or not test.failed_cycles):
        used = text.portion(one.utilisation or 0.0)
        yield Fact("Decided by", f"{amount_words(one)} ({used} the tolerance)", meaning(one.name))
        yield Fact("Where", where(test, one))


def _against(result: Comparison, test: IsoTest) -> Iterator[Fact]:
    """Yield what is worse than a baseline, how much was tested, against what, and what is allowed."""
    since = result.baseline
    yield from worse_facts(since) if since is not None and since.verdict == "fail" else ()
    parts = [test.cycle_count]
    parts += [text.counted(len(test.poses.command), "pose")] if test.poses is not None else []
    parts += [text.counted(len(test.path.s), "plane")] if test.path is not None else []
    yield Fact("After ISO 9283", text.enumerated(parts))
    yield Fact("Reference", result.reference.name, brief=False)
    yield Fact("Tolerance", tolerance_words(result.tolerance), brief=False)


def _body(result: Comparison, test: IsoTest) -> Section:
    sections = list(_sections(test))
    if result.baseline is not None:
        sections.append(_against_baseline(result.baseline, len(sections)))
    worst = sorted(sections, key=lambda one: one.verdict != "fail")  # what fails is read first
    return Section(
        f"Test {result.name}",
        result.verdict,
        (
            *_against(result, test),
            Fact("Made", minute(result.provenance), brief=False),
            recording_fact(result.recording),
        ),
        (*criteria_tables(test), cycles_table(test)),
        blocks=partial(_files, result),
        warnings=tuple(_warnings(result)),
        sections=tuple(replace(one, rank=worst.index(one)) for one in sections),
    )


def _warnings(result: Comparison) -> Iterator[LogWarning]:
    """Yield the warnings of the comparison, and those of its logs by their names."""
    yield from result.warnings
    yield from (one.of(run.name) for run in result.runs for one in run.run.warnings)


def _files(result: Comparison) -> Iterator[Block]:
    """Yield the files, and how the comparison was made."""
    yield inputs_table("Reference files", result.reference.files)
    files = dict.fromkeys(file for run in result.runs for file in run.run.log.files)
    yield inputs_table("Files of the cycles", files)
    yield provenance_table(result.provenance, kinds=UNITS)


def _sections(test: IsoTest) -> Iterator[Section]:
    """Yield a section about each part that there is of a test."""
    poses, path = test.poses, test.path
    if test.failed_cycles:
        yield Section(
            "Failed cycles",
            test.verdict and "fail",
            (
                Fact(
                    "Failed",
                    f"{len(test.failed_cycles)} of {len(test.failed_cycles) + len(test.cycles)}",
                    brief=False,
                ),
            ),
            (failed_table(test),),
            checks=tuple(_failed_checks(test)),
        )
    if test.not_judged:
        yield Section("Criteria without a verdict", errors=tuple(not_judged_findings(test)))
    if poses is not None:
        facts = (
            Fact("Poses", Value(len(poses.command)), brief=False),
            Fact("Band", Value(test.band, "m", given=True), brief=False),
        )
        yield _section(test, "Poses", facts, pose_tables(test), lambda: (pose_drawing(test, poses),))
    if path is None:
        return
    facts = (
        Fact("Length", Value(path.total, "m"), brief=False),
        Fact("Planes", Value(len(path.s)), brief=False),
    )
    yield _section(test, "Path", facts, (), partial(_path_blocks, test, path))
    if path.corners:
        yield _section(
            test, "Corners", (), (corner_table(test, path),), lambda: (corner_drawing(test, path),)
        )
    if path.legs:
        yield _section(test, "Speed", (), (leg_table(test, path),), lambda: (speed_figure(path),))


def _path_blocks(test: IsoTest, path: CutPath) -> Iterator[Block]:
    """Yield what a page shows of a path; of one without a leg that is judged its speed, too."""
    yield path_figure(path)
    yield deviation_figure(test, path)
    if not path.legs:
        yield speed_figure(path)
    yield plane_table(test, path)


def _section(
    test: IsoTest,
    part: str,
    facts: tuple[Fact, ...],
    tables: Iterable[Table],
    blocks: Callable[[], Iterable[Block]],
) -> Section:
    """Return the section about a part of a test."""
    criteria = overall_of(test, part)
    decided = decisive(test, part)
    first = () if decided is None else (
        Fact(decided.name, value_of(decided), meaning(decided.name), brief=False),
        Fact("Where", where(test, decided), brief=False),
    )  # fmt: skip
    return Section(
        part,
        combine_verdicts(one.verdict for one in criteria),
        (*first, *facts),
        tuple(tables),
        blocks=blocks,
        checks=tuple(_checks(test, criteria)),
        properties={one.name: one.value for one in criteria if one.value is not None},
    )


def _failed_checks(test: IsoTest) -> Iterator[Check]:
    if test.verdict == "fail":
        for cycle in test.failed_cycles:
            yield Check(cycle.name, "fail", format_failed_cycle(cycle), kind="failed-cycle")


def _checks(test: IsoTest, criteria: Iterable[Criterion]) -> Iterator[Check]:
    """Yield a check for each criterion that has a tolerance."""
    for one in criteria:
        if one.verdict is not None:
            yield Check(one.name, one.verdict, check_words(test, one) if one.verdict == "fail" else "")


def _against_baseline(found: BaselineComparison, rank: int) -> Section:
    """Return what changed since an earlier comparison, with its checks: no section of a cycle holds them."""
    return replace(baseline_section(found, rank), checks=tuple(criterion_checks(found)))


def _line(result: Comparison, test: IsoTest) -> Mapping[str, Cell]:
    """Return the line of a test among several."""
    return {
        "Test": Ref(f"Test {result.name}"),
        "Recording": result.recording.name if result.recording else "",
        "Made [UTC]": minute_of(result.provenance.created),
        "Reference": result.reference.name,
        "Verdict": Judged(result.verdict),
        "Cycles": Value(len(test.cycles)),
        "Failed cycles": Value(len(test.failed_cycles)) if test.failed_cycles else None,
        "Assuming": "; ".join(result.assumptions),
        **{one.name: value_of(one) for one in test.overall},
    }


def iso_scene(result: Comparison, test: IsoTest) -> Scene:
    """Return the command, what was attained of it, enlarged, and the cycles that move on one clock.

    The deviations of poses and path are enlarged by the same factor.
    """
    factor = enlarged(test.path, test.poses)
    shown = next((one for one in result.runs if one.run.tcp is not None), None)
    arms = () if shown is None else tuple(_arm(shown))
    paths = [*(_cycle(one) for one in result.runs if one.run.timed)]
    if test.path is not None:
        tube = tube_of(test.path, factor)
        paths = [
            command_path(test.path),
            *paths,
            *([] if tube is None else [tube]),
            mean_of(test.path, factor),
        ]
    if test.poses is not None:
        paths += _clouds(test.poses, factor)
    of_arm = [f"arm of {shown.name}"] if shown is not None and arms else []
    title = ", ".join((*of_arm, *_titled(test)))
    balls = None if test.poses is None else _balls(test, test.poses, factor)
    return Scene(
        f"{title[0].upper()}{title[1:]} [m], deviations drawn x{factor}", arms, tuple(paths), balls=balls
    )


def _titled(test: IsoTest) -> list[str]:
    """Return what is shown of a test."""
    of_path = ["mean path coloured by AT", "tube of RT"] if test.path is not None else []
    of_poses = ["attained poses", "balls of RP"] if test.poses is not None else []
    return of_path + of_poses


def _arm(one: Deviation) -> Iterator[Arm]:
    """Yield the arm of a cycle, on its own clock from its start on; nothing without kinematics."""
    if one.run.robot is not None:
        t_ns = times_of(one.run)
        since = None if t_ns is None else t_ns[:] - t_ns[0]
        yield Arm(placed(one.run.robot, one.alignment), one.run.q, since, CYCLES_COLOUR)


def _cycle(one: Deviation) -> Path:
    """Return the point that moves as a cycle does, on its own clock from its start on."""
    since = one.t_ns[:] - one.run.t_ns[0]
    return Path("cycles", one.actual, since, CYCLES_COLOUR, sample=one.sample, line=False)


def _clouds(poses: AttainedPoses, factor: int) -> Iterator[Path]:
    """Yield the commanded poses, and where they were attained, enlarged about them."""
    cloud = poses.command + factor * (poses.attained - poses.command)
    yield Path("commanded poses", poses.command, None, REFERENCE_COLOUR, asked=True, line=False)
    yield Path(f"attained x{factor}", cloud.reshape(-1, 3), None, DEVIATION_COLOUR, line=False)


def _balls(test: IsoTest, poses: AttainedPoses, factor: int) -> Balls | None:
    """Return balls of the radius RP about the barycentres; None of one cycle."""
    found = {one.at: one.value for one in test.criteria if one.name == "RP"}
    radius = [found.get(f"pose {k + 1}") for k in range(len(poses.command))]
    known = np.array([one is not None for one in radius], dtype=np.bool_)
    if not known.any():
        return None
    centre = poses.command + factor * (poses.attained.mean(axis=0) - poses.command)
    sizes = factor * np.array([one for one in radius if one is not None])
    return Balls(f"RP x{factor}", centre[known], sizes, TUBE_COLOUR)
