"""`urmpipe.load_network`, `network_check`, `network_solve` and `network_drive`: kinematic networks."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, TypeAlias, Unpack

import numpy as np

from urmpipe.output_files import guarded_outputs, output_kind, write_drawing
from urmpipe.parameters import kinds
from urmpipe.parameters.param import params_of
from urmpipe.parameters.shared import Reading
from urmpipe.parameters.systems import DRIVES, NetworkCheck, NetworkDrive, NetworkSolve
from urmpipe.public_functions import PathLike, public_function, raise_warnings
from urmpipe.reading import map_files, resolve_reading
from urmpipe_models.errors import Finding, LogError, OptionError, map_collecting_errors
from urmpipe_models.networks import file as network_file
from urmpipe_models.networks.file import Network
from urmpipe_pipeline.logs import TableLike, dataframe_to_table
from urmpipe_pipeline.logs.formats.text import fingerprint
from urmpipe_pipeline.networks.drawing import network_svg
from urmpipe_pipeline.networks.drive_request import DriveRequest, drive_network
from urmpipe_pipeline.networks.finding import Search, find_network
from urmpipe_pipeline.networks.given_values import Range, is_word
from urmpipe_pipeline.networks.network_motion import NetworkMotion, motion_drawing
from urmpipe_pipeline.networks.result import Command, NetworkResult
from urmpipe_pipeline.operands import load_runs
from urmpipe_pipeline.outputs import MOTION_ROW, OutputKind
from urmpipe_pipeline.runs.run import Run
from urmpipe_pipeline.tables.csv_files import write_joint_log

NetworkLike: TypeAlias = PathLike | Mapping[str, Any] | Network
"""A name, a file, the tables of one, or a network."""

SEARCHING_SHARE = 0.9  # of the work


@public_function(network=kinds.NETWORK_TABLES)
def load_network(network: PathLike | Mapping[str, Any]) -> Network:
    """Return a network that urmpipe brings along, of a .toml file, or of such tables. See docs/networks.md.

    Args:
        network: The network's name, its file, or the tables of one, such as {"joints": {"A": {"kind":
            "revolute", "bodies": ["ground", "crank"]}}, "bodies": {"crank": {}}}.

    Raises:
        NetworkError: If there is no such network, or with everything that is wrong with its tables.
    """
    return network_file.load_network(network)


@public_function(NetworkCheck, network=kinds.NETWORK)
def network_check(network: NetworkLike, **options: Unpack[NetworkCheck]) -> NetworkResult:
    """Assemble a network and find how it moves: its graph, its mobility, and which constraints are redundant.

    Args:
        network: A name, a file, the tables of one, or a `Network`.
        **options: Values of controls and joints, the search, what is written: the options of `urmpipe network
            check`, by their names.

    Returns:
        `mobility` (None if it does not close: then `gaps`), `assemblies`, `loops`, `clusters`, `warnings`.

    Raises:
        UrmpipeError: With everything that is wrong with the network, an option or an output.

    Source: [KinematicSystems]_ section 3.
    """
    return _find(network, "check", options)


@public_function(NetworkSolve, network=kinds.NETWORK)
def network_solve(network: NetworkLike, **options: Unpack[NetworkSolve]) -> NetworkResult:
    """Assemble a network with its controls held: on the branch of its start, nearest to values, or every way.

    Controls away from their start are moved there from the assembly at the start. If no motion leads there,
    the assembly nearest to the start is returned, and a warning says that it is of another branch.

    Args:
        network: A name, a file, the tables of one, or a `Network`.
        **options: Values of controls and joints, the search, what is written: the options of `urmpipe network
            solve`, by their names.

    Returns:
        `assemblies`, each with its `values` by name in [m] and [rad], `residual` and `mobility`;
        `distances` of all that the search came to from the start; `reason`; `gaps` where nothing closes.

    Raises:
        UrmpipeError: With everything that is wrong with the network, an option or an output.

    Source: [KinematicSystems]_ section 3.
    """
    return _find(network, "solve", options)


def _find(network: NetworkLike, command: Command, values: Mapping[str, Any]) -> NetworkResult:
    """Return the assemblies of a network, and write what is named."""
    loaded = network if isinstance(network, Network) else network_file.load_network(network)
    search = Search(
        values["controls"] or {}, values["start"] or {}, values.get("every", False), values["restarts"],
        values["seed"],
    )  # fmt: skip
    files = [path for path in _paths(network) if path.suffix.lower() == ".toml"]
    progress = values["progress"] or (lambda share: None)
    with guarded_outputs({"recording": values["output"], "drawing": values["draw"]}, files) as written:
        inputs = [fingerprint(path) for path in files]
        result = find_network(
            loaded, command, search, inputs, lambda share: progress(SEARCHING_SHARE * share)
        )
        raise_warnings(values["strict"], result.warnings)
        written.write("drawing", lambda part, path: write_drawing(part, network_svg(result)))
        return written.recorded(
            result, lambda share: progress(SEARCHING_SHARE + (1.0 - SEARCHING_SHARE) * share)
        )


def _paths(*operands: object) -> list[Path]:
    """Return the operands that are names of files, as paths."""
    return [Path(operand) for operand in operands if isinstance(operand, (str, Path))]


@public_function(NetworkDrive, network=kinds.NETWORK, drives=DRIVES)
def network_drive(
    network: NetworkLike,
    drives: Mapping[str, Range] | None = None,
    **options: Unpack[NetworkDrive],
) -> NetworkMotion:
    """Move a network by its controls, or by joints in their place, on one branch. See docs/networks.md.

    The motion follows the branch of an assembly by continuation. It names singular poses, and ends where it
    turns back, or a joint reaches its limit.

    Args:
        network: A name, a file, the tables of one, or a `Network`.
        drives: From and to by name, such as {"crank": (0, "360deg")}; one value holds a variable. Of controls
            numbers are in the units of the network, of joints in [rad] and [m]; texts have units. With a log:
            the joint of the log that drives each, such as {"crank": "q1"}; default: those of the same names.
        **options: Duration and law, loads, the log and how it is read, what is written: the options of
            `urmpipe network drive`, by their names. `point` and the points of `wrenches` are in [m] in the
            frame of their body, forces in [N], moments in [N.m] along the axes of the ground.

    Returns:
        `joints`, `joint_motion` (values, rates, second derivatives in [rad] or [m] and per [s], shape (n,
        joints)), `point_motion` (likewise of the traced point, shape (n, 3) each), `events` (singular poses
        and limits), `transmission`, `distance` to a singular pose [-], shape (n,), `forces`, `verdict`
        ("pass" if the drives reach their end), `to_frame()`.

    Raises:
        UrmpipeError: With everything that is wrong with the network, a drive, the log or an output.

    Source: [KinematicSystems]_ section 3.
    """
    values: Mapping[str, Any] = options  # as their kinds read them
    output, log, tsp = values["output"], values["log"], values["tsp"]
    drives = drives or {}
    parts: tuple[Callable[[], Any], ...] = (
        lambda: network if isinstance(network, Network) else network_file.load_network(network),
        lambda: DriveRequest(
            drives, values["steps"], values["duration"], values["law"], 0.005 if tsp is None else tsp,
            values["branch"], values["start"] or {}, values["point"], values["wrenches"],
            values["torques"] or {}, values["restarts"], values["seed"],
        ),
        lambda: _check_log_parameters(values),
        lambda: output_kind(output, "motion"),
    )  # fmt: skip
    loaded, request, _, kind = map_collecting_errors(lambda part: part(), parts)
    run = None if log is None else _read_log(log, loaded, drives, values)
    files = [path for path in _paths(network, log) if path.is_file()] + map_files(values)
    outputs: dict[OutputKind, PathLike | None] = {"drawing": values["draw"]}
    if kind is not None:
        outputs[kind] = output
    progress = values["progress"] or (lambda share: None)
    with guarded_outputs(outputs, files) as written:
        inputs = [fingerprint(path) for path in files if path.is_file()]
        motion = drive_network(loaded, request, run, inputs, lambda share: progress(SEARCHING_SHARE * share))
        raise_warnings(values["strict"], motion.warnings)
        written.write("drawing", lambda part, path: write_drawing(part, motion_drawing(motion)))
        written.write("motion", lambda part, path: _write_motion(motion, part, path))
        motion = written.recorded(
            motion, lambda share: progress(SEARCHING_SHARE + (1.0 - SEARCHING_SHARE) * share)
        )
    return replace(motion, log=output) if kind == "motion" else motion


def _read_log(
    log: PathLike | TableLike | Run, network: Network, drives: Mapping[str, Range], values: Mapping[str, Any]
) -> Run:
    """Return the run of a log: its joints are the columns that drives name, or those named like controls."""
    if isinstance(log, Run):
        return log
    controls = [control.name for control in network.controls if control.value is None]
    names = [str(column) for column in drives.values() if is_word(column)] or controls
    operand = Path(log) if isinstance(log, (str, Path)) else dataframe_to_table(log, "log")
    load = partial(load_runs, [operand], tsp=values["tsp"], derivative=values["derivative"])
    if names and values["joints"] is None:
        with suppress(LogError):  # the log has other joints: reading it without names reports its faults
            return load(read=resolve_reading({**values, "joints": names}).options)[0]
    return load(read=resolve_reading(values).options)[0]


def _check_log_parameters(values: Mapping[str, Any]) -> None:
    """Raise an `OptionError` for parameters that do not apply with a log, or that need one."""
    law = None if values["law"] == "uniform" else values["law"]
    without = {"steps": values["steps"], "duration": values["duration"], "law": law}
    of_logs = {name: values[name] for name in ("derivative", *params_of(Reading))}
    has_log = values["log"] is not None
    faults = [
        Finding("found together with a log, allowed: one of the two; the log sets the times", parameter=name)
        for name, value in without.items()
        if has_log and value is not None
    ]
    faults += [
        Finding("found without a log, allowed: together with a log", parameter=name)
        for name, value in of_logs.items()
        if not has_log and value is not None and value is not False and value not in ({}, (), [])
    ]
    if faults:
        raise OptionError(*faults)


def _write_motion(motion: NetworkMotion, part: Path, path: Path) -> None:
    """Write a motion as a log: times, joints, and the traced point as the recorded tool centre point."""
    position = None if motion.point_motion is None else motion.point_motion[0]
    write_joint_log(
        part, path, joints=motion.joints, units=motion.joint_units, q=motion.joint_motion[0],
        row=np.arange(1, len(motion) + 1), t_ns=motion.t_ns, position=position, quat_xyzw=motion.quat_xyzw,
        row_column=MOTION_ROW,
    )  # fmt: skip
