"""Block of the motion of a kinematic network: its controls in; joints, bodies and points out.

With controls c and free variables x, e(x, c) = 0 are the closure equations ([KinematicSystems]_ section 3).
At each communication point x starts on the line through the last two, and is refined by a fixed number of
Newton steps x := x - (J^T J + mu I)^-1 J^T e, J = de/dx.

`network_motion` reads the options and assembles the start; `_Motion` has the variables and functions.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from urmpipe_fmus.block import BlockModel, Input, Memory, Output, Recipe, Values, Variable
from urmpipe_fmus.blocks.coordinates import check_count, option_error
from urmpipe_models.elementwise import Element, Vector
from urmpipe_models.errors import UnitError, format_unknown_name, format_value
from urmpipe_models.measure_units import WRITTEN, quantity_to_si
from urmpipe_models.networks.assembly import CLOSED_TOLERANCE, assemble, single_assembly, start_configuration
from urmpipe_models.networks.driving import move_to
from urmpipe_models.networks.file import Network, load_network
from urmpipe_models.networks.mechanism import Mechanism, build_mechanism
from urmpipe_models.networks.parts import POSE_UNITS
from urmpipe_models.networks.rates import close_network, largest_residual, predict_variables, variable_changes
from urmpipe_models.networks.tables import network_tables, with_start
from urmpipe_models.toml_tables import is_number, is_number_list

NETWORK_MOTION_OPTIONS: Mapping[str, str] = {
    "network": "a kinematic network: a name of the catalogue, or a .toml file",
    "controls": 'start values of controls, such as { crank = "40deg" } (default: those of the network)',
    "start": "joint values, in rad and m or with units, to which the assembly at the start is the nearest",
    "points": 'points of bodies in m whose places are outputs, such as ["coupler:0.45,0.1,0"]',
    "newton": "Newton steps per evaluation (default: 3)",
}

NEWTON = 3  # 100 values of the control per turn: within 3e-10 rad of what is closed; 2 steps: 2e-5 rad

DISPLAY = {"rad": "deg", "m": "mm", "": ""}

# The memories: of controls and of free variables, in the order of the variables of a mechanism.
LAST = ("control_values", "free_variables")
CHANGES = ("control_changes", "free_changes")


def network_motion(
    network: Network | str | Path | Mapping[str, Any],
    *,
    controls: Mapping[str, float | str] | None = None,
    start: Mapping[str, Any] | None = None,
    points: Mapping[str, Any] | Sequence[str] | str | None = None,
    newton: int = NEWTON,
) -> BlockModel:
    """Return the block that computes the motion of a network by its controls.

    Inputs are the controls that can be set: in [rad] or [m] if a control is an angle or a length, else the
    number that its functions take. They have no limits, as the joints of `kinematic_chain` have none. Outputs
    are the variables of joints and of bodies without joints to the ground, points, and the residual.

    Args:
        network: The network, its name, its file or its tables.
        controls: Start values of inputs, as `network check --set` takes them.
        start: Values of joints by name, in [rad] and [m] or texts with units; a list for several variables:
            the nearest assembly to them. Default: that of the network, from which `controls` are moved.
        points: Names with {"body": name, "point": [x, y, z]} in [m] of the body; or texts "BODY:X,Y,Z",
            whose names are p1, p2, ...
        newton: Newton steps per evaluation.

    Raises:
        UnitError: With everything that is wrong with the options, or if the start does not assemble.
        NetworkError: With everything that is wrong with the network or its controls.

    Source: [KinematicSystems]_ section 3.
    """
    if not isinstance(network, (Network, str, Path, Mapping)):
        raise option_error("network_motion", "network", network, "a name, a file, or tables")
    loaded = network if isinstance(network, Network) else load_network(network)
    for option, value in (("controls", controls), ("start", start)):
        if value is not None and not isinstance(value, Mapping):
            raise option_error("network_motion", option, value, "a table of names and values")
    for name, number in (controls or {}).items():
        if not (isinstance(number, str) or is_number(number)):
            raise UnitError(
                f"unit network_motion: option controls: found {name} = {format_value(number)},"
                " allowed: a number, or a text with a unit"
            )
    mechanism = build_mechanism(_at_joint_values(loaded, start or {}))
    values = {name: loaded.control_value(name, value) for name, value in (controls or {}).items()}
    assembled = assemble(mechanism, {} if start is None else values)
    if start is None and values and assembled.assemblies:  # on the branch of the network's own start
        x, indices = start_configuration(mechanism, values), mechanism.controls
        limits = np.tile((-np.inf, np.inf), (len(x), 1))
        x, branch = move_to(mechanism, assembled.x_nearest, indices, x[indices], mechanism.free, limits)
        is_reached = branch is None or branch.complete
        assembled = single_assembly(mechanism, x, "") if is_reached else assemble(mechanism, values)
    if not assembled.assemblies:
        gap = assembled.closure_errors[0]
        raise UnitError(
            f"unit network_motion: {loaded.name} does not close: found a gap of {gap.metres:g} m and"
            f" {gap.radians:g} rad at {gap.name}, allowed: {CLOSED_TOLERANCE:g}; see urmpipe network check"
        )
    return _build_block(with_start(loaded, assembled.x[:, 0].tolist()), points, newton)


def from_tables(network: str, points: Mapping[str, Any], newton: int) -> BlockModel:
    """Return `network_motion` of a JSON text of `network_tables`, assembled where it starts."""
    return _build_block(load_network(json.loads(network)), points, newton)


def _build_block(network: Network, points: Any, newton: int) -> BlockModel:
    """Return the block of a network whose start is assembled."""
    check_count("network_motion", "newton", newton)
    motion = _Motion(network, build_mechanism(network), _read_points(network, points), newton)
    if not motion.inputs:
        raise UnitError(
            f"unit network_motion: option network: found {network.name} without a control to set,"
            " allowed: one or more"
        )
    remembers = len(motion.mechanism.free) > 0
    return BlockModel(
        name="network_motion",
        description=f"Motion of {network.name} by its controls",
        variables=tuple(motion.variables()),
        outputs=motion.outputs,
        update=motion.update if remembers else None,
        equations=(
            "e(x, c) = 0: gaps of cut joints (p2 - p1 and the skew part of R2 R1^T), errors of elements,",
            "      with c the controls and x the free variables, in lengths of the mechanism and rad",
            "x starts on the line through the last two communication points, then per Newton step",
            "x := x - (J^T J + mu I)^-1 J^T e, J = de/dx, mu = 1e-13",
            "residual = max |e|",
        ),
        source="Kinematic systems, section 3: docs/networks.md",
        recipe=Recipe(
            __name__,
            "from_tables",
            {
                "network": json.dumps(network_tables(network), allow_nan=False),
                "points": {name: {"body": body, "point": list(place)} for name, body, place in motion.points},
                "newton": newton,
            },
        ),
    )


class _Control(NamedTuple):
    """An input: its variable and control, its unit, and the factor from the control's unit to it."""

    variable: str
    control: str
    unit: str
    factor: float


