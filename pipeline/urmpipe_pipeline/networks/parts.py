"""Facts and tables of a network: how it hangs together, what moves and why, and where it closes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from urmpipe_models.display import format_count
from urmpipe_models.networks.assembly import Assembly, ClosureError
from urmpipe_models.networks.file import Network
from urmpipe_models.networks.mobility import Mobility
from urmpipe_models.networks.parts import POSE_UNITS
from urmpipe_pipeline.networks.result import NetworkResult
from urmpipe_pipeline.presentation.parts import recording_fact, table_of
from urmpipe_pipeline.presentation.section import Cell, Column, Fact, Table, Value
from urmpipe_pipeline.text import format_rounded, join_list

MANY = 6
"""Gaps and redundant constraints that are named in a sentence; the others are counted."""

NARROW = 8
"""Columns of variables that are shown where there is little room."""

LEAST_TURN = 1e-6
"""Angle of a gap in [rad] that is named beside its length: less is what the search left."""

ROUNDED = 9
"""Digits after the point of variables in SI: what is less is rounding."""


def gap_words(gap: ClosureError) -> str:
    """Return what does not close, and by how much: "loop A, B, C, D is 12.3 mm and 1.2 deg apart"."""
    if gap.loop == (gap.name,):
        off = format_rounded(gap.radians, "rad") if gap.radians else format_rounded(gap.metres, "m")
        return f"element {gap.name} is {off} off its {'angle' if gap.radians else 'length'}"
    apart = [format_rounded(gap.metres, "m")] * bool(gap.metres)
    apart += [format_rounded(gap.radians, "rad")] * _is_turned(gap)
    return f"loop {', '.join(gap.loop)} is {' and '.join(apart)} apart"


def _is_turned(gap: ClosureError) -> bool:
    """Return whether a gap has an angle that matters."""
    return gap.radians > LEAST_TURN or not gap.metres


def gap_facts(result: NetworkResult) -> Iterator[Fact]:
    """Yield what does not close besides what the headline names."""
    yield from (Fact("Does not close", gap_words(one)) for one in result.closure_errors[1:MANY])
    if (more := len(result.closure_errors) - MANY) > 0:
        yield Fact("Does not close", f"and {more} more")


def mobility_facts(moves: Mobility) -> Iterator[Fact]:
    """Yield what makes the mobility another than Kutzbach's, and what is special about it."""
    yield Fact("Redundant", redundant_words(moves), "their loss would set nothing free")
    spins = ", ".join(moves.passive)
    yield Fact(
        "Passive rotations", spins, "they turn about the line through two global joints and move nothing else"
    )
    if moves.special:
        said = f"mobility {moves.mobility} here, {moves.nearby} at assembled configurations nearby"
        yield Fact("Special configuration", said)


def redundant_words(moves: Mobility) -> str:
    """Return the redundant constraints by their joints: "C: rotation about m, rotation about k; D: ..."."""
    owners: dict[str, list[str]] = {}
    for one in moves.redundant:
        owners.setdefault(one.joint, []).append(one.constraint)
    said = [f"{name}: {', '.join(some)}" for name, some in owners.items()]
    more = len(said) - MANY
    return "; ".join([*said[:MANY], *([f"and those of {more} more"] if more > 0 else [])])


def facts(result: NetworkResult) -> Iterator[Fact]:
    """Yield what the network is, and how it was assembled."""
    network = result.network
    yield Fact("Network", network.description, brief=False)
    yield Fact("Structure", structure_words(result))
    yield Fact("Loops", _listed(result.loops))
    yield Fact("Controls", control_values(result))
    yield Fact("Clusters", _listed(result.clusters) if len(result.clusters) > 1 else "")
    yield Fact("Assemblies", found_words(result))
    yield Fact("Source", network.source, brief=False)
    yield recording_fact(result.recording)


def _listed(groups: Sequence[Sequence[str]]) -> str:
    """Return groups of names, as far as there is room."""
    more = len(groups) - MANY
    return "; ".join([*map(", ".join, groups[:MANY]), *([f"and {more} more"] if more > 0 else [])])


def structure_words(result: NetworkResult) -> str:
    """Return how it hangs together: "closed chain of 4 bodies by 4 joints, 1 loop"."""
    network = result.network
    counts = ((len(network.joints), "joint"), (len(network.elements), "element"))
    ties = join_list([format_count(count, noun) for count, noun in counts if count])
    loops = format_count(len(result.loops), "loop") if result.loops else "no loop"
    held = f" by {ties}" if ties else ""
    return f"{result.structure} of {len(network.body_names)} bodies{held}, {loops}"


