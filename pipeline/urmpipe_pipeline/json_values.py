"""Values as JSON can hold them: finite numbers, text, lists and objects."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np


def json_ready(value: Any) -> Any:
    """Return a value as JSON can hold it: arrays as lists, NaN and infinities as null."""
    if isinstance(value, Mapping):
        return {str(key): json_ready(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [json_ready(item) for item in value]
    if isinstance(value, np.ndarray):
        return json_ready(value.tolist())
    if isinstance(value, np.generic):
        return json_ready(value.item())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return str(value) if isinstance(value, Path) else value


def parsed_json(written: str | bytes) -> Any:
    """Return the value that JSON holds.

    Raises:
        ValueError: If it is no JSON, or nested too deep to be read.
    """
    try:
        return json.loads(written)
    except RecursionError:
        raise ValueError("nested too deep") from None


def plain(value: Any) -> str:
    """Return an option's value as one line: text as it is, the rest as JSON."""
    return value if isinstance(value, str) else json.dumps(json_ready(value), ensure_ascii=False)
