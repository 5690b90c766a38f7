"""The deviation of a point from where it should be, as a unit."""

from __future__ import annotations

from collections.abc import Mapping

from urmpipe_fmus.unit import Recipe, Unit
from urmpipe_fmus.values import Values
from urmpipe_fmus.variable import Input, Output, Parameter
from urmpipe_models.delta import DEFAULT_TOLERANCE, delta, outside
from urmpipe_models.elementwise import Element

OPTIONS: Mapping[str, str] = {}


def delta_meter() -> Unit:
    """Return the unit that subtracts where a point is from where it should be.

    Source: [UrmArm2021]_ eq. 19-21, 23.
    """
    return Unit(
        name="delta_meter",
        description="Deviation of a point from where it should be, and whether it is tolerated",
        variables=(
            Parameter(
                name="tolerance",
                description="Largest deviation allowed along x, y and z",
                unit="m",
                display_unit="mm",
                start=DEFAULT_TOLERANCE,
                minimum=0.0,
            ),
            Input(name="reference", description="Where the point should be: x, y, z", unit="m", size=3),
            Input(name="actual", description="Where the point is: x, y, z", unit="m", size=3),
            Output(name="delta", description="Deviation: x, y, z", unit="m", display_unit="mm", size=3),
            Output(name="norm", description="Length of the deviation", unit="m", display_unit="mm"),
            Output(
                name="out_of_tolerance",
                description="Whether the deviation along x, y or z is above the tolerance or has no value",
                type="Boolean",
            ),
        ),
        outputs=_outputs,
        equations=(
            "delta = reference - actual (eq. 19-21)",
            "norm = sqrt(delta_x^2 + delta_y^2 + delta_z^2) (eq. 23)",
            "out_of_tolerance = not max(|delta_x|, |delta_y|, |delta_z|) <= tolerance",
        ),
        source="UrmArm2021, eq. 19-21 and 23",
        recipe=Recipe(__name__, "delta_meter"),
    )


def _outputs(v: Values) -> Mapping[str, Element]:
    found = delta(v.reference, v.actual)
    return {
        "delta": (found.x, found.y, found.z),
        "norm": found.norm,
        "out_of_tolerance": outside(found, v.tolerance),
    }
