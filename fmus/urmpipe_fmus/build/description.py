"""The texts in an FMU: modelDescription.xml for FMI 2.0 co-simulation, and the page of documentation.

`model_description` writes, in the order of the schema (FMI 2.0.4, section 2.2), what the FMU can do, the
units, the log categories, the default experiment, the variables, and what the outputs depend on.
`documentation` fills documentation.html.jinja with the table of variables (`variable_row`), the equations,
and what happens in a step.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache, partial
from importlib.metadata import version
from typing import Any, Literal
from xml.etree import ElementTree as ET

import numpy as np

from urmpipe_fmus.block import INTERNAL_STEP, MAX_INTEGER, BlockModel, Input, Output, Variable
from urmpipe_fmus.dependencies import Dependencies
from urmpipe_fmus.si_units import BASE_NAMES, display_conversion, parse_unit

Backend = Literal["native", "python"]

DEFAULT_STEP = 0.005  # s, communication step of the default experiment of a model without a table
DEFAULT_DURATION = 1.0  # s, duration of that experiment

LOG_CATEGORIES = {
    "logStatusError": "Why a call was refused or failed",
    "logAll": "All messages",
}
TITLES = ("Name", "Part", "Unit", "Start", "Min", "Max", "Description")
NUMBERS = ("Start", "Min", "Max")


def model_description(
    model: BlockModel, guid: str, backend: Backend, source_files: Sequence[str] = ()
) -> str:
    """Return the text of modelDescription.xml; the same for the same model, GUID, backend and version.

    Args:
        model: The block model.
        guid: The GUID that ties the binary to this description.
        backend: Native or Python.
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
    _add_co_simulation(root, model, backend, source_files)
    _add_unit_definitions(root, model)
    categories = ET.SubElement(root, "LogCategories")
    for name, description in LOG_CATEGORIES.items():
        ET.SubElement(categories, "Category", name=name, description=description)
    stop, step = default_experiment(model)
    ET.SubElement(root, "DefaultExperiment", startTime="0.0", stopTime=repr(stop), stepSize=repr(step))
    variables = ET.SubElement(root, "ModelVariables")
    for reference, (name, variable) in enumerate(model.scalars):
        _add_scalar_variable(variables, reference, name, variable)
    _add_model_structure(root, model)
    ET.indent(root)
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{ET.tostring(root, encoding="unicode")}\n'


def default_experiment(model: BlockModel) -> tuple[float, float]:
    """Return stop time and communication step in [s] of the default experiment: of the table, if any."""
    if model.table is None or len(model.table.t_ns) < 2 or model.table.t_ns[-1] <= 0:
        return DEFAULT_DURATION, DEFAULT_STEP
    return float(model.table.t_ns[-1]) / 1e9, float(np.median(np.diff(model.table.t_ns))) / 1e9


def markup_text(text: str) -> str:
    """Return a text with Python's escapes for what XML cannot hold: control characters, single surrogates."""
    return "".join(
        char
        if char in "\t\n\r" or " " <= char < "\ud800" or "\udfff" < char < "\ufffe" or char > "\uffff"
        else char.encode("unicode_escape").decode()
        for char in text
    )


def _add_co_simulation(
    root: ET.Element, model: BlockModel, backend: Backend, source_files: Sequence[str]
) -> None:
    """Declare the abilities of the FMU; the default of each is false."""
    only_python = ("needsExecutionTool", "canNotUseMemoryManagementFunctions")
    element = ET.SubElement(
        root,
        "CoSimulation",
        dict.fromkeys(only_python, "true") if backend == "python" else {},
        modelIdentifier=model.name,
        canHandleVariableCommunicationStepSize="true",
        canGetAndSetFMUstate="true",
        canSerializeFMUstate="true",
    )
    if source_files:
        files = ET.SubElement(element, "SourceFiles")
        for name in source_files:
            ET.SubElement(files, "File", name=name)


def _add_unit_definitions(root: ET.Element, model: BlockModel) -> None:
    """Define the units of the variables, each with its display units."""
    used = sorted({variable.unit for variable in model.variables if variable.unit})
    if not used:
        return
    definitions = ET.SubElement(root, "UnitDefinitions")
    for unit in used:
        element = ET.SubElement(definitions, "Unit", name=unit)
        base = parse_unit(unit)
        exponents = zip(BASE_NAMES, base.exponents, strict=True)
        attributes = {name: str(exponent) for name, exponent in exponents if exponent}
        ET.SubElement(element, "BaseUnit", attributes | _scale(base.factor, base.offset))
        displays = {variable.display_unit for variable in model.variables if variable.unit == unit}
        for display in sorted(displays - {""}):
            scale = _scale(*display_conversion(unit, display))
            ET.SubElement(element, "DisplayUnit", {"name": display, **scale})


def _scale(factor: float, offset: float) -> dict[str, str]:
    """Return the attributes factor and offset, each unless it is the default."""
    return ({"factor": repr(factor)} if factor != 1.0 else {}) | ({"offset": repr(offset)} if offset else {})


