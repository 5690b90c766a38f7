"""What of a recording is shown as it is: the drawing of a system as an image, its file as text."""

from __future__ import annotations

import base64
from dataclasses import dataclass
from typing import Literal

from urmpipe_pipeline.simulations.simulation import Simulation


@dataclass(frozen=True, slots=True)
class Drawing:
    """A drawing in SVG, embedded as an image.

    Browsers run no script in an image, load nothing for it and let nobody click in it, whatever the file
    says that it came from.

    Attributes:
        title: Its heading.
        alt: What it shows, for who does not see it.
        source: A data address of the SVG.
    """

    title: str
    alt: str
    source: str
    kind: Literal["drawing"] = "drawing"


@dataclass(frozen=True, slots=True)
class Listing:
    """A text, folded away.

    Attributes:
        title: Its heading.
        text: Its lines.
    """

    title: str
    text: str
    kind: Literal["text"] = "text"


def system_drawing(simulation: Simulation) -> Drawing | None:
    """Return the drawing of a system; None if the recording has none."""
    if not simulation.system_svg:
        return None
    data = base64.b64encode(simulation.system_svg.encode("utf-8", "replace")).decode("ascii")
    joined = "; ".join(f"{source} to {into}" for into, source in simulation.connections.items())
    blocks = ", ".join(one.name for one in simulation.blocks)
    alt = f"The blocks {blocks}" + (f", connected: {joined}." if joined else ".")
    return Drawing("System", alt, f"data:image/svg+xml;base64,{data}")


def system_file(simulation: Simulation) -> Listing | None:
    """Return the system file; None if the recording has none."""
    return Listing("System file", simulation.system_text) if simulation.system_text else None
