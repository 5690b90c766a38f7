"""Block of the kinematics of a robot: the places of its points, and their motion, from its joints.

1. `chain_to_geometry`: the geometry as tunable parameters - segments and tilts of a URM arm, the frames of
   the joints of any other - with base and tool.
2. `kinematic_chain`: the block.
"""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

from urmpipe_fmus.block import BlockModel, Input, Output, Parameter, Values, Variable
from urmpipe_fmus.blocks.coordinates import (
    check_choices,
    check_flag,
    check_robot,
    coordinate_variables,
    read_coordinates,
    robot_recipe,
)
from urmpipe_models.arm.chain import Chain
from urmpipe_models.arm.chain import Parameter as ArmParameter
from urmpipe_models.arm.denavit_hartenberg import SEGMENT_SOURCE, TILT_SOURCE
from urmpipe_models.errors import UnitError, map_collecting_errors
from urmpipe_models.kinematics.forward import Motion, forward, iter_point_motions
from urmpipe_models.math3d import Transform, euler_zyx, from_rpy, matrix_to_rpy
from urmpipe_models.robots.toml import chain_from_dict

KINEMATIC_CHAIN_OPTIONS: Mapping[str, str] = {
    "robot": "a robot: a name of the catalogue, a .toml or a .urdf file",
    "points": 'the points whose place is an output, such as ["p6", "p7"] (default: all)',
    "sensors": "the points whose angles, and motion with rates, are outputs (default: the tool centre)",
    "rates": "true: the joints' rates are inputs, the sensors' velocity and acceleration outputs",
}


class Geometry(NamedTuple):
    """The geometry of a robot.

    Attributes:
        parameters: Tunable; they start at the geometry of the robot's description.
        chain_at: Returns the robot with the values of the parameters.
    """

    parameters: tuple[Parameter, ...]
    chain_at: Callable[[Values], Chain]


def chain_to_geometry(robot: Chain) -> Geometry:
    """Return the geometry of a robot: lengths and tilts of a URM arm, else the frames of its joints.

    The frames of its base and its tool (`base`, `tool`) are parameters of both.
    """
    links = [parameter for parameter in robot.parameters if parameter.place not in ("base", "tool")]
    is_urm = {parameter.source for parameter in links} == {SEGMENT_SOURCE, TILT_SOURCE}
    geometry = _urm_geometry(robot, links) if is_urm else _frame_geometry(robot)
    ends = (
        *_frame_parameters("base", "the base in the world", robot.base),
        *_frame_parameters("tool", "the tool centre point at the end of the arm", robot.tool),
    )

    def chain_at(v: Values) -> Chain:
        return geometry.chain_at(v).placed(_read_frame(v, "base"), _read_frame(v, "tool"))

    return Geometry((*geometry.parameters, *ends), chain_at)


def _urm_geometry(robot: Chain, links: Sequence[ArmParameter]) -> Geometry:
    """Return the geometry of a URM arm: lengths and tilts."""
    lengths, tilts = (
        [parameter for parameter in links if parameter.source == source]
        for source in (SEGMENT_SOURCE, TILT_SOURCE)
    )

    def chain_at(v: Values) -> Chain:
        values = zip((*lengths, *tilts), (*v.lengths, *v.tilts), strict=True)
        return robot.with_parameters({parameter.name: value for parameter, value in values})

    parameters = (
        Parameter(
            name="lengths",
            description="Segments r_1..r_(n+1), the last one the effector",
            unit="m",
            display_unit="mm",
            start=tuple(parameter.value for parameter in lengths),
            size=len(lengths),
        ),
        Parameter(
            name="tilts",
            description="Tilts theta_2..theta_(n+1) of each segment against the one before",
            unit="rad",
            display_unit="deg",
            start=tuple(parameter.value for parameter in tilts),
            size=len(tilts),
        ),
    )
    return Geometry(parameters, chain_at)


def _frame_geometry(robot: Chain) -> Geometry:
    """Return the geometry of any robot: the frames of its joints and of its tip; the axes are constant."""
    origins = [f"origin{k}" for k in range(1, len(robot.joints) + 1)]
    parameters = [
        parameter
        for name, joint in zip(origins, robot.joints, strict=True)
        for parameter in _frame_parameters(name, f"joint {joint.name} in the frame before it", joint.origin)
    ]

    def chain_at(v: Values) -> Chain:
        joints = [
            replace(joint, origin=_read_frame(v, name))
            for name, joint in zip(origins, robot.joints, strict=True)
        ]
        return replace(robot, joints=tuple(joints), tip=_read_frame(v, "tip"), visuals=())

    tip = _frame_parameters("tip", "the end of the arm in the frame of the last joint", robot.tip)
    return Geometry((*parameters, *tip), chain_at)


def _frame_parameters(name: str, where: str, frame: Transform) -> tuple[Parameter, Parameter]:
    """Return a frame as two parameters: x, y, z, and the angles about the fixed x, y, z."""
    return (
        Parameter(
            name=name,
            description=f"Place of {where}: x, y, z",
            unit="m",
            display_unit="mm",
            start=tuple(map(float, frame.translation)),
            size=3,
        ),
        Parameter(
            name=f"{name}_rpy",
            description=f"Turn of {where}: roll, pitch, yaw (about the fixed x, y, z)",
            unit="rad",
            display_unit="deg",
            start=matrix_to_rpy(frame.rotation),
            size=3,
        ),
    )


def _read_frame(v: Values, name: str) -> Transform:
    """Return the frame of the two parameters of a name."""
    return Transform(from_rpy(*getattr(v, f"{name}_rpy")).rotation, getattr(v, name))


