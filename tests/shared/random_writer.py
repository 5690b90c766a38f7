"""Random logs as laboratories write them, each with its truth. `make_log(seed)` knows nothing of the reader.

1. Words: units, names of joints, words of sides, recorded poses, times.
2. Motion: an arm of the catalogue, a SCARA, a planar arm; smooth joint values or poses; a clock.
3. Columns: the clock, joints with sides, rates and efforts, a recorded pose, others; the text of each cell.
4. Table: topics, episodes, damage; header, delimiter, decimal sign, encoding; Parquet, workbooks, JSON.
5. Truth: what the text says, in SI by the number of the column, times exact in [ns].

A log is well written if names and units of joints and clock are in it and no row is damaged; else `unsaid`
lists what is not.
"""

from __future__ import annotations

import contextlib
import gzip
import io
import json
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime, timedelta
from decimal import Decimal
from typing import Any

import numpy as np
import openpyxl
import pyarrow as pa
from pyarrow import parquet
from scipy.spatial.transform import Rotation

from urmpipe_models.arm.chain import Chain, Joint
from urmpipe_models.kinematics.forward import poses_over_log
from urmpipe_models.math3d import Transform, from_xyz_rpy, to_quaternions
from urmpipe_models.robots.catalogue import load_robot

# 1. Words

FACTOR = {"rad": 1.0, "deg": math.pi / 180, "m": 1.0, "mm": 1e-3, "cm": 1e-2, "": 1.0}
NS = {"s": 10**9, "ms": 10**6, "us": 10**3, "ns": 1}
WRITTEN = {
    "rad": "rad rad Rad radians", "deg": "deg deg ° Grad degrees DEG", "m": "m m meter", "mm": "mm",
    "cm": "cm", "s": "s s sec seconds", "ms": "ms ms msec", "us": "us µs", "ns": "ns",
}  # fmt: skip
FAMILIES = """q#, qd#, tau#; q_#, dq_#, tau_#; q[#], dq[#], tau[#]; q(#), qd(#), tau(#); J#, J#_vel, J#_torque
joint_#, joint_#_velocity, joint_#_torque; j#, j#_v, j#_i; joint#_pos, joint#_vel, joint#_eff; A#, A#_v, A#_M
Joint #, Joint # Velocity, Joint # Torque; Axis#, Axis#Speed, Axis#Torque; theta_#, omega_#, tau_#
axis_#_position, axis_#_velocity, axis_#_current; theta#, theta#_dot, torque#; phi#, phid#, M#
Achse #, Geschwindigkeit Achse #, Moment Achse #; Gelenk#, Gelenk#_Geschwindigkeit, Gelenk#_Moment
Gelenkwinkel_#, Winkelgeschw_#, Strom_#; Achswinkel#, Achsgeschwindigkeit#, Achsmoment#
/joint_states/position[#], /joint_states/velocity[#], /joint_states/effort[#]; @, @_vel, @_eff; Q#, QD#, TAU#
/joint_states/@/position, /joint_states/@/velocity, /joint_states/@/effort; position.#, velocity.#, effort.#
field.position#, field.velocity#, field.effort#; state.q[#], state.dq[#], state.tau_J[#]; @.pos, @.vel, @.tau
m_q#, m_dq#, m_tau#; joint_positions_#, joint_velocities_#, joint_torques_#; q.#, qd.#, tau.#; robax.rax_#, ,
jointAngle#, jointSpeed#, jointLoad#; qpos_#, qvel_#, qfrc_#; Pos J#, Vel J#, Trq J#; pos_#, vel_#, torque_#
th#, thd#, tq#; AxisPos#, AxisVel#, AxisTrq#; joint# angle, joint# rate, joint# current
angle_#, speed_#, current_#; Position|J#, Velocity|J#, Torque|J#; pos|Joint #, vel|Joint #, eff|Joint #"""
WORDS = {3: "shoulder elbow wrist", 4: "turn arm lift roll", 7: "S L E U R B T"}
WORDS[6] = "base shoulder elbow wrist1 wrist2 wrist3"
SIDES = """actual/target measured/commanded meas/cmd act/ref ist/soll fb/set feedback/command actual/desired
/cmd state/goal real/planned actual/setpoint measured/reference Istwert/Sollwert /target"""
HARD_SIDES = "act/dem follower/leader robot/sim raw/filtered /d 1/2 left/right"
POSES = """vector: #x #y #z #rotvec_x #rotvec_y #rotvec_z; rpy: #x #y #z #roll #pitch #yaw; : #x #y #z
zyx: #X #Y #Z #A #B #C; quat_xyzw: #x #y #z #qx #qy #qz #qw; zyx: #x #y #z #yaw #pitch #roll
quat_wxyz: #x #y #z #qw #qx #qy #qz; matrix: #x #y #z #r11 #r12 #r13 #r21 #r22 #r23 #r31 #r32 #r33
quat_xyzw: #position.x #position.y #position.z #orientation.x #orientation.y #orientation.z #orientation.w"""
HARD_POSES = """rpy: #X #Y #Z #W #P #R; vector: #x #y #z #rx #ry #rz; xyz: #x #y #z #rx #ry #rz
zyx: #x #y #z #rz #ry #rx; quat_wxyz: #x #y #z #q1 #q2 #q3 #q4
vector: #pose_0 #pose_1 #pose_2 #pose_3 #pose_4 #pose_5"""
TIMES = "t time Time timestamp Timestamp Zeit stamp TIME elapsed time_stamp"
CLOCKS = """s s s s s s ms ms us ns uptime epoch_s epoch_ms epoch_ns %Y-%m-%d_%H:%M:%S.%f %Y-%m-%dT%H:%M:%S.%f
%Y-%m-%dT%H:%M:%S.%fZ %d.%m.%Y_%H:%M:%S.%f %m/%d/%Y_%H:%M:%S.%f %H:%M:%S.%f two stamps duration"""
STAMPS = "sec nsec; secs nsecs; header.stamp.sec header.stamp.nanosec"
DAMAGE = "short long text cut swapped spike zeros repeated-row repeated-stamp"


