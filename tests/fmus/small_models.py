"""Block models in a few lines: variables without descriptions, and two models of many tests."""

from __future__ import annotations

from typing import Any, TypeVar

from urmpipe_fmus.block import BlockModel, Input, Memory, Output, Parameter, State, Variable

Kind = TypeVar("Kind", bound=Variable)


def variable(kind: type[Kind], name: str, **fields: Any) -> Kind:
    return kind(name=name, description="", **fields)


def block(*variables: Variable, name: str = "u", **functions: Any) -> BlockModel:
    return BlockModel(name=name, description="", variables=variables, **functions)


def mixed() -> BlockModel:
    """A unit of every kind: y is fresh, m is the input of the point before, x the input's integral."""
    return block(
        variable(Parameter, "k", start=2.0, minimum=0.0, maximum=10.0),
        variable(Parameter, "fixed", tunable=False),
        variable(Input, "u", minimum=-100.0, maximum=100.0, start=1.0),
        variable(Input, "n", type="Integer"),
        variable(State, "x", output=True),
        variable(Memory, "m", output=True),
        variable(Output, "y"),
        outputs=lambda v: {"y": v.k * v.u + v.x + 100.0 * v.m},
        derivatives=lambda v: {"x": v.u / (v.fixed - 1.0)},
        update=lambda v: {"m": v.u},
        internal_step=0.25,
        name="mixed",
    )


BOUNDED = block(
    variable(Parameter, "r", minimum=-0.5),
    variable(Parameter, "n", type="Integer", minimum=-1.5, maximum=1e12),
    variable(Input, "b", type="Boolean", minimum=0, maximum=1),
    name="bounded",
)
