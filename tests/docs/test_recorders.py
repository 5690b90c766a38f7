"""The recorders of docs/recording-logs.md run, and what they write loads without an option or a warning.

Each runs as it stands in the page, against a stand-in for the simulator that has the functions it calls: two
joints at q1 = t^2, q2 = t / 7, every 50 ms.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from numpy.typing import NDArray

from urmpipe_pipeline.joint_log import PASSED_OVER, JointLog
from urmpipe_pipeline.logs import LogMap, read_log

PAGE = (Path(__file__).parents[2] / "docs" / "recording-logs.md").read_text(encoding="utf-8")
TIMES = 0.05 * np.arange(20)
VALUES = np.column_stack([TIMES * TIMES, TIMES / 7.0])
STAMP = 1_740_416_404


def snippets(heading: str, language: str) -> list[str]:
    """Return the code under a heading of the page."""
    section = PAGE.split(f"\n## {heading}\n")[1].split("\n## ")[0]
    return re.findall(rf"^```{language}\n(.*?)^```$", section, re.DOTALL | re.MULTILINE)


def read_plainly(path: Path) -> JointLog:
    """Read a log without any option; nothing may be assumed."""
    log = read_log([path])
    assert log.warnings == ()
    return log


def assert_the_motion(log: JointLog, names: tuple[str, ...] = ("q1", "q2"), last: int = 20) -> None:
    assert log.joints == names
    assert [log.units[name] for name in names] == ["rad", "rad"]
    np.testing.assert_array_equal(log.t_ns, np.rint(TIMES[:last] * 1e9))
    np.testing.assert_array_equal(log.q, VALUES[:last])  # every digit was written


def run_in(folder: Path, program: str, *arguments: str) -> None:
    """Run an interpreter that not every machine has."""
    found = shutil.which(program)
    if found is None:
        pytest.skip(f"{program} is not installed")
    done = subprocess.run([found, *arguments], cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


SIMULATOR = """
-- The main script: actuation moves the joints, sensing sees them moved, then the time goes on.
local step, count, joints = 0.05, 0, {['/arm/joint1'] = 1, ['/arm/joint2'] = 2}
local state = {0, 0}
local sim = {stringparam_scene_path = 13}
function sim.getStringParam(which) assert(which == 13) return '.' end
function sim.getObject(path) return assert(joints[path]) end
function sim.getJointPosition(joint) return assert(state[joint]) end
function sim.getSimulationTime() return count * step end
function sim.getSimulationTimeStep() return step end
package.preload['sim'] = function() return sim end
dofile('recorder.lua')
sysCall_init()
for k = 1, 19 do
    state = {(k * step) * (k * step), k * step / 7}
    sysCall_sensing()
    count = k
