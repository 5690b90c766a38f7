"""Normal equations of a matrix."""

from __future__ import annotations

from urmpipe_models.elementwise import FloatArray
from urmpipe_pipeline.diagnosis.fit import Normal


def normal_of(jacobian: FloatArray, y: FloatArray) -> Normal:
    """Return the normal equations of columns, shape (n, p), and what they should be, shape (n,)."""
    return Normal(jacobian.T @ jacobian, jacobian.T @ y, float(y @ y), len(y))