def split(text: str) -> list[str]:
    """Return the parts of a text between semicolons or line ends."""
    return [part.strip() for part in re.split("[;\n]", text)]


@dataclass
class Column:
    """A column: its name without unit, what it is, its cells, its true unit, its joint or axis."""

    name: str
    role: str
    cells: list[str]
    unit: str = ""
    index: int = 0
    is_unit_written: bool = True


@dataclass
class Truth:
    """What a log says, by the number of each column, in SI; `rotation` are quaternions x, y, z, w."""

    names: dict[str, list[str]]  # of the columns, by what they are
    joints: dict[int, np.ndarray]
    t_ns: list[int] | None
    sides: dict[int, np.ndarray] = field(default_factory=dict)  # commanded and the like
    rates: dict[int, np.ndarray] = field(default_factory=dict)
    position: np.ndarray | None = None
    rotation: np.ndarray | None = None
    masks: list[np.ndarray] = field(default_factory=list)  # rows of a topic, of an episode
    damaged_lines: list[int] = field(default_factory=list)
    answers: dict[str, Any] = field(default_factory=dict)  # values of placeholders
    tick: int = 1  # what a double of the clock rounds to, in [ns]


@dataclass
class Log:
    """A log as the bytes of a file, with its arm and its truth."""

    seed: int
    name: str
    data: bytes
    chain: Chain
    truth: Truth
    unsaid: list[str]
    kinds: list[str]


def make_log(seed: int) -> Log:
    """Return the log of a seed."""
    return _Writer(seed).log()


