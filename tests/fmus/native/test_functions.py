"""Every function of NumPy that a unit may use, in C."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from loaded_fmu import Loaded
from small_models import block, variable
from urmpipe_fmus.block import Input, Output
from urmpipe_fmus.build.fmu import build_fmu
from urmpipe_fmus.dependencies import FUNCTIONS, LOGICAL

EXACT = (
    *LOGICAL,
    *("add", "subtract", "multiply", "divide", "negative", "positive", "absolute", "fabs", "sign", "square"),
    *("reciprocal", "sqrt", "copysign", "heaviside", "floor", "ceil", "trunc", "rint", "round", "around"),
    *("fmod", "remainder", "floor_divide", "minimum", "maximum", "clip", "where"),
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
    finite = np.where(np.isnan(found), 1.5e300, np.where(found > 0.0, 2.5e300, -2.5e300))
    return np.where(np.isfinite(found), found, finite)


def outputs(x: Any, y: Any) -> dict[str, Any]:
    """All functions; those of truth values of whether the values are above 0."""
    of_truth = ("logical", "bitwise", "invert")
    return {
        f"np_{name}": applied(name, x > 0.0, y > 0.0) if name.startswith(of_truth) else applied(name, x, y)
        for name in FUNCTIONS
    } | {"angle": np.arctan2(np.where(x < 5.0, -np.abs(x), x), -1.0)}


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::RuntimeWarning")  # of what is not finite, which is meant here
def test_each_function_gives_what_numpy_gives(tmp_path: Path) -> None:
    names = [f"np_{name}" for name in FUNCTIONS] + ["angle"]
    variables = [*(variable(Input, name) for name in "xy"), *(variable(Output, name) for name in names)]
    model = block(*variables, name="all_functions", outputs=lambda v: outputs(v.x, v.y))
    fmu = Loaded(build_fmu(model, tmp_path, backend="native").path).fmu
    assert fmu.getReal([2 + len(FUNCTIONS)]) == [-np.pi]  # atan2 tells signs of zero apart by half a turn
    rng = np.random.default_rng(5)
    sizes = 10.0 ** rng.uniform(-9.0, 3.5, 25)
    some = [*EDGES, *(rng.normal(size=15) * 3).tolist(), *(rng.choice([-1.0, 1.0], 25) * sizes).tolist()]
    x, y = np.array([(x, y) for x in some for y in some]).T
    rows = []
    for pair in zip(x.tolist(), y.tolist(), strict=True):
        fmu.setReal([0, 1], pair)
        rows.append(fmu.getReal(range(2, 2 + len(FUNCTIONS))))
    for name, found in zip(FUNCTIONS, np.array(rows).T, strict=True):
        expected = outputs(x, y)[f"np_{name}"]
        # 8 units in the last place: NumPy's own loops and C's functions differ by up to 4 each
        error = 0.0 if name in EXACT else 8 * np.spacing(np.abs(expected))
        wrong = ~(np.abs(found - expected) <= error)
        assert not wrong.any(), (name, np.array([x, y, found, expected])[:, wrong])
