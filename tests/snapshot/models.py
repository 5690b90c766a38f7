"""Evaluate functions of urmpipe_models and urmpipe_fmus at fixed inputs: the snapshot keeps the variables.

All names of the product stand in the imports below, so that they can be rewritten when modules move.
"""

# Variables of this script take results of every type in turn.
# mypy: ignore-errors

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from urmpipe_fmus.block import Table
from urmpipe_fmus.blocks import block_names, make_block
from urmpipe_fmus.run import run
from urmpipe_models.arm.chain import Chain
from urmpipe_models.delta import delta, exceeds_tolerance
from urmpipe_models.drives import (
    Drive,
    DrivenJoint,
    Gains,
    JointMotion,
    control_voltage,
    current_rate,
    dissipated_power,
    load_acceleration,
    motor_torque,
    ramp,
    shaft_acceleration,
    shaft_torque,
    stored_energy,
    trapezoid,
)
from urmpipe_models.drives import step as set_point_step
from urmpipe_models.dynamics.driven_arm import (
    ArmState,
    Motor,
    arm_energy,
    find_equilibrium,
    joint_accelerations,
    joint_torques,
    max_stable_step,
    motor_derivatives,
    power_flow,
    spectral_radius,
)
from urmpipe_models.dynamics.equations import (
    energies_over_log,
    forward_dynamics,
    inverse_dynamics,
    mass_matrix,
    torque_terms,
    torque_terms_over_log,
    torques_over_log,
)
from urmpipe_models.dynamics.links import (
    Wrench,
    centres_of_mass,
    kinetic_energy,
    potential_energy,
    wrench_power,
)
from urmpipe_models.elementwise import cosine_sine
from urmpipe_models.hand_eye import rotation_residual, solve_hand_eye
from urmpipe_models.ik.closed import closed_form
from urmpipe_models.ik.path import solve_path
from urmpipe_models.ik.solutions import SearchOptions, Targets, forward_targets, pose_errors
from urmpipe_models.ik.solve import solve
from urmpipe_models.kinematics.forward import (
    bias_over_log,
    forward,
    frames_over_log,
    jacobian,
    jacobian_over_log,
    point_motions,
    point_over_log,
    points_over_log,
    poses_over_log,
    tip_pose,
)
from urmpipe_models.kinematics.singularity import characteristic_length, singularity_over_log
from urmpipe_models.lagrange.formulas import c_code, equations_text, open_form
from urmpipe_models.math3d import (
    Transform,
    conjugate,
    euler_zxz,
    euler_zyx,
    fit_rotation,
    from_offset,
    from_rpy,
    from_zxz,
    matrix_to_rpy,
    quaternion_product,
    rotation_about,
    rotation_angle,
    rotation_x,
    rotation_y,
    rotation_z,
    slerp,
    to_matrices,
    to_quaternions,
    to_rotation_vectors,
    translation,
)
from urmpipe_models.networks.assembly import assemble, body_poses
from urmpipe_models.networks.closure import evaluate_closure, evaluate_scaled_closure
from urmpipe_models.networks.driving import compute_shares, drive_rows, find_driven_variables
from urmpipe_models.networks.file import load_network, network_names
from urmpipe_models.networks.forces import Wrench as BodyWrench
from urmpipe_models.networks.forces import compute_forces
from urmpipe_models.networks.mechanism import build_mechanism
from urmpipe_models.networks.mobility import analyse_mobility
from urmpipe_models.networks.rates import close_network, compute_rates
from urmpipe_models.planning.from_rows import rows_to_path
from urmpipe_models.planning.joints import joint_limited_law, joints_along, max_limit_utilisation
from urmpipe_models.planning.laws import jerk_law, trapezoid_law
from urmpipe_models.planning.path import PathRows, arc_at_corner, cube_rows
from urmpipe_models.robots.catalogue import load_robot, robot_names
from urmpipe_models.wraps import (
    reinterpolate,
    repolarize,
    unwrap_euler,
    unwrap_quaternions,
    unwrap_rotation_vectors,
)

