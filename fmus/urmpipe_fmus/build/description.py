"""A unit's modelDescription.xml for FMI 2.0 co-simulation.

The page of documentation inside an FMU.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from functools import cache, partial
from importlib.metadata import version
from typing import Any, Literal
from xml.etree import ElementTree as ET

import numpy as np

from urmpipe_fmus.block import INTERNAL_STEP, MAX_INTEGER, BlockModel, Input, Output, Variable
from urmpipe_fmus.dependencies import Dependencies
from urmpipe_fmus.si_units import BASE_NAMES, display_conversion, parse_unit

Backend = Literal["native", "python"]

STEP = 0.005
"""Communication step of the default experiment in [s], where no table tells a better one."""

DURATION = 1.0
"""Duration of the default experiment in [s], where no table tells a better one."""

LOG_CATEGORIES = {
    "logStatusError": "Why a call was refused or failed",
    "logAll": "All messages",
}


def model_description(
    model: BlockModel, guid: str, backend: Backend, source_files: Sequence[str] = ()
) -> str:
    """Return the text of modelDescription.xml; the same for the same unit, GUID, backend and version.

    Args:
        model: The block model.
        guid: What ties the binary to this description.
        backend: Who runs the unit.
        source_files: C files below sources/ that a binary is compiled from; empty if there are none.
    """
    root = ET.Element(
        "fmiModelDescription",
        fmiVersion="2.0",
        modelName=model.name,
        guid=guid,
        description=markup_text(model.description),
        generationTool=f"urmpipe {version('urmpipe')}",
        variableNamingConvention="structured",
    )
    _co_simulation(root, model, backend, source_files)
    _unit_definitions(root, model)
    categories = ET.SubElement(root, "LogCategories")
    for name, description in LOG_CATEGORIES.items():
        ET.SubElement(categories, "Category", name=name, description=description)
    _default_experiment(root, model)
    variables = ET.SubElement(root, "ModelVariables")
    for reference, (name, one) in enumerate(model.scalars):
        _scalar_variable(variables, reference, name, one)
    _model_structure(root, model)
    ET.indent(root)
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{ET.tostring(root, encoding="unicode")}\n'


def default_experiment(model: BlockModel) -> tuple[float, float]:
    """Return stop time and communication step in [s] of the default experiment: the table's, if any."""
    if model.table is None or len(model.table.t_ns) < 2 or model.table.t_ns[-1] <= 0:
        return DURATION, STEP
    return float(model.table.t_ns[-1]) / 1e9, float(np.median(np.diff(model.table.t_ns))) / 1e9


def markup_text(text: str) -> str:
    """Return a text with what XML cannot hold (control characters, halves of pairs) as Python's escapes."""
    return "".join(
        one
        if one in "\t\n\r" or " " <= one < "\ud800" or "\udfff" < one < "\ufffe" or one > "\uffff"
        else one.encode("unicode_escape").decode()
        for one in text
    )


def _co_simulation(
    root: ET.Element, model: BlockModel, backend: Backend, source_files: Sequence[str]
) -> None:
    """Say what the FMU can do; what is not said is false."""
    only_python = ("needsExecutionTool", "canNotUseMemoryManagementFunctions")
    flags = dict.fromkeys(only_python, "true") if backend == "python" else {}
    element = ET.SubElement(
        root,
        "CoSimulation",
        flags,
        modelIdentifier=model.name,
        canHandleVariableCommunicationStepSize="true",
        canGetAndSetFMUstate="true",
        canSerializeFMUstate="true",
    )
    if source_files:
        files = ET.SubElement(element, "SourceFiles")
        for name in source_files:
            ET.SubElement(files, "File", name=name)


def _unit_definitions(root: ET.Element, model: BlockModel) -> None:
    """Define the units that variables have, each with its display units."""
    used = sorted({one.unit for one in model.variables if one.unit})
    if not used:
        return
    definitions = ET.SubElement(root, "UnitDefinitions")
    for spelling in used:
        element = ET.SubElement(definitions, "Unit", name=spelling)
        base = parse_unit(spelling)
        exponents = zip(BASE_NAMES, base.exponents, strict=True)
        attributes = {name: str(value) for name, value in exponents if value}
        attributes |= _scale(base.factor, base.offset)
        ET.SubElement(element, "BaseUnit", attributes)
        displays = {one.display_unit for one in model.variables if one.unit == spelling and one.display_unit}
        for display in sorted(displays):
            scale = _scale(*display_conversion(spelling, display))
            ET.SubElement(element, "DisplayUnit", {"name": display, **scale})


def _scale(factor: float, offset: float) -> dict[str, str]:
    """Return the attributes factor and offset, each unless it is the default."""
    return ({"factor": repr(factor)} if factor != 1.0 else {}) | ({"offset": repr(offset)} if offset else {})


def _default_experiment(root: ET.Element, model: BlockModel) -> None:
    stop, step = default_experiment(model)
    ET.SubElement(root, "DefaultExperiment", startTime="0.0", stopTime=repr(stop), stepSize=repr(step))


def _scalar_variable(parent: ET.Element, reference: int, name: str, one: Variable) -> None:
    """Add a scalar: an input's `initial` is not allowed, a computed output has no start."""
    attributes = {"name": name, "valueReference": str(reference)}
    if one.description:
        attributes["description"] = markup_text(one.description)
    attributes |= {"causality": one.causality, "variability": one.variability}
    if not isinstance(one, Input):
        attributes["initial"] = "calculated" if isinstance(one, Output) else "exact"
    element = ET.SubElement(parent, "ScalarVariable", attributes)
    ET.SubElement(element, one.type, _type_attributes(name, one))


