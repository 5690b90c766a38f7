"""A system drawn as SVG: blocks with their ports and units, and what is connected with what."""

from __future__ import annotations

from collections.abc import Iterator
from html import escape
from textwrap import wrap

from urmpipe_fmus.cosim.diagram import CHARACTER, HEAD, PAD, ROW, Box, Diagram, Pin, Wire, cut, diagram
from urmpipe_fmus.cosim.layout import Layout
from urmpipe_fmus.cosim.plan import Plan

MARGIN = 24.0
"""Around the drawing in [px]."""

LINE, TITLE = 17.0, 22.0
"""Height of a line of the description, and of the title, in [px]."""

LARGER = 16.0 / 12.0
"""The title's letters for one of the rest."""

NARROWEST = 420.0
"""Least width of the drawing in [px]: room for its title."""

STYLE = """
.paper{fill:#ffffff}.box{fill:#f5f7fa;stroke:#5b6b7d}.head{fill:#dfe7f0}.log .head{fill:#e8e0cf}
.wire{fill:none;stroke:#3a6ea5;stroke-width:1.4;stroke-linejoin:round}
.array{stroke-width:2.8}.held{stroke-dasharray:7 4}.back{stroke:#a55a3a}
.tip{fill:#3a6ea5}.back-tip{fill:#a55a3a}
text{fill:#1c2733;font:12px ui-monospace,"DejaVu Sans Mono",monospace}
.name{font-weight:bold}.quiet{fill:#5a6875}.title{font-size:16px;font-weight:bold}.many{font-size:10px}
@media (prefers-color-scheme:dark){.paper{fill:#14191f}.box{fill:#1e262f;stroke:#8496a8}.head{fill:#2b3947}
.log .head{fill:#453d2b}.wire{stroke:#7fb2e5}.back{stroke:#e59b7f}.tip{fill:#7fb2e5}.back-tip{fill:#e59b7f}
text{fill:#e8edf2}.quiet{fill:#a3b1bf}}
"""


def system_svg(plan: Plan) -> str:
    """Return a drawing of a system as a self-contained SVG: the same text for the same system.

    Its colours are those of a light page, or of a dark one where the reader prefers that.
    """
    shown = diagram(plan)
    layout = Layout(shown)
    width = max(layout.width, NARROWEST)
    titles = wrap(plan.system.name, int(width / (LARGER * CHARACTER)))
    lines = wrap(plan.system.description, int(width / CHARACTER))
    below = MARGIN + TITLE * (len(titles) - 1)
    top = below + 2.0 * LINE + LINE * len(lines)
    key = [line for said in _key(layout) for line in wrap(said, int(width / CHARACTER))]
    full = (width + 2.0 * MARGIN, top + layout.height + MARGIN + LINE * len(key))
    body = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{full[0]:.0f}" height="{full[1]:.0f}"'
        f' viewBox="0 0 {full[0]:.0f} {full[1]:.0f}" role="img">',
        f"<title>{_text(plan.system.name)}</title><style>{STYLE}</style>",
        f'<rect class="paper" width="{full[0]:.0f}" height="{full[1]:.0f}"/>',
    ]
    for i, line in enumerate(titles):
        body.append(
            f'<text class="title" x="{MARGIN:g}" y="{MARGIN + 12 + TITLE * i:g}">{_text(line)}</text>'
        )
    for i, line in enumerate(lines):
        body.append(
            f'<text class="quiet" x="{MARGIN:g}" y="{below + 14 + LINE * (i + 1):g}">{_text(line)}</text>'
        )
    body.append(f'<g transform="translate({MARGIN:g} {top:.1f})">')
    for wire in layout.wires:
        body += _wire(wire, layout.way(wire), layout.back(wire))
    for name, box in shown.boxes.items():
        body += _box(name, box, _feeding(shown))
    for i, line in enumerate(key):
        body.append(
            f'<text class="quiet" x="0" y="{layout.height + LINE * (i + 1):.1f}">{_text(line)}</text>'
        )
    return "\n".join([*body, "</g></svg>", ""])


