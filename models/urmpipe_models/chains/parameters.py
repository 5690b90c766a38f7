"""The parameters of an arm: the named lengths and angles whose elementary motions make its frames."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Literal

from urmpipe_models.elementwise import Element
from urmpipe_models.transform import Step, Transform, made_of, product


@dataclass(frozen=True, slots=True)
class Parameter:
    """One length or angle of an arm, and where it acts: its frame is before @ motion(value) @ after.

    Attributes:
        name: Its name, unique in the arm.
        kind: along: it shifts along its axis; about: it turns about it.
        axis: x, y or z of the frame that `before` reaches.
        value: In [m] along, in [rad] about the axis, any element.
        source: What described it, in a few words.
        place: Name of its frame: base, a joint's name, tip or tool.
        frame_index: Place of its frame in `Chain.frames`; 0 is the base.
        before: What stands before it in its frame.
        after: What stands after it in its frame.
    """

    name: str
    kind: Literal["along", "about"]
    axis: Literal["x", "y", "z"]
    value: Element
    source: str
    place: str
    frame_index: int
    before: Transform
    after: Transform

    @property
    def unit(self) -> str:
        """Of its value: m or rad."""
        return "m" if self.kind == "along" else "rad"


def parameters_of(frames: Sequence[Transform], places: Sequence[str]) -> Iterator[Parameter]:
    """Yield the parameters of frames from the base outwards; a repeated name gets a prime.

    Args:
        frames: Those of an arm, each in the one before it.
        places: Their names.
    """
    names: set[str] = set()
    for index, (frame, place) in enumerate(zip(frames, places, strict=True)):
        parts = parts_of(frame)
        for k, step in enumerate(parts):
            if isinstance(step, Transform):
                continue
            name = step.name or f"{place}.{'r' * (step.kind == 'about')}{step.axis}"
            while name in names:
                name += "'"
            names.add(name)
            before, after = product(parts[:k]), product(parts[k + 1 :])
            yield Parameter(name, step.kind, step.axis, step.value, step.source, place, index, before, after)


def parts_of(frame: Transform) -> tuple[Transform | Step, ...]:
    """Return what a frame is made of.

    One that does not tell is x, y, z, then its rotation as a constant, then turns by 0 about z, y, x.
    """
    if frame.made_of is not None:
        return frame.made_of
    x, y, z = frame.translation
    return (
        Step("along", "x", x, source="frame"),
        Step("along", "y", y, source="frame"),
        Step("along", "z", z, source="frame"),
        Transform(frame.rotation),
        Step("about", "z", source="frame"),
        Step("about", "y", source="frame"),
        Step("about", "x", source="frame"),
    )


def with_values(frame: Transform, values: Sequence[Element]) -> Transform:
    """Return a frame with other values of its parameters, in [m] and [rad], multiplied again."""
    given = iter(values)
    parts = parts_of(frame)
    return made_of(*(replace(one, value=next(given)) if isinstance(one, Step) else one for one in parts))
