"""A network: parts with which nothing is wrong."""

from __future__ import annotations

from dataclasses import dataclass, field

from urmpipe_models.display import Shown, line_of, number_of
from urmpipe_models.errors import NetworkError
from urmpipe_models.messages import in_html
from urmpipe_models.networks.faults import faults_of
from urmpipe_models.networks.parts import Parts


@dataclass(frozen=True, repr=False)
class Network(Parts, Shown):
    """Bodies, and what ties them: joints, constraint elements, controls.

    `urmpipe.load_network` reads one from a file, or makes one of such tables.

    Attributes:
        description: One line for people.
        source: Where the numbers come from.
        length_unit: m or mm: the unit in which its file has lengths, and people give them.
        angle_unit: rad or deg, likewise of angles.

    Raises:
        NetworkError: With everything that is wrong.
    """

    description: str = ""
    source: str = ""
    length_unit: str = field(default="m", compare=False)
    angle_unit: str = field(default="rad", compare=False)

    def __post_init__(self) -> None:
        if found := tuple(dict.fromkeys(faults_of(self))):
            raise NetworkError(*found)

    def _headline(self) -> str:
        """Return its name, what it is, and how much there is of it."""
        parts = {"body": len(self.bodies) + 1, "joint": len(self.joints), "element": len(self.elements)}
        counts = (
            f"{count} bodies" if what == "body" else number_of(count, what)
            for what, count in parts.items()
            if count
        )
        return line_of(self.name, self.description, ", ".join(counts))

    def _table(self) -> str:
        """Return a row a joint or element: its name, kind and bodies."""
        rows = "".join(
            f"<tr><td>{in_html(one.name)}</td><td>{one.kind}</td><td>{in_html(one.bodies[0])}</td>"
            f"<td>{in_html(one.bodies[1])}</td></tr>"
            for _, one in self.ties
        )
        return f"<table><tr><th>name</th><th>kind</th><th>body</th><th>body</th></tr>{rows}</table>"
