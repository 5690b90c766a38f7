"""The open form as text."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from operator import itemgetter

from urmpipe_models.lagrange.names import angle_names, angle_words, coordinate_names, legend, text_names
from urmpipe_models.lagrange.open_form import OpenForm
from urmpipe_models.lagrange.variables import Monomial, Terms
from urmpipe_models.messages import one_line
from urmpipe_models.robots.written import EXPORT_MARK


def equations_text(form: OpenForm) -> str:
    """Return the equations as text: a block a coordinate, a line a term.

    Of a coordinate q, q' is its rate and q'' its acceleration; c and s with the numbers of coordinates are
    cosine and sine of their sum.
    """
    coordinates = coordinate_names(form.variables, form.chain.coordinates)
    names = text_names(form.variables, coordinates)
    lines = [f"# {line}".rstrip() for line in _head(form, coordinates)]
    for i, name in enumerate(coordinates):
        lines += ["", f"tau_{name} = {' + '.join(form.formulas)}"]
        lines += [f"  {term} = {_formula(form, own[i], names)}" for term, own in form.formulas.items()]
    return "\n".join(lines) + "\n"


def _head(form: OpenForm, coordinates: Sequence[str]) -> Iterator[str]:
    """Yield what the names mean, and what the terms cost."""
    yield f"{EXPORT_MARK}: equations of motion of {one_line(form.chain.name)}"
    yield "tau: what the drives must give, in N.m, of a joint that slides in N"
    yield "q, q', q'': a coordinate in rad, rad/s, rad/s2, or in m, m/s, m/s2"
    yield from legend(form.chain.coordinates, coordinates)
    used = {
        k // 2
        for own in form.formulas.values()
        for of in own
        for key in of
        for k, one in enumerate(key)
        if one
    }
    for k, (name, angle) in enumerate(zip(angle_names(form.variables), form.variables.angles, strict=True)):
        if k in used:
            words = angle_words(angle, coordinates)
            yield f"c{name} = cos({words}), s{name} = sin({words})"
    if "tool" in form.formulas:
        yield "fx, fy, fz in N, mx, my, mz in N.m: act on the tool centre point from outside, in world axes"
    yield ""
    yield "Operations: of the expanded sums, and as C computes them"
    for term in form.formulas:
        before, after = form.cost(term)
        yield f"{term}: {before}; reduced: {after}"


def _formula(form: OpenForm, of: Terms, names: Sequence[str]) -> str:
    """Return a formula as a sum of products of rates, accelerations and wrench, each with its factor."""
    shape = form.variables.shape
    parts: dict[Monomial, dict[Monomial, float]] = {}
    for key, coefficient in of.items():
        parts.setdefault(key[shape:], {})[key[:shape]] = coefficient
    written = ""
    for key, factor in sorted(parts.items(), key=itemgetter(0), reverse=True):
        product = "*".join(_powers(key, names[shape:]))
        total = _sum(factor, names)
        if product and len(factor) > 1:
            total = f"({total})"
        part = {"1.0": product, "-1.0": f"-{product}"}.get(total, f"{total}*{product}") if product else total
        written = _joined(written, part)
    return written or "0"


def _sum(of: Terms, names: Sequence[str]) -> str:
    """Return a polynomial as a sum."""
    written = ""
    for key, coefficient in of.items():
        powers = _powers(key, names)
        plain = powers and abs(coefficient) == 1.0
        factors = powers if plain else [repr(abs(coefficient)), *powers]
        written = _joined(written, ("-" if coefficient < 0.0 else "") + "*".join(factors))
    return written


def _joined(sum_: str, part: str) -> str:
    """Return a sum with one more part."""
    if not sum_:
        return part
    return f"{sum_} - {part[1:]}" if part.startswith("-") else f"{sum_} + {part}"


def _powers(key: Monomial, names: Sequence[str]) -> list[str]:
    """Return the factors of a monomial, such as c2^2."""
    return [
        name if exponent == 1 else f"{name}^{exponent}"
        for name, exponent in zip(names, key, strict=False)
        if exponent
    ]
