"""Names of columns as strangers write them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from motion import Motion, moves, of_robot, sines, times
from stranger import (
    COMMA,
    CSV,
    FIXED,
    GERMAN,
    PANDAS,
    QUOTED,
    SAVETXT,
    SEMICOLON,
    SIX,
    TABS,
    Column,
    Stranger,
    Writer,
    strangers,
    table,
    unit_clock,
)
from urmpipe_models.elementwise import FloatArray


def made(seed: int, joints: int = 6, rows: int = 200) -> Motion:
    return (sines if seed % 3 else moves)(times(rows, 0.03, 0.1 * (seed % 2), seed), joints, seed)


def numbered(pattern: str, count: int = 6, start: int = 1) -> list[str]:
    return [pattern.format(k) for k in range(start, start + count)]


def suffixed(stems: Sequence[str], *suffixes: str) -> list[str]:
    """Return names joint by joint, each with all suffixes."""
    return [stem + suffix for stem in stems for suffix in suffixes]


def mixed(motion: Motion, names: Sequence[str], kinds: Sequence[str], **own: Any) -> Stranger:
    """Return columns joint by joint: the kinds are attributes of a motion, one column each."""
    columns = np.column_stack([getattr(motion, kind)[:, j] for j in range(motion.joints) for kind in kinds])
    return other(motion, names, columns, **own)


def other(motion: Motion, names: Sequence[str], columns: FloatArray, **own: Any) -> Stranger:
    """Return a clock and columns of our own in [rad]."""
    fake = Motion(motion.t, columns, columns, motion.seed)
    truth: dict[str, Any] = {"q": motion.q, "qd": motion.qd, **own}
    return table(fake, "t q", {"t": "time", "q": names}, **truth)


MAKERS = (
    ("$AXIS_ACT.A{}", "deg"),
    ("actuator_{}.position", "deg"),
    ("posj_{}", "deg"),
    ("arm_{}_joint", "rad"),
    ("Joint {} Actual Position (deg)", "deg"),
    ("rob1_{}", "deg"),
    ("mes_q_{}", "rad"),
    ("Motor{}_Pos", "rad"),
    ("arm.joint_states.position.{}", "rad"),
)
"""Names by controllers and recorders, and the unit of what stands below."""

WX = ["waist", "shoulder", "elbow", "forearm_roll", "wrist_angle", "wrist_rotate"]
URS = ["shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3"]


@strangers
def family_of_names() -> Iterator[Stranger]:
    """All of a family are joints, not only those of its names that are known."""
    five = ["shoulder_pan_pos", "shoulder_lift_pos", "elbow_pos", "wrist_angle_pos", "wrist_rotate_pos"]
    isaac = ["shoulder", "upper_arm", "forearm", "wrist_1", "wrist_2", "wrist_3"]
    yield table(made(301, 5), "t q", {"t": "t", "q": five})
    yield table(
        made(302), "t q gripper", {"t": "t", "q": isaac, "gripper": "robotiq_gripper"}, writer=SEMICOLON
    )
    yield table(made(303, 4), "t q", {"t": "time", "q": ["base_pos", "elbow_pos", "wrist_pos", "tool_pos"]})
    half = ["joint1_pos", "joint2_pos", "joint3_pos", "wrist_a_pos", "wrist_b_pos", "wrist_c_pos"]
    yield table(made(304), "t q", {"t": "time", "q": half}, writer=TABS)
    yield table(made(305), "t q tau", {"t": "time", "q": suffixed(WX, "_pos"), "tau": suffixed(WX, "_load")})
    yield table(made(309, 5), "t q", {"t": "time", "q": URS[:5]})
    for k, (pattern, unit) in enumerate(MAKERS):
        yield table(
            made(601 + k), "t q", {"t": "time", "q": pattern}, unit=unit, writer=(CSV, TABS, PANDAS)[k % 3]
        )
    yield table(
        made(308), "t q tau", {"t": "time", "q": list("SLURBT"), "tau": [f"{n}_trq" for n in "SLURBT"]}
    )
    humanoid = ["hip_yaw", "hip_roll", "hip_pitch", "knee", "ankle_pitch", "ankle_roll"]
    yield table(made(306), "t q", {"t": "time", "q": suffixed(humanoid, "_angle")}, writer=QUOTED)


@strangers
def positions_and_velocities_side_by_side() -> Iterator[Stranger]:
    both = ("q", "qd")
    yield mixed(made(311), suffixed(URS, "_pos", "_vel"), both)
    yield mixed(made(312), suffixed(WX, "_position", "_velocity"), both, writer=SEMICOLON)
    yield mixed(made(313), suffixed(numbered("q{}"), "", "_dot"), both, writer=TABS)
    yield mixed(made(314, 7), suffixed(numbered("j{}", 7), "_p", "_v"), both, writer=FIXED)
    yield mixed(
        made(316), suffixed(numbered("A{}"), ".pos", ".vel", ".trq"), ("q", "qd", "tau"), writer=PANDAS
    )
    yield mixed(made(318, 5), suffixed(URS[:5], "", "_velocity"), both, writer=SEMICOLON)
    yield mixed(made(319, 4), suffixed(WX[:4], "", "_vel"), both)
    yield mixed(made(317), suffixed(numbered("joint_{}"), "", "_speed", "_current"), ("q", "qd", "current"))


def followed(motion: Motion) -> tuple[Motion, FloatArray]:
    """Return a motion and what had been commanded: it came 0.1 s earlier."""
    ahead = np.column_stack([np.interp(motion.t + 0.1, motion.t, one) for one in motion.q.T])
    return motion, np.round(ahead, 9)


def commanded(seed: int, target: Sequence[str], actual: Sequence[str], **own: Any) -> Stranger:
    """Return what was commanded before what was done."""
    motion, ahead = followed(made(seed, len(actual)))
    pairs = np.column_stack((ahead, motion.q))
    return other(motion, [*target, *actual], pairs, answers=(ahead,), **own)


@strangers
def targets_and_actual_values() -> Iterator[Stranger]:
    yield commanded(321, numbered("q_des_{}"), numbered("q_act_{}"))
    yield commanded(322, numbered("q{}_des"), numbered("q{}_act"), writer=SEMICOLON)
    yield commanded(323, numbered("target_q{}"), numbered("actual_q{}"), writer=TABS)
    yield commanded(324, numbered("joint_{}_ref", 7), numbered("joint_{}_meas", 7))
    yield commanded(325, suffixed(URS, "_cmd"), suffixed(URS, "_state"), writer=PANDAS)
    yield commanded(326, numbered("q_d[{}]", 7, 0), numbered("q[{}]", 7, 0))
    yield commanded(327, numbered("qref{}"), numbered("qmsr{}"), writer=SIX)
    motion, ahead = followed(made(328))
    between = np.stack((ahead, motion.q), axis=2).reshape(len(motion.t), -1)
    yield other(motion, suffixed(numbered("q{}"), "_des", "_act"), between, answers=(ahead,))


@strangers
def two_arms() -> Iterator[Stranger]:
    """Taken whole, or asked: half of them in silence is wrong."""
    for k, (sides, stems, writer) in enumerate(
        [
            (("left_", "right_"), numbered("joint{}"), CSV),
            (("left_", "right_"), WX, SEMICOLON),
            (("l_arm_", "r_arm_"), numbered("j{}"), TABS),
            (("robot1/", "robot2/"), [f"{stem}_joint" for stem in URS], PANDAS),
            (("L", "R"), numbered("J{}", 7), QUOTED),
        ]
    ):
        motion = made(331 + k, 2 * len(stems))
        halves = (motion.q[:, : len(stems)], motion.q[:, len(stems) :])
        names = [side + stem for side in sides for stem in stems]
        yield table(motion, "t q", {"t": "time", "q": names}, writer=writer, answers=halves)


@strangers
def names_of_rapid() -> Iterator[Stranger]:
    def outer(motion: Motion, names: Sequence[str], extra: Sequence[str], **own: Any) -> Stranger:
        """Return joints in [deg] and six outer axes that are not there, 9E9 each."""
        text = "9E+09" if own.pop("long", False) else "0"

        def edit(written: str) -> str:
            head, *rows = written.replace("\r\n", "\n").splitlines()
            tail = [",".join([head, *extra]), *(",".join([row, *[text] * len(extra)]) for row in rows)]
            return "\n".join([*tail, ""])

        return table(motion, "t q", {"t": "time", "q": names}, unit="deg", edit=edit, **own)

    rax, eax = numbered("rax_{}"), [f"eax_{letter}" for letter in "abcdef"]
    robax, extax = [f"robax/{name}" for name in rax], [f"extax/{name}" for name in eax]
    yield outer(made(341), rax, eax, long=True)
    yield outer(made(342), robax, extax, long=True)
    yield outer(made(343), [f"robax.{name}" for name in rax], [f"extax.{name}" for name in eax])
    yield table(
        made(344), "t q", {"t": "time", "q": [f"jointtarget.robax.{name}" for name in rax]}, unit="deg"
    )
    yield table(made(345), "q", {"q": rax}, unit="deg", writer=SEMICOLON)


LEROBOT = ["shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll"]


def lists(values: FloatArray) -> Column:
    return [str([float(one) for one in row]) for row in np.round(values, 6)]


def episode(seed: int, writer: Writer = PANDAS, **names: str) -> Stranger:
    """Return an episode of LeRobot: six numbers in a cell, state and action, then counters."""
    motion = made(seed)
    motion, ahead = followed(replace(motion, t=times(200, 0.05)))
    names = {"state": "observation.state", "action": "action", **names}
    index = np.arange(200)
    columns: list[Column] = [
        lists(ahead), lists(motion.q), motion.t, index, 0 * index, index + 400, 0 * index,
    ]  # fmt: skip
    header = [
        names["action"], names["state"], "timestamp", "frame_index", "episode_index", "index", "task_index",
    ]  # fmt: skip
    text = writer.text(header, columns)
    own = table(motion, "t q", q_within=1e-6, answers=(ahead,))
    return replace(own, files={"episode_000000.csv": text.encode()})


@strangers
def names_of_lerobot() -> Iterator[Stranger]:
    yield episode(351)
    yield episode(352, SEMICOLON)
    yield episode(353, QUOTED)
    for k, suffix in enumerate((".pos", "", ".pos")):
        names = {"t": "timestamp", "q": suffixed(LEROBOT, suffix), "gripper": f"gripper{suffix}"}
        motion = made(354 + k, 5)
        both = np.column_stack((motion.q, motion.gripper))
        yield table(
            motion, "t q gripper", names, writer=(CSV, TABS, PANDAS)[k], answers=(both,),
            unit="deg" if k else "rad",
        )  # fmt: skip
    state = suffixed([f"observation.state.{name}" for name in LEROBOT], ".pos")
    yield table(made(357, 5), "t q", {"t": "timestamp", "q": state})
    motion, ahead = followed(made(359, 5))
    flat = [f"{kind}.{name}.pos" for kind in ("action", "observation.state") for name in LEROBOT]
    yield other(motion, flat, np.column_stack((ahead, motion.q)), answers=(ahead,), writer=TABS)
    yield table(
        made(358, 5), "t q", {"t": "timestamp", "q": [f"main_{name}" for name in LEROBOT]}, writer=SEMICOLON
    )


@strangers
def names_of_interbotix() -> Iterator[Stranger]:
    five = [name for name in WX if name != "forearm_roll"]
    yield table(made(361), "t q gripper", {"t": "time", "q": WX, "gripper": "gripper"}, writer=TABS)
    yield table(made(362, 5), "t q", {"t": "time", "q": five}, writer=SEMICOLON)
    yield table(made(363), "t q", {"t": "time", "q": suffixed(WX, "_position")}, writer=PANDAS)

    motion = made(364)
    fingers = np.column_stack((motion.q, 20 * motion.gripper, motion.gripper / 2, -motion.gripper / 2))
    yield other(motion, [*WX, "gripper", "left_finger", "right_finger"], fingers)
    names = [
        f"/wx250s/joint_states/{name}/position" for name in [*WX, "gripper", "left_finger", "right_finger"]
    ]
    yield other(motion, names, fingers, writer=QUOTED)


@strangers
def units_inside_names() -> Iterator[Stranger]:
    for k, (pattern, unit, writer) in enumerate(
        [
            ("q_rad_{}", "rad", CSV),
            ("joint{}_deg", "deg", SEMICOLON),
            ("q_{}_rad_", "rad", TABS),
            ("pos_deg_J{}", "deg", COMMA),
            ("J{} [deg]", "deg", GERMAN),
            ("joint_{}(rad)", "rad", QUOTED),
            ("angle_deg_{}", "deg", FIXED),
            ("A{}_rad", "rad", SAVETXT),
            ("deg_q{}", "deg", PANDAS),
            ("joint_{}_position_rad", "rad", SIX),
        ]
    ):
        yield table(made(371 + k), "t q", {"t": "time_s", "q": pattern}, unit=unit, writer=writer)
    ms = unit_clock(1e-3, whole=True)
    yield table(
        made(390), "t q qd", {"t": "time_ms", "q": "q_rad_{}", "qd": "qd_rad_s_{}"}, clock=ms, writer=TABS,
        t_within=1e-3,
    )  # fmt: skip
    yield table(
        of_robot("ur5e", times(100, 0.05), 391), "t q tip",
        {"t": "t_s", "q": "q{}_deg", "tip": ("x_m", "y_m", "z_m")}, unit="deg", robot="ur5e",
    )  # fmt: skip
