"""SciPy's rotations in the forms in which logs record them."""

from __future__ import annotations

from scipy.spatial.transform import Rotation

from urmpipe_models.elementwise import FloatArray
from urmpipe_models.math3d import RotationForm


def orientation_columns(rotation: Rotation, form: RotationForm) -> FloatArray:
    """Return the columns of a form; capital letters are axes that move along."""
    match form:
        case "vector":
            return rotation.as_rotvec()
        case "quat_xyzw" | "quat_wxyz":
            return rotation.as_quat(scalar_first=form == "quat_wxyz")
        case "matrix":
            return rotation.as_matrix().reshape(-1, 9)
    return rotation.as_euler("xyz" if form == "rpy" else form.upper())  # type: ignore[call-overload,no-any-return]