def control_values(result: NetworkResult) -> str:
    """Return the controls with the values at which they were held."""
    shown = result.assemblies[0] if result.assemblies else result.nearest
    values = {} if shown is None else shown.values
    named = ((one.name, values.get(one.name, (one.start,))[0], one.value) for one in result.network.controls)
    return ", ".join(
        f"{name} = {value:.6g}" + (f" ({drive.text})" if drive is not None else "")
        for name, value, drive in named
    )


def found_words(result: NetworkResult) -> str:
    """Return how many assemblies there are, of how many starts, and why the search ended."""
    return result.reason + (
        f" ({format_count(result.start_count, 'start')} in all)" if result.start_count > 1 else ""
    )


def mobility_table(moves: Mobility) -> Table:
    """Return the mobility, what it is made of, and how Kutzbach's count differs from it."""
    rows: list[tuple[str, Cell, str]] = [
        (
            "variables",
            Value(moves.variables),
            "controls, joints, and bodies that no joint ties to the ground",
        ),
        ("rank", Value(moves.rank), "of the Jacobian of what must close"),
        ("mobility", Value(moves.mobility), "variables less rank"),
        ("Kutzbach", Value(moves.kutzbach), "6 (bodies - 1) less the constraints, as if none were redundant"),
    ]
    if moves.redundant:
        rows.append(("redundant", Value(len(moves.redundant)), redundant_words(moves)))
    if moves.passive:
        rows.append(("passive rotations", Value(len(moves.passive)), ", ".join(moves.passive)))
    if moves.special:
        rows.append(("mobility nearby", Value(moves.nearby), "a special configuration: less moves nearby"))
    return table_of("Mobility", {"quantity": "", "value": "Value", "about": "Description"}, rows, brief=True)


def gaps_table(gaps: Sequence[ClosureError]) -> Table:
    """Return what does not close, the largest gap first."""
    rows = [
        (
            one.name,
            ", ".join(one.loop),
            Value(one.metres, "m"),
            Value(one.radians, "rad") if _is_turned(one) else None,
        )
        for one in gaps
    ]
    heads = {"name": "Cut joint or element", "loop": "Loop", "metres": "apart", "radians": "turned"}
    return table_of("What does not close", heads, rows, brief=True)


def assemblies_table(result: NetworkResult) -> Table:
    """Return a row an assembly with its variables; of a single one a row a variable."""
    every = result.assemblies or ((result.nearest,) if result.nearest else ())
    named = list(_variables(result.network, every[0])) if every else []
    if len(every) == 1:
        title = "Variables" if result.assemblies else "Variables where it comes nearest to closing"
        rows = [(name, _cell(every[0], owner, k, unit)) for name, owner, k, unit in named]
        return table_of(title, {"name": "Variable", "value": "Value"}, rows, brief=result.command == "solve")
    columns = [Column("assembly", "Assembly", [Value(k) for k in range(1, len(every) + 1)])]
    for place, (name, owner, k, unit) in enumerate(named):
        columns.append(
            Column(name, name, [_cell(one, owner, k, unit) for one in every], brief=place < NARROW)
        )
    columns.append(Column("mobility", "Mobility", [Value(one.mobility) for one in every]))
    title = f"Assemblies ({len(every)})"
    if (more := len(named) - NARROW) > 0:
        title += f"; {format_count(more, 'more variable')} in the report and in --json"
    return Table(title, tuple(columns))


def _variables(network: Network, one: Assembly) -> Iterator[tuple[str, str, int, str]]:
    """Yield the variables: name, owner, number there and unit; the names of several of one are numbered."""
    units: dict[str, tuple[str, ...]] = {body.name: POSE_UNITS for body in network.bodies}
    units |= {joint.name: joint.units for joint in network.joints}  # a body may be called as its joint
    for owner, values in one.values.items():
        own = units.get(owner, ())
        for k in range(len(values)):
            yield owner if len(values) == 1 else f"{owner} {k + 1}", owner, k, own[k] if k < len(own) else ""


def _cell(one: Assembly, owner: str, k: int, unit: str) -> Value:
    return Value(round(float(one.values[owner][k]), ROUNDED) + 0.0, unit)
