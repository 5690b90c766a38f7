"""Which meshes can be drawn, and what is told of those that cannot."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from urmpipe_models.arm.chain import Box, Chain, Joint, Mesh, Visual
from urmpipe_models.math3d import translation
from urmpipe_models.robots.toml import chain_from_dict, chain_to_dict
from urmpipe_models.robots.urdf import read_urdf
from urmpipe_pipeline.joint_log import LogWarning
from urmpipe_pipeline.presentation.meshes import is_drawable, mesh_warnings
from urmpipe_pipeline.runs.ingest import tcp_motion


def test_one_warning_tells_of_all_meshes_that_are_missing(tmp_path: Path) -> None:
    there = tmp_path / "there.STL"
    there.write_bytes(b"solid")
    (tmp_path / "folder.stl").mkdir()
    (tmp_path / "picture.png").write_bytes(b"")
    files = [there, tmp_path / "gone.stl", tmp_path / "gone.stl", tmp_path / "folder.stl"]
    meshes = [Mesh(str(file)) for file in [*files, tmp_path / "picture.png", "package://gone/a.dae"]]
    visuals = (Visual(None, Box((1.0, 1.0, 1.0))), *(Visual(None, mesh) for mesh in meshes))
    robot = Chain("arm", (Joint("j"),), visuals=visuals)
    assert mesh_warnings(robot) == [
        LogWarning(
            "visual-missing",
            f"4 of 5 mesh files of robot arm cannot be drawn, the first {tmp_path / 'gone.stl'}:"
            " solids stand for the links; allowed: .stl, .obj, .glb, .gltf, .dae files that are there",
        )
    ]
    assert mesh_warnings(replace(robot, visuals=visuals[:2])) == []
    assert tcp_motion(robot, *(np.zeros((1, 1)),) * 3)[1] == mesh_warnings(robot)


def test_a_mesh_that_the_description_may_not_take_is_told_and_not_drawn(tmp_path: Path) -> None:
    (tmp_path / "my arm").mkdir()
    (tmp_path / "secret.stl").write_bytes(b"solid")
    (tmp_path / "my arm" / "arm.urdf").write_text(
        "<robot name='arm'><link name='b'><visual><geometry><mesh filename='../secret.stl'/></geometry>"
        "</visual></link><link name='e'/><joint name='j' type='continuous'><parent link='b'/>"
        "<child link='e'/></joint></robot>"
    )
    robot = read_urdf(tmp_path / "my arm" / "arm.urdf")
    for one in (robot, chain_from_dict(chain_to_dict(robot))):  # as a recording keeps it
        assert not any(map(is_drawable, one.visuals))
        assert mesh_warnings(one) == [
            LogWarning(
                "visual-missing",
                "1 of 1 mesh files of robot arm are outside its folder and not drawn, the first"
                f" {tmp_path}/my arm/../secret.stl: solids stand for the links; allowed: files in the folder"
                " of its description, in ROS packages around it, and in folders of ROS_PACKAGE_PATH",
            )
        ]


@pytest.mark.parametrize(
    ("document", "whole"),
    [
        ({"buffers": [{"uri": "data:application/octet-stream;base64,AA=="}]}, True),
        ({"buffers": [{"uri": "arm.bin"}]}, False),
        ({"images": [{"uri": "arm.png"}]}, False),
        ([], False),
        ({"buffers": None}, False),
    ],
)
def test_a_gltf_that_needs_other_files_is_not_drawn(document: object, whole: bool, tmp_path: Path) -> None:
    path = tmp_path / "arm.gltf"
    path.write_text(json.dumps(document), encoding="utf-8")
    assert is_drawable(Visual(None, Mesh(str(path)), translation(0.0, 0.0, 0.0))) is whole


def test_a_gltf_of_many_brackets_or_of_no_text_is_not_drawn(tmp_path: Path) -> None:
    path = tmp_path / "arm.gltf"
    for content in (b"[" * 100_000, b'{"buffers":' * 100_000, b"\xff\xfe", b"9" * 5000):
        path.write_bytes(content)
        assert not is_drawable(Visual(None, Mesh(str(path))))