_rng = np.random.default_rng(7)
_angles = _rng.uniform(-3, 3, (20, 3))
_quats = _rng.standard_normal((20, 4))
_quats /= np.linalg.norm(_quats, axis=1)[:, None]
_t = np.linspace(0, 1, 101)


def _plain(frame: Transform) -> NDArray[np.float64]:
    """Return a transform as a matrix of 3 x 4."""
    return np.column_stack([np.array(frame.rotation, dtype=float), np.array(frame.translation, dtype=float)])


def _joints(chain: Chain, count: int) -> NDArray[np.float64]:
    """Return joint values within the limits, on which no pose is singular."""
    return np.array(chain.start) + _rng.uniform(-0.5, 0.5, (count, len(chain.coordinates)))


# Transforms and orientations
_frame = translation(0.1, 0.2, 0.3) @ rotation_x(0.3) @ rotation_y(-0.4) @ rotation_z(2.0)
transforms = {
    "product": _plain(_frame),
    "inverse": _plain(_frame.inverse()),
    "about": _plain(rotation_about((0.6, 0.0, 0.8), 1.2)),
    "rpy": np.array([_plain(from_rpy(*one)) for one in _angles]),
    "zxz": np.array([_plain(from_zxz(*one)) for one in _angles]),
    "offset": _plain(from_offset([0.1, 0.2, 0.3, 0.4, 0.5, 0.6])),
    "euler_zyx": np.array([euler_zyx(from_rpy(*one).rotation) for one in _angles], dtype=float),
    "euler_zxz": np.array([euler_zxz(from_zxz(*one).rotation) for one in _angles], dtype=float),
    "rpy_of": np.array([matrix_to_rpy(from_rpy(*one).rotation) for one in _angles]),
}
orientations = {
    form: to_quaternions(_angles, form) for form in ("vector", "rpy", "zyx", "xyz", "zyz", "zxz")
} | {
    "matrices": to_matrices(_quats),
    "back": to_quaternions(to_matrices(_quats).reshape(-1, 9), "matrix"),
    "wxyz": to_quaternions(_quats, "quat_wxyz"),
    "conjugate": conjugate(_quats),
    "between": rotation_angle(_quats, _quats[::-1]),
    "slerp": slerp(_quats, _quats[::-1], np.linspace(0, 1, 20)),
    "product": quaternion_product(_quats, _quats[::-1]),
    "vectors": to_rotation_vectors(_quats),
    "best": fit_rotation(_rng.standard_normal((3, 3)))[0],
    "continuous": unwrap_quaternions(_quats),
    "continuous_vectors": unwrap_rotation_vectors(_angles),
    "continuous_euler": unwrap_euler(_angles),
    "cosine_sine": np.array(cosine_sine(np.linspace(-700, 700, 999))),
}

