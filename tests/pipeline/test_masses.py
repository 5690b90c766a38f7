"""What a person is warned of in the masses of an arm."""

from __future__ import annotations

from urmpipe_models.arm.chain import Chain, Joint
from urmpipe_models.drives import PassiveJoint
from urmpipe_pipeline.joint_log import LogWarning
from urmpipe_pipeline.runs.torques import mass_warnings, urdf_mass_warning


def test_links_whose_masses_are_left_out_are_named() -> None:
    joints = (Joint("j"),)
    assert mass_warnings(Chain("arm", joints)) == []
    assert mass_warnings(Chain("arm", joints, left_out=("finger",))) == [
        LogWarning(
            "mass-left-out", "the mass of finger is left out: this link moves by a joint outside the chain"
        )
    ]
    assert mass_warnings(Chain("arm", joints, left_out=("left", "right"))) == [
        LogWarning(
            "mass-left-out",
            "the masses of left, right are left out: these links move by joints outside the chain",
        )
    ]


def test_masses_that_are_not_used_say_why() -> None:
    robot = Chain("arm", (Joint("j"),), left_out=("finger",), mass_faults=("arm.urdf:3: link a: mass", "b"))
    words = "the masses of the robot are not used: arm.urdf:3: link a: mass; b"
    assert mass_warnings(robot) == [LogWarning("mass-fault", words)]


def test_what_a_urdf_does_not_hold_is_named() -> None:
    assert urdf_mass_warning(Chain("arm", (Joint("j"),))) == []
    drives = (PassiveJoint("j", 1.0, 0.0),)
    robot = Chain("arm", (Joint("j"),), gravity=(0.0, -9.81, 0.0), drives=drives, left_out=("finger",))
    words = "a URDF does not hold gravity [0.0, -9.81, 0.0] m/s2 and the drives and which masses are left out"
    assert urdf_mass_warning(robot) == [LogWarning("not-in-urdf", f"{words}: a TOML robot file does")]
