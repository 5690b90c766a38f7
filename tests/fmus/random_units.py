"""Random units as the text of a user's file, and random values for them.

Values stay finite and of a size about 1, and errors of rounding do not grow: what jumps (floor, sign, a
comparison) is asked only of inputs, parameters and constants, which have the same bits wherever a unit runs.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Any, TypeAlias

import numpy as np
from hypothesis import HealthCheck
from hypothesis import strategies as st
from hypothesis.strategies import DrawFn, SearchStrategy

from urmpipe_fmus.block import INTERNAL_STEP, BlockModel, Recipe, Variable
from urmpipe_fmus.blocks.user import block_from_source

FILE = "random_unit.py"

PATIENT: dict[str, Any] = {
    "deadline": None,
    "suppress_health_check": [HealthCheck.too_slow, HealthCheck.data_too_large],
}
"""Settings of tests on random units: on a busy machine a large one takes some tenths of a second to draw."""

numbers = st.integers(-2000, 2000).map(lambda k: k / 1000)
OF_TYPE: dict[str, SearchStrategy[Any]] = {
    "Real": numbers,
    "Integer": st.integers(-3, 3),
    "Boolean": st.integers(0, 1),
}

SMOOTH: tuple[str, ...] = (
    *("np.sin({a})", "np.cos({a})", "np.tanh({a})", "np.arctan({a})", "np.exp(-np.abs({a}))"),
    *("({a} + {b})", "({a} - {b})", "({a} * {b})", "-{a}", "({a} / (1.5 + np.abs({b})))", "{a} ** 2"),
    *("np.sqrt(1.0 + np.abs({a}))", "np.hypot({a}, {b})", "np.arctan2({a}, 1.0 + np.abs({b}))"),
    *("np.minimum({a}, {b})", "np.maximum({a}, {b})", "np.clip({a}, -1.0, 1.0)", "np.log1p(np.abs({a}))"),
    *("np.where({c}, {a}, {b})", "np.arcsin(0.5 * np.tanh({a}))", "np.cosh(np.tanh({a}))"),
    *("np.copysign({a}, {e})", "({a} + np.floor({e}))", "({a} * np.sign({e}))", "({a} + np.round({e}))"),
    *("({a} + {e} % 0.75)", "({a} + {e} // 0.75)", "({a} + np.trunc({e}))", "({a} + np.heaviside({e}, 0.5))"),
)
"""Expressions of expressions {a} and {b}, exact ones {e} and conditions {c}."""

EXACT = ("({e} + {f})", "({e} - {f})", "({e} * {f})", "np.abs({e})", "np.maximum({e}, {f})")
CONDITIONS = (
    *("{e} < {f}", "{e} >= {f}", "{e} == {f}", "np.logical_and({e} < {f}, {f} != 0.5)"),
    *("np.logical_or({e} > {f}, {f} <= 0.0)", "np.logical_not({e} > 0.0)", "({e} > 0.0) & ({f} > 0.0)"),
)


class Grammar:
    """Draws expressions of leaves, and exact ones: of values with the same bits wherever the unit runs."""

    def __init__(self, draw: DrawFn, leaves: list[str], exact: list[str]) -> None:
        self.draw, self.leaves, self.exact = draw, leaves, exact

    def smooth(self, depth: int = 3) -> str:
        """A value of a size about 1."""
        if depth == 0 or self.draw(st.integers(0, 3)) == 0:
            return self._leaf(self.leaves)
        return self._filled(SMOOTH, depth - 1)

    def exactly(self, depth: int = 1) -> str:
        """A value with the same bits wherever it is computed."""
        return self._leaf(self.exact) if depth == 0 or self.draw(st.booleans()) else self._filled(EXACT, 0)

    def condition(self) -> str:
        return self._filled(CONDITIONS, 1)

    def of_type(self, kind: str) -> str:
        """A value that a variable of a type may have."""
        if kind == "Boolean":
            return self.condition()
        return f"np.floor({self.exactly()})" if kind == "Integer" else self.smooth()

    def _leaf(self, names: list[str]) -> str:
        return self.draw(st.sampled_from(names)) if self.draw(st.integers(0, 4)) else repr(self.draw(numbers))

    def _filled(self, forms: tuple[str, ...], depth: int) -> str:
        """One of the forms, with expressions at its places."""
        form = self.draw(st.sampled_from(forms))
        made = dict.fromkeys("ab", partial(self.smooth, depth)) | {"c": self.condition}
        made |= dict.fromkeys("ef", partial(self.exactly, min(depth, 1)))
        return form.format(**{name: make() for name, make in made.items() if f"{{{name}}}" in form})


@st.composite
def random_unit_sources(draw: DrawFn, remembers: bool = True) -> str:
    """The text of a user's file with a random unit in it, one that remembers or one that never does."""
    given = [
        _variable(draw, kind, f"{kind[0].lower()}{k}")
        for kind, least in (("Parameter", 0), ("Input", 1), ("State", 0), ("Memory", 0))
        if remembers or kind in ("Parameter", "Input")
        for k in range(draw(st.integers(least, 2)))
    ]
    outputs = [_variable(draw, "Output", f"o{k}") for k in range(draw(st.integers(1, 3)))]
    exact = _leaves([one for one in given if one["kind"] in ("Parameter", "Input")])
    leaves = [*_leaves(given), "np.sin(v.time)"]
    table = draw(st.none() | _tables())
    if table is not None:
        leaves += ["v.table.before[0]", "v.table.after[1]", "v.table.fraction"]
    grammar = Grammar(draw, leaves, exact)
    functions = {
        "outputs": _function(grammar, outputs, "{}"),
        "derivatives": _function(grammar, [one for one in given if one["kind"] == "State"], "np.tanh({})"),
        "update": _function(grammar, [one for one in given if one["kind"] == "Memory"], "0.1 * np.tanh({})"),
    }
    written = "".join(f"    {_written(one)},\n" for one in draw(st.permutations([*given, *outputs])))
    description = draw(st.text(st.characters(categories=["L", "Zs", "P", "S"]), max_size=10))
    more = {name: f"lambda v: {text}" for name, text in functions.items() if text}
    more |= {} if table is None else {"table": table}
    return f"""import numpy as np
from urmpipe_fmus.block import BlockModel, Input, Memory, Output, Parameter, State, Table
variables = (
{written})
unit = BlockModel(
    name="random_unit",
    description={description!r},
    variables=variables,
    internal_step={draw(st.sampled_from([1e-3, 3e-3, 0.1]))},
    {", ".join(f"{name}={text}" for name, text in more.items())},
)
"""


