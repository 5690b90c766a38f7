"""Which causes are named, of seeded logs with noise: with the models themselves."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np
import pytest

from altered_arm import (
    Named,
    Noise,
    Numbers,
    altered,
    demo_motion,
    drifting,
    fine,
    named,
    names_of,
    noisy,
    nominal,
    rich_motion,
    search_of,
    spoilt,
    times,
    uniform,
)
from rail_arm import rail_arm
from urmpipe_models.arm.chain import Chain
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_pipeline.diagnosis.causes import Alternative, Cause, rms
from urmpipe_pipeline.diagnosis.explain import ExplanationBuilder
from urmpipe_pipeline.diagnosis.explanations import SearchResult
from urmpipe_pipeline.diagnosis.search import Search
from urmpipe_pipeline.runs.reading_errors import Edit, Edits

URM6 = load_robot("urm6")
SHORT, LONG = 50, 2000
RIGHT = np.radians(0.1) * 2.0
"""An angle in [rad] that 2000 samples of +-3.5 mm tell clearly."""


def found(
    numbers: Numbers, edits: Edits = (), *, chain: Chain = URM6, motion: str = "rich", samples: int = LONG,
    noise: Noise = uniform, seed: int = 0, oriented: bool = False,
) -> tuple[Search, SearchResult, frozenset[str]]:  # fmt: skip
    """Search a log with some causes; return what was found, and the names of the causes."""
    moved = demo_motion() if motion == "demo" else rich_motion(chain)
    clean = nominal(chain, moved, times(samples), oriented=oriented)
    data = altered(clean, moved, numbers, edits)
    search = search_of(noisy(clean, np.random.default_rng(seed), noise, data))
    result = search.find()
    return search, result, names_of(search, result, [*numbers], edits)


def said(numbers: Numbers, edits: Edits = (), **how: object) -> tuple[Named, frozenset[str]]:
    search, result, wanted = found(numbers, edits, **how)  # type: ignore[arg-type]
    return named(search, result), wanted


def causes_of(search: Search, result: SearchResult) -> tuple[tuple[Cause, ...], tuple[Alternative, ...]]:
    """Return the causes of a search in the words of the result; none of them is out of tolerance."""
    names = tuple(URM6.coordinates)
    return ExplanationBuilder(search, result, names, names, lambda *_: False).causes()


def numbers_of(**sizes: float | list[float]) -> Numbers:
    """Sizes by kind and name, joined by two underscores."""
    return {
        name.replace("__", ":"): np.atleast_1d(np.array(size, dtype=float)) for name, size in sizes.items()
    }


def signs(joints: Sequence[int]) -> Edits:
    return tuple(Edit("joint_sign", (j,)) for j in joints)


@pytest.mark.slow
@pytest.mark.parametrize("motion", ["demo", "rich"])
def test_the_sign_of_each_joint_is_named_from_50_samples(motion: str) -> None:
    for j in range(6):
        answer, wanted = said({}, signs((j,)), motion=motion, samples=SHORT, seed=j)
        assert wanted <= answer.sure, j


@pytest.mark.slow
def test_so_are_the_signs_of_each_two_joints() -> None:
    for seed, joints in enumerate(combinations(range(6), 2)):
        motion = ("demo", "rich")[seed % 2]
        answer, wanted = said({}, signs(joints), motion=motion, samples=SHORT, seed=seed)
        assert wanted <= answer.sure, (motion, joints)


@pytest.mark.slow
@pytest.mark.parametrize("robot", ["urm6", "ur5e", "panda", "rail_arm"])
def test_a_sign_and_an_exchange_of_any_arm_are_named(robot: str) -> None:
    chain = rail_arm() if robot == "rail_arm" else load_robot(robot)
    for edit in (Edit("joint_sign", (3,)), Edit("joints_swapped", (1, 3))):
        answer, wanted = said({}, (edit,), chain=chain)
        assert answer.outcome(wanted) == "named"


CAUSES = {
    "r1": numbers_of(link_length__r1=2e-3),
    "r3": numbers_of(link_length__r3=-2e-3),
    "theta4": numbers_of(tilt__theta4=RIGHT),
    "phi1": numbers_of(joint_offset__phi1=-RIGHT),
    "phi3": numbers_of(joint_offset__phi3=RIGHT),
    "phi4": numbers_of(joint_offset__phi4=RIGHT),
    "scale of phi2": numbers_of(joint_scale__phi2=2e-3),
    "base": numbers_of(base_shift__base=[1.5e-3, -1.2e-3, 1.6e-3]),
    "lag": numbers_of(time_lag__clock=5e-3),
}


@pytest.mark.slow
@pytest.mark.parametrize("cause", CAUSES)
def test_a_clear_cause_is_named(cause: str) -> None:
    answer, wanted = said(CAUSES[cause])
    assert answer.outcome(wanted) == "named"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("cause", "noise", "oriented"),
    [
        (cause, *kind)
        for cause, kind in zip(CAUSES, 3 * [(spoilt, False), (fine, False), (uniform, True)], strict=True)
    ],
)
def test_so_it_is_in_other_noise(cause: str, noise: Noise, oriented: bool) -> None:
    answer, wanted = said(CAUSES[cause], noise=noise, oriented=oriented)
    assert answer.outcome(wanted) == "named"


@pytest.mark.slow
@pytest.mark.parametrize("pair", [("r3", "phi4"), ("theta4", "lag"), ("base", "scale of phi2")])
def test_two_clear_causes_are_named(pair: tuple[str, str]) -> None:
    answer, wanted = said({**CAUSES[pair[0]], **CAUSES[pair[1]]}, motion="demo")
    assert answer.outcome(wanted) == "named"


@pytest.mark.slow
def test_a_sign_and_a_length_are_named_together() -> None:
    answer, wanted = said(CAUSES["r3"], (Edit("joint_sign", (2,)),))
    assert answer.outcome(wanted) == "named"


@pytest.mark.slow
def test_twins_are_named_by_the_first_of_them() -> None:
    search, result, _ = found(numbers_of(joint_offset__phi1=RIGHT))
    (cause,), _ = causes_of(search, result)
    assert (cause.kind, cause.axis) == ("base_rotation", (0.0, 0.0, 1.0))  # setup comes before structure
    assert "offset of phi1" in cause.twins


@pytest.mark.slow
def test_a_joint_that_stands_still_has_an_offset_and_no_scale_of_its_own() -> None:
    moved = rich_motion(URM6)
    t = times(LONG)
    q = moved(t)
    q[:, 2] = 0.4
    still = type(moved)(t, q)
    clean = nominal(URM6, still, t)
    data = altered(clean, still, numbers_of(joint_offset__phi3=RIGHT))
    search = search_of(noisy(clean, np.random.default_rng(0), uniform, data))
    result = search.find()
    causes, undecided = causes_of(search, result)
    told = [*causes, *(cause for one in undecided for cause in one.causes)]
    assert {"phi3"} == {cause.name for cause in told}
    assert undecided or "scale of phi3" in causes[0].twins


@pytest.mark.slow
@pytest.mark.parametrize("lasting", [0.5, 2.0])  # with less the samples, 0.07 s apart, are hardly correlated
def test_correlated_noise_is_no_cause(lasting: float) -> None:
    def noise(rng: np.random.Generator, position: FloatArray) -> FloatArray:
        return drifting(rng, position, lasting)

    silent = [not said({}, samples=500, noise=noise, seed=seed)[0].best for seed in range(8)]
    assert sum(silent) >= 7  # 5 % are allowed to alarm


@pytest.mark.slow
@pytest.mark.parametrize(("samples", "trials"), [(SHORT, 12), (LONG, 4)])
def test_white_noise_is_no_cause(samples: int, trials: int) -> None:
    silent = [not said({}, samples=samples, seed=seed)[0].best for seed in range(trials)]
    assert sum(silent) >= trials - 1


@pytest.mark.slow
def test_sizes_lie_in_their_intervals() -> None:
    inside = []
    for seed in range(10):
        search, result, _ = found(CAUSES["r3"], seed=seed)
        ((cause,), _) = causes_of(search, result)
        inside.append(cause.low[0] <= -2e-3 <= cause.high[0])
    assert sum(inside) >= 9  # 95 % of 10 are 9.5, with a standard deviation of 0.7


@pytest.mark.slow
def test_what_the_causes_take_away_leads_from_the_whole_to_what_remains() -> None:
    search, result, _ = found({**CAUSES["r3"], **CAUSES["lag"]}, (Edit("joint_sign", (2,)),))
    causes, _ = causes_of(search, result)
    rows = np.arange(search.model.rows)
    before, after = (rms(search.model.deviation(one, rows).T) for one in (search.null, result.best.state))
    assert [cause.kind for cause in causes] == ["time_lag", "joint_sign", "link_length"]  # clocks first
    assert causes[0].rms_before == pytest.approx(before)
    assert causes[-1].rms_after == pytest.approx(after)
    assert [one.rms_after for one in causes[:-1]] == [one.rms_before for one in causes[1:]]


@pytest.mark.slow
def test_the_same_log_gives_the_same_answer_to_the_last_bit() -> None:
    (_, first, _), (_, second, _) = (found(CAUSES["phi3"], samples=6000) for _ in range(2))
    np.testing.assert_array_equal(first.best.state.values, second.best.state.values)
    assert first.best.score == second.best.score
    assert first.best.subset == second.best.subset
    assert [one.score for one in first.rivals] == [one.score for one in second.rivals]
