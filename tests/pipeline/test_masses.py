"""What a person is warned of in the masses of an arm."""

from __future__ import annotations

from urmpipe_models.chains.chain import Chain, Joint
from urmpipe_pipeline.joint_log import LogWarning
from urmpipe_pipeline.masses import mass_notices


def test_links_whose_masses_are_left_out_are_named() -> None:
    joints = (Joint("j"),)
    assert mass_notices(Chain("arm", joints)) == []
    assert mass_notices(Chain("arm", joints, left_out=("finger",))) == [
        LogWarning("mass-left-out", "the mass of finger is left out: this link moves by a joint of its own")
    ]
    assert mass_notices(Chain("arm", joints, left_out=("left", "right"))) == [
        LogWarning(
            "mass-left-out",
            "the masses of left, right are left out: these links move by joints of their own",
        )
    ]