def random_units(remembers: bool = True) -> SearchStrategy[BlockModel]:
    """Random units, made from the text that their recipe holds."""
    return random_unit_sources(remembers).map(
        lambda source: replace(block_from_source(source, FILE), recipe=Recipe(module=FILE, source=source))
    )


UnitCase: TypeAlias = tuple[BlockModel, dict[str, Any], dict[str, Any]]
"""A unit, start values of some parameters, inputs, states and memories, and samples of its inputs."""


def random_cases(count: int, remembers: bool = True) -> SearchStrategy[UnitCase]:
    return random_units(remembers).flatmap(
        lambda model: st.tuples(st.just(model), _starts(model), _columns(model, count))
    )


@st.composite
def _starts(draw: DrawFn, model: BlockModel) -> dict[str, Any]:
    return {
        one.name: draw(_values(one, one.width)) if one.size else draw(_values(one, 1))[0]
        for one in model.arguments
        if one.name != INTERNAL_STEP and draw(st.booleans())
    }


@st.composite
def _columns(draw: DrawFn, model: BlockModel, count: int) -> dict[str, Any]:
    flat = {one: np.array(draw(_values(one, count * one.width))) for one in model.inputs}
    return {one.name: flat[one].reshape((count, one.size) if one.size else count) for one in flat}


def _values(variable: Variable, count: int) -> SearchStrategy[list[float]]:
    """Values that a variable takes."""
    kind = OF_TYPE[variable.type].map(float)
    return st.lists(kind, min_size=count, max_size=count)


def _variable(draw: DrawFn, kind: str, name: str) -> dict[str, Any]:
    """What is written of a variable."""
    types = ["Real"] if kind == "State" else ["Real", "Real", "Integer", "Boolean"]
    of_type, size = draw(st.sampled_from(types)), draw(st.none() | st.integers(1, 3))
    made: dict[str, Any] = {"kind": kind, "name": name, "description": "random", "type": of_type}
    if size is not None:
        made["size"] = size
    if of_type == "Real":
        made |= draw(st.sampled_from([{}, {"unit": "rad", "display_unit": "deg"}, {"unit": "N.m"}]))
    if kind != "Output":
        made["start"] = draw(OF_TYPE[of_type])
    if kind == "Parameter":
        made["tunable"] = draw(st.booleans())
    if kind in ("State", "Memory"):
        made["output"] = draw(st.booleans())
    if kind == "Input" and of_type == "Real" and draw(st.booleans()):
        made |= {"minimum": -2.0, "maximum": 2.0}
    return made


def _written(variable: dict[str, Any]) -> str:
    """A variable as Python."""
    arguments = ", ".join(f"{name}={value!r}" for name, value in variable.items() if name != "kind")
    return f"{variable['kind']}({arguments})"


def _leaves(variables: list[dict[str, Any]]) -> list[str]:
    return [
        f"v.{one['name']}" if "size" not in one else f"v.{one['name']}[{k}]"
        for one in variables
        for k in range(one.get("size", 1))
    ]


def _function(grammar: Grammar, variables: list[dict[str, Any]], bounded: str) -> str:
    """The dict that a function of the unit returns, as Python."""
    items = []
    for one in variables:
        form = bounded if one["type"] == "Real" else "{}"
        found = [form.format(grammar.of_type(one["type"])) for _ in range(one.get("size", 1))]
        items.append(f"{one['name']!r}: {found[0] if 'size' not in one else '(' + ', '.join(found) + ',)'}")
    return f"{{{', '.join(items)}}}" if items else ""


@st.composite
def _tables(draw: DrawFn) -> str:
    """A table of two columns about the first half second, as Python."""
    times = draw(st.lists(st.integers(0, 500), min_size=1, max_size=5, unique=True).map(sorted))
    rows = [[draw(numbers), draw(numbers)] for _ in times]
    return f"Table(np.array({[1_000_000 * one for one in times]}), np.array({rows}))"
