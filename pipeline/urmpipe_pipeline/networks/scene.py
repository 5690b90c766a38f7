"""What stands in space of a network: its first assembly, and the others as ghosts."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from urmpipe_models.networks.assembly import Assembly
from urmpipe_pipeline.networks.drives import Tie, drive_words, ties
from urmpipe_pipeline.networks.parts_in_space import (
    CONTROL_COLOUR,
    OPEN_COLOUR,
    Part,
    Placed,
    find_plane,
    parts,
    placed,
)
from urmpipe_pipeline.networks.result import NetworkResult
from urmpipe_pipeline.presentation.figure import SpaceFigure
from urmpipe_pipeline.presentation.palette import GHOST_COLOURS
from urmpipe_pipeline.presentation.parts import spot_at
from urmpipe_pipeline.presentation.scene import PlaneView, Scene, Solid

MANY, FEW = 7, 3
"""Further assemblies that are all seen at first; of more, so many are, and the others can be switched on."""

SIDES = 6
"""Sides of what is round of a ghost: there may be many."""

FAINT = 0.12
"""Opacity of a ghost."""

COLOURS = tuple(one for one in GHOST_COLOURS.values() if one != CONTROL_COLOUR)
"""One a ghost; then they start again."""

MOST = 60
"""Further assemblies that are there at all."""

NAMED = {CONTROL_COLOUR: "driven", OPEN_COLOUR: "not closed"}
"""Joints and elements of a colour of their own, by it."""

GROUPS = {"body": "bodies", "joint": "joints", "element": "elements"}


def scene(result: NetworkResult) -> Scene | None:
    """Return a network in space; None where nothing was found of it."""
    found = tuple(solids(result))
    return Scene(title(result), solids=found, plane=motion_plane(result)) if found else None


def space_figure(result: NetworkResult) -> Iterator[SpaceFigure]:
    """Yield a network in space for a page."""
    shown = shown_assembly(result)
    if shown is None:
        return
    others = len(result.assemblies) - 1
    caption = f"{title(result)}. Grey: the ground; vermilion: what controls drive."
    caption += " Crimson: a joint whose bodies do not meet." if result.closure_errors else ""
    caption += " Faint: further assemblies, which the legend switches." if others > 0 else ""
    alt = f"{result.name} in three dimensions, {len(result.network.body_names)} bodies."
    shown_solids = [
        replace(solid, label="" if solid.group == "ghosts" else solid.label) for solid in solids(result)
    ]
    yield SpaceFigure(
        "In space", caption, alt, solids=joined_labels(shown_solids), plane=motion_plane(result)
    )


def joined_labels(labelled: Sequence[Solid]) -> tuple[Solid, ...]:
    """Return solids, the labels of those at the same place as one label of the first: "slider, B, s"."""
    places = [tuple(np.round(solid.at, 6).tolist()) for solid in labelled]
    labels: dict[tuple[float, ...], list[str]] = {}
    for solid, place in zip(labelled, places, strict=True):
        labels.setdefault(place, []).extend([solid.label] if solid.label else [])
    joined = [", ".join(labels.pop(place, ())) for place in places]
    return tuple(replace(solid, label=words) for solid, words in zip(labelled, joined, strict=True))


def motion_plane(result: NetworkResult) -> PlaneView | None:
    """Return the plane in which it moves; None if it is not planar."""
    shown = shown_assembly(result)
    return None if shown is None else find_plane(placed(result.network, shown))


def title(result: NetworkResult) -> str:
    """Return what is shown in space."""
    if not result.assemblies:
        return f"{result.name} where it comes nearest to closing [m]"
    count = len(result.assemblies)
    return f"{result.name}, assembly 1 of {count} [m]" if count > 1 else f"{result.name} [m]"


def shown_assembly(result: NetworkResult) -> Assembly | None:
    """Return the first assembly, or what comes nearest to one."""
    return result.assemblies[0] if result.assemblies else result.nearest


def solids(result: NetworkResult) -> Iterator[Solid]:
    """Yield the bodies, joints and elements of the first assembly, and each other assembly as one."""
    shown = shown_assembly(result)
    if shown is None:
        return
    network = result.network
    yield from part_solids(placed(network, shown))
    many = len(result.assemblies) - 1 > MANY
    for number, other in enumerate(result.assemblies[1 : MOST + 1]):
        yield _ghost(placed(network, other, SIDES), number, hidden=many and number >= FEW)


def part_solids(at: Placed) -> Iterator[Solid]:
    """Yield the bodies, elements and joints of an assembly."""
    owners = ties(at.network)
    for part in parts(at):
        yield _solid(part, owners.get(part.name) if part.kind != "body" else None)


def _solid(part: Part, owner: Tie | None) -> Solid:
    """Return a part as it stands in space."""
    words = part.name if owner is None else " ".join(filter(None, (part.name, drive_words(owner))))
    group = GROUPS[part.kind]
    return Solid(
        group,
        part.name,
        part.colour,
        np.concatenate(part.pieces),
        part.lines,
        part.opacity,
        words,
        spot_at(part.at),
        part.name if part.kind == "body" else NAMED.get(part.colour, group),
    )


def _ghost(at: Placed, number: int, *, hidden: bool) -> Solid:
    """Return a further assembly: its bodies and elements in one colour, without the ground."""
    seen = [
        part
        for part in parts(at)
        if part.kind != "joint" and (part.kind, part.name) != ("body", at.network.ground)
    ]
    triangles = np.concatenate([np.empty((0, 3, 3)), *(piece for part in seen for piece in part.pieces[:1])])
    lines = tuple(
        line for part in seen if len(part.pieces) < 3 for line in part.lines
    )  # a rod is seen without
    name = f"assembly {number + 2}"
    bodies = [part.at for part in seen if part.kind == "body"]
    where = spot_at(bodies[-1] if bodies else np.zeros(3))
    return Solid(
        "ghosts", name, COLOURS[number % len(COLOURS)], triangles, lines, FAINT, name, where, name, hidden
    )
