"""How a network shows itself: whether it closes, how much moves and why, its graph and its assemblies."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import Any

from urmpipe_models.display import format_count
from urmpipe_pipeline.networks.drawing import drawings
from urmpipe_pipeline.networks.parts import (
    assemblies_table,
    facts,
    gap_facts,
    gap_words,
    gaps_table,
    mobility_facts,
    mobility_table,
)
from urmpipe_pipeline.networks.result import NetworkResult
from urmpipe_pipeline.networks.scene import scene, space_figure
from urmpipe_pipeline.presentation.parts import inputs_table, provenance_table
from urmpipe_pipeline.presentation.section import (
    Block,
    Check,
    Event,
    Fact,
    Judged,
    Presentation,
    Ref,
    Section,
    Table,
    Value,
)


def present(result: NetworkResult) -> Presentation:
    """Return what a network shows."""
    moves = result.mobility
    body = Section(
        f"Network {result.name}",
        result.verdict,
        tuple(facts(result)),
        tuple(_tables(result)),
        blocks=partial(_page, result),
        checks=(_check(result),),
        properties=_properties(result),
        events=partial(_events, result),
        warnings=result.warnings,
    )
    return Presentation(
        name=result.name,
        headline=headline(result),
        verdict=result.verdict,
        facts=tuple(_facts(result)),
        body=body,
        opens_at_row=0,
        scene=partial(scene, result),
        lines=(
            {
                "Network": Ref(body.title),
                "Verdict": Judged(result.verdict),
                "Structure": result.structure,
                "Bodies": Value(len(result.network.body_names)),
                "Mobility": None if moves is None else Value(moves.mobility),
                "Kutzbach": None if moves is None else Value(moves.kutzbach),
                "Assemblies": Value(len(result.assemblies)),
                "Warnings": Value(len(result.warnings)),
            },
        ),
        created=result.provenance.created,
    )


def headline(result: NetworkResult) -> str:
    """Return whether it closes, what it is and how much of it moves, or what does not close."""
    if not result.assemblies:
        return f"{result.name}: does not close" + (
            f": {gap_words(result.closure_errors[0])}" if result.closure_errors else ""
        )
    count = len(result.assemblies)
    found = "assembled"
    if result.all_solutions:
        least = "at least " if result.start_count > 1 else ""  # random starts may miss some
        found = f"{least}{count} {'assembly' if count == 1 else 'assemblies'}"
    moves = result.mobility
    if moves is None:
        return f"{result.name}: {found}"
    said = f"{result.name}: {found}, a {moves.kind} of mobility {moves.mobility}"
    said += f", {format_count(len(moves.passive), 'passive rotation')} of it" if moves.passive else ""
    if moves.kutzbach == moves.mobility:
        return said
    count = len(moves.redundant)
    why = f"{format_count(count, 'constraint')} {'is' if count == 1 else 'are'} redundant" if count else ""
    return f"{said} (Kutzbach {moves.kutzbach}{': ' if why else ''}{why})"


def _facts(result: NetworkResult) -> Iterator[Fact]:
    """Yield what explains the headline."""
    yield from gap_facts(result)
    if not result.all_solutions and len(result.distances) > 1:
        others = ", ".join(f"{distance:.4g}" for distance in result.distances[1:7])
        more = " ..." if len(result.distances) > 7 else ""
        words = f"{result.distances[0]:.4g}; others {others}{more}"
        yield Fact("Distance from the start", words, "In rad and lengths of the mechanism.")
    if result.mobility is not None:
        yield from mobility_facts(result.mobility)


def _tables(result: NetworkResult) -> Iterator[Table]:
    """Yield what does not close, what moves, and where it closes."""
    if result.closure_errors:
        yield gaps_table(result.closure_errors)
    if result.mobility is not None:
        yield mobility_table(result.mobility)
    if result.assemblies or result.nearest is not None:
        yield assemblies_table(result)


def _check(result: NetworkResult) -> Check:
    """Return what the verdict rests on."""
    words = "; ".join(gap_words(one) for one in result.closure_errors[:1]) or result.reason
    closed = result.verdict == "pass"
    return Check("every loop closes", result.verdict, "" if closed else words, kind="not-assembled")


def _properties(result: NetworkResult) -> dict[str, Any]:
    """Return what a test suite says of it."""
    moves = result.mobility
    counts = {
        "structure": result.structure,
        "assemblies": len(result.assemblies),
        "starts": result.start_count,
    }
    return counts | ({} if moves is None else {"mobility": moves.mobility, "kutzbach": moves.kutzbach})


def _page(result: NetworkResult) -> Iterator[Block]:
    """Yield what only a page has room for, its drawings among it: the viewer has its scene."""
    yield from drawings(result)
    yield from space_figure(result)
    if result.provenance.inputs:
        yield inputs_table("Input files", result.provenance.inputs)
    yield provenance_table(result.provenance)


def _events(result: NetworkResult) -> Iterator[Event]:
    """Yield what does not close, and warnings: they hold at all times."""
    yield from (Event(None, f"does not close: {gap_words(one)}", "error") for one in result.closure_errors)
    yield from (Event(None, f"{one.kind}: {one.sentence()}", "warning") for one in result.warnings)
