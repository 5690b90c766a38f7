"""What tests assert in passing."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ParamSpec, TypeVar

import numpy as np
import pytest

OTHER_TIME = "; --time COLUMN names the time column; --time none leaves the time column out"
"""What every finding about a clock ends with."""

INCREASE = f"allowed: times that increase from row to row{OTHER_TIME}"

Item = TypeVar("Item")
Given = ParamSpec("Given")


def there(value: Item | None) -> Item:
    """A value that must be there."""
    assert value is not None
    return value


def refusal(
    kind: type[Exception], work: Callable[Given, object], *args: Given.args, **options: Given.kwargs
) -> str:
    """What a call says that must be refused."""
    with pytest.raises(kind) as error:
        work(*args, **options)
    return str(error.value)


def assert_near(got: Any, expected: Any, atol: float) -> None:
    """Compare with no relative tolerance."""
    np.testing.assert_allclose(got, expected, rtol=0.0, atol=atol)
