"""Tables of TOML are written and read back. toml_tables.cases has messages and checked tables."""

from __future__ import annotations

import tomllib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from urmpipe_models.toml_tables import format_toml

texts = st.text(st.characters(exclude_categories=["Cs"]), max_size=20)
leaves = st.booleans() | st.integers(-(2**63), 2**63 - 1) | st.floats(allow_nan=False) | texts
keys = st.from_regex(r"[A-Za-z0-9_-]+", fullmatch=True)
values = st.recursive(
    leaves, lambda inner: st.lists(inner, max_size=3) | st.dictionaries(keys, inner, max_size=3)
)


@pytest.mark.slow
@given(st.dictionaries(keys, values, max_size=4))
def test_what_is_written_reads_back(table: dict[str, object]) -> None:
    assert tomllib.loads("\n".join(format_toml(table))) == table
