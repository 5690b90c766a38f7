"""What type and metadata of an Arrow column tell: whether it holds numbers, its unit, its role."""

from __future__ import annotations

import pyarrow as pa

UNIT, ROLE = b"unit", b"role"
"""The keys of its unit, and of what it holds with its place among those of this role."""

JOINT = b"joint"  # the role of a column that is a joint, but in no known place


def is_number(kind: pa.DataType) -> bool:
    """Return whether a type is that of numbers."""
    return bool(pa.types.is_integer(kind) or pa.types.is_floating(kind) or pa.types.is_decimal(kind))