end
sysCall_cleanup()
"""


def test_the_lua_script_of_coppeliasim(tmp_path: Path) -> None:
    (code,) = snippets("CoppeliaSim, Lua", "lua")
    (tmp_path / "recorder.lua").write_text(code, encoding="utf-8")
    (tmp_path / "simulator.lua").write_text(SIMULATOR, encoding="utf-8")
    run_in(tmp_path, "lua5.4", "simulator.lua")
    assert_the_motion(read_plainly(tmp_path / "log.csv"))


class Simulator:
    """What the remote API of CoppeliaSim answers."""

    def __init__(self) -> None:
        self.calls: list[str] = []
        self.sample = 0

    def require(self, name: str) -> Simulator:
        assert name == "sim"
        return self

    def getObject(self, path: str) -> int:  # noqa: N802 (CoppeliaSim's names)
        return ["/arm/joint1", "/arm/joint2"].index(path)

    def getJointPosition(self, joint: int) -> float:  # noqa: N802
        return float(VALUES[self.sample, joint])

    def getSimulationTime(self) -> float:  # noqa: N802
        return float(TIMES[self.sample]) if self.sample < len(TIMES) else 10.0

    def step(self) -> None:
        self.sample += 1

    def setStepping(self, on: bool) -> None:  # noqa: N802
        self.calls.append(f"stepping {on}")

    def startSimulation(self) -> None:  # noqa: N802
        self.calls.append("start")

    def stopSimulation(self) -> None:  # noqa: N802
        self.calls.append("stop")


def module(name: str, monkeypatch: pytest.MonkeyPatch, **contents: Any) -> None:
    made = ModuleType(name)
    vars(made).update(contents)
    monkeypatch.setitem(sys.modules, name, made)


def test_the_python_script_of_coppeliasim(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    simulator = Simulator()
    module("coppeliasim_zmqremoteapi_client", monkeypatch, RemoteAPIClient=lambda: simulator)
    monkeypatch.chdir(tmp_path)
    (code,) = snippets("CoppeliaSim, Python", "python")
    exec(compile(code, "recording-logs.md", "exec"), {})
    assert_the_motion(read_plainly(tmp_path / "log.csv"))
    assert simulator.calls == ["stepping True", "start", "stop"]


def test_the_function_of_matlab(tmp_path: Path) -> None:
    function, _ = snippets("MATLAB", "matlab")
    (tmp_path / "write_log.m").write_text(function, encoding="utf-8")
    call = "t = 0.05 * (0:19); write_log('log.csv', t, [t .* t; t / 7]');"
    run_in(tmp_path, "octave-cli", "--no-init-file", "--eval", call)
    assert_the_motion(read_plainly(tmp_path / "log.csv"))


SIMLOG = """
t = 0.05 * (0:19)([1:10 10:20]); % the solver logged an event at row 10 twice
function values = in_unit(values, unit)
    assert(unit, 'rad');