class _Writer:
    def __init__(self, seed: int) -> None:
        self.seed, self.random = seed, np.random.default_rng(seed)
        self.unsaid: list[str] = []
        self.kinds: list[str] = []
        self.words: dict[str, str] = {}
        self.form = ""

    def chance(self, share: float) -> bool:
        return bool(self.random.random() < share)

    def pick(self, options: str | Sequence[Any]) -> Any:
        options = options.split() if isinstance(options, str) else options
        return options[int(self.random.integers(len(options)))]

    def leave_out(self, share: float, what: str) -> bool:
        """Return whether something is not written, which makes a log a hard one."""
        if self.is_well or not self.chance(share):
            return False
        self.unsaid.append(what)
        return True

    def numbers(self, values: np.ndarray, style: str) -> list[str]:
        return [repr(float(value)) if style == "repr" else style % value for value in values]

    def log(self) -> Log:
        self.is_well = self.chance(0.5)
        self.is_poses = self.leave_out(0.08, "poses")
        self.move()
        clock, joints, pose = self.clock(), self.joint_columns(), self.pose_columns()
        if {c.name for c in joints} & {c.name for c in pose}:
            pose = []
        columns = [*clock, *joints, *pose] if self.chance(0.8) else [*clock, *pose, *joints]
        for other in self.other_columns():
            first = 0 if self.chance(0.2) else len(clock)
            columns.insert(int(self.random.integers(first, len(columns) + 1)), other)
        masks: list[np.ndarray] = []
        if pose and clock and self.leave_out(0.1, "topics"):
            masks = self.topics(columns, pose)
        elif clock and clock[0].role == "time" and self.leave_out(0.06, "episodes"):
            masks = self.episodes(columns, clock)
        elif self.chance(0.1):
            self.kinds.append("missing")
            for column in columns:
                if column.role in ("joint", "position", "rate") and self.chance(0.3):
                    column.cells[int(self.random.integers(1, self.n - 1))] = "NaN"
        return self.table(
            columns, [list(row) for row in zip(*(c.cells for c in columns), strict=True)], masks
        )

    # 2. Motion

    def move(self) -> None:
        most = 400 if self.chance(0.9) else 3000
        self.n = int(math.exp(self.random.uniform(math.log(30), math.log(most))))
        self.step = int(self.pick([1e6, 2e6, 4e6, 5e6, 8e6, 8e6, 10e6, 12e6, 20e6, 50e6, 100e6]))
        self.robot = self.pick("ur5e ur3 ur10e panda iiwa14 arm6 articulated6r urm6 ur5 SCARA planar")
        kinds = {"SCARA": "revolute revolute prismatic revolute", "planar": "revolute revolute revolute"}
        if self.robot in kinds:
            made = [
                Joint(f"j{k + 1}", kind, from_xyz_rpy((0.3 * (k in (1, 2)), 0.0, 0.1), (0.0, 0.0, 0.0)))  # type: ignore[arg-type]
                for k, kind in enumerate(kinds[self.robot].split())
            ]
            self.chain = Chain(self.robot, tuple(made), from_xyz_rpy((0.1, 0.0, 0.0), (0.0, 0.0, 0.0)))
        else:
            self.chain = load_robot(self.robot)
        self.joints = [joint for joint in self.chain.joints if joint.kind != "fixed"]
        slides = self.slides = np.array([joint.kind == "prismatic" for joint in self.joints])
        if self.is_poses:
            self.n = min(self.n, 120)
        t = np.arange(self.n) * self.step
        if self.chance(0.3):
            t += (self.random.normal(0, 0.05, self.n).clip(-0.4, 0.4) * self.step).astype(np.int64)
        for _ in range(self.pick([0, 0, 0, 1, 3])):
            t[int(self.random.integers(1, self.n)) :] += int(self.step * self.random.uniform(2, 30))
        self.t = t - t[0]
        s, scale = self.t[:, np.newaxis] / 1e9, np.where(slides, 0.1, self.pick([0.05, 0.5, 1.0, 1.0, 1.0]))
        scale *= self.random.random(len(slides)) < 0.95  # else the joint rests
        middle = np.array(
            [0.5 * (j.lower + j.upper) if math.isfinite(j.lower + j.upper) else 0.0 for j in self.joints]
        )
        room = np.array([max(min(j.upper - j.lower, 6.0) / 2 - 1.0, 0.0) for j in self.joints])
        place = np.where(slides, 0.2, middle + self.random.uniform(-1, 1, len(slides)) * room)
        self.q, self.qd = np.tile(place, (self.n, 1)), np.zeros((self.n, len(slides)))
        for rates, phases in zip(
            self.random.uniform(0.3, 2.5, (3, len(slides))),
            self.random.uniform(0, 6, (3, len(slides))),
            strict=True,
        ):
            self.q += 0.3 * scale * np.sin(rates * s + phases)
            self.qd += 0.3 * scale * rates * np.cos(rates * s + phases)
        if self.is_poses:
            self.q = np.where(
                slides,
                self.random.uniform(0, 0.3, self.q.shape),
                self.random.uniform(-2.5, 2.5, self.q.shape),
            )
        elif self.chance(0.1):  # joint 1 turns on, and all are wrapped
            self.q[:, :1] += 2.0 * s
            self.qd[:, 0] += 2.0
            self.q = np.where(slides, self.q, (self.q + math.pi) % (2 * math.pi) - math.pi)

    # 3. Columns

    def clock(self) -> list[Column]:
        kind = (
            "none"
            if self.is_poses or self.leave_out(0.25, "no clock")
            else self.pick(CLOCKS).replace("_%H", " %H")
        )
        self.kinds.append(f"clock {kind}")
        start = (
            int(self.random.integers(1_500_000_000_000_000_000, 1_750_000_000_000_000_000)) // 10**6 * 10**6
        )
        name = self.pick(TIMES)
        if kind == "none":
            return []
        if "%" in kind or kind == "two":
            dates = [
                datetime.fromtimestamp(start // 10**9, UTC) + timedelta(microseconds=int(v) // 1000)
                for v in self.t
            ]
            dates = [date.replace(day=20) for date in dates] if kind[1] in "dm" else dates
            name = self.pick("timestamp date datetime Zeitstempel time Time")
            forms = (
                {name: kind}
                if kind != "two"
                else dict(
                    zip(
                        self.pick([("Date", "Time"), ("date", "time"), ("Datum", "Uhrzeit")]),
                        ("%Y-%m-%d", "%H:%M:%S.%f"),
                        strict=True,
                    )
                )
            )
            return [
                Column(name, "time", [date.strftime(form) for date in dates], "date")
                for name, form in forms.items()
            ]
        if kind == "stamps":
            parts = [divmod(int(v) + start, 10**9) for v in self.t]
            names = self.pick(split(STAMPS)).split()
            return [
                Column(names[k], "time", [str(part[k]) for part in parts], ("s", "ns")[k], 0, False)
                for k in (0, 1)
            ]
        unit = kind.split("_")[-1] if kind not in ("uptime", "duration") else "s"
        if kind.startswith("epoch"):
            name = self.pick("timestamp __time Time stamp unix_time")
        if kind == "duration":
            name, unit = self.pick("dt delta_t duration"), self.pick("s ms")
        shift = start if kind.startswith("epoch") else start // 10**6 if kind == "uptime" else 0
        ticks = [0, *np.diff(self.t)] if kind == "duration" else self.t + shift
        cells = [f"{Decimal(int(v)).scaleb(-round(math.log10(NS[unit]))):f}" for v in ticks]
        if kind == "s" and self.step >= 5e6 and self.chance(0.5):
            cells = [f"{float(cell):.{self.pick([3])}f}" for cell in cells]
            cells = cells if len(set(cells)) == self.n else [f"{Decimal(int(v)).scaleb(-9):f}" for v in ticks]
        return [
            Column(
                name,
                "duration" if kind == "duration" else "time",
                cells,
                unit,
                0,
                not self.leave_out(0.3, "time unit"),
            )
        ]

    def joint_columns(self) -> list[Column]:
        family = [name.strip() for name in self.pick(split(FAMILIES)).split(",")]
        count, names = len(self.joints), [joint.name for joint in self.joints]
        first = 0 if re.search(r"[\[.]", family[0]) or self.chance(0.15) else 1
        if self.leave_out(0.1, "names in words"):
            names, family = WORDS[count].split(), ["@", "@_vel", "@_torque"]
        self.kinds.append(f"names {family[0]}")
        angle, style = self.pick("rad deg"), self.pick("repr repr %.6f %.9f %.4f %.12g %.8e %+.4e")
        units = [self.pick("mm mm m m cm") if slides else angle for slides in self.slides]
        is_written = not self.leave_out(0.5, "joint unit")
        if self.slides.any() and not is_written:
            self.unsaid.append("slide unit")
        measured, commanded = "", None
        if self.chance(0.3):
            measured, commanded = self.pick(HARD_SIDES if self.leave_out(0.2, "sides") else SIDES).split("/")
            self.kinds.append(f"sides {measured}/{commanded}")
        place = self.pick(["{s}_{n}", "{n}_{s}", "{s}.{n}", "{n} {s}"])
        place = "/{s}{n}" if "/" in family[0] else "{s} {n}" if "|" in family[0] else place

        def group(template: str, role: str, values: np.ndarray, side: str, per: str = "") -> list[Column]:
            bare = [template.replace("#", str(first + k)).replace("@", names[k]) for k in range(count)]
            full = [place.format(s=side, n=name) if side else name for name in bare]
            cells = [self.numbers(values[:, k] / FACTOR[unit], style) for k, unit in enumerate(units)]
            return [
                Column(full[k], role, cells[k], unit + per, k, is_written) for k, unit in enumerate(units)
            ]

        groups = [group(family[0], "joint", self.q, measured)]
        if commanded is not None:
            late = np.vstack([self.q[2:], self.q[-1:], self.q[-1:]]) + self.random.normal(
                0, 1e-4, self.q.shape
            )
            groups.append(group(family[0], "side", late, commanded))
        if family[1] and self.chance(0.3) and not self.is_poses:
            groups.append(group(family[1], "rate", self.qd, measured, "/s"))
        if family[1] and self.chance(0.2):
            unit = "A" if re.search("(?i)current|strom|_i$", family[2]) else "Nm"
            efforts = group(family[2], "other", self.random.normal(0, 0.5, self.q.shape).cumsum(0), measured)
            groups.append([replace(column, unit=unit) for column in efforts])
        if self.chance(0.3):
            groups = [groups[k] for k in self.random.permutation(len(groups))]
        if self.chance(0.1):
            groups = [list(some) for some in zip(*groups, strict=True)]  # q1, qd1, q2, qd2, ...
        return [column for some in groups for column in some]

    def pose_columns(self) -> list[Column]:
        if not self.chance(0.35):
            return []
        poses = HARD_POSES if self.leave_out(0.4, "form of orientation") else POSES
        form, text = (part.strip() for part in self.pick(split(poses)).split(":"))
        prefix = self.pick(["", "tcp_", "ee_", "TCP ", "tool_", "actual_TCP_", "pose."])
        self.kinds.append(f"pose {form} {prefix}")
        moved = [
            from_xyz_rpy(tuple(self.random.normal(0, 0.3, 3)), tuple(self.random.normal(0, 1, 3)))
            for _ in "bt"
        ]
        base, tool = moved if self.chance(0.4) else (Transform(), Transform())
        position, matrix = poses_over_log(replace(self.chain, base=base, tool=tool), self.q)
        turn = Rotation.from_matrix(matrix)
        length, angle, style = (
            self.pick("m m mm mm cm"),
            self.pick("rad deg"),
            self.pick("repr %.9f %.6f %.10g"),
        )
        is_written = not self.leave_out(0.4, "pose unit")
        if form.startswith("quat") or form in ("matrix", ""):
            rows = turn.as_quat()[:, [3, 0, 1, 2] if form == "quat_wxyz" else [0, 1, 2, 3]]
            rows, angle = (matrix.reshape(-1, 9) if form == "matrix" else rows), ""
        else:
            angle = "rad" if form == "vector" else angle
            rows = (
                turn.as_rotvec()
                if form == "vector"
                else turn.as_euler("xyz" if form == "rpy" else form.upper())
            )
        self.form, columns = form, []
        for k, name in enumerate(text.split()):
            values = position[:, k] / FACTOR[length] if k < 3 else rows[:, k - 3] / FACTOR[angle]
            role, unit = ("position", length) if k < 3 else ("rotation", angle)
            columns.append(
                Column(
                    name.replace("#", prefix),
                    role,
                    self.numbers(values, style),
                    unit,
                    k % 3 if k < 3 else k - 3,
                    is_written,
                )
            )
        return columns

    def other_columns(self) -> list[Column]:
        noise, ones = self.random.normal(0, 1, self.n), np.ones(self.n)
        flag, word, first = self.pick("1 True true"), self.pick("AUTO T1 running"), self.pick([0, 1, 4711])
        options = [
            Column("temperature", "other", self.numbers(35 + 0.01 * noise.cumsum(), "%.2f"), "°C"),
            Column("gripper", "other", [str(int(v)) for v in np.arange(self.n) // (self.n // 3 + 1) % 2]),
            Column("mode", "other", [word] * self.n),
            Column(
                self.pick(["seq", "counter", "frame", "index", "Unnamed: 0"]),
                "other",
                [str(k + first) for k in range(self.n)],
            ),
            Column("voltage", "other", self.numbers(48 + 0.05 * noise, "%.3f"), "V"),
            Column("Fz", "other", self.numbers(3 * noise, "%.3f"), "N"),
            Column("valid", "other", [flag] * self.n),
            Column("speed_scaling", "other", self.numbers(ones, "%.1f")),
        ]
        return [options[k] for k in self.random.permutation(len(options))[: self.pick([0, 0, 0, 1, 1, 2])]]

    # 4. Table

    def topics(self, columns: list[Column], pose: list[Column]) -> list[np.ndarray]:
        """Put the pose on rows of its own, at stamps between those of the joints."""
        mine = self.random.permutation(self.n) % 2 == 0
        mine[:2] = True, False
        for column in columns:
            if column.role not in ("time", "duration"):
                mask = mine != (column in pose)
                column.cells = [
                    cell if is_mine else "" for cell, is_mine in zip(column.cells, mask, strict=True)
                ]
        return [mine]

    def episodes(self, columns: list[Column], clock: list[Column]) -> list[np.ndarray]:
        half = self.n // 2
        for column in clock:
            column.cells = [column.cells[k % half if k < 2 * half else half] for k in range(self.n)]
        episode = np.minimum(np.arange(self.n) // half, 1)
        column = Column(self.pick("episode_index episode run"), "other", [str(v) for v in episode])
        columns.insert(int(self.random.integers(len(columns))), column)
        return [episode == 0, episode == 1]

    def damage(self, columns: list[Column], rows: list[list[str]], masks: list[np.ndarray]) -> list[int]:
        """Damage a row; return the rows where a reader may find it. The masks go with their rows."""
        if not self.leave_out(0.2, "damage"):
            return []
        kind, row = self.pick(DAMAGE), int(self.random.integers(5, len(rows) - 5))
        self.kinds.append(f"damage {kind}")
        numbers = [k for k, column in enumerate(columns) if column.role == "joint"]
        clocks = [k for k, column in enumerate(columns) if column.role == "time"]
        if kind == "short":
            del rows[row][numbers[-1]]
        elif kind == "long":
            rows[row].append(rows[row][numbers[0]])
        elif kind == "text":
            rows[row][self.pick(numbers)] = self.pick("ERR #N/A 1.2.3 -- 0.5x")
        elif kind == "cut":
            row = len(rows) - 1
            rows[row] = rows[row][: max(numbers[0] + 1, len(rows[row]) // 2)]
        elif kind == "swapped":
            rows[row], rows[row + 1] = rows[row + 1], rows[row]
            for mask in masks:
                mask[[row, row + 1]] = mask[[row + 1, row]]
        elif kind == "spike":
            column = self.pick(numbers)
            rows[row][column] = repr(1000.0 * _number(rows[row][column] or "0.1") + 1.0)
        elif kind == "zeros":
            rows[row] = ["0.0" if k in numbers else cell for k, cell in enumerate(rows[row])]
        elif kind == "repeated-row":
            rows[row + 1] = list(rows[row])
            for mask in masks:
                mask[row + 1] = mask[row]
        else:
            rows[row + 1] = [rows[row][k] if k in clocks else cell for k, cell in enumerate(rows[row + 1])]
        is_quiet = kind in ("spike", "zeros") or (
            not clocks and kind in ("swapped", "repeated-row", "repeated-stamp")
        )
        return [] if is_quiet else [row, row + 1, row + 2]

    def header(self, columns: list[Column], delimiter: str) -> tuple[list[str], list[str]]:
        """Return the names with their units, or both apart."""
        if self.leave_out(0.12, "header"):
            return [], []
        form = self.pick(["{n} [{u}]", "{n}[{u}]", "{n} ({u})", "{n}({u})", "{n}_{u}", "row"])
        self.kinds.append(f"units {form}")
        names, units = [], []
        for column in columns:
            unit, per = (column.unit.split("/") + [""])[:2]  # noqa: RUF005
            word = self.words.setdefault(unit, self.pick(WRITTEN.get(unit, unit or "-"))) + (
                "/s" if per else ""
            )
            if form == "{n}_{u}":
                word = (
                    {"°": "deg", "µs": "us", "°C": "C"}.get(word, word)
                    .replace("°", "deg")
                    .replace("/", "_per_")
                )
            is_written = column.is_unit_written and unit not in ("", "date")
            names.append(form.format(n=column.name, u=word) if is_written and form != "row" else column.name)
            units.append(word if is_written else "")
        if not delimiter.strip() and delimiter != "\t":
            names = [name.replace(" [", "[").replace(" (", "(").replace(" ", "_") for name in names]
            units = [unit or "-" for unit in units]
        return names, units if form == "row" and set(units) - {"", "-"} else []

    def table(self, columns: list[Column], rows: list[list[str]], masks: list[np.ndarray]) -> Log:
        has_empty, has_spaces = (
            any({"", "NaN"} & set(row) for row in rows),
            any(" " in cell for cell in rows[0]),
        )
        delimiter = self.pick(
            [",", ",", ",", ";", "\t", ", ", "|"] + ["  ", " "] * (not has_empty and not has_spaces)
        )
        header, units = self.header(columns, delimiter)
        damaged = self.damage(columns, rows, masks)
        truth = _truth(columns, rows, masks, self)
        if header and not damaged and self.chance(0.12):
            return self.other_format(rows, header, units, truth)
        empty = self.pick(["", "", "NaN", "nan", "null"])
        rows = [[empty if cell == "NaN" else cell for cell in row] for row in rows]
        if delimiter in (";", "\t") and self.chance(0.4):
            self.kinds.append("decimal comma")
            rows = [
                [re.sub(r"^([-+]?\d+|.*\d\d:\d\d:\d\d)\.(\d+(e[-+]\d+)?)$", r"\1,\2", cell) for cell in row]
                for row in rows
            ]
        trailing = delimiter if delimiter in (";", ",", "\t") and self.chance(0.05) else ""
        quote, quote_names = '"' * self.chance(0.1), '"' * (self.chance(0.15) and bool(delimiter.strip()))
        lines = [
            self.pick(["# recorded by lab 3", "% Robot log", "// run 7", "# date: 2024-05-06"])
        ] * self.chance(0.15)
        if header:
            mark = self.pick(["# ", "#", "%"]) if self.chance(0.07) and not quote_names else ""
            above = [name.rpartition("|")[0] for name in header]
            for some in ([above] if any(above) else []) + [[name.rpartition("|")[2] for name in header]]:
                lines.append(
                    mark + delimiter.join(f"{quote_names}{name}{quote_names}" for name in some) + trailing
                )
            lines += [delimiter.join(units) + trailing] * bool(units)
        truth.damaged_lines = [len(lines) + 1 + row for row in damaged]
        quoted = [
            [f"{quote}{cell}{quote}" if re.search("[A-Za-z]", cell) else cell for cell in row] for row in rows
        ]
        end = self.pick(["\n", "\n", "\n", "\r\n"])
        text = end.join([*lines, *(delimiter.join(row) + trailing for row in quoted)])
        text += end * ("damage cut" not in self.kinds and self.chance(0.9))
        encoding = self.pick(
            ["utf-8", "utf-8", "utf-8", "utf-8-sig", "utf-16"] + ["latin-1"] * (not text.isascii())
        )
        self.kinds += [f"delimiter {delimiter!r}", encoding]
        name = f"log{self.seed}.{self.pick('csv csv txt log')}"
        return Log(self.seed, name, text.encode(encoding), self.chain, truth, self.unsaid, self.kinds)

    def other_format(self, rows: list[list[str]], header: list[str], units: list[str], truth: Truth) -> Log:
        kind = self.pick("parquet xlsx jsonl csv.gz")
        self.kinds.append(kind)
        names = [
            f"{name} [{unit}]" if unit else name
            for name, unit in zip(header, units or [""] * len(header), strict=True)
        ]
        names = [name.replace("|", " ") for name in names]
        values = [[_value(cell) for cell in row] for row in rows]
        target = io.BytesIO()
        if kind == "parquet":
            parquet.write_table(
                pa.table({name: [row[k] for row in values] for k, name in enumerate(names)}), target
            )
        elif kind == "xlsx":
            book = openpyxl.Workbook(write_only=True)
            sheet = book.create_sheet("log")
            for row in (names, *values):
                sheet.append(row)
            book.save(target)
        elif kind == "jsonl":
            target.write(
                "".join(json.dumps(dict(zip(names, row, strict=True))) + "\n" for row in values).encode()
            )
        else:
            target.write(gzip.compress("\n".join(",".join(row) for row in (names, *rows)).encode()))
        truth.tick = {"csv.gz": 1, "xlsx": 1000}.get(kind, 300)  # of 1.7e9 s; openpyxl: 16 digits
        return Log(
            self.seed, f"log{self.seed}.{kind}", target.getvalue(), self.chain, truth, self.unsaid, self.kinds
        )


# 5. Truth


def _number(cell: str) -> float:
    try:
        return float(cell)
    except ValueError:
        return math.nan


def _value(cell: str) -> Any:
    if cell in ("", "NaN"):
        return None
    return int(cell) if re.fullmatch("-?[0-9]+", cell) else cell if math.isnan(_number(cell)) else float(cell)


def _stamp(columns: list[Column], cells: list[str]) -> int:
    """Return a time in integer [ns], from the text of its cells."""
    if columns[0].unit != "date":
        return int(
            sum(Decimal(cell) * NS[column.unit] for column, cell in zip(columns, cells, strict=True) if cell)
        )
    text = re.sub("[TZ]", " ", " ".join(cells))
    h, m, s, us = (int(v) for v in re.findall(r"(\d\d):(\d\d):(\d\d)\.(\d{6})", text)[0])
    days = 0
    for form in ("%Y-%m-%d", "%d.%m.%Y", "%m/%d/%Y"):
        with contextlib.suppress(ValueError):
            days = datetime.strptime(text[:10], form).toordinal()
    return ((((days * 24 + h) * 60 + m) * 60 + s) * 10**6 + us) * 1000


def _truth(columns: list[Column], rows: list[list[str]], masks: list[np.ndarray], writer: _Writer) -> Truth:
    by: dict[str, dict[int, np.ndarray]] = {
        role: {} for role in ("joint", "side", "rate", "position", "rotation")
    }
    for k in sorted(range(len(columns)), key=lambda k: columns[k].index):
        if (column := columns[k]).role in by:
            cells = np.array([_number(row[k]) if k < len(row) else math.nan for row in rows])
            by[column.role][k + 1] = cells * FACTOR[column.unit.split("/")[0]]
    clocks = [k for k, column in enumerate(columns) if column.role in ("time", "duration")]
    t: list[int] | None = None
    if clocks:
        t = [
            _stamp([columns[k] for k in clocks], [row[k] if k < len(row) else "" for k in clocks])
            for row in rows
        ]
        t = np.cumsum(t).tolist() if columns[clocks[0]].role == "duration" else t
    rotation = np.column_stack([*by["rotation"].values()]) if by["rotation"] else None
    joints = [str(k) for k in by["joint"]]
    names = {role: [column.name for column in columns if column.role == role] for role in by}
    units = {
        str(k + 1): column.unit for k, column in enumerate(columns) if column.unit in FACTOR and column.unit
    }
    return Truth(
        names, by["joint"], t, by["side"], by["rate"],
        np.column_stack([*by["position"].values()]) if by["position"] else None,
        None if rotation is None else to_quaternions(rotation, writer.form), masks,  # type: ignore[arg-type]
        answers={
            "joints": joints, "time": str(clocks[0] + 1) if clocks else "none", "period": writer.step / 1e9,
            "unit": units, "angle": next((units[k] for k in joints if units[k] in ("rad", "deg")), "rad"),
        },
    )  # fmt: skip