# Kinematics, dynamics and inverse kinematics of every arm
kinematics, dynamics, inverse = {}, {}, {}
for _name in robot_names():
    _chain = load_robot(_name)
    _q, _qd, _qdd = (_joints(_chain, 12) - shift * np.array(_chain.start) for shift in (0, 1, 1))
    _point = point_over_log(_chain, _q, _qd, _qdd)
    _near = singularity_over_log(_chain, _q)
    kinematics[_name] = {
        "points": points_over_log(_chain, _q),
        "pose": poses_over_log(_chain, _q),
        "frames": frames_over_log(_chain, _q),
        "jacobian": jacobian_over_log(_chain, _q),
        "bias": bias_over_log(_chain, _q, _qd),
        "velocity": _point.velocity,
        "acceleration": _point.acceleration,
        "euler_zyx": _point.euler_zyx,
        "smallest": _near.smallest,
        "manipulability": _near.manipulability,
        "length": characteristic_length(_chain),
        "tip": _plain(tip_pose(_chain, _q[0].tolist())),
        "forward": np.array([_plain(one) for one in forward(_chain, _q[0].tolist())]),
        "one_jacobian": np.array(jacobian(_chain, _q[0].tolist()), dtype=float),
        "motions": len(point_motions(_chain, _q[0].tolist(), _qd[0].tolist(), _qdd[0].tolist())),
    }
    _targets = forward_targets(_chain, _q[:6])
    _form = closed_form(_chain)
    _sought = SearchOptions(tolerance=None, restarts=4, seed=1)
    for _method in ("iterative", "closed") if _form else ("iterative",):
        if len(_chain.coordinates) < 6 and _method == "iterative":
            _targets = Targets(_targets.position)
        _found = solve(_chain, _targets, every=_method == "closed", method=_method, search=_sought)
        inverse[f"{_name}.{_method}"] = {
            "q": _found.q,
            "reasons": list(_found.reasons.ravel()),
            "branches": list(_found.branches),
            "shortfall": _found.position_residual,
        }
    _line = np.array(_chain.start) + np.linspace(0, 1, 30)[:, None] * (_q[0] - np.array(_chain.start))
    _path = forward_targets(_chain, _line)
    if len(_chain.coordinates) < 6:
        _path = Targets(_path.position)
    _walked = solve_path(_chain, _path, np.arange(30) * 50_000_000, start=_line[0], search=_sought)
    inverse[f"{_name}.path"] = {
        "q": _walked.q,
        "method": _walked.method,
        "branch": list(_walked.branch),
        "misses": [round(float(np.nanmax(one)), 6) for one in pose_errors(_chain, _walked.q, _path)],
    }
    if not _chain.inertials:
        continue
    _one = [row[0].tolist() for row in (_q, _qd, _qdd)]
    _wrench = Wrench((1.0, -2.0, 3.0), (0.1, 0.2, -0.3))
    _tau = inverse_dynamics(_chain, *_one, _wrench)
    dynamics[_name] = {
        "torque": torques_over_log(_chain, _q, _qd, _qdd),
        "terms": torque_terms_over_log(_chain, _q, _qd, _qdd),
        "energies": energies_over_log(_chain, _q, _qd),
        "matrix": np.array(mass_matrix(_chain, _one[0]), dtype=float),
        "inverse": np.array(_tau, dtype=float),
        "forward": np.array(forward_dynamics(_chain, _one[0], _one[1], _tau, _wrench), dtype=float),
        "one_terms": [np.array(one, dtype=float) for one in torque_terms(_chain, *_one, _wrench)],
        "energy": [float(kinetic_energy(_chain, *_one[:2])), float(potential_energy(_chain, _one[0]))],
        "power": float(wrench_power(_chain, *_one[:2], _wrench)),
        "centres": np.array(centres_of_mass(_chain, _one[0]), dtype=float),
    }

# Drives, alone and in an arm
_drive, _gains = Drive(2500.0, 5.0, 100.0, 0.05, 0.5, 0.001, 0.5), Gains(7.5, 0.75, 0.01)
_ur3 = load_robot("ur3")
_driven = replace(
    _ur3, drives=tuple(DrivenJoint(one, _drive, 0.005, _gains, 48.0) for one in _ur3.coordinates)
)
_state = ArmState(
    [0.1, -1.2, 1.4, -1.8, -1.6, 0.2],
    [0.1] * 6,
    [Motor(_drive, angle, 0.1, 0.5, 3.0) for angle in (0.101, -1.199, 1.401, -1.8, -1.6, 0.2)],
)
drives = {
    "shaft": shaft_torque(_drive, 0.1, 0.2, 0.11, 0.1),
    "driving": motor_torque(_drive, 2.0),
    "acceleration": shaft_acceleration(_drive, 2.0, 30.0),
    "current": current_rate(_drive, 24.0, 0.2, 2.0),
    "stored": stored_energy(_drive, 0.1, 0.2, 2.0, 0.11),
    "lost": dissipated_power(_drive, 0.2, 2.0, 0.1),
    "load": load_acceleration(1.5, 0.2, 0.3, 4.0, -1.0),
    "voltage": float(
        control_voltage(1.0, _gains, JointMotion(0.2, 0.3, 0.4), JointMotion(0.1, 0.2, 0.3), 48.0)
    ),
    "step": np.array([[float(one) for one in set_point_step(t, 0.1, 0.0, 1.0)] for t in _t]),
    "ramp": np.array([[float(one) for one in ramp(t, 0.1, 0.0, 0.5, 1.0)] for t in _t]),
    "trapezoid": np.array([[float(one) for one in trapezoid(t, 0.1, 0.0, 0.5, 1.0, 5.0)] for t in _t]),
    "arm_torques": np.array(joint_torques(_state), dtype=float),
    "arm_accelerations": np.array(joint_accelerations(_driven, _state), dtype=float),
    "motors": np.array([[float(v) for v in one] for one in motor_derivatives(_state).values()]),
    "powers": [float(one) for one in power_flow(_driven, _state)],
    "energy": float(arm_energy(_driven, _state)),
    "rest": np.array([[float(v) for v in one] for one in find_equilibrium(_driven)]),
    "stable": float(max_stable_step(_driven)),
    "radius": float(spectral_radius(_driven, np.array(_state.q))),
}