def _add_scalar_variable(parent: ET.Element, reference: int, name: str, variable: Variable) -> None:
    """Add a scalar: an input must not have `initial`, a computed output has no start."""
    attributes = {"name": name, "valueReference": str(reference)}
    if variable.description:
        attributes["description"] = markup_text(variable.description)
    attributes |= {"causality": variable.causality, "variability": variable.variability}
    if not isinstance(variable, Input):
        attributes["initial"] = "calculated" if isinstance(variable, Output) else "exact"
    element = ET.SubElement(parent, "ScalarVariable", attributes)

    of_type = {}
    if variable.unit:
        of_type["unit"] = variable.unit
    if variable.display_unit:
        of_type["displayUnit"] = variable.display_unit
    for key, bound, inside in (("min", variable.minimum, math.ceil), ("max", variable.maximum, math.floor)):
        if variable.type == "Real" and math.isfinite(bound):
            of_type[key] = repr(float(bound))
        elif variable.type == "Integer" and abs(bound) <= MAX_INTEGER:
            of_type[key] = str(inside(bound))
    if not isinstance(variable, Output):
        start = variable.scalar_start(name)
        if variable.type == "Boolean":
            of_type["start"] = "true" if start else "false"
        else:
            of_type["start"] = repr(float(start)) if variable.type == "Real" else str(int(start))
    ET.SubElement(element, variable.type, of_type)


def _add_model_structure(root: ET.Element, model: BlockModel) -> None:
    """Declare the dependencies of the outputs.

    At communication points the known variables are the inputs. A state is not one, as its derivative is not
    exposed: an output that is a state depends on nothing, and so does an output computed from states only. In
    the initialization all variables with an exact start value are known too (FMI 2.0.4, section 2.2.8).
    """
    index = {name: number for number, (name, _) in enumerate(model.scalars, start=1)}
    inputs = {name for variable in model.inputs for name in variable.names}
    depends = Dependencies(model).outputs
    structure = ET.SubElement(root, "ModelStructure")
    outputs = [name for name, variable in model.scalars if variable.causality == "output"]
    for title, names, known in (("Outputs", outputs, inputs), ("InitialUnknowns", list(depends), set(index))):
        lines = ET.SubElement(structure, title) if names else structure
        for name in sorted(names, key=index.__getitem__):
            numbers = sorted(index[dependency] for dependency in depends.get(name, frozenset()) & known)
            dependencies = " ".join(map(str, numbers))
            ET.SubElement(lines, "Unknown", index=str(index[name]), dependencies=dependencies)


def documentation(model: BlockModel) -> str:
    """Return a self-contained HTML page: variables, equations, source, and what happens in a step."""
    page = _template().render(
        model=model,
        version=version("urmpipe"),
        titles=TITLES,
        numbers=NUMBERS,
        rows=[list(zip(TITLES, variable_row(variable), strict=True)) for variable in model.variables],
        steps=_step_texts(model),
    )
    return markup_text(page)


@cache
def _template() -> Any:
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


def variable_row(variable: Variable, digits: int | None = None) -> tuple[str, ...]:
    """Return the cells of a variable in a table, in the order of `TITLES`.

    Args:
        variable: The variable.
        digits: Number of significant digits; None for all.
    """
    cell = partial(_format_value, variable, digits=digits)
    name = variable.name
    if variable.size is not None:
        name += "[1]" + (f" .. [{variable.size}]" if variable.size > 1 else "")
    part = f"{variable.causality}, {variable.variability}"
    kind = variable.type if variable.type != "Real" else variable.unit
    starts = variable.starts[:1] if len(set(variable.starts)) == 1 else variable.starts
    start = "computed" if isinstance(variable, Output) else ", ".join(map(cell, starts))
    return name, part, kind, start, cell(variable.minimum), cell(variable.maximum), variable.description


def _format_value(variable: Variable, value: float, digits: int | None) -> str:
    """Return a value, and in parentheses the same in the display unit; empty for an infinite bound."""
    if not math.isfinite(value):
        return ""
    if variable.type == "Boolean":
        return "true" if value else "false"
    short = f"{value:.{digits or 6}g}"
    text = short if digits or float(short) == value else repr(float(value))
    if not variable.display_unit or variable.display_unit == variable.unit:
        return text
    factor, offset = display_conversion(variable.unit, variable.display_unit)
    return f"{text} ({factor * value + offset:.{digits or 7}g} {variable.display_unit})"


def _step_texts(model: BlockModel) -> list[str]:
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
        names = ", ".join(variable.name for variable in model.memories)
        lines.append(
            f"fmi2DoStep first takes the sample: the next values of {names}, from the inputs as set."
        )
    if model.states:
        names = ", ".join(variable.name for variable in model.states)
        lines.append(
            f"{'Then it' if model.memories else 'fmi2DoStep'} integrates {names} with the classical"
            f" Runge-Kutta method in equal steps of at most the parameter {INTERNAL_STEP}, the inputs held."
            " A step after which a state is not finite is an error, and undone."
        )
    if not model.memories and not model.states:
        lines.append("It remembers nothing: fmi2DoStep only moves the time on.")
    return lines
