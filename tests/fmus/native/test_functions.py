"""Every function of NumPy that a unit may use, in C."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from urmpipe_fmus.block import BlockModel, Input, Output
from urmpipe_fmus.dependencies import FUNCTIONS, LOGICAL
from urmpipe_fmus.native.symbols import Symbol, traceable
from urmpipe_fmus.native.trace import traced
from urmpipe_models.errors import UnitError

EXACT = (
    *LOGICAL,
    *("add", "subtract", "multiply", "divide", "negative", "positive", "absolute", "fabs", "sign", "square"),
    *(
        "reciprocal",
        "sqrt",
        "copysign",
        "heaviside",
        "floor",
        "ceil",
        "trunc",
        "rint",
        "round",
        "around",
        "fmod",
    ),
    *("remainder", "floor_divide", "minimum", "maximum", "clip", "where"),
)
"""Those that any computer rounds alike; the others are within some units in the last place."""

EDGES = [0.0, -0.0, 0.5, -0.5, 1.5, 2.5, -2.5, 0.49999999999999994, 1.0, -1.0, 3.0, 2.0**52 + 1.0, 1e-300]


def applied(name: str, x: Any, y: Any) -> Any:
    """A function of NumPy of two values, or of the first; what is not finite as a number that tells it."""
    function = getattr(np, name)
    special = {"where": (x > y, x, y), "clip": (x, -1.0, 0.5), "round": (x, 1), "around": (x,)}
    found = function(*special.get(name, (x, y)[: getattr(function, "nin", 1)]))
    if name in LOGICAL:
        return np.where(found, 1.0, 0.0)
    told = np.where(np.isnan(found), 1.5e300, np.where(found > 0.0, 2.5e300, -2.5e300))
    return np.where(np.isfinite(found), found, told)


def applied_to_truth(name: str, x: Any, y: Any) -> Any:
    """A function of truth values of whether the values are above 0."""
    of_truth = name.startswith(("logical", "bitwise", "invert"))
    return applied(name, x > 0.0, y > 0.0) if of_truth else applied(name, x, y)


@pytest.fixture(scope="module")
def all_functions() -> BlockModel:
    inputs = (Input(name="x", description=""), Input(name="y", description=""))
    return BlockModel(
        name="all_functions",
        description="",
        variables=(
            *inputs,
            *(Output(name=f"np_{name}", description="") for name in FUNCTIONS),
            Output(name="angle", description=""),
        ),
        outputs=lambda v: (
            {f"np_{name}": applied_to_truth(name, v.x, v.y) for name in FUNCTIONS}
            | {"angle": np.arctan2(np.where(v.x < 5.0, -np.abs(v.x), v.x), -1.0)}
        ),
    )


def test_what_is_traced_is_what_a_unit_may_use() -> None:
    assert set(traceable()) == set(FUNCTIONS)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::RuntimeWarning")  # of what is not finite, which is meant here
def test_each_function_gives_what_numpy_gives(native: Callable[..., Any], all_functions: BlockModel) -> None:
    fmu = native(all_functions)
    rng = np.random.default_rng(5)
    sizes = 10.0 ** rng.uniform(-9.0, 3.5, 25)
    some = [*EDGES, *(rng.normal(size=15) * 3).tolist(), *(rng.choice([-1.0, 1.0], 25) * sizes).tolist()]
    outputs = list(range(2, 2 + len(FUNCTIONS)))
    x, y = np.array([(x, y) for x in some for y in some]).T
    rows = []
    for pair in zip(x.tolist(), y.tolist(), strict=True):
        fmu.fmu.setReal([0, 1], pair)
        rows.append(fmu.fmu.getReal(outputs))
    for name, found in zip(FUNCTIONS, np.array(rows).T, strict=True):
        expected = applied_to_truth(name, x, y)
        # 8 units in the last place: NumPy's own loops and C's functions differ by up to 4 each
        error = 0.0 if name in EXACT else 8 * np.spacing(np.abs(expected))
        wrong = ~(np.abs(found - expected) <= error)
        assert not wrong.any(), (name, np.array([x, y, found, expected])[:, wrong])


@pytest.mark.slow
def test_signs_of_zero_are_kept(native: Callable[..., Any], all_functions: BlockModel) -> None:
    """atan2 tells them apart by half a turn."""
    assert native(all_functions).fmu.getReal([2 + len(FUNCTIONS)]) == [-np.pi]


def refused(function: Callable[[Any], Any]) -> str:
    """What is said of a function that cannot be traced."""
    with pytest.raises(UnitError) as error:
        traced(
            BlockModel(
                name="one",
                description="",
                variables=(Input(name="x", description=""), Output(name="z", description="")),
                outputs=lambda v: {"z": function(v.x)},
            )
        )
    return error.value.findings[0].message


def test_what_cannot_be_traced_is_refused_by_name() -> None:
    assert refused(np.cbrt).startswith(
        "unit one: outputs: np.cbrt: found in a unit's function, allowed: absolute, add, arccos, "
    )
    assert refused(lambda x: np.add(x, 1.0, dtype=np.float32)).startswith(
        "unit one: outputs: np.add with dtype: found in a unit's function, allowed: absolute, "
    )
    assert refused(np.add.reduce).startswith("unit one: outputs: np.add.reduce: found")
    assert refused(lambda x: (x > 0.0) + (x > 1.0)) == (
        "unit one: outputs: np.add of truth values: found in a unit's function,"
        " allowed: np.where(condition, 1.0, 0.0)"
    )
    assert refused(lambda x: x if x > 0 else -x) == (
        "unit one: outputs: a branch on a value: found in a unit's function (if, and, or, not, min, max),"
        " allowed: np.where, np.logical_and, np.minimum and their like"
    )
    assert refused(lambda x: x * np.array([1.0, 2.0])) == (
        "unit one: outputs: an array of shape (2,): found in a unit's function,"
        " allowed: floats and what the variables give"
    )
    assert refused(lambda x: x * 1j) == (
        "unit one: outputs: complex: found in a unit's function, allowed: floats and what the variables give"
    )
    assert refused(lambda _: 1j) == "unit one: outputs: z: found complex, allowed: one element"


def test_casadi_is_left_as_it_was() -> None:
    import casadi

    casadi.GlobalOptions.setSimplificationOnTheFly(True)
    refused(np.cbrt)
    assert casadi.GlobalOptions.getSimplificationOnTheFly()
    assert isinstance(Symbol(casadi.SX(1.0)) + 1.0, Symbol)
