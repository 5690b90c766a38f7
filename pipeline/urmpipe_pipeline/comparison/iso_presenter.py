"""How a test after ISO 9283 is shown.

1. Headline and facts: the verdict, the criterion that decides, what was tested.
2. Sections: failed cycles, poses, path, corners, speed, and the changes since a baseline.
3. Scene: the command, the mean path with its tube, attained poses, and all cycles on one clock. The
   deviations of poses and path are enlarged by the same factor.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from functools import partial

import numpy as np

from urmpipe_models.display import format_count
from urmpipe_pipeline import text
from urmpipe_pipeline.comparison.align import apply_alignment
from urmpipe_pipeline.comparison.baseline import baseline_section, criterion_checks, worse_facts
from urmpipe_pipeline.comparison.comparison import BaselineComparison, Comparison
from urmpipe_pipeline.comparison.deviation import Deviation
from urmpipe_pipeline.comparison.verdict import UNITS
from urmpipe_pipeline.iso9283.criteria import combine_verdicts
from urmpipe_pipeline.iso9283.figures import (
    CYCLES_COLOUR,
    TUBE_COLOUR,
    command_line,
    corner_drawing,
    criterion_by_pose,
    deviation_figure,
    display_factor,
    mean_line,
    path_figure,
    pose_drawing,
    speed_figure,
    tube,
)
from urmpipe_pipeline.iso9283.result import AttainedPoses, CutPath, IsoTest
from urmpipe_pipeline.iso9283.tables import (
    corner_table,
    criteria_rows,
    criteria_tables,
    cycles_table,
    failed_table,
    find_decisive,
    find_worst_place,
    format_criteria,
    format_criterion,
    format_failed_cycle,
    format_failed_cycles,
    format_failure,
    format_tolerance,
    leg_table,
    meaning,
    not_judged_findings,
    overall_of_part,
    plane_table,
    pose_tables,
    sort_worst_first,
    to_value,
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
    """Return the presentation of a comparison that is a test after ISO 9283."""
    return Presentation(
        name=result.name,
        headline=headline(result, test),
        verdict=result.verdict,
        facts=(*_decisive_facts(test), *_basic_facts(result, test)),
        body=_body(result, test),
        word="" if result.verdict else "incomplete" if test.not_judged else "measured",
        scene=partial(iso_scene, result, test),
        lines=(_line(result, test),),
        rows=partial(criteria_rows, test),
        created=result.provenance.created,
    )


def headline(result: Comparison, test: IsoTest) -> str:
    """Return the failed cycles, the criteria out of tolerance or the one that is closest to it."""
    against = f"against {result.reference.name}"
    worst = find_decisive(test)
    failed = [criterion for criterion in sort_worst_first(test.overall) if criterion.verdict == "fail"]
    if worst is None:
        message = f"{against}: no criterion is judged, none has a tolerance"
    elif failed:
        message = f"out of tolerance {against}: {format_criteria(failed)}"
    else:
        message = f"within tolerance {against}: {format_criterion(worst)}"
    if test.failed_cycles:
        count = format_count(len(test.failed_cycles), "cycle")
        names = format_failed_cycles(test.failed_cycles)
        message = f"followed {result.reference.name}; {count} failed: {names}; the others {message}"
    message = f"{_cycle_count(result, test)} {message}"
    if test.not_judged:
        message += f"; not judged: {', '.join(criterion.name for criterion in test.not_judged)}"
    if result.baseline is not None:
        worse = f"{'and' if failed else 'but'} worse" if result.baseline.verdict == "fail" else "not worse"
        message += f", {worse} than the baseline {result.baseline.name}"
    return message + format_assumptions(result.assumptions) + format_defaults(result.provenance)


def _cycle_count(result: Comparison, test: IsoTest) -> str:
    """Return the number of cycles, and their log if they are of one."""
    files = {run.run.log.files for run in result.runs}
    name = result.name.removesuffix(f"-against-{result.reference.name}")
    return f"{test.cycle_count} of {name}" if len(files) == 1 and name else test.cycle_count


def _decisive_facts(test: IsoTest) -> Iterator[Fact]:
    """Yield the criterion that decides, its utilisation, and its place."""
    if test.failed_cycles:
        yield Fact("Failed cycles", Value(len(test.failed_cycles)))
    criterion = find_decisive(test)
    if criterion is not None and (criterion.verdict == "fail" or not test.failed_cycles):
        portion = text.format_portion(criterion.utilisation or 0.0)
        value = f"{format_criterion(criterion)} ({portion} the tolerance)"
        yield Fact("Decided by", value, meaning(criterion.name))
        yield Fact("Where", find_worst_place(test, criterion))


def _basic_facts(result: Comparison, test: IsoTest) -> Iterator[Fact]:
    """Yield what is worse than a baseline, what was tested, the reference and the tolerance."""
    baseline = result.baseline
    yield from worse_facts(baseline) if baseline is not None and baseline.verdict == "fail" else ()
    parts = [test.cycle_count]
    parts += [format_count(len(test.poses.command), "pose")] if test.poses is not None else []
    parts += [format_count(len(test.path.s), "plane")] if test.path is not None else []
    yield Fact("After ISO 9283", text.join_list(parts))
    yield Fact("Reference", result.reference.name, brief=False)
    yield Fact("Tolerance", format_tolerance(result.tolerance), brief=False)


def _body(result: Comparison, test: IsoTest) -> Section:
    sections = list(_sections(test))
    if result.baseline is not None:
        sections.append(_baseline_section(result.baseline, len(sections)))
    failed_first = sorted(sections, key=lambda section: section.verdict != "fail")
    return Section(
        f"Test {result.name}",
        result.verdict,
        (
            *_basic_facts(result, test),
            Fact("Made", minute(result.provenance), brief=False),
            recording_fact(result.recording),
        ),
        (*criteria_tables(test), cycles_table(test)),
        blocks=partial(_files, result),
        warnings=tuple(_warnings(result)),
        sections=tuple(replace(section, rank=failed_first.index(section)) for section in sections),
    )


def _warnings(result: Comparison) -> Iterator[LogWarning]:
    """Yield the warnings of the comparison, and those of its logs by their names."""
    yield from result.warnings
    yield from (warning.of(run.name) for run in result.runs for warning in run.run.warnings)


def _files(result: Comparison) -> Iterator[Block]:
    """Yield the files, and how the comparison was made."""
    yield inputs_table("Reference files", result.reference.files)
    files = dict.fromkeys(file for run in result.runs for file in run.run.log.files)
    yield inputs_table("Files of the cycles", files)
    yield provenance_table(result.provenance, kinds=UNITS)


def _sections(test: IsoTest) -> Iterator[Section]:
    """Yield one section per part of the test."""
    poses, path = test.poses, test.path
    if test.failed_cycles:
        count = f"{len(test.failed_cycles)} of {len(test.failed_cycles) + len(test.cycles)}"
        checks = [
            Check(cycle.name, "fail", format_failed_cycle(cycle), kind="failed-cycle")
            for cycle in test.failed_cycles
            if test.verdict == "fail"
        ]
        yield Section(
            "Failed cycles",
            test.verdict and "fail",
            (Fact("Failed", count, brief=False),),
            (failed_table(test),),
            checks=tuple(checks),
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
        tables = (corner_table(test, path),)
        yield _section(test, "Corners", (), tables, lambda: (corner_drawing(path),))
    if path.legs:
        yield _section(test, "Speed", (), (leg_table(test, path),), lambda: (speed_figure(path),))


def _path_blocks(test: IsoTest, path: CutPath) -> Iterator[Block]:
    """Yield what a page shows of a path; of one without a leg its speed, too."""
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
    """Return the section of a part of a test, with a check for each criterion that has a tolerance."""
    criteria = overall_of_part(test, part)
    decisive = find_decisive(test, part)
    if decisive is not None:
        place = Fact("Where", find_worst_place(test, decisive), brief=False)
        value = Fact(decisive.name, to_value(decisive), meaning(decisive.name), brief=False)
        facts = (value, place, *facts)
    checks = [
        Check(c.name, c.verdict, format_failure(test, c) if c.verdict == "fail" else "")
        for c in criteria
        if c.verdict is not None
    ]
    return Section(
        part,
        combine_verdicts(criterion.verdict for criterion in criteria),
        facts,
        tuple(tables),
        blocks=blocks,
        checks=tuple(checks),
        properties={c.name: c.value for c in criteria if c.value is not None},
    )


def _baseline_section(baseline: BaselineComparison, rank: int) -> Section:
    """Return what changed since an earlier comparison, with its checks: no section of a cycle has them."""
    return replace(baseline_section(baseline, rank), checks=tuple(criterion_checks(baseline)))


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
        **{criterion.name: to_value(criterion) for criterion in test.overall},
    }


def iso_scene(result: Comparison, test: IsoTest) -> Scene:
    """Return the command, the attained path and poses, enlarged, and the cycles that move on one clock."""
    factor = display_factor(test.path, test.poses)
    with_arm = next((run for run in result.runs if run.run.tcp is not None), None)
    arms = () if with_arm is None else tuple(_arm(with_arm))
    paths = [_cycle_point(run) for run in result.runs if run.run.timed]
    titles = [f"arm of {with_arm.name}"] if with_arm is not None and arms else []
    balls = None
    if test.path is not None:
        of_tube = tube(test.path, factor)
        paths = [command_line(test.path), *paths, *(() if of_tube is None else (of_tube,))]
        paths.append(mean_line(test.path, factor))
        titles += ["mean path coloured by AT", "tube of RT"]
    if test.poses is not None:
        paths += _clouds(test.poses, factor)
        titles += ["attained poses", "balls of RP"]
        balls = _balls(test, test.poses, factor)
    title = ", ".join(titles)
    title = f"{title[0].upper()}{title[1:]} [m], deviations drawn x{factor}"
    return Scene(title, arms, tuple(paths), balls=balls)


def _arm(cycle: Deviation) -> Iterator[Arm]:
    """Yield the arm of a cycle, with times from its start; none without kinematics."""
    if cycle.run.robot is not None:
        t_ns = times_of(cycle.run)
        since_start = None if t_ns is None else t_ns[:] - t_ns[0]
        yield Arm(apply_alignment(cycle.run.robot, cycle.alignment), cycle.run.q, since_start, CYCLES_COLOUR)


def _cycle_point(cycle: Deviation) -> Path:
    """Return the point that moves as a cycle does, with times from its start."""
    since_start = cycle.t_ns[:] - cycle.run.t_ns[0]
    return Path("cycles", cycle.actual, since_start, CYCLES_COLOUR, sample=cycle.sample, line=False)


def _clouds(poses: AttainedPoses, factor: int) -> Iterator[Path]:
    """Yield the commanded poses, and the attained ones, enlarged around them."""
    cloud = poses.command + factor * (poses.attained - poses.command)
    yield Path("commanded poses", poses.command, None, REFERENCE_COLOUR, asked=True, line=False)
    yield Path(f"attained x{factor}", cloud.reshape(-1, 3), None, DEVIATION_COLOUR, line=False)


def _balls(test: IsoTest, poses: AttainedPoses, factor: int) -> Balls | None:
    """Return balls of the radius RP around the barycentres; None for one cycle."""
    radii = criterion_by_pose(test, "RP", len(poses.command))
    known = np.isfinite(radii)
    if not known.any():
        return None
    centre = poses.command + factor * (poses.attained.mean(axis=0) - poses.command)
    return Balls(f"RP x{factor}", centre[known], factor * radii[known], TUBE_COLOUR)
