"""NormalEquations equations of a matrix."""

from __future__ import annotations

from urmpipe_models.elementwise import FloatArray
from urmpipe_pipeline.diagnosis.fit import NormalEquations


def normal_of(jacobian: FloatArray, y: FloatArray) -> NormalEquations:
    """Return the normal equations of columns, shape (n, p), and what they should be, shape (n,)."""
    return NormalEquations(jacobian.T @ jacobian, jacobian.T @ y, float(y @ y), len(y))
