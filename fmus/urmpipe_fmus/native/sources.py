"""The C sources of a unit's FMU: the generated model, the runtime, and FMI's headers."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

from urmpipe_fmus.native.model_code import c_string, model_code, model_sizes
from urmpipe_fmus.unit import Unit

FMI_HEADERS = ("fmi2Functions.h", "fmi2FunctionTypes.h", "fmi2TypesPlatform.h")
"""The standard's own, with their licence in them; FMPy ships them."""

GUID_HEADER = "sources/guid.h"
"""Where the header of `guid_header` belongs."""


def native_sources(unit: Unit) -> dict[str, bytes]:
    """Return all C files of a unit's FMU, by their path in it, but for `GUID_HEADER`.

    The same unit gives the same bytes.

    Raises:
        UnitError: If a function of the unit cannot be traced.
    """
    import fmpy

    runtime = files("urmpipe_fmus.native") / "runtime"
    headers = Path(fmpy.__file__).parent / "c-code"
    found = {one.name: one.read_bytes() for one in runtime.iterdir() if one.name.endswith((".c", ".h"))}
    found |= {name: (headers / name).read_bytes() for name in FMI_HEADERS}
    found |= {"model.c": model_code(unit).encode(), "model_sizes.h": model_sizes(unit).encode()}
    return {f"sources/{name}": found[name] for name in sorted(found)}


def guid_header(guid: str) -> bytes:
    """Return `GUID_HEADER`: the GUID that the FMU is instantiated with."""
    return f"#ifndef GUID_H\n#define GUID_H\n\n#define MODEL_GUID {c_string(guid)}\n\n#endif\n".encode()
