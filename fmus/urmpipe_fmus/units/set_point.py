"""Set points of a joint as a unit."""

from __future__ import annotations

from collections.abc import Mapping

from urmpipe_fmus.unit import Recipe, Unit
from urmpipe_fmus.values import Values
from urmpipe_fmus.variable import Output, Parameter
from urmpipe_models.drives import TRAPEZOID
from urmpipe_models.drives import set_point as set_point_at
from urmpipe_models.elementwise import Element

OPTIONS: Mapping[str, str] = {}


def set_point() -> Unit:
    """Return the unit: a function of time alone, with position, velocity and acceleration out."""
    return Unit(
        name="set_point",
        description="Set point of a joint over time: a step, a ramp, or a trapezoid of velocity",
        variables=(*_parameters(), *_outputs()),
        outputs=_outputs_at,
        equations=(
            "from t = begin on, from initial to target, way = |target - initial|:",
            "kind 0, step: theta = target; omega = alpha = 0",
            "kind 1, ramp: omega = +-speed for way / speed; alpha = 0",
            "kind 2, trapezoid: alpha = +-a for t_a = min(v / a, sqrt(way / a)), 0 for",
            "      max(way / v - v / a, 0), -+a for t_a; v: speed, a: acceleration",
        ),
        recipe=Recipe(__name__, "set_point"),
    )


def _parameters() -> tuple[Parameter, ...]:
    return (
        Parameter(
            name="kind",
            description="0 step, 1 ramp, 2 trapezoid of velocity",
            start=float(TRAPEZOID),
            minimum=0.0,
            maximum=2.0,
            type="Integer",
        ),
        Parameter(name="begin", description="When the move begins", unit="s", start=0.1),
        Parameter(name="initial", description="Where from", unit="rad", display_unit="deg"),
        Parameter(name="target", description="Where to", unit="rad", display_unit="deg", start=1.0),
        Parameter(
            name="speed",
            description="Largest velocity",
            unit="rad/s",
            display_unit="deg/s",
            start=2.0,
            minimum=1e-9,
        ),
        Parameter(
            name="acceleration", description="Largest acceleration", unit="rad/s2", start=10.0, minimum=1e-9
        ),
    )


def _outputs() -> tuple[Output, ...]:
    return (
        Output(name="theta", description="Set position", unit="rad", display_unit="deg"),
        Output(name="omega", description="Set velocity", unit="rad/s", display_unit="deg/s"),
        Output(name="alpha", description="Set acceleration", unit="rad/s2"),
    )


def _outputs_at(v: Values) -> Mapping[str, Element]:
    motion = set_point_at(v.kind, v.time, v.begin, v.initial, v.target, v.speed, v.acceleration)
    return {
        "theta": motion.position,
        "omega": motion.velocity,
        "alpha": motion.acceleration,
    }
