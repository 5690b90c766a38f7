"""What is wrong with the controls of a network, and with the names in functions of them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from urmpipe_models.errors import Finding, shown
from urmpipe_models.names import nearest, not_among
from urmpipe_models.networks.expressions import Expression
from urmpipe_models.networks.parts import Control, Parts, Placed


def control_faults(parts: Parts) -> Iterator[Finding]:
    """Yield what is wrong with controls, and names in functions of them that none of them has."""
    for one in parts.controls:
        yield from _own_faults(f"controls.{one.name}", one)
    names = sorted({one.name for one in parts.controls})
    driving = (*parts.functions, *parts.lengths)
    unknown: set[str] = set()
    for where, function in (*parts.between_controls, *driving):
        for name in sorted(function.names.difference(names)):
            unknown.add(name)
            yield Finding(f"control {not_among(name, names)}", about=where)
    for cycle in _cycles(parts.controls):
        way = " -> ".join((*cycle, cycle[0]))
        message = f"is a function of itself: {way}; allowed: functions of other controls"
        yield Finding(message, about=f"controls.{cycle[0]}.value")
    yield from _idle(parts.controls, driving, unknown)


def _own_faults(where: str, control: Control) -> Iterator[Finding]:
    """Yield what is wrong with the name, the limits and the start of a control."""
    if not is_name(control.name):
        allowed = "a letter, then letters, digits, _; not pi, a function or a word of Python"
        yield Finding(f"found {shown(control.name)} as a name, allowed: {allowed}", about=where)
    if control.value is not None:
        return
    lower, start, upper = control.lower, control.start, control.upper
    if not lower <= upper:
        message = f"found {lower:g}, above upper, {upper:g}; allowed: at most upper"
        yield Finding(message, about=f"{where}.lower")
    elif not math.isfinite(start):
        yield Finding(f"found {start:g}, allowed: a finite number", about=f"{where}.start")
    elif not lower <= start <= upper:
        yield Finding(f"found {start:g}, allowed: {lower:g} to {upper:g}", about=f"{where}.start")


def is_name(text: str) -> bool:
    """Return whether an expression can have a text as the name of a control."""
    try:
        return text.isidentifier() and Expression(text).names == {text}
    except ValueError:
        return False


def _cycles(controls: tuple[Control, ...]) -> Iterator[list[str]]:
    """Yield the names of controls that are functions of each other, in a ring."""
    names = {one.name for one in controls}
    needs = {one.name: one.value.names & names if one.value else frozenset() for one in controls}
    while needs:
        while ready := [name for name, needed in needs.items() if not needed & needs.keys()]:
            for name in ready:
                del needs[name]
        if needs:  # each of these needs another of these
            way = [next(iter(needs))]
            while (following := min(needs[way[-1]] & needs.keys())) not in way:
                way.append(following)
            yield way[way.index(following) :]
            for name in way[way.index(following) :]:
                del needs[name]


def _idle(controls: tuple[Control, ...], driving: Sequence[Placed], unknown: set[str]) -> Iterator[Finding]:
    """Yield controls that drive nothing, but for those that a name which is none may have meant."""
    names = [one.name for one in controls]
    found = {name for _, function in driving for name in function.names}
    found |= {nearest(name, names) or "" for name in unknown}
    functions = {one.name: one.value.names for one in controls if one.value is not None}
    used: set[str] = set()
    while found:
        used |= found
        found = {name for one in found for name in functions.get(one, ())} - used
    for name in names:
        if name not in used:
            message = "drives nothing; allowed: controls that drive a joint or an element"
            yield Finding(message, about=f"controls.{name}", kind="idle")