def _key(layout: Layout) -> Iterator[str]:
    """Yield what the lines mean, of those that are drawn."""
    if any(wire.held for wire in layout.wires):
        yield "Dashed: held between two samples, or two rows of a log."
    if any(wire.size > 1 for wire in layout.wires):
        yield "Thick: an array, with its size."
    if any(map(layout.back, layout.wires)):
        yield "Brown: back to a block further left."
    if any(pin.value for box in layout.boxes.values() for pin in box.left):
        yield "name = value: an input that nothing changes."


def _text(text: str) -> str:
    """Return a text for SVG; what no XML may hold is left out."""
    return escape("".join(one for one in text if one.isprintable()))


def _feeding(shown: Diagram) -> set[tuple[str, str]]:
    """Return the outputs that lead somewhere."""
    return {(wire.source, wire.output) for wire in shown.wires}


def _wire(wire: Wire, points: list[tuple[float, float]], back: bool) -> Iterator[str]:
    """Yield a wire with its tip, and how many scalars go through it."""
    start, *curves = (f"{x:.1f} {y:.1f}" for x, y in points)
    way = f"M{start} C{' '.join(curves)}"
    kinds = " ".join(["wire", *(["array"] if wire.size > 1 else []), *(["back"] if back else [])])
    kinds += " held" if wire.held else ""
    ends = f"{wire.source}.{wire.output} → {wire.target}.{wire.input}"
    yield f'<path class="{kinds}" d="{way}"><title>{_text(ends)}</title></path>'
    x, y = points[-1]
    tip = "back-tip" if back else "tip"
    yield f'<path class="{tip}" d="M{x:.1f} {y:.1f} l-8 -4 v8 z"/>'
    if wire.size > 1:
        x, y = points[0]
        yield f'<text class="many" x="{x + 5:.1f}" y="{y - 4:.1f}">{wire.size}</text>'


def _box(name: str, box: Box, feeding: set[tuple[str, str]]) -> Iterator[str]:
    """Yield a box with its name, its kind and its ports."""
    x, y, width, height = box.x, box.y, box.width, box.height
    yield '<g class="log">' if box.log else "<g>"
    yield f'<rect class="box" x="{x:.1f}" y="{y:.1f}" width="{width:.1f}" height="{height:.1f}" rx="4"/>'
    head = f'x="{x + 1:.1f}" y="{y + 1:.1f}" width="{width - 2:.1f}" height="{HEAD - 6:.1f}"'
    yield f'<rect class="head" {head} rx="3"/>'
    yield f'<text class="name" x="{x + PAD:.1f}" y="{y + 16:.1f}">{_text(cut(name))}</text>'
    yield f'<text class="quiet" x="{x + PAD:.1f}" y="{y + 31:.1f}">{_text(cut(box.kind))}</text>'
    for i, pin in enumerate(box.left):
        yield _pin(pin, x + PAD, y + HEAD + ROW * (i + 0.5) + 4.0, "start", quiet=bool(pin.value))
    for i, pin in enumerate(box.right):
        quiet = (name, pin.name) not in feeding
        yield _pin(pin, x + width - PAD, y + HEAD + ROW * (i + 0.5) + 4.0, "end", quiet=quiet)
    if box.hidden:
        row = y + HEAD + ROW * (len(box.right) + 0.5) + 4.0
        yield _pin(Pin(f"{box.hidden} more"), x + width - PAD, row, "end", quiet=True)
    yield "</g>"


def _pin(pin: Pin, x: float, y: float, anchor: str, *, quiet: bool) -> str:
    """Return the text of a port: its name, and its unit in a quieter colour."""
    unit = f' <tspan class="quiet">{_text(pin.unit)}</tspan>' if pin.unit else ""
    kind = ' class="quiet"' if quiet else ""
    return f'<text{kind} x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}">{_text(pin.label)}{unit}</text>'
