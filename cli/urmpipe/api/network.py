"""`urmpipe.load_network`, `network_check`, `network_solve` and `network_drive`: kinematic networks."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, TypeAlias, Unpack

import numpy as np

from urmpipe.keyword_checks import PathLike, public, public_reading, refuse_warnings
from urmpipe.output_files import guarded_outputs, output_kind, write_drawing
from urmpipe.reading import Reading, map_files, resolved
from urmpipe_models.errors import Finding, LogError, OptionError, map_collecting_errors
from urmpipe_models.networks import file as network_file
from urmpipe_models.networks.assembly import DEFAULT_RESTARTS
from urmpipe_models.networks.driving import Law
from urmpipe_models.networks.file import Network
from urmpipe_models.networks.forces import Wrench
from urmpipe_pipeline.networks.drawing import network_svg
from urmpipe_pipeline.networks.drive_request import DriveRequest, drive_network
from urmpipe_pipeline.networks.finding import Search, find_network
from urmpipe_pipeline.networks.given_values import Range, is_word
from urmpipe_pipeline.networks.network_motion import NetworkMotion, motion_drawing
from urmpipe_pipeline.networks.result import Command, NetworkResult
from urmpipe_pipeline.operands import load_runs
from urmpipe_pipeline.outputs import MOTION_ROW, OutputKind
from urmpipe_pipeline.runs.derivatives import Method
from urmpipe_pipeline.runs.run import Run
from urmpipe_pipeline.sources import TableLike, held_of
from urmpipe_pipeline.sources.tables.text import fingerprint
from urmpipe_pipeline.tables.csv_files import write_joint_log

NetworkLike: TypeAlias = PathLike | Mapping[str, Any] | Network
"""A name, a file, the tables of one, or a network."""

SEARCHING = 0.9
"""Share of the work that assembly is where something is written, too."""


@public
def load_network(network: PathLike | Mapping[str, Any]) -> Network:
    """Return a network that urmpipe brings along, of a .toml file, or of such tables. See docs/networks.md.

    Args:
        network: The network's name, its file, or the tables of one, such as {"joints": {"A": {"kind":
            "revolute", "bodies": ["ground", "crank"]}}, "bodies": {"crank": {}}}.

    Raises:
        NetworkError: If there is no such network, or with everything that is wrong with its tables.
    """
    return network_file.load_network(network)


@public
def network_check(
    network: NetworkLike,
    *,
    controls: Mapping[str, float | str] | None = None,
    start: Mapping[str, Any] | None = None,
    restarts: int = DEFAULT_RESTARTS,
    seed: int = 0,
    strict: bool = False,
    draw: PathLike | None = None,
    output: PathLike | None = None,
    progress: Callable[[float], None] | None = None,
) -> NetworkResult:
    """Assemble a network and find how it moves: its graph, its mobility, and which constraints are redundant.

    Args:
        network: A name, a file, the tables of one, or a `Network`.
        controls: Values of controls instead of their starts, by name: numbers in the units of the network,
            or texts with units, such as "40deg".
        start: Values of joints in [rad] and [m] by name, or texts with units: the assembly nearest to them is
            returned; default: the one that a motion from the network's start leads to.
        restarts: Random starts that are tried in vain where the network's own start does not close.
        seed: Of the random starts.
        strict: Whether a warning is an error.
        draw: An SVG file to draw the graph and the mechanism to.
        output: The recording (.rrd) to write.
        progress: Called with the share that is done, 0..1.

    Returns:
        `mobility` (None if it does not close: then `gaps`), `assemblies`, `loops`, `clusters`, `warnings`.

    Raises:
        UrmpipeError: With everything that is wrong with the network, an option or an output.

    Source: [KinematicSystems]_ section 3.
    """
    search = Search(controls or {}, start or {}, False, restarts, seed)
    return _found(network, "check", search, strict, draw, output, progress)


@public
def network_solve(
    network: NetworkLike,
    *,
    controls: Mapping[str, float | str] | None = None,
    start: Mapping[str, Any] | None = None,
    every: bool = False,
    restarts: int = DEFAULT_RESTARTS,
    seed: int = 0,
    strict: bool = False,
    draw: PathLike | None = None,
    output: PathLike | None = None,
    progress: Callable[[float], None] | None = None,
) -> NetworkResult:
    """Assemble a network with its controls held: on the branch of its start, nearest to values, or every way.

    Controls away from their start are moved there from the assembly at the start. If no motion leads there,
    the assembly nearest to the start is returned, and a warning says that it is of another branch.

    Args:
        network: A name, a file, the tables of one, or a `Network`.
        controls: Values of controls instead of their starts, by name: numbers in the units of the network,
            or texts with units, such as "40deg".
        start: Values of joints in [rad] and [m] by name, or texts with units: the assembly nearest to them is
            returned; default: the one that a motion from the network's start leads to.
        every: Find all assemblies, by random starts.
        restarts: Random starts in a row without anything new that end the search.
        seed: Of the random starts: the same seed, the same assemblies.
        strict: Whether a warning is an error.
        draw: An SVG file to draw the graph and the assemblies to.
        output: The recording (.rrd) to write; further assemblies are ghosts in it.
        progress: Called with the share that is done, 0..1.

    Returns:
        `assemblies`, each with its `values` by name in [m] and [rad], `residual` and `mobility`;
        `distances` of all that the search came to from the start; `reason`; `gaps` where nothing closes.

    Raises:
        UrmpipeError: With everything that is wrong with the network, an option or an output.

    Source: [KinematicSystems]_ section 3.
    """
    search = Search(controls or {}, start or {}, every, restarts, seed)
    return _found(network, "solve", search, strict, draw, output, progress)


def _found(
    network: NetworkLike,
    command: Command,
    search: Search,
    strict: bool,
    draw: PathLike | None,
    output: PathLike | None,
    progress: Callable[[float], None] | None,
) -> NetworkResult:
    """Return what is found of a network, and write what was requested."""
    loaded = network if isinstance(network, Network) else network_file.load_network(network)
    named = [Path(network)] if isinstance(network, (str, Path)) else []
    files = [path for path in named if path.suffix.lower() == ".toml"]
    tell = progress or (lambda share: None)
    with guarded_outputs({"recording": output, "drawing": draw}, files) as written:
        inputs = [fingerprint(path) for path in files]
        found = find_network(loaded, command, search, inputs, lambda share: tell(SEARCHING * share))
        refuse_warnings(strict, found.warnings)
        written.write("drawing", lambda part, path: write_drawing(part, network_svg(found)))
        return written.recorded(found, lambda share: tell(SEARCHING + (1.0 - SEARCHING) * share))


@public_reading(Reading)
def network_drive(
    network: NetworkLike,
    drives: Mapping[str, Range] | None = None,
    *,
    steps: int | None = None,
    duration: float | None = None,
    law: Law = "uniform",
    tsp: float | None = None,
    branch: int | None = None,
    start: Mapping[str, Any] | None = None,
    point: str | tuple[str, Sequence[float]] | None = None,
    wrenches: Sequence[str | Wrench] = (),
    torques: Mapping[str, float | str] | None = None,
    log: PathLike | TableLike | Run | None = None,
    derivative: Method | None = None,
    restarts: int = DEFAULT_RESTARTS,
    seed: int = 0,
    strict: bool = False,
    draw: PathLike | None = None,
    output: PathLike | None = None,
    progress: Callable[[float], None] | None = None,
    **reading: Unpack[Reading],
) -> NetworkMotion:
    """Move a network by its controls, or by joints in their place, on one branch. See docs/networks.md.

    The motion follows the branch of an assembly by continuation. It names singular poses, and ends where it
    turns back, or a joint reaches its limit.

    Args:
        network: A name, a file, the tables of one, or a `Network`.
        drives: From and to by name, such as {"crank": (0, "360deg")}; one value holds a variable. Of controls
            numbers are in the units of the network, of joints in [rad] and [m]; texts have units. With a log:
            the joint of the log that drives each, such as {"crank": "q1"}; default: those of the same names.
        steps: Equal steps, one per `tsp`; default: 200.
        duration: Duration in [s] instead of steps.
        law: How the drives move over the duration: uniform, trapezoid (a third each), quintic (from rest to
            rest).
        tsp: Time from row to row in [s]; default: 0.005. With a log: the period of its grid.
        branch: Number of the assembly at the begin of the drives, as `network_solve` with `every` lists them.
        start: Values of joints in [rad] and [m], or texts with units: the motion begins at the assembly
            nearest to them; default: that which continues the network's own start.
        point: A point of a body to trace, such as "coupler:0.45,0.2,0" in [m]: the tool centre point of the
            run.
        wrenches: Loads, such as "coupler:0.45,0,0:0,-50,0": point in the frame of the body in [m], force in
            [N], and if wanted the moment in [N.m], along the axes of the ground.
        torques: Loads at joints in [N.m] or [N], by name.
        log: A log whose joints drive the network, row by row.
        derivative: central or savgol: how the log is differentiated; default: by its resolution.
        restarts: Random starts in a row without anything new that end a search for assemblies.
        seed: Of the random starts.
        strict: Whether a warning is an error.
        draw: An SVG file to draw the motion to.
        output: A recording (.rrd) or a log (.csv) to write.
        progress: Called with the share that is done, 0..1.
        **reading: How to read the log, as in `ingest`.

    Returns:
        `joints`, `joint_motion` (values, rates, second derivatives in [rad] or [m] and per [s], shape (n,
        joints)), `point_motion` (likewise of the traced point, shape (n, 3) each), `events` (singular poses
        and limits), `transmission`, `distance` to a singular pose [-], shape (n,), `forces`, `verdict`
        ("pass" if the drives reach their end), `to_frame()`.

    Raises:
        UrmpipeError: With everything that is wrong with the network, a drive, the log or an output.

    Source: [KinematicSystems]_ section 3.
    """
    written = None if output is None else Path(output)
    parts: tuple[Callable[[], Any], ...] = (
        lambda: network if isinstance(network, Network) else network_file.load_network(network),
        lambda: DriveRequest(
            drives or {}, steps, duration, law, 0.005 if tsp is None else tsp, branch, start or {}, point,
            wrenches, torques or {}, restarts, seed,
        ),
        lambda: _refuse_together(log, steps, duration, law, {"derivative": derivative, **reading}),
        lambda: output_kind(written, "motion"),
    )  # fmt: skip
    loaded, request, _, kind = map_collecting_errors(lambda make: make(), parts)
    run = None if log is None else _read_log(log, loaded, drives or {}, tsp, derivative, reading)
    named = [Path(path) for path in (network, log) if isinstance(path, (str, Path))]
    files = [path for path in named if path.is_file()] + map_files(reading)
    outputs: dict[OutputKind, PathLike | None] = {"drawing": draw}
    if kind is not None:
        outputs[kind] = written
    share = progress or (lambda done: None)
    with guarded_outputs(outputs, files) as targets:
        inputs = [fingerprint(path) for path in files if path.is_file()]
        motion = drive_network(loaded, request, run, inputs, lambda done: share(SEARCHING * done))
        refuse_warnings(strict, motion.warnings)
        targets.write("drawing", lambda part, path: write_drawing(part, motion_drawing(motion)))
        targets.write("motion", lambda part, path: _write_motion(motion, part, path))
        motion = targets.recorded(motion, lambda done: share(SEARCHING + (1.0 - SEARCHING) * done))
    return replace(motion, log=written) if kind == "motion" else motion


def _read_log(
    log: PathLike | TableLike | Run,
    network: Network,
    drives: Mapping[str, Range],
    tsp: float | None,
    derivative: Method | None,
    reading: Mapping[str, Any],
) -> Run:
    """Return the run of a log: its joints are the columns that drives name, or those named like controls."""
    if isinstance(log, Run):
        return log
    controls = [control.name for control in network.controls if control.value is None]
    named = [str(column) for column in drives.values() if is_word(column)] or controls
    operand = Path(log) if isinstance(log, (str, Path)) else held_of(log, "log")
    load = partial(load_runs, [operand], tsp=tsp, derivative=derivative)
    if named and reading.get("joints") is None:
        try:
            return load(read=resolved({**reading, "joints": named}).options)[0]
        except LogError:
            pass  # the log has other joints: reading it without names reports what is wrong with it
    return load(read=resolved(reading).options)[0]


def _refuse_together(
    log: Any, steps: int | None, duration: float | None, law: str, reading: Mapping[str, Any]
) -> None:
    """Raise an `OptionError` for options that a log leaves without a meaning, or that need one."""
    given = {"steps": steps, "duration": duration, "law": None if law == "uniform" else law}
    faults = [
        Finding("found together with a log, allowed: without one, which has times of its own", parameter=name)
        for name, value in given.items()
        if log is not None and value is not None
    ]
    faults += [
        Finding("found without a log, allowed: with one", parameter=name)
        for name, value in reading.items()
        if log is None and value is not None and value is not False and value not in ({}, (), [])
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
