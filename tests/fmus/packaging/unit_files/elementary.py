"""The elementary functions that a C library computes in its own way."""

from typing import Any

import numpy as np

from urmpipe_fmus.block import BlockModel, Input, Output


def outputs(v: Any) -> dict[str, Any]:
    small, far = np.tanh(v.x), 1.0 + np.abs(v.x)
    found = {name: getattr(np, name)(v.x) for name in ("sin", "cos", "tan", "arctan", "tanh", "arcsinh")}
    found |= {name: getattr(np, name)(-np.abs(v.x)) for name in ("exp", "expm1", "sinh", "cosh")}
    found |= {name: getattr(np, name)(small) for name in ("arcsin", "arccos")}
    found |= {name: getattr(np, name)(0.5 * small) for name in ("log1p", "arctanh")}
    found |= {name: getattr(np, name)(far) for name in ("log", "arccosh", "sqrt")}
    found |= {"hypot": np.hypot(v.x, v.y), "arctan2": np.arctan2(v.y, v.x), "cube": v.x**3, "power": far**v.y}
    return {f"np_{name}": value for name, value in found.items()}


NAMES = outputs(type("Given", (), {"x": 0.5, "y": 0.5}))
unit = BlockModel(
    name="elementary",
    description="",
    variables=(
        *(Input(name=name, description="", start=0.5) for name in "xy"),
        *(Output(name=name, description="") for name in NAMES),
    ),
    outputs=outputs,
)