class _Group(NamedTuple):
    """Variables of a joint or a body that are one output."""

    variable: str
    owner: str
    description: str
    indices: tuple[int, ...]
    unit: str


@dataclass(frozen=True)
class _Motion:
    """The variables and functions of the block; points: name, body and place in the body in [m]."""

    network: Network
    mechanism: Mechanism
    points: Sequence[tuple[str, str, Vector]]
    newton: int

    @cached_property
    def _names(self) -> dict[str, str]:
        """The names of variables of controls, joints and bodies, by their names in the network."""
        taken = {"time", "table", "residual", *LAST, *CHANGES, *(name for name, _, _ in self.points)}
        owners = dict.fromkeys(variable.owner for variable in self.mechanism.variables)
        names: dict[str, str] = {}
        for owner in (*owners, *(joint.name for joint in self.network.joints)):
            if owner not in names:
                names[owner] = _identifier(owner, taken)
                taken |= _forms(names[owner])
        return names

    @cached_property
    def inputs(self) -> tuple[_Control, ...]:
        """The controls that can be set, in the order of the mechanism's variables."""
        inputs = []
        for k in self.mechanism.controls:
            control = self.mechanism.variables[k].owner
            unit, factor = self.network.control_unit(control) or ("", 1)
            inputs.append(_Control(self._names[control], control, unit, float(factor)))
        return tuple(inputs)

    @cached_property
    def groups(self) -> tuple[_Group, ...]:
        """The outputs of joints, and of bodies without a joint to the ground."""
        groups = []
        for joint in self.network.joints:
            variable, what = self._names[joint.name], f"joint {joint.name}"
            if joint.kind == "cylindrical":
                groups.append(_Group(f"{variable}_theta", joint.name, f"Angle of {what}", (0,), "rad"))
                groups.append(_Group(f"{variable}_s", joint.name, f"Displacement of {what}", (1,), "m"))
            elif joint.units:
                word = {"prismatic": "Displacement", "global": "Rotation vector"}.get(joint.kind, "Angle")
                indices = tuple(range(len(joint.units)))
                groups.append(_Group(variable, joint.name, f"{word} of {what}", indices, joint.units[0]))
        for name in self.mechanism.graph.roots[1:]:
            variable = self._names[name]
            groups.append(_Group(f"{variable}_p", name, f"Position of body {name}: x, y, z", (0, 1, 2), "m"))
            groups.append(_Group(f"{variable}_q", name, f"Rotation vector of body {name}", (3, 4, 5), "rad"))
        return tuple(groups)

    def variables(self) -> Iterator[Variable]:
        starts = self.mechanism.start
        for control, start in zip(self.inputs, starts, strict=False):
            yield Input(
                name=control.variable,
                description=f"Control {control.control}",
                unit=control.unit,
                display_unit=DISPLAY[control.unit],
                start=float(start) * control.factor,
            )
        for group in self.groups:
            size = len(group.indices) if len(group.indices) > 1 else None
            yield _output(group.variable, group.description, group.unit, size)
        for name, body, place in self.points:
            at = ", ".join(f"{value:g}" for value in place)
            yield _output(name, f"Place of the point ({at}) m of {body}: x, y, z", "m", 3)
        yield _output("residual", "Largest error of the closure, in rad and lengths of the network", "", None)
        if len(self.mechanism.free):
            yield from self._memories()

    def _memories(self) -> Iterator[Memory]:
        """Yield the last configuration, and its change from the one before."""
        count = len(self.inputs)
        starts = [float(value) for value in self.mechanism.start]
        words = ("Controls", "Free variables of the network")
        for words_of, last, change, part in zip(
            words, LAST, CHANGES, (starts[:count], starts[count:]), strict=True
        ):
            when = "at the last communication point"
            yield Memory(name=last, description=f"{words_of} {when}", start=tuple(part), size=len(part))
            yield Memory(name=change, description=f"Their change up to there: {last}", size=len(part))

    def outputs(self, v: Values) -> Mapping[str, Any]:
        """Return joints, points and the residual."""
        x = self._configuration(v)
        mechanism, network = self.mechanism, self.network
        values = {
            joint.name: [value.value for value in mechanism.joint_values(joint, x)]
            for joint in network.joints
            if joint.units
        }
        for name in mechanism.graph.roots[1:]:
            first = mechanism.variable_index[name, 0]
            values[name] = x[first : first + len(POSE_UNITS)]
        results: dict[str, Any] = {"residual": largest_residual(mechanism, x)}
        for group in self.groups:
            elements = tuple(values[group.owner][index] for index in group.indices)
            results[group.variable] = elements if len(elements) > 1 else elements[0]
        poses = mechanism.poses(x) if self.points else {}
        return results | {name: poses[body].point(place) for name, body, place in self.points}

    def update(self, v: Values) -> Mapping[str, Any]:
        """Return the configuration as the last one, and how it has changed."""
        x = self._configuration(v)
        change = variable_changes(self.mechanism, self._last(v), x)
        count = len(self.inputs)
        parts = zip((*LAST, *CHANGES), (x[:count], x[count:], change[:count], change[count:]), strict=True)
        return {name: tuple(part) for name, part in parts}

    def _last(self, v: Values) -> list[Element]:
        return [element for name in LAST for element in getattr(v, name)]

    def _configuration(self, v: Values) -> list[Element]:
        """Return the variables that close the network at the present inputs."""
        controls = [getattr(v, control.variable) / control.factor for control in self.inputs]
        if not len(self.mechanism.free):
            return controls
        change = [element for name in CHANGES for element in getattr(v, name)]
        predicted = predict_variables(self.mechanism, self._last(v), change, controls)
        return close_network(self.mechanism, predicted, self.newton)


