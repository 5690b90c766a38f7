"""urmpipe: does the motion this environment produced agree with the motion that was asked for?

    import urmpipe
    run = urmpipe.ingest("log.csv", robot="urm6")
    comparison = urmpipe.compare("path.csv", ["log.csv"], robot="urm6")
    urmpipe.report([comparison], "report.html")
    urmpipe.export(run, "log.parquet")
    simulation = urmpipe.simulate("log-to-delta", arguments={"log": "log.csv"})
    urmpipe.ik("targets.csv", robot="arm6").to_frame()
    urmpipe.build_fmu("kinematic_chain", robot="urm6")

The functions are loaded when they are first used.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from urmpipe.api.build_fmu import build_fmu as build_fmu
    from urmpipe.api.compare import compare as compare
    from urmpipe.api.export import export as export
    from urmpipe.api.ik import ik as ik
    from urmpipe.api.ingest import ingest as ingest
    from urmpipe.api.report import Report as Report
    from urmpipe.api.report import report as report
    from urmpipe.api.simulate import simulate as simulate
    from urmpipe.api.view import view as view
    from urmpipe.api.write_map import write_map as write_map
    from urmpipe.inverse.result import InverseResult as InverseResult
    from urmpipe_fmus.build import BuiltFmu as BuiltFmu
    from urmpipe_models.chains.chain import Chain as Chain
    from urmpipe_models.errors import UrmpipeError as UrmpipeError
    from urmpipe_models.inverse.targets import Targets as Targets
    from urmpipe_models.robots.catalogue import load_robot as load_robot
    from urmpipe_models.robots.catalogue import robot_names as robot_names
    from urmpipe_pipeline.comparison.comparison import Comparison as Comparison
    from urmpipe_pipeline.export import Exported as Exported
    from urmpipe_pipeline.recording import read_recording as read_recording
    from urmpipe_pipeline.recording import write_recording as write_recording
    from urmpipe_pipeline.runs.results import Run as Run
    from urmpipe_pipeline.simulations.simulation import Simulation as Simulation
    from urmpipe_pipeline.sources import ReadOptions as ReadOptions
    from urmpipe_pipeline.sources import read_map as read_map

__version__ = "0.1.0"

_HOME = {
    "BuiltFmu": "urmpipe_fmus.build",
    "Chain": "urmpipe_models.chains.chain",
    "Comparison": "urmpipe_pipeline.comparison.comparison",
    "ReadOptions": "urmpipe_pipeline.sources",
    "InverseResult": "urmpipe.inverse.result",
    "Targets": "urmpipe_models.inverse.targets",
    "Exported": "urmpipe_pipeline.export",
    "Report": "urmpipe.api.report",
    "Run": "urmpipe_pipeline.runs.results",
    "UrmpipeError": "urmpipe_models.errors",
    "Simulation": "urmpipe_pipeline.simulations.simulation",
    "build_fmu": "urmpipe.api.build_fmu",
    "compare": "urmpipe.api.compare",
    "export": "urmpipe.api.export",
    "ik": "urmpipe.api.ik",
    "ingest": "urmpipe.api.ingest",
    "load_robot": "urmpipe_models.robots.catalogue",
    "read_map": "urmpipe_pipeline.sources",
    "read_recording": "urmpipe_pipeline.recording",
    "report": "urmpipe.api.report",
    "robot_names": "urmpipe_models.robots.catalogue",
    "simulate": "urmpipe.api.simulate",
    "view": "urmpipe.api.view",
    "write_map": "urmpipe.api.write_map",
    "write_recording": "urmpipe_pipeline.recording",
}

__all__ = ["__version__", *sorted(_HOME)]  # noqa: PLE0604 - the names are those of _HOME


def __getattr__(name: str) -> Any:
    """Load a public name when it is first asked for."""
    from importlib import import_module

    if name not in _HOME:
        raise AttributeError(f"module 'urmpipe' has no attribute {name!r}")
    return getattr(import_module(_HOME[name]), name)


def __dir__() -> list[str]:
    return sorted(__all__)
