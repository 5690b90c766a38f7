"""What drives the joints and the lengths of a network, in words."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TypeAlias

from urmpipe_models.networks.file import Network
from urmpipe_models.networks.parts import ConstraintElement, Control, Expression, Joint, JointKind, spellings

LETTERS: dict[JointKind, str] = {
    "revolute": "R",
    "prismatic": "P",
    "cylindrical": "C",
    "helical": "H",
    "global": "G",
    "user": "U",
}
"""What stands for a kind of joint in a drawing."""

SHORT = 12
"""Letters of a formula that a drawing has room for; of a longer one it names the controls."""


Tie: TypeAlias = Joint | ConstraintElement
"""What holds two bodies."""


def ties(network: Network) -> dict[str, Tie]:
    """Return the joints and the elements of a network by their names."""
    joints: dict[str, Tie] = {one.name: one for one in network.joints}
    return joints | {one.name: one for one in network.elements}


def formulas(one: Tie) -> tuple[Expression, ...]:
    """Return what drives a joint, or is the length of an element."""
    if isinstance(one, ConstraintElement):
        return (one.length,)
    return (*(drive for drive in one.drives if drive is not None), *one.motion)


def is_driven(one: Tie) -> bool:
    """Return whether a joint has no say in its variables, or an element's length depends on a control."""
    return any(part.names for part in formulas(one)) or (isinstance(one, Joint) and bool(formulas(one)))


def drive_words(one: Tie) -> str:
    """Return what drives a joint or an element, briefly: "= 2 * s", "by s, t"; empty where nothing does."""
    some = formulas(one)
    if not is_driven(one):
        return ""
    alone = [name for part in some for name in part.names if part.text in spellings(name)]
    if len(some) == 1 and alone:  # without the factor of the file's unit
        return f"= {alone[0]}"
    if len(some) == 1 and len(some[0].text) <= SHORT:
        return f"= {some[0].text.strip()}"
    names = sorted(set().union(*(part.names for part in some)))
    return f"by {', '.join(names)}" if names else "held"


def caption(one: Tie) -> str:
    """Return a joint or an element in a drawing: its name, its kind, and what drives it: "A R = s"."""
    kind = LETTERS[one.kind] if isinstance(one, Joint) else one.kind
    return " ".join(filter(None, (one.name, kind, drive_words(one))))


def controlled(network: Network, control: Control) -> Iterator[str]:
    """Yield the joints, the elements and the controls that are functions of a control, by their names."""
    for name, one in ties(network).items():
        if any(control.name in part.names for part in formulas(one)):
            yield name
    for other in network.controls:
        if other.value is not None and control.name in other.value.names:
            yield other.name
