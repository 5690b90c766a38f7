"""Measured columns are read before plain and commanded ones, or a question is raised; the rest is named."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import urmpipe
from asserting import refusal
from urmpipe.main import run
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.errors import LogError
from urmpipe_pipeline.joint_log import PASSED_OVER
from urmpipe_pipeline.logs import LogMap, read_log

CASES = Path(__file__).resolve().parents[3].parent / "shared" / "cases"

MEASURED = ["measured", "meas", "mes", "mess", "act", "actual", "ist", "real", "fb", "fbk", "feedback"]
MEASURED += ["enc", "encoder", "sensor", "state"]
COMMANDED = ["cmd", "command", "target", "desired", "ref", "reference", "set", "soll", "goal"]
COMMANDED += ["requested", "planned", "calc"]
T = np.arange(40) / 50


def motion(count: int, off: float) -> FloatArray:
    return np.round(0.4 * np.sin(T[:, np.newaxis] * (1 + 0.2 * np.arange(count))) + off, 6)


def written(path: Path, *families: Sequence[str]) -> Path:
    """Write columns of which those of each family are 0.1 above those of the one before."""
    columns = [T, *(motion(len(names), 0.1 * k) for k, names in enumerate(families))]
    header = ",".join(["t", *(name for names in families for name in names)])
    np.savetxt(path, np.column_stack(columns), "%.6f", ",", header=header, comments="")
    return path


def with_word(stem: str, number: str, word: str, place: str, sign: str) -> str:
    """Return a name with a word at its front, end or inside; without a sign it begins with a capital."""
    if not word:
        return stem + number
    if not sign:
        capital = word.capitalize()
        front = word + stem.capitalize() + number
        return {"front": front, "behind": stem + number + capital, "inside": stem + capital + number}[place]
    parts = {"front": [word, stem + number], "behind": [stem + number, word], "inside": [stem, word, number]}
    return sign.join(filter(None, parts[place]))


STYLES = st.tuples(
    st.sampled_from(["front", "behind", "inside"]), st.sampled_from(["_", "-", ".", "/", " ", ""])
)
STEMS = {
    **dict.fromkeys(["q", "J", "A", "joint", "axis", "theta", "jnt", "arm.joint", "motor"], "123456"),
    **dict.fromkeys(["", "tcp_", "tool_", "pos_"], "xyz"),
}


@pytest.mark.slow
@given(
    stem=st.sampled_from([*STEMS]),
    done=st.tuples(st.sampled_from(MEASURED), STYLES),
    other=st.tuples(st.sampled_from(["", *COMMANDED]), STYLES),
    first=st.booleans(),
    robot=st.booleans(),
)
def test_the_family_with_a_word_for_measured_is_read(
    stem: str,
    done: tuple[str, tuple[str, str]],
    other: tuple[str, tuple[str, str]],
    *,
    first: bool,
    robot: bool,
) -> None:
    stands, passed = (
        [with_word(stem, n, word, *style) for n in STEMS[stem]] for word, style in (done, other)
    )
    families = (stands, passed) if first else (passed, stands)
    arm = "ur5e" if robot and len(stands) == 6 else None
    with TemporaryDirectory() as folder:
        log = urmpipe.ingest(written(Path(folder) / "log.csv", *families), robot=arm).log
    values = log.q if len(stands) == 6 else log.tcp_position
    assert values is not None
    assert values.tolist() == motion(len(stands), 0.0 if first else 0.1).tolist()
    (warning,) = (one for one in log.warnings if one.kind == PASSED_OVER)
    assert warning.message == f"{passed[0]} to {passed[-1]} passed over for {stands[0]} to {stands[-1]}"


LIMBS = ("boom", "stick", "bucket")
UR = ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3")


@pytest.mark.parametrize(
    ("over", "done", "names"),
    [
        ("/command/{}_joint/position", "/joint_states/{}_joint/position", UR),
        ("{}", "{}_fbk", UR),
        ("{}_cmd [rad]", "{}_enc [rad]", LIMBS),
        ("{}_angle", "{}_angle_act", LIMBS),
        ("{}.target", "{}.position", UR),
        ("target_position_{}", "current_position_{}", "123"),
        ("arm/joint{}/reference", "arm/joint{}/state/position", "123"),
        ("q{}_target", "q{}_pos", "123"),
        ("sim_q{}", "real_joint{}", "123"),
        ("q{}", "measuredq{}", "123"),
        ("q{}", "qact{}", "123"),
    ],
)  # fmt: skip
def test_other_names_of_joints(over: str, done: str, names: Sequence[str], tmp_path: Path) -> None:
    stands, passed = ([form.format(name) for name in names] for form in (done, over))
    for families in ((stands, passed), (passed, stands)):
        log = read_log([written(tmp_path / "log.csv", *families)])
        assert [one.header for one in log.columns if one.role == "joint"] == stands
        assert [one.message for one in log.warnings if one.kind == PASSED_OVER] == [
            f"{passed[0]} to {passed[-1]} passed over for {stands[0]} to {stands[-1]}"
        ]


@pytest.mark.parametrize(
    "families",
    [
        ("q1 q2 q3", "servo1 servo2 servo3"),
        ("q1_target q2_target q3_target", "q1_ref q2_ref q3_ref"),
        ("q1_act q2_act q3_act", "q1_enc q2_enc q3_enc"),
        ("q1 q2 q3", "q1_act q2_act"),
        ("shoulder_pan shoulder_lift elbow wrist_1 wrist_2 wrist_3", "elbow_act"),
        ("tcp_x tcp_y tcp_z", "x y z"),
    ],
)
def test_candidates_that_no_word_separates_raise_a_question(families: Sequence[str], tmp_path: Path) -> None:
    path = written(tmp_path / "log.csv", *(names.split() for names in families))
    message = refusal(LogError, read_log, [path])
    assert all(names.split()[0] in message for names in families) and "allowed: one" in message
    joints = families[0].split()
    if "x" not in families[1].split():
        assert read_log([path], LogMap(joints=tuple(joints))).joints == tuple(joints)


def test_orientation_and_rates_are_those_of_what_is_read(tmp_path: Path) -> None:
    groups = ["q{}", "q{}_act", "qd{}", "qd{}_act"]
    joints, done, rates, done_rates = ([form.format(k) for k in "123456"] for form in groups)
    pose, actual = (
        f"{b}x{e} {b}y{e} {b}z{e} {b}rx{e} {b}ry{e} {b}rz{e}".split() for b, e in (("", ""), ("", "_fb"))
    )
    path = written(tmp_path / "log.csv", joints, rates, pose, done, done_rates, actual)
    log = read_log([path], LogMap(rotation="vector"))
    result = {
        role: [c.header for c in log.columns if c.role == role]
        for role in ("joint", "rate", "position", "rotation")
    }
    assert result == {"joint": done, "rate": done_rates, "position": actual[:3], "rotation": actual[3:]}
    (warning,) = (one.message for one in log.warnings if one.kind == PASSED_OVER)
    assert warning.split("; ") == [
        "q1 to q6 passed over for q1_act to q6_act",
        "x to z passed over for x_fb to z_fb",
        "qd1 to qd6 passed over for qd1_act to qd6_act",
        "rx to rz passed over for rx_fb to rz_fb",
    ]
    log = read_log([written(tmp_path / "log.csv", joints, rates, done)])
    assert log.qd is None  # those of the joints that were passed over


@pytest.mark.parametrize(
    "names",
    [
        "joint_states.position[0] joint_states.position[1]",
        "q1_cmd q2_cmd",
        "x y z sensor_1 sensor_2",
        "q1 q2 target_x target_y target_z",
    ],
)
def test_one_family_is_read_without_a_word(names: str, tmp_path: Path) -> None:
    log = read_log([written(tmp_path / "log.csv", names.split())])
    assert PASSED_OVER not in {one.kind for one in log.warnings}
    read = [c.header for c in log.columns if c.role in ("joint", "position")]
    assert read == [name for name in names.split() if not name.startswith(("sensor", "target_"))]


@pytest.mark.skipif(not CASES.is_dir(), reason="the cases in ../shared/cases are not here")
@pytest.mark.parametrize(
    ("files", "keywords", "verdict"),
    [
        (["verdict/path.csv", "verdict/c9.csv"], {"robot": "ur5e"}, "fail"),
        (["verdict/path.csv", "verdict/c10.csv"], {"robot": "ur5e"}, "fail"),
        (["verdict/path.csv", "verdict/xyz_x_real.csv"], {}, "fail"),
        (["reading/tcp-calc-actual.csv"], {"robot": "ur5e"}, "fail"),
        (["reading/tcp-pair.csv"], {"sides": ("target", "actual")}, "pass"),
    ],
)
def test_a_verdict_is_about_what_was_done(
    files: list[str], keywords: dict[str, object], verdict: str
) -> None:
    result = urmpipe.compare(*(CASES / file for file in files), **keywords)  # type: ignore[arg-type]
    assert result.verdict == verdict
    assert result.runs[0].statistics["x"].max > 0.9e-3
    warning = [one.kind for one in result.runs[0].run.warnings]
    assert (PASSED_OVER in warning) != ("sides" in keywords)


def test_the_line_is_printed_and_stored_and_no_error_for_strict(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    names = [[form.format(k) for k in "123456"] for form in ("q{} [rad]", "q{}_fb [rad]")]
    path, kept = written(tmp_path / "log.csv", *names), tmp_path / "log.rrd"
    assert run(["ingest", str(path), "--strict", "--json", "-o", str(kept)]) == 0
    shown = capsys.readouterr()
    line = "q1 [rad] to q6 [rad] passed over for q1_fb [rad] to q6_fb [rad]; "
    line += "--joints q1,q2,q3,q4,q5,q6 takes these"
    assert f"warning: {line}\n" in shown.err
    assert line in [one["message"] for one in json.loads(shown.out)["warnings"]]
    assert PASSED_OVER in [one.kind for one in urmpipe.read_recording(kept).warnings]  # type: ignore[attr-defined]
    (unused,) = (one for one in read_log([path]).inferences if one.what == "columns not used")
    (hint,) = unused.hints
    result = urmpipe.compare(path, sides=hint.value, tolerance="joint=1rad")  # type: ignore[arg-type]
    assert result.runs[0].joint_delta is not None
    np.testing.assert_allclose(result.runs[0].joint_delta, -0.1)
