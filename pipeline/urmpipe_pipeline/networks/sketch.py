"""A mechanism as SVG: a planar one in its plane, others in three projections; the pieces of any drawing."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from urmpipe_models.networks.file import Network
from urmpipe_pipeline.networks.drives import Tie, drive_words, is_driven, ties
from urmpipe_pipeline.networks.parts_in_space import (
    CONTROL_COLOUR,
    OPEN_COLOUR,
    Part,
    find_plane,
    parts,
    placed,
)
from urmpipe_pipeline.networks.result import NetworkResult
from urmpipe_pipeline.networks.scene import shown_assembly, title
from urmpipe_pipeline.presentation.palette import INK_COLOUR
from urmpipe_pipeline.presentation.parts import spot_at
from urmpipe_pipeline.presentation.projections import (
    ABOVE,
    FRONT,
    SIDEWAYS,
    Piece,
    Sketch,
    draw_along_normal,
    draw_projections,
)
from urmpipe_pipeline.presentation.scene import PlaneView, Spot

NAMED = 24
"""Bodies and joints up to which each has its name in the projections."""

TURNING = ("revolute", "global")
"""Joints that are drawn after those that slide, whose symbols are larger: a pin shows on its slider."""

JOINT_EDGE, JOINT_FILL, BALL_FILL, DRIVEN_FILL, ELEMENT_EDGE = (
    "#303a42",
    "#ffffff",
    "#66727c",
    "#fbdcc4",
    "#51606b",
)
"""Of joints, of balls, of what controls drive, and of elements."""


def mechanism_svg(result: NetworkResult) -> str:
    """Return the first assembly, or what comes nearest to one, in its plane or in three projections."""
    shown = shown_assembly(result)
    if shown is None:
        return ""
    at = placed(result.network, shown)
    found = parts(at)
    sketch = Sketch(
        pieces=list(mechanism_pieces(result.network, found)), names=list(part_names(result.network, found))
    )
    return sketch_svg(sketch, find_plane(at), title(result))


def sketch_svg(sketch: Sketch, plane: PlaneView | None, heading: str) -> str:
    """Return a sketch along the normal of a plane, or in three projections if there is none."""
    if plane is None:
        return draw_projections(sketch, (SIDEWAYS, FRONT, ABOVE), heading)
    return draw_along_normal(sketch, plane, heading)


def view_words(plane: PlaneView | None) -> str:
    """Return from where a mechanism is seen: "seen along z"."""
    return "from the side, the front and above" if plane is None else f"seen along {plane.axis_names[2]}"


def mechanism_pieces(network: Network, found: Sequence[Part]) -> Iterator[Piece]:
    """Yield what is drawn of each part: bodies in their colours, elements dashed, joints before both."""
    owners = ties(network)
    for part in sorted(found, key=lambda part: part.kind == "joint" and owners[part.name].kind in TURNING):
        if part.kind == "body":
            for piece in part.pieces:
                opacity = 0.75 if part.opacity == 1.0 else part.opacity
                yield Piece(piece.reshape(-1, 3), part.colour, 1.2, part.colour, opacity)
            yield from (Piece(line, part.colour, 1.2) for line in part.lines)
        elif part.kind == "element":
            colour = CONTROL_COLOUR if is_driven(owners[part.name]) else ELEMENT_EDGE
            opacity = 0.25 if part.opacity == 1.0 else 0.08
            yield from (Piece(one.reshape(-1, 3), colour, 0.8, colour, opacity) for one in part.pieces)
            yield from (Piece(line, colour, 1.6, dashed=True) for line in part.lines)
        else:
            yield from _joint(part, owners[part.name])


def _joint(part: Part, joint: Tie) -> Iterator[Piece]:
    """Yield the symbol of a joint: white, a ball grey, in the colour of controls if these drive it."""
    driven = is_driven(joint)
    edge = OPEN_COLOUR if part.colour == OPEN_COLOUR else CONTROL_COLOUR if driven else JOINT_EDGE
    fill = DRIVEN_FILL if driven else BALL_FILL if joint.kind == "global" else JOINT_FILL
    yield from (Piece(line, edge, 1.2, front=len(line) > 2 or edge == OPEN_COLOUR) for line in part.lines)
    yield from (Piece(one.reshape(-1, 3), edge, 1.6, fill, front=True) for one in part.pieces)


def part_names(network: Network, found: Sequence[Part]) -> Iterator[Spot]:
    """Yield the names of joints, bodies and elements; of many parts only those of bodies."""
    owners, few = ties(network), len(found) <= NAMED
    for part in sorted(found, key=lambda one: one.kind != "joint"):
        if part.kind == "body":
            yield Spot(spot_at(part.at), part.name, INK_COLOUR)
        elif few or is_driven(owners[part.name]):
            owner = owners[part.name]
            colour = CONTROL_COLOUR if is_driven(owner) else ELEMENT_EDGE
            yield Spot(spot_at(part.at), " ".join(filter(None, (part.name, drive_words(owner)))), colour)