def kinematic_chain(
    robot: Chain,
    *,
    points: Sequence[str] | None = None,
    sensors: Sequence[str] | None = None,
    rates: bool = False,
) -> BlockModel:
    """Return the block that computes points of a robot from its joints.

    Inputs are the angles `phi` of the revolute joints and the ways `s` of the prismatic ones, each from the
    base outwards; with rates also `phid`, `phidd`, `sd`, `sdd`. They start at the calibration pose. They have
    no limits: a value beyond a joint's range has a pose too, and a repolarized angle exceeds one turn.

    Args:
        robot: The robot.
        points: Names of the points p1..pn that are outputs; all by default.
        sensors: Points whose angles rz, ry, rx are outputs too; the tool centre point by default.
        rates: Whether the joints' rates are inputs; then velocity v and acceleration a of the sensors are
            outputs.

    Raises:
        UnitError: With the errors of the options.

    Source: [UrmArm2021]_ eq. 1-14; v and a by the outward recursion (see `iter_point_motions`).
    """
    check_robot("kinematic_chain", robot)
    names = robot.point_names
    selected, sensor_names = map_collecting_errors(
        lambda choice: check_choices("kinematic_chain", *choice, names),
        (
            ("points", names if points is None else points),
            ("sensors", names[-1:] if sensors is None else sensors),
        ),
    )
    check_flag("kinematic_chain", "rates", rates)
    if not (selected or sensor_names):
        raise UnitError("unit kinematic_chain: options points, sensors: found none, allowed: one of either")
    geometry = chain_to_geometry(robot)

    def outputs(v: Values) -> Mapping[str, Any]:
        """Return the places of the points, and the angles and motions of the sensors."""
        arm = geometry.chain_at(v)
        q = read_coordinates(arm, v)
        motions: dict[str, Motion] = {}
        if rates:
            qd, qdd = read_coordinates(arm, v, "d"), read_coordinates(arm, v, "dd")
            motions = dict(zip(names, iter_point_motions(arm, q, qd, qdd), strict=True))
            poses = {name: motion.pose for name, motion in motions.items()}
        else:
            poses = dict(zip(names, forward(arm, q), strict=True))
        values: dict[str, Any] = {name: poses[name].translation for name in selected}
        for name in sensor_names:
            rz, ry, rx, singular = euler_zyx(poses[name].rotation)
            of_sensor = {"rz": rz, "ry": ry, "rx": rx, "singular": singular}
            if rates:
                of_sensor |= {"v": motions[name].velocity, "a": motions[name].acceleration}
            values |= {f"{quantity}{name[1:]}": value for quantity, value in of_sensor.items()}
        return values

    return BlockModel(
        name="kinematic_chain",
        description=f"Points of {robot.name or 'an arm'} from its joints",
        variables=(
            *geometry.parameters,
            *coordinate_variables(robot, Input, 2 if rates else 0),
            *(_output(name, f"Place of point {name}: x, y, z", "m", 3) for name in selected),
            *(variable for name in sensor_names for variable in _sensor_outputs(name, rates)),
        ),
        outputs=outputs,
        equations=(
            "p_k = the origin of the frame after joint k: the product of the joints' frames and motions;",
            "of a URM arm p_(i+1) = Rz(phi_1) [r_1 + sum_k prod_j (Ry(theta_(j+1)) Rz(phi_(j+1))) r_(k+1)]"
            " (eq. 1-8)",
            "R = Rz(rz) Ry(ry) Rx(rx) (eq. 9, 14)",
            "rz = atan2(a21, a11), ry = atan2(-a31, hypot(a11, a21)), rx = atan2(a32, a33) (eq. 10-13)",
            "at ry = +-90 deg: rx = 0, rz = atan2(-a12, a22), and singular is true",
            *(RATE_EQUATIONS if rates else ()),
        ),
        source="UrmArm2021, eq. 1-14, with atan2 in eq. 10 and 13",
        recipe=robot_recipe(__name__, robot, points=list(selected), sensors=list(sensor_names), rates=rates),
    )


RATE_EQUATIONS = (
    "v = v_before + omega x d, a = a_before + alpha x d + omega x (omega x d), joint by joint",
    "omega grows by z phid, alpha by z phidd + omega x z phid; a sliding joint adds z sd to v,",
    "z sdd + 2 omega x z sd to a",
)


def from_robot_toml(robot: str, **options: Any) -> BlockModel:
    """Return `kinematic_chain` of the robot in a text of `robot_toml`, equal to the bit."""
    return kinematic_chain(chain_from_dict(tomllib.loads(robot)), **options)


def _sensor_outputs(name: str, rates: bool) -> Iterator[Variable]:
    """Yield the outputs of the sensor on a point."""
    number = name[1:]
    for angle, axis in (("rz", "z"), ("ry", "the turned y"), ("rx", "the turned x")):
        yield _output(f"{angle}{number}", f"Angle of {name} about {axis}", "rad", None)
    yield Output(
        name=f"singular{number}",
        description=f"Whether ry{number} is +-90 deg, where rx{number} is 0 by convention",
        type="Boolean",
    )
    if rates:
        yield _output(f"v{number}", f"Velocity of {name}", "m/s", 3)
        yield _output(f"a{number}", f"Acceleration of {name}", "m/s2", 3)


def _output(name: str, description: str, unit: str, size: int | None) -> Output:
    display_unit = "deg" if unit == "rad" else ""
    return Output(name=name, description=description, unit=unit, display_unit=display_unit, size=size)
