"""urmpipe: does the motion this environment produced agree with the commanded motion?

    import urmpipe
    run = urmpipe.ingest("log.csv", robot="urm6")
    comparison = urmpipe.compare("path.csv", "log.csv", robot="urm6")
    urmpipe.diagnose("path.csv", "log.csv", robot="urm6").summary
    urmpipe.iso("path.csv", "test.csv", robot="urm6", tolerance="AP=0.4mm")
    urmpipe.report(comparison, "report.html")
    urmpipe.export(run, "log.parquet")
    simulation = urmpipe.simulate("log-to-delta", arguments={"log": "log.csv", "reference": "path.csv"})
    urmpipe.ik("targets.csv", robot="arm6").to_frame()
    urmpipe.plan("contour.csv", robot="ur5e", output="plan.csv")
    urmpipe.accuracy("contour.csv", "irb60", limit=0.4e-3).running_speed
    urmpipe.network_check("bennett").mobility
    urmpipe.network_drive("four-bar", {"crank": (0, "360deg")}, point="coupler:0.45,0.2,0").to_frame()
    urmpipe.build_fmu("kinematic_chain", robot="urm6")

The functions are loaded when they are first used.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from urmpipe.api.accuracy import accuracy as accuracy
    from urmpipe.api.build_fmu import build_fmu as build_fmu
    from urmpipe.api.compare import compare as compare
    from urmpipe.api.diagnose import diagnose as diagnose
    from urmpipe.api.equations import Equations as Equations
    from urmpipe.api.equations import equations as equations
    from urmpipe.api.export import export as export
    from urmpipe.api.ik import ik as ik
    from urmpipe.api.ingest import ingest as ingest
    from urmpipe.api.iso import iso as iso
    from urmpipe.api.load_robot import load_robot as load_robot
    from urmpipe.api.network import load_network as load_network
    from urmpipe.api.network import network_check as network_check
    from urmpipe.api.network import network_drive as network_drive
    from urmpipe.api.network import network_solve as network_solve
    from urmpipe.api.plan import plan as plan
    from urmpipe.api.read_map import read_map as read_map
    from urmpipe.api.recordings import read_recording as read_recording
    from urmpipe.api.recordings import write_recording as write_recording
    from urmpipe.api.report import Report as Report
    from urmpipe.api.report import report as report
    from urmpipe.api.simulate import simulate as simulate
    from urmpipe.api.view import view as view
    from urmpipe.api.write_map import write_map as write_map
    from urmpipe.parameters.shared import LogReading as LogReading
    from urmpipe.parameters.shared import Reading as Reading
    from urmpipe.parameters.shared import TableReading as TableReading
    from urmpipe.public_functions import UrmpipeWarning as UrmpipeWarning
    from urmpipe_fmus.build.fmu import BuiltFmu as BuiltFmu
    from urmpipe_models.arm.chain import Chain as Chain
    from urmpipe_models.errors import CosimulationError as CosimulationError
    from urmpipe_models.errors import FmuError as FmuError
    from urmpipe_models.errors import LogError as LogError
    from urmpipe_models.errors import NetworkError as NetworkError
    from urmpipe_models.errors import OptionError as OptionError
    from urmpipe_models.errors import OutputError as OutputError
    from urmpipe_models.errors import PathError as PathError
    from urmpipe_models.errors import RecordingError as RecordingError
    from urmpipe_models.errors import RobotError as RobotError
    from urmpipe_models.errors import UnitError as UnitError
    from urmpipe_models.errors import UrmpipeError as UrmpipeError
    from urmpipe_models.errors import ViewerError as ViewerError
    from urmpipe_models.ik.solutions import Targets as Targets
    from urmpipe_models.math3d import Transform as Transform
    from urmpipe_models.networks.file import Network as Network
    from urmpipe_models.networks.file import network_names as network_names
    from urmpipe_models.planning.path import PathRows as PathRows
    from urmpipe_models.robots.catalogue import robot_names as robot_names
    from urmpipe_pipeline.accuracy.result import AccuracyResult as AccuracyResult
    from urmpipe_pipeline.comparison.comparison import Comparison as Comparison
    from urmpipe_pipeline.comparison.deviation import Deviation as Deviation
    from urmpipe_pipeline.diagnosis.result import Diagnosis as Diagnosis
    from urmpipe_pipeline.joint_log import JointLog as JointLog
    from urmpipe_pipeline.logs import LogMap as LogMap
    from urmpipe_pipeline.networks.network_motion import NetworkMotion as NetworkMotion
    from urmpipe_pipeline.networks.result import NetworkResult as NetworkResult
    from urmpipe_pipeline.planned_paths.result import PlannedPath as PlannedPath
    from urmpipe_pipeline.runs.run import Run as Run
    from urmpipe_pipeline.simulations.simulation import Simulation as Simulation
    from urmpipe_pipeline.solved_targets.result import IkResult as IkResult
    from urmpipe_pipeline.tables import Exported as Exported

__version__ = "0.1.0"
is_command_process = False  # set by `urmpipe.main.main`: no other code uses this Python afterwards

_HOME = {
    "AccuracyResult": "urmpipe_pipeline.accuracy.result",
    "BuiltFmu": "urmpipe_fmus.build.fmu",
    "Chain": "urmpipe_models.arm.chain",
    "Comparison": "urmpipe_pipeline.comparison.comparison",
    "CosimulationError": "urmpipe_models.errors",
    "Deviation": "urmpipe_pipeline.comparison.deviation",
    "Diagnosis": "urmpipe_pipeline.diagnosis.result",
    "Equations": "urmpipe.api.equations",
    "Exported": "urmpipe_pipeline.tables",
    "FmuError": "urmpipe_models.errors",
    "IkResult": "urmpipe_pipeline.solved_targets.result",
    "JointLog": "urmpipe_pipeline.joint_log",
    "LogError": "urmpipe_models.errors",
    "LogReading": "urmpipe.parameters.shared",
    "LogMap": "urmpipe_pipeline.logs",
    "Network": "urmpipe_models.networks.file",
    "NetworkError": "urmpipe_models.errors",
    "NetworkMotion": "urmpipe_pipeline.networks.network_motion",
    "NetworkResult": "urmpipe_pipeline.networks.result",
    "OptionError": "urmpipe_models.errors",
    "OutputError": "urmpipe_models.errors",
    "Reading": "urmpipe.parameters.shared",
    "PathError": "urmpipe_models.errors",
    "PathRows": "urmpipe_models.planning.path",
    "PlannedPath": "urmpipe_pipeline.planned_paths.result",
    "RecordingError": "urmpipe_models.errors",
    "Report": "urmpipe.api.report",
    "RobotError": "urmpipe_models.errors",
    "Run": "urmpipe_pipeline.runs.run",
    "Simulation": "urmpipe_pipeline.simulations.simulation",
    "TableReading": "urmpipe.parameters.shared",
    "Targets": "urmpipe_models.ik.solutions",
    "Transform": "urmpipe_models.math3d",
    "UnitError": "urmpipe_models.errors",
    "UrmpipeError": "urmpipe_models.errors",
    "UrmpipeWarning": "urmpipe.public_functions",
    "ViewerError": "urmpipe_models.errors",
    "accuracy": "urmpipe.api.accuracy",
    "build_fmu": "urmpipe.api.build_fmu",
    "compare": "urmpipe.api.compare",
    "diagnose": "urmpipe.api.diagnose",
    "equations": "urmpipe.api.equations",
    "export": "urmpipe.api.export",
    "ik": "urmpipe.api.ik",
    "ingest": "urmpipe.api.ingest",
    "iso": "urmpipe.api.iso",
    "load_network": "urmpipe.api.network",
    "load_robot": "urmpipe.api.load_robot",
    "network_check": "urmpipe.api.network",
    "network_drive": "urmpipe.api.network",
    "network_names": "urmpipe_models.networks.file",
    "network_solve": "urmpipe.api.network",
    "plan": "urmpipe.api.plan",
    "read_map": "urmpipe.api.read_map",
    "read_recording": "urmpipe.api.recordings",
    "report": "urmpipe.api.report",
    "robot_names": "urmpipe_models.robots.catalogue",
    "simulate": "urmpipe.api.simulate",
    "view": "urmpipe.api.view",
    "write_map": "urmpipe.api.write_map",
    "write_recording": "urmpipe.api.recordings",
}

__all__ = ["__version__", *sorted(_HOME)]  # noqa: PLE0604 - the names are those of _HOME


def __getattr__(name: str) -> Any:
    """Load a public name when it is first used."""
    from importlib import import_module

    if name not in _HOME:
        raise AttributeError(f"module 'urmpipe' has no attribute {name!r}")
    return getattr(import_module(_HOME[name]), name)


def __dir__() -> list[str]:
    return sorted(__all__)