def _at_joint_values(network: Network, start: Mapping[str, Any]) -> Network:
    """Return a network whose joints start at other values, in [rad] and [m]."""
    joints = {joint.name: joint for joint in network.joints if joint.units}
    faults = [f"start: joint {format_unknown_name(name, joints)}" for name in start if name not in joints]
    for name, value in start.items():
        if name not in joints:
            continue
        units = joints[name].units
        values = list(value) if isinstance(value, (list, tuple)) else [value]
        read = [
            quantity_to_si(entry, WRITTEN[unit]) if isinstance(entry, str) else entry
            for entry, unit in zip(values, units, strict=False)
        ]
        if len(values) == len(units) and is_number_list(read, len(units)):
            joints[name] = replace(joints[name], start=tuple(float(entry) for entry in read))
        else:
            count = "a number" if len(units) == 1 else f"a list of {len(units)} numbers"
            faults.append(
                f"start: found {name} = {format_value(value)}, allowed: {count} in {', '.join(units)}"
            )
    if faults:
        raise UnitError(*(f"unit network_motion: option {fault}" for fault in faults))
    return replace(network, joints=tuple(joints.get(joint.name, joint) for joint in network.joints))


def _read_points(network: Network, points: Any) -> tuple[tuple[str, str, Vector], ...]:
    """Return the points of the option: name, body, and place in the body in [m]."""
    rows: dict[str, tuple[Any, Any]] = {}
    faults, read = [], []
    if isinstance(points, Mapping):
        for name, table in points.items():
            if isinstance(table, Mapping) and {*table} == {"body", "point"}:
                rows[name] = (table["body"], table["point"])
            else:
                faults.append(f"{name}: found {format_value(table)}")
    elif points is not None:
        words = points if isinstance(points, (list, tuple)) else [points]
        joined = ",".join(map(str, words))  # the shell's points=A:1,2,3,B:4,5,6 is a list of six words
        for k, text in enumerate(re.split(r",(?=[^,]*:)", joined), 1):
            body, _, place = text.rpartition(":")
            rows[f"p{k}"] = (body, _numbers(place))
    for name, (body, place) in rows.items():
        if body not in network.body_names:
            faults.append(f"{name}: body {format_unknown_name(str(body), network.body_names)}")
        elif not is_number_list(place, 3):
            faults.append(f"{name}: found {format_value(place)}, allowed: x, y, z in m")
        else:
            read.append((name, body, (float(place[0]), float(place[1]), float(place[2]))))
    if faults:
        form = 'allowed form: "BODY:X,Y,Z", or NAME = { body = "BODY", point = [X, Y, Z] }'
        raise UnitError(*(f"unit network_motion: option points: {fault}; {form}" for fault in faults))
    return tuple(read)


def _numbers(text: str) -> list[float] | str:
    """Return numbers with commas between them; any other text as it is."""
    try:
        return [float(word) for word in text.split(",")]
    except ValueError:
        return text


def _identifier(name: str, taken: set[str]) -> str:
    """Return a name as FMI variables have it: letters, digits and _, unlike those that are taken."""
    identifier = re.sub(r"\W", "_", name, flags=re.ASCII)
    if not identifier[:1].isalpha():
        identifier = f"v{identifier}"
    while _forms(identifier) & taken:
        identifier += "_"
    return identifier


def _forms(identifier: str) -> set[str]:
    """Return the names of all variables that an owner of variables may have."""
    return {identifier, *(f"{identifier}_{suffix}" for suffix in ("theta", "s", "p", "q"))}


def _output(name: str, description: str, unit: str, size: int | None) -> Output:
    return Output(name=name, description=description, unit=unit, display_unit=DISPLAY[unit], size=size)
