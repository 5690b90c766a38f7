from __future__ import annotations

from string import ascii_lowercase, digits

from hypothesis import assume, given, settings
from hypothesis import strategies as st

from urmpipe_models.errors import MAX_LISTED, format_names, format_suggestion, format_unknown_name

# No letter twice in a name: then what two names have in common is found without a doubt.
LETTERS = st.lists(st.sampled_from(ascii_lowercase + digits), min_size=2, max_size=12, unique=True)
NAMES = st.lists(LETTERS.map("".join), min_size=1, max_size=30)


def test_the_name_most_like_it_may_have_been_meant() -> None:
    assert format_suggestion("igest", ("compare", "ingest", "export")) == " (did you mean ingest?)"
    assert format_suggestion("UR-5E", ("ur3e", "ur5e")) == " (did you mean ur5e?)"
    assert format_suggestion("base-link", ("base", "base_link")) == " (did you mean base_link?)"
    assert format_suggestion("q_- 1", ("q1",)) == " (did you mean q1?)"
    assert format_suggestion("MASSE", ("mas", "maße")) == " (did you mean maße?)"
    assert format_suggestion("lenght", ()) == format_suggestion("q1", ("tool", "base")) == ""
    assert format_suggestion("abcde", ("abcxy",)) == " (did you mean abcxy?)"  # 6 of 10 letters
    assert format_suggestion("copy", ("compare",)) == ""  # 6 of 11


@settings(max_examples=40, deadline=None)
@given(NAMES, st.data())
def test_a_name_with_a_letter_missing_is_answered_with_it(names: list[str], data: st.DataObject) -> None:
    meant = data.draw(st.sampled_from(names))
    at = data.draw(st.integers(0, len(meant) - 1))
    written = meant[:at] + meant[at + 1 :]
    assume(written not in names)
    could_be = [one for one in names if any(written == one[:i] + one[i + 1 :] for i in range(len(one)))]
    assert format_suggestion(written.upper(), names) == f" (did you mean {max(could_be)}?)"


def test_what_is_found_and_what_is_allowed_is_said() -> None:
    assert format_unknown_name("q", ["q1", "q2"]) == "found 'q' (did you mean q2?), allowed: q1, q2"
    assert format_unknown_name("q", []) == "found 'q', allowed: none"


def test_of_many_names_the_nearest_are_listed() -> None:
    names = [f"u{i:02}" for i in range(20)] + ["speed"]
    text = format_names("sped", names)
    assert text.startswith("speed, ")
    assert text.endswith(" and 5 others")
    assert len(text.removesuffix(" and 5 others").split(", ")) == MAX_LISTED
    assert format_names("sped", names[:16]) == ", ".join(names[:16])
    assert format_unknown_name("sped", names) == f"found 'sped' (did you mean speed?), allowed: {text}"