def _type_attributes(name: str, one: Variable) -> dict[str, str]:
    """Return unit, range and start of a scalar as its type writes them."""
    attributes = {}
    if one.unit:
        attributes["unit"] = one.unit
    if one.display_unit:
        attributes["displayUnit"] = one.display_unit
    for key, bound, inside in (("min", one.minimum, math.ceil), ("max", one.maximum, math.floor)):
        if one.type == "Real" and math.isfinite(bound):
            attributes[key] = repr(float(bound))
        elif one.type == "Integer" and abs(bound) <= MAX_INTEGER:
            attributes[key] = str(inside(bound))
    if not isinstance(one, Output):
        attributes["start"] = _number(one, one.scalar_start(name))
    return attributes


def _number(one: Variable, value: float) -> str:
    """Return a value as the variable's type writes it."""
    if one.type == "Boolean":
        return "true" if value else "false"
    return repr(float(value)) if one.type == "Real" else str(int(value))


def _model_structure(root: ET.Element, model: BlockModel) -> None:
    """Say what the outputs depend on.

    At communication points the knowns are the inputs. A state is none, as its derivative is not exposed: an
    output that is one depends on nothing, and so does what is computed from states only. In the
    initialization all that has an exact start value is known too (FMI 2.0.4, section 2.2.8).
    """
    index = {name: number for number, (name, _) in enumerate(model.scalars, start=1)}
    inputs = {name for one in model.inputs for name in one.names}
    depends = Dependencies(model).outputs
    structure = ET.SubElement(root, "ModelStructure")
    outputs = [name for name, one in model.scalars if one.causality == "output"]
    for title, names, known in (("Outputs", outputs, inputs), ("InitialUnknowns", list(depends), set(index))):
        lines = ET.SubElement(structure, title) if names else structure
        for name in sorted(names, key=index.__getitem__):
            on = _indices(index, depends.get(name, frozenset()) & known)
            ET.SubElement(lines, "Unknown", index=str(index[name]), dependencies=on)


def _indices(index: dict[str, int], names: Iterable[str]) -> str:
    """Return the indices of variables, rising, as an XML list."""
    return " ".join(str(number) for number in sorted(index[name] for name in names))


TITLES = ("Name", "Part", "Unit", "Start", "Min", "Max", "Description")
NUMBERS = ("Start", "Min", "Max")


def documentation(model: BlockModel) -> str:
    """Return a page of HTML that needs nothing else: variables, equations, source, and what a step does."""
    page = _template().render(
        model=model,
        version=version("urmpipe"),
        titles=TITLES,
        numbers=NUMBERS,
        rows=[list(zip(TITLES, variable_row(one), strict=True)) for one in model.variables],
        steps=_steps(model),
    )
    return markup_text(page)


@cache
def _template() -> Any:
    """Return the page's template."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("urmpipe_fmus", ""),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    return environment.get_template("documentation.html.jinja")


def variable_row(one: Variable, digits: int | None = None) -> tuple[str, ...]:
    """Return what a table says of a variable, in the order of `TITLES`.

    Args:
        one: The variable.
        digits: So many significant digits of each number; None for all.
    """
    value = partial(_value, one, digits=digits)
    name = one.name if one.size is None else f"{one.name}[1]" + (f" .. [{one.size}]" if one.size > 1 else "")
    part = f"{one.causality}, {one.variability}"
    kind = one.type if one.type != "Real" else one.unit
    start = "computed" if isinstance(one, Output) else ", ".join(map(value, _starts(one)))
    return name, part, kind, start, value(one.minimum), value(one.maximum), one.description


def _starts(one: Variable) -> tuple[float, ...]:
    """Return the start values, one if they are all the same."""
    return one.starts[:1] if len(set(one.starts)) == 1 else one.starts


def _value(one: Variable, value: float, digits: int | None) -> str:
    """Return a value, and what it is in the unit that people like to see; nothing for no bound."""
    if not math.isfinite(value):
        return ""
    if one.type == "Boolean":
        return "true" if value else "false"
    short = f"{value:.{digits or 6}g}"
    said = short if digits or float(short) == value else repr(float(value))
    if not one.display_unit or one.display_unit == one.unit:
        return said
    factor, offset = display_conversion(one.unit, one.display_unit)
    return f"{said} ({factor * value + offset:.{digits or 7}g} {one.display_unit})"


def _steps(model: BlockModel) -> list[str]:
    """Return what happens from one communication point to the next."""
    lines = [
        "Outputs are those of the inputs as they stand: set inputs, get outputs, without a step in between."
    ]
    if model.table is not None:
        first, last = (float(t) / 1e9 for t in model.table.t_ns[[0, -1]])
        lines.append(
            f"It reads a table of {len(model.table.t_ns)} rows from {first:.9g} s to {last:.9g} s at the time"
            " of the communication point, rounded to nanoseconds; outside the table its first and last row"
            " hold."
        )
    if model.memories:
        names = ", ".join(one.name for one in model.memories)
        lines.append(
            f"fmi2DoStep first takes the sample: the next values of {names}, from the inputs as set."
        )
    if model.states:
        names = ", ".join(one.name for one in model.states)
        lines.append(
            f"{'Then it' if model.memories else 'fmi2DoStep'} integrates {names} with the classical"
            f" Runge-Kutta method in equal steps of at most the parameter {INTERNAL_STEP}, the inputs held."
            " A step after which a state is not finite is an error, and undone."
        )
    if not model.memories and not model.states:
        lines.append("It remembers nothing: fmi2DoStep only moves the time on.")
    return lines
