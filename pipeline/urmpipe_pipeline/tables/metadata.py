"""What every export tells about itself, as far as its format can hold it."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from urmpipe_pipeline.json_values import json_ready

MARK = "urmpipe export"
"""Stands in every file that can hold it; only such a file is replaced."""


def described(about: Mapping[str, Any], rows: str) -> dict[str, Any]:
    """Return what a reader of the file needs to know: whose it is, what its rows are, where it came from."""
    return {"mark": MARK, "schema": 1, "name": about["name"], "rows": rows, **about}


def as_json(about: Mapping[str, Any]) -> str:
    """Return a description as JSON, which every encoding can hold."""
    return json.dumps(json_ready(about))
