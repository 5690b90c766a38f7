"""What a minute is enough for: the banner, a line for each judged part, results side by side."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from urmpipe_pipeline import text
from urmpipe_pipeline.presentation.digits import written
from urmpipe_pipeline.presentation.section import (
    Cell,
    Column,
    Fact,
    Judged,
    Presentation,
    Ref,
    Section,
    Table,
    Value,
    Verdict,
)
from urmpipe_pipeline.report.tables import Anchors, Grid, ShownFact, grid, shown_facts

STATES: tuple[Verdict, ...] = ("fail", "pass", None)
"""What a verdict may be, the most important first."""

PLAIN = "plain"
"""How a banner, a card and a badge without a verdict look."""

TOLD = 4
"""Headlines of results that stand in the banner; more of them are counted."""


@dataclass(frozen=True, slots=True)
class Banner:
    """The verdict on all results.

    Attributes:
        state: pass, fail, or plain where nothing was judged.
        word: The same in capitals, or what stands for it.
        headline: How many results fail, or how the only one came out.
        facts: What explains it, of the worst.
        others: What else was found, the worst first, a sentence each.
    """

    state: str
    word: str
    headline: str
    facts: tuple[ShownFact, ...]
    others: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Card:
    """A judged part; its numbers stand where it stands.

    Attributes:
        name: Its heading.
        href: Where it is.
        state: pass or fail.
        size: What uses up most of its limit; empty where nothing has a limit.
        share: Share of the limit that is used up, 0 to 1 at most, drawn as a bar; None without one.
        used: The same in words.
    """

    name: str
    href: str
    state: str
    size: str
    share: float | None
    used: str


@dataclass(frozen=True, slots=True)
class Summary:
    """Cards and tables under a heading."""

    title: str
    cards: tuple[Card, ...]
    tables: tuple[Grid, ...]


def word_of(verdict: Verdict, instead: str = "") -> str:
    """Return a verdict in capitals, or what stands for it."""
    return (verdict or instead).upper()


def banner_of(shown: Sequence[tuple[Presentation, Anchors]]) -> Banner:
    """Return the verdict on all results: the worst explains it, none of the others hides behind it."""
    others = worst_first(shown)
    worst, anchors = others[0]
    counted = _counted([one for one, _ in shown if one.verdict])
    others = others if counted else others[1:]
    told = [f"{word_of(one.verdict, one.word)}: {one.headline.rstrip('.')}." for one, _ in others[:TOLD]]
    if left := Counter(word_of(one.verdict, one.word) for one, _ in others[TOLD:]):
        told.append(f"And {', '.join(f'{count} more: {word}' for word, count in left.items())}.")
    return Banner(
        worst.verdict or PLAIN,
        word_of(worst.verdict, worst.word),
        counted or worst.headline,
        tuple(_short(worst.facts, anchors)),
        tuple(told),
    )


def _counted(judged: Sequence[Presentation]) -> str:
    """Return how many of several judged results and their lines fail, or that all pass; empty for one.

    As in "3 of 10 logs, in 3 of 5 recordings": lines are counted if all are of one kind, and if no result
    fails for another reason than its lines.
    """
    if len(judged) < 2:
        return ""
    failed = [one for one in judged if one.verdict == "fail"]
    results = "recordings" if all(one.recording for one in judged) else "results"
    said = _share(len(failed), len(judged), results)
    lines = [(next(iter(line)), line.get("Verdict")) for one in judged for line in one.lines]
    known = [one for one in failed if any(line.get("Verdict") == Judged("fail") for line in one.lines)]
    heads = {head for head, _ in lines}
    if len(heads) != 1 or len(known) < len(failed):
        return said
    out = sum(verdict == Judged("fail") for _, verdict in lines)
    counted = _share(out, len(lines), f"{heads.pop().lower()}s")
    return counted if all(len(one.lines) == 1 for one in judged) else f"{counted}, in {said}"


def _share(count: int, total: int, noun: str) -> str:
    return f"{count} of {total} {noun}" if count else f"all {total} {noun}"


def worst_first(shown: Sequence[tuple[Presentation, Anchors]]) -> list[tuple[Presentation, Anchors]]:
    """Return results that fail, then those that pass, then others; of each the fullest of a limit first."""
    return sorted(shown, key=lambda pair: _badness(pair[0].verdict, _most_used(pair[0])))


def badness(section: Section) -> tuple[int, float, int]:
    """Return what puts the worst of some sections first; those without a verdict keep their rank."""
    return (*_badness(section.verdict, _used(section)), section.rank)


def cards_of(shown: Sequence[tuple[Presentation, Anchors]]) -> tuple[Card, ...]:
    """Return a card for each judged part, the worst first; none of a single one, which stands below alone."""
    every = [(one, anchors, part) for one, anchors in shown for part in judged_parts(one.body)]
    every.sort(key=lambda found: badness(found[2]))
    several = len(shown) > 1
    cards = (
        _card(part, f"{part.title} ({one.name})" if several and part is not one.body else part.title, anchors)
        for one, anchors, part in every
    )
    return tuple(cards) if len(every) > 1 else ()


def judged_parts(body: Section) -> list[Section]:
    """Return the judged sections of a result, or the result itself if it alone is judged."""
    return list(judged_sections(body)) or ([body] if body.verdict else [])


def judged_sections(section: Section) -> Iterator[Section]:
    """Yield the innermost sections with a verdict and facts, and one that fails for a reason of its own."""
    below = [found for child in section.sections for found in judged_sections(child)]
    alone = section.verdict == "fail" and all(one.verdict != "fail" for one in below)
    if section.verdict and (alone if below else section.facts):
        yield section
    yield from below


def side_by_side(shown: Sequence[tuple[Presentation, Anchors]]) -> Iterator[Grid]:
    """Yield a table for each kind of line that several results have; lines of one name stand together.

    Lines are of one kind if their first two heads are the same. The first cell leads to its section, or to
    its result.
    """
    kinds: dict[tuple[str, ...], list[tuple[Ref, Mapping[str, Cell]]]] = {}
    results: Counter[tuple[str, ...]] = Counter()
    leads: dict[int, str] = {}
    for one, anchors in shown:
        results.update({_kind(line) for line in one.lines})
        for line in one.lines:
            first = next(iter(line.values()))
            name = first if isinstance(first, Ref) else Ref(written(first))
            leads[id(name)] = anchors.href(name) or f"#{anchors.ident(one.body)}"
            kinds.setdefault(_kind(line), []).append((name, line))
    for kind, lines in kinds.items():
        if results[kind] > 1:
            order = list(dict.fromkeys(name.title for name, _ in lines))
            lines.sort(key=lambda pair: order.index(pair[0].title))
            heads = dict.fromkeys(head for _, line in lines for head in line)
            columns = [Column(head, head, [line.get(head) for _, line in lines]) for head in heads]
            columns[0] = replace(columns[0], cells=[name for name, _ in lines])
            table = Table(f"{kind[0]}: {results[kind]} results", tuple(columns))
            yield grid(table, lambda cell: leads.get(id(cell), ""), folds=False)


def _kind(line: Mapping[str, Cell]) -> tuple[str, ...]:
    return tuple(line)[:2]


def _badness(verdict: Verdict, used: float) -> tuple[int, float]:
    """Return what puts the worst first."""
    return STATES.index(verdict), -used


def _most_used(one: Presentation) -> float:
    """Return the largest share of a limit that a judged part of a result uses up; -1 without one."""
    return max(map(_used, judged_sections(one.body)), default=-1.0)


def _used(section: Section) -> float:
    """Return the share of the limit that decided about a section; -1 without one."""
    value = _decisive(section)
    return -1.0 if value is None or value.used is None else value.used


def _decisive(section: Section) -> Value | None:
    """Return what decided about a section: its first fact, if it has a limit."""
    value = section.facts[0].value if section.facts else None
    return value if isinstance(value, Value) and value.limit is not None else None


def _card(section: Section, name: str, anchors: Anchors) -> Card:
    value = _decisive(section)
    used = None if value is None else value.used
    return Card(
        name=name,
        href=f"#{anchors.ident(section)}",
        state=section.verdict or PLAIN,
        size="" if value is None else section.facts[0].name,
        share=None if used is None else min(used, 1.0),
        used="" if used is None or math.isinf(used) else f"{text.format_portion(used)} the limit",
    )


def _short(facts: Sequence[Fact], anchors: Anchors) -> Iterator[ShownFact]:
    """Yield facts without what they mean: that is said where there is room."""
    return (replace(fact, help="") for fact in shown_facts(facts, anchors.href))
