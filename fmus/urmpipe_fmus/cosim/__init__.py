"""Co-simulation: systems of FMUs, described in TOML, checked before the first step, run and drawn.

    system = load_system("log-to-delta", {"log": "run.csv"})
    plan = prepare(system, make)         # make(block) returns the block's model or its FMU
    record = simulate(plan)

Names are loaded when they are first used: the process that runs the FMUs needs few of them.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from urmpipe_fmus.cosim.drawing import system_svg as system_svg
    from urmpipe_fmus.cosim.plan import LogColumn as LogColumn
    from urmpipe_fmus.cosim.plan import Plan as Plan
    from urmpipe_fmus.cosim.plan import prepare as prepare
    from urmpipe_fmus.cosim.simulation import CosimulationRecord as CosimulationRecord
    from urmpipe_fmus.cosim.simulation import simulate as simulate
    from urmpipe_fmus.cosim.simulation import start_worker as start_worker
    from urmpipe_fmus.cosim.system import Block as Block
    from urmpipe_fmus.cosim.system import Connection as Connection
    from urmpipe_fmus.cosim.system import LogInput as LogInput
    from urmpipe_fmus.cosim.system import Port as Port
    from urmpipe_fmus.cosim.system import System as System
    from urmpipe_fmus.cosim.system import load_system as load_system
    from urmpipe_fmus.cosim.system import read_system as read_system
    from urmpipe_fmus.cosim.system import system_name as system_name
    from urmpipe_fmus.cosim.system import system_names as system_names
    from urmpipe_fmus.cosim.system import system_text as system_text

_SYSTEM = "Block Connection LogInput Port System load_system read_system system_name system_names system_text"
_MODULES = {
    **dict.fromkeys(_SYSTEM.split(), "system"),
    **dict.fromkeys(("LogColumn", "Plan", "prepare"), "plan"),
    **dict.fromkeys(("CosimulationRecord", "simulate", "start_worker"), "simulation"),
    "system_svg": "drawing",
}

__all__ = sorted(_MODULES)  # noqa: PLE0605 - the names are those of _MODULES


def __getattr__(name: str) -> Any:
    """Load a public name when it is first used."""
    from importlib import import_module

    if name not in _MODULES:
        raise AttributeError(f"module 'urmpipe_fmus.cosim' has no attribute {name!r}")
    return getattr(import_module(f"urmpipe_fmus.cosim.{_MODULES[name]}"), name)
