"""What tests assert in passing."""

from __future__ import annotations

from typing import TypeVar

Item = TypeVar("Item")


def there(value: Item | None) -> Item:
    """A value that must be there."""
    assert value is not None
    return value
