"""The unit: a model with FMI variables, written once in elementwise NumPy.

From a unit come a vectorised run over a log (`run`), a Python FMU, a native FMU and its documentation.
Its functions take the values of the variables (`v.phi`, `v.time`) and return new ones by name. Each value
is an element: a float, an array, or a symbol of a trace; so the functions use `+ - * /` and NumPy's
elementwise functions (`dependencies.FUNCTIONS`), `np.where` instead of `if`, and no `np.linalg`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, get_args

from urmpipe_fmus.table import Table
from urmpipe_fmus.values import Values
from urmpipe_fmus.variable import Input, Memory, Output, Parameter, State, ValueType, Variable
from urmpipe_models.elementwise import Element
from urmpipe_models.errors import UnitError, shown

Function = Callable[[Values], Mapping[str, Element | Sequence[Element]]]

INTERNAL_STEP = "internal_step"
"""The parameter that every unit with continuous states gets: the largest step of its integrator in [s]."""


@dataclass(frozen=True, slots=True)
class Recipe:
    """How to make a unit again, where its FMU is run by Python.

    Attributes:
        module: Import name of the module that makes it; of a user's file the name of the file.
        function: The module's function that returns the unit; empty if the module holds it as a variable.
        arguments: What the function is called with: strings, numbers, lists and mappings of them. A table
            is not among them: a unit that has one takes it as the argument `table`.
        source: The text of a user's file; empty for a module of an installed package.
    """

    module: str = ""
    function: str = ""
    arguments: Mapping[str, Any] = field(default_factory=dict)
    source: str = ""


@dataclass(frozen=True, kw_only=True, eq=False)
class Unit:
    """A model with FMI variables.

    At a communication point t_k the inputs are set and the outputs are those of these inputs at once:
    `outputs` is a function of time, parameters, inputs and states. A step from t_k to t_k+1 first takes the
    sample, `update` giving the next values of the memories from those of t_k, then integrates the states
    with RK4 in steps of at most `internal_step`, the inputs held.

    Attributes:
        name: An identifier: the name of the block, of the FMU's file and of its binaries.
        description: One line for people.
        variables: In the order in which importers show them.
        outputs: The values of all `Output`s; None if there are none.
        derivatives: The derivatives of all `State`s, in [unit/s]; None if there are none.
        update: The next values of all `Memory`s; None if there are none.
        internal_step: Largest step of the integrator in [s], the start value of a parameter of that name.
        table: Rows over time, to be read as `v.table`; None for most units.
        equations: The model as people write it, a line an equation or remark.
        source: Where the equations come from.
        recipe: How to make the unit again.
    """

    name: str
    description: str
    variables: tuple[Variable, ...]
    outputs: Function | None = None
    derivatives: Function | None = None
    update: Function | None = None
    internal_step: float = 1e-3
    table: Table | None = None
    equations: tuple[str, ...] = ()
    source: str = ""
    recipe: Recipe = field(default_factory=Recipe)

    def __post_init__(self) -> None:
        if self.states and not any(one.name == INTERNAL_STEP for one in self.variables):
            step = Parameter(
                name=INTERNAL_STEP,
                description="Largest step of the integrator (RK4)",
                unit="s",
                start=self.internal_step,
                minimum=1e-9,
                tunable=False,
            )
            object.__setattr__(self, "variables", (*self.variables, step))
        faults = [f"unit {self.name}: {fault}" for fault in self._faults()]
        if faults:
            raise UnitError(*faults)

    @cached_property
    def parameters(self) -> tuple[Parameter, ...]:
        """Its parameters, in order."""
        return tuple(one for one in self.variables if isinstance(one, Parameter))

    @cached_property
    def inputs(self) -> tuple[Input, ...]:
        """Its inputs, in order."""
        return tuple(one for one in self.variables if isinstance(one, Input))

    @cached_property
    def states(self) -> tuple[State, ...]:
        """Its continuous states, in order."""
        return tuple(one for one in self.variables if isinstance(one, State))

    @cached_property
    def memories(self) -> tuple[Memory, ...]:
        """Its discrete states, in order."""
        return tuple(one for one in self.variables if isinstance(one, Memory))

    @cached_property
    def computed(self) -> tuple[Output, ...]:
        """The outputs that `outputs` computes, in order."""
        return tuple(one for one in self.variables if isinstance(one, Output))

    @cached_property
    def given(self) -> tuple[Variable, ...]:
        """All that the functions are given, by kind: parameters, inputs, states, memories."""
        return (*self.parameters, *self.inputs, *self.states, *self.memories)

    @cached_property
    def scalars(self) -> tuple[tuple[str, Variable], ...]:
        """Name and variable of every scalar, in order: the index is FMI's value reference."""
        return tuple((name, one) for one in self.variables for name in one.names)

    def _wrong_kinds(self) -> Iterator[str]:
        """Yield what is of a kind that Python takes and FMI does not know."""
        for one in self.variables:
            if not isinstance(one, (Parameter, Input, Output, State, Memory)):
                allowed = "a Parameter, Input, Output, State or Memory"
                yield f"found {shown(one)} as a variable, allowed: {allowed}"
                continue
            for key in ("name", "description", "unit", "display_unit"):
                yield from _no_text(f"{one.name}: {key}", getattr(one, key))
            if one.type not in get_args(ValueType):
                yield f"{one.name}: found type {shown(one.type)}, allowed: {', '.join(get_args(ValueType))}"
            if one.size is not None and type(one.size) is not int:
                yield f"{one.name}: found size {shown(one.size)}, allowed: an integer; None for a scalar"
        for key in ("name", "description", "source"):
            yield from _no_text(key, getattr(self, key))
        if isinstance(self.equations, str):
            yield f"equations: found {shown(self.equations)}, allowed: a tuple of texts, a line each"

    def _faults(self) -> Iterator[str]:
        wrong = list(self._wrong_kinds())
        if wrong:
            yield from wrong
            return
        if not self.name.isidentifier() or not self.name.isascii():
            yield f"found {shown(self.name)} as its name, allowed: a letter, then letters, digits and _"
        if not self.variables:
            yield "found no variables, allowed: one or more (FMI has no FMU without them)"
        names = [one.name for one in self.variables]
        for name in sorted({name for name in names if names.count(name) > 1}):
            yield f"{name}: found twice, allowed: each name once"
        for name in {"time", "table"} & set(names):
            yield f"{name}: found as a variable, allowed: another name (v.{name} is given to all units)"
        for one in self.variables:
            yield from one.faults()
            if one.name == INTERNAL_STEP and not _is_internal_step(one):
                yield f"{one.name}: found as a variable, allowed: one Real parameter with a min above 0"
        yield from self._missing()

    def _missing(self) -> Iterator[str]:
        """Yield the functions that lack variables, and the variables that lack a function."""
        for kind, variables, function, name in (
            ("output", self.computed, self.outputs, "outputs"),
            ("state", self.states, self.derivatives, "derivatives"),
            ("memory", self.memories, self.update, "update"),
        ):
            if variables and function is None:
                yield f"{kind} {variables[0].name} is declared, but `{name}` is not set"
            elif function is not None and not variables:
                yield f"`{name}` is set, but no {kind} is declared"


def _is_internal_step(one: Variable) -> bool:
    return isinstance(one, Parameter) and one.type == "Real" and one.size is None and one.minimum > 0.0


def _no_text(what: str, value: Any) -> Iterator[str]:
    if not isinstance(value, str):
        yield f"{what}: found {shown(value)}, allowed: a text"
