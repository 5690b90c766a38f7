"""What a URM arm is made from, read back from its chain."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from asserting import there
from urmpipe_models.chains.chain import Chain, Joint, Mimic
from urmpipe_models.chains.urm import ROUNDING, urm_chain, urm_geometry
from urmpipe_models.transform import Transform, from_offset, rotation_x, translation

lengths = st.floats(-2.0, 2.0)
tilts = st.floats(-3.14, 3.14) | st.sampled_from([0.0, math.pi / 2, -math.pi / 2, math.pi, -math.pi])
modules = st.lists(st.tuples(lengths, tilts, st.sampled_from([1.0, -1.0])), min_size=1, max_size=6)

ARM = urm_chain("two", (0.3, 0.2, 0.1), (0.5, -0.7), directions=(1, -1))


def test_name_start_and_words_go_into_the_chain() -> None:
    chain = urm_chain("two", (0.3, 0.2, 0.1), (0.5, -0.7), start=(1, 2), description="short", source="a test")
    assert (chain.name, chain.start) == ("two", (1.0, 2.0))
    assert (chain.description, chain.source) == ("short", "a test")
    bare = urm_chain("two", (0.3, 0.2, 0.1), (0.5, -0.7))
    assert (bare.start, bare.description, bare.source) == ((0.0, 0.0), "", "")


@settings(max_examples=30)
@given(modules, lengths)
def test_an_arm_tells_what_it_was_made_from_wherever_it_stands(
    given_modules: list[tuple[float, float, float]], last: float
) -> None:
    r, theta, directions = zip(*given_modules, strict=True)
    chain = urm_chain("arm", (*r, last), theta, directions=directions)
    frame = from_offset([0.1, 0.2, 0.3, 0.4, 0.5, 0.6])
    found = there(urm_geometry(chain.placed(frame, frame)))
    assert (found.lengths, found.directions) == ((*r, last), directions)
    turned = np.sin(np.subtract(found.tilts, theta) / 2.0)  # pi and -pi are one tilt
    np.testing.assert_allclose(turned, 0.0, rtol=0.0, atol=1e-15)  # of atan2 of a rounded sine and cosine


@pytest.mark.parametrize("tilt", [math.pi, -math.pi, np.nextafter(math.pi, 4.0)])
def test_a_tilt_of_half_a_turn_comes_back_as_pi(tilt: float) -> None:
    made = urm_chain("two", (0.3, 0.2, 0.1), (tilt, 0.5))
    found = there(urm_geometry(made))
    assert found.tilts == (math.pi, 0.5)
    again = urm_chain("two", *found[:2])
    assert urm_geometry(again) == found
    for one, other in zip(made.joints, again.joints, strict=True):
        np.testing.assert_allclose(one.origin.rotation, other.origin.rotation, rtol=0.0, atol=ROUNDING)


def changed(k: int, **what: object) -> Chain:
    """Return the arm with one joint changed."""
    joints = list(ARM.joints)
    joints[k] = replace(joints[k], **what)  # type: ignore[arg-type]
    return replace(ARM, joints=tuple(joints), start=())


@pytest.mark.parametrize(
    "chain",
    [
        changed(0, origin=translation(0.0, 0.0, 0.1)),  # the first module stands on the base
        changed(0, axis=(0.0, 0.6, 0.8)),
        changed(1, axis=(0.0, 1.0, 0.0)),
        changed(1, kind="prismatic"),
        changed(1, mimic=Mimic("phi1")),
        changed(1, origin=ARM.joints[1].origin @ rotation_x(0.1)),
        changed(2, origin=ARM.joints[2].origin @ translation(0.0, 1e-3, 0.0)),
        changed(2, kind="revolute"),
        replace(ARM, tip=translation(0.1, 0.0, 0.1)),
        replace(ARM, tip=ARM.tip @ rotation_x(0.1)),
        Chain("one", (Joint("phi1"),)),
    ],
)
def test_any_other_arm_is_none(chain: Chain) -> None:
    assert urm_geometry(ARM) is not None
    assert urm_geometry(chain) is None


def test_a_frame_may_be_rounded() -> None:
    def shifted(x: float) -> Chain:
        return replace(ARM, tip=Transform(translation=(x, 0.0, 0.1)))

    assert urm_geometry(shifted(ROUNDING)) == urm_geometry(ARM)
    assert urm_geometry(shifted(np.nextafter(ROUNDING, 1.0))) is None


def test_the_axis_of_what_does_not_turn_means_nothing() -> None:
    assert urm_geometry(changed(2, axis=(1.0, 0.0, 0.0))) == urm_geometry(ARM)
