"""Robot files are the same chain after a round trip. toml.cases has their meaning and errors."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.strategies import SearchStrategy

from urmpipe_models.arm.chain import Chain
from urmpipe_models.math3d import Transform, rotation_x
from urmpipe_models.robots.catalogue import load_robot, robot_names
from urmpipe_models.robots.toml import chain_from_dict, chain_to_dict, read_robot_file, robot_toml


def bits(chain: Chain) -> str:
    """Every number of frames, joints, masses and drives: == takes 0.0 and -0.0 for the same."""
    frames = [(frame.translation, frame.rotation) for frame in chain.frames]
    joints = [replace(joint, origin=Transform()) for joint in chain.joints]
    return repr((chain.start, frames, joints, chain.gravity, chain.inertials, chain.drives))


@pytest.mark.slow
@settings(max_examples=80, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_round_trip_of_bits(heavy_chains: SearchStrategy[Chain], data: st.DataObject, tmp_path: Path) -> None:
    chain = data.draw(heavy_chains)
    path = tmp_path / f"{chain.name or 'x'}.toml" if chain.name.isalnum() else tmp_path / "x.toml"
    path.write_text(robot_toml(chain), encoding="utf-8", newline="\n")
    of_json = json.loads(json.dumps(chain_to_dict(chain), allow_nan=False))  # infinities are null
    for back in (read_robot_file(path), chain_from_dict(of_json)):
        assert (back, bits(back), back.parameters) == (chain, bits(chain), chain.parameters)


@pytest.mark.parametrize("name", robot_names())
def test_a_toml_file_keeps_the_parameters(tmp_path: Path, name: str) -> None:
    chain = load_robot(name).placed(tool=Transform(rotation_x(0.5).rotation, (0.1, 0.2, 0.3)))
    chain = chain.with_parameters({"tool.rx": 0.25, chain.parameters[6].name: 0.4})
    path = tmp_path / f"{name}.toml"
    path.write_text(robot_toml(chain), encoding="utf-8")
    back = read_robot_file(path)
    assert (back, back.parameters) == (chain, chain.parameters)