# Planning
_corners = PathRows(
    [[0.3, -0.2, 0.3], [0.5, -0.2, 0.3], [0.5, 0.1, 0.3], [0.3, 0.1, 0.4]], [0, 0.05, 0.03, 0], corner=True
)
_limited = replace(
    load_robot("ur5e"), joints=tuple(replace(one, acceleration=8.0) for one in load_robot("ur5e").joints)
)
planning = {}
for _name, _rows in {
    "corners": _corners,
    "wall": cube_rows("wall", 0.3, 0.03, np.array([0.45, 0.0, 0.4])),
    "diagonal": cube_rows("diagonal", 0.2, 0.02, np.array([0.45, 0.0, 0.4])),
}.items():
    _path = rows_to_path(_rows)
    _joints_of = joints_along(_limited, _path)
    _laws = {
        "trapezoid": trapezoid_law(_path, 0.5, 6.0),
        "total": trapezoid_law(_path, 0.5, 2.0, "total"),
        "jerk": jerk_law(_path, 0.5, 6.0, 60.0, "tangential"),
    }
    if _joints_of.reached:
        _laws["limits"] = joint_limited_law(_joints_of)
        planning[f"{_name}.usage"] = float(max_limit_utilisation(_joints_of, _laws["trapezoid"]).share)
    for _law, _made in _laws.items():
        _moved = _made.at(_made.duration * _t)
        planning[f"{_name}.{_law}"] = {
            "duration": _made.duration,
            "s": _moved.s,
            "v": _moved.v,
            "a": _moved.a,
            "position": _path.points(_moved.s).position,
        }
_arc = arc_at_corner(np.array([0.5, 0.0, 0.0]), np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0]), 0.1, 2)
planning["arc"] = [_arc.start, _arc.normal, _arc.radius, _arc.angle]