end
first = t .* t; first(10) = 99;
second = t / 7; second(10) = -99;
simlog.Revolute_Joint.Rz.q.series = struct('time', t', 'values', @(unit) in_unit(first', unit));
simlog.Revolute_Joint1.Rz.q.series = struct('time', t', 'values', @(unit) in_unit(second, unit));
"""


def test_the_script_for_a_simscape_log(tmp_path: Path) -> None:
    function, script = snippets("MATLAB", "matlab")
    (tmp_path / "write_log.m").write_text(function, encoding="utf-8")
    (tmp_path / "record.m").write_text(f"1;\n{SIMLOG}\n{script}", encoding="utf-8")
    run_in(tmp_path, "octave-cli", "--no-init-file", "record.m")
    assert_the_motion(read_plainly(tmp_path / "log.csv"))


def messages() -> list[SimpleNamespace]:
    """What a driver publishes, and between it a gripper's own node."""
    published = []
    for k, (first, second) in enumerate(VALUES.tolist()):
        stamp = SimpleNamespace(sec=STAMP + k // 20, nanosec=k % 20 * 50_000_000)
        header = SimpleNamespace(stamp=stamp, frame_id="")
        arm = {"name": ["elbow_joint", "shoulder_joint"], "position": [second, first]}
        published.append(SimpleNamespace(header=header, velocity=[], effort=[], **arm))
        grip = {"name": ["finger_joint"], "position": [0.01]}
        published.append(SimpleNamespace(header=header, velocity=[], effort=[], **grip))
    return published


def test_the_node_of_ros_2(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    subscribed: list[tuple[str, Callable[[SimpleNamespace], None]]] = []

    class Node:
        def __init__(self, name: str) -> None:
            assert name == "joint_recorder"

        def create_subscription(
            self, kind: type, topic: str, callback: Callable[[SimpleNamespace], None], depth: int
        ) -> None:
            assert kind is JointState
            assert depth > 0
            subscribed.append((topic, callback))

    class JointState:
        pass

    def spin(node: Node) -> None:
        ((topic, callback),) = subscribed
        assert topic == "joint_states"
        for message in messages():
            callback(message)
        raise KeyboardInterrupt

    module("rclpy", monkeypatch, init=lambda: None, spin=spin)
    module("rclpy.executors", monkeypatch, ExternalShutdownException=type("Stopped", (Exception,), {}))
    module("rclpy.node", monkeypatch, Node=Node)
    module("sensor_msgs", monkeypatch)
    module("sensor_msgs.msg", monkeypatch, JointState=JointState)
    monkeypatch.chdir(tmp_path)
    (code,) = snippets("ROS 2", "python")
    exec(compile(code, "recording-logs.md", "exec"), {})
    log = read_plainly(tmp_path / "log.csv")
    assert_the_motion(log, ("shoulder_joint_position", "elbow_joint_position"))
    assert log.clock_start_ns == STAMP * 10**9


def test_the_echo_of_ros_2(tmp_path: Path) -> None:
    (command,) = snippets("ROS 2", "sh")
    assert command == "ros2 topic echo --csv /joint_states > log.csv\n"
    rows = [
        [m.header.stamp.sec, m.header.stamp.nanosec, "", *m.name, *m.position, "", ""]
        for m in messages()[::2]
    ]
    text = "".join(",".join(map(str, row)) + "\n" for row in rows)
    (tmp_path / "log.csv").write_text(text, encoding="utf-8")
    log = read_plainly(tmp_path / "log.csv")
    assert log.units["position.shoulder_joint"] == "rad"
    np.testing.assert_array_equal(log.t_ns, np.rint(TIMES * 1e9))
    shoulder = log.joints.index("position.shoulder_joint")
    np.testing.assert_array_equal(log.q[:, shoulder], VALUES[:, 0])


def test_the_log_at_the_top_of_the_page_loads(tmp_path: Path) -> None:
    lines = PAGE.splitlines()
    first = lines.index("    t [s],q1 [rad],q2 [rad]")
    (tmp_path / "log.csv").write_text("\n".join(line[4:] for line in lines[first : first + 3]) + "\n")
    log = read_plainly(tmp_path / "log.csv")
    q: NDArray[np.float64] = log.q
    assert q.tolist() == [[0.5, -0.25], [0.5021, -0.2478]]
    assert [b - a for a, b in pairwise(log.t_ns.tolist())] == [50_000_000]


def test_the_recipe_of_rtde_names_the_joints_and_the_tool_centre_point(tmp_path: Path) -> None:
    (recipe,) = snippets("Universal Robots, RTDE", "xml")
    names: list[str] = []
    for field in ElementTree.fromstring(recipe).iter("field"):
        name, count = field.attrib["name"], {"DOUBLE": 1, "VECTOR6D": 6}[field.attrib["type"]]
        names += [name] if count == 1 else [f"{name}_{k}" for k in range(count)]
    table = np.full((20, len(names)), 0.25)  # what stands still
    table[:, names.index("timestamp")] = 1234.5 + TIMES
    rates, joints = (names.index(f"actual_{what}_0") for what in ("qd", "q"))
    table[:, joints : joints + 2], table[:, rates : rates + 2] = VALUES, np.gradient(VALUES, 0.05, axis=0)
    np.savetxt(tmp_path / "monday.csv", table, "%.17g", header=" ".join(names), comments="")
    log = read_log([tmp_path / "monday.csv"])
    assert [one.kind for one in log.warnings] == [PASSED_OVER]  # target_q beside actual_q
    assert log.source == "ur-rtde"
    assert log.joints == tuple(f"actual_q_{k}" for k in range(6))
    np.testing.assert_array_equal(log.q[:, :2], VALUES)
    assert log.qd is not None
    assert (log.rotation_form, log.clock_start) == ("vector", 1234.5)
    target = read_log([tmp_path / "monday.csv"], LogMap(joints=tuple(f"target_q_{k}" for k in range(6))))
    assert np.unique(target.q).tolist() == [0.25]