# Repolarizing, deviations, frames of a measuring device
_turning = np.column_stack([9 * np.sin(3 * _t), 4 * _t**2 + 0.1 * np.cos(9 * _t)])
_wrapped = (_turning + np.pi) % (2 * np.pi) - np.pi
_whole = repolarize(_wrapped, np.full(101, 0.01))
_seen_q = _joints(load_robot("ur5e"), 25)
_at, _turned = poses_over_log(load_robot("ur5e"), _seen_q)
_turned = to_matrices(_turned) if _turned.shape[-1] == 4 else _turned
_measured = (_at + np.einsum("nij,j->ni", _turned, [0.02, -0.01, 0.12])) @ np.array(
    [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
) + [1.0, 2.0, 0.5]
_eye = solve_hand_eye(_at, _turned, _measured + 1e-5 * _rng.standard_normal(_measured.shape))
logs = {
    "turned": _whole.q,
    "changes": [_whole.rows, _whole.joints, _whole.change],
    "repaired": reinterpolate(_wrapped, _t, np.array([[3, 0], [50, 1]])),
    "delta": [
        float(one) if np.ndim(one) == 0 else np.array(one, dtype=float)
        for one in delta((0.1, 0.2, 0.3), (0.11, 0.19, 0.33))
    ],
    "outside": float(exceeds_tolerance(delta((0.1, 0.2, 0.3), (0.11, 0.19, 0.33)), 0.01)),
    "eye": [_eye.base_rotation, _eye.base_position, _eye.tool_position],
    "miss": rotation_residual(_turned, _turned[::-1]),
}

# Networks
networks = {}
_DRIVEN = {
    "four-bar": ("crank", 2.5),
    "bennett": ("turn", 2.0),
    "rssr": ("crank", 2.0),
    "slider-crank": ("crank", 3.0),
    "sarrus": ("tilt", 0.5),
    "stewart-gough-driven": ("leg1", 0.82),
}
for _name in network_names():
    _mechanism = build_mechanism(load_network(_name))
    _made = assemble(_mechanism, restarts=50, seed=2)
    _x = _made.x[:, 0]
    _closed, _can = evaluate_closure(_mechanism, _made.x[:, :1]), analyse_mobility(_mechanism, _x)
    networks[_name] = {
        "x": _made.x,
        "reason": _made.reason,
        "poses": body_poses(_mechanism, _x),
        "residual": _closed.residual,
        "jacobian": _closed.jacobian,
        "scaled": evaluate_scaled_closure(_mechanism, _made.x[:, :1]).jacobian,
        "mobility": [_can.mobility, _can.kutzbach],
        "newton": np.array(close_network(_mechanism, _x.tolist(), 2), dtype=float),
    }
    if _name in _DRIVEN:
        _control, _end = _DRIVEN[_name]
        _others = [one.name for one in load_network(_name).controls if one.name != _control]
        _by = find_driven_variables(_mechanism, [_control, *_others])
        _shares = compute_shares("quintic", np.linspace(0, 1, 21))
        _values = np.tile(_x[_by.places], (21, 1))
        _values[:, 0] += _shares[0] * (_end - _values[0, 0])
        _moves = drive_rows(_mechanism, _x, _by, _values)
        _xd = np.zeros((len(_by.places), 21))
        _xd[0] = 0.7
        _rates = compute_rates(_mechanism, _moves.x, _xd, 0 * _xd, _by.places, _moves.free, _moves.spins)
        _load = BodyWrench(load_network(_name).bodies[-1].name, (0.1, 0.0, 0.0), (1.0, -2.0, 3.0))
        _forces = compute_forces(_mechanism, _moves.x, _by.places, _moves.free, [_load])
        networks[f"{_name}.driven"] = {
            "x": _moves.x,
            "xd": _rates.xd,
            "xdd": _rates.xdd,
            "transmission": _rates.transmission,
            "distance": _rates.distance,
            "forces": _forces.drives,
            "reactions": dict(_forces.reactions),
            "shares": _shares,
        }

# Equations of motion
_open = open_form(load_robot("../../in/two_link.toml"))
lagrange = {
    "text": equations_text(_open).splitlines(),
    "c": c_code(_open).splitlines(),
    "costs": [[*one.operations, *one.reduced] for one in _open.costs],
}

# Units over a table
_OPTIONS = {
    "kinematic_chain": {"robot": load_robot("urm6"), "rates": True},
    "repolarizer": {"joints": 2},
    "chain_dynamics": {"robot": _ur3},
    "driven_arm": {"robot": _driven},
    "network_motion": {"network": "four-bar"},
    "log_source": {
        "table": Table(np.round(_t * 1e9).astype(np.int64), np.column_stack([_t**2, np.sin(_t)])),
        "columns": [("a", "m", None, "first"), ("b", "rad", None, "second")],
    },
}
units = {}
for _name in block_names():
    _unit = make_block(_name, **_OPTIONS.get(_name, {}))
    _times, _inputs = _t[:5] / 10 if _name in ("driven_arm", "chain_dynamics") else _t, {}
    for _k, _one in enumerate(_unit.inputs):
        _size = _one.size or 1
        _wave = 0.1 * np.sin(3 * _times[:, None] + _k + np.arange(_size)) + (
            0.9 if _name == "network_motion" else 0.0
        )
        _inputs[_one.name] = _wave if _one.size else _wave[:, 0]
    units[_name] = run(_unit, _times, _inputs)

for _one in [name for name, value in globals().items() if callable(value) and not name.startswith("__")]:
    del globals()[_one]
