"""The errors that evo finds (github.com/MichaelGrupp/evo), on the same poses at the same times."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from evo.core.metrics import APE, PoseRelation
from evo.core.trajectory import PoseTrajectory3D
from evo.tools.file_interface import read_tum_trajectory_file
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation, Slerp

from asserting import there
from exported import export_result
from made_runs import ingested, path_run
from thinned_logs import lay_thinned_logs
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_pipeline.comparison.compare import CompareOptions, compare_runs
from urmpipe_pipeline.comparison.deviation import Deviation
from urmpipe_pipeline.logs import LogMap
from urmpipe_pipeline.runs.ingest import ingest_log
from urmpipe_pipeline.runs.run import Run
from urmpipe_pipeline.tables import ExportOptions
from urmpipe_pipeline.trajectories import AlignMode

METRES = 1e-12
"""Positions of some metres, turned and moved: some tens of rounding errors of 1e-15 m."""

RADIANS = 1e-13
"""evo turns matrices into rotation vectors: some hundreds of rounding errors of 1e-16, from 0 to pi alike."""


def evo_errors(
    reference: PoseTrajectory3D, log: PoseTrajectory3D, align: AlignMode
) -> tuple[FloatArray, FloatArray]:
    """Return the translation part and the angle of evo's absolute pose error."""
    np.testing.assert_array_equal(reference.timestamps, log.timestamps)  # nothing to associate
    if align == "rigid":
        log.align(reference, correct_scale=False)
    elif align == "start":
        log.align_origin(reference)
    found = []
    for relation in (PoseRelation.translation_part, PoseRelation.rotation_angle_rad):
        metric = APE(relation)
        metric.process_data((reference, log))
        found.append(np.asarray(metric.error, dtype=np.float64))
    return found[0], found[1]


def as_evo(run: Run) -> PoseTrajectory3D:
    return PoseTrajectory3D(run.log.tcp_position, there(run.log.tcp_rotation)[:, [3, 0, 1, 2]], run.t)


def assert_agree(deviation: Deviation, reference: Run, log: Run, align: AlignMode) -> None:
    distance, angle = evo_errors(as_evo(reference), as_evo(log), align)
    np.testing.assert_allclose(deviation.delta[:, 3], distance, rtol=0, atol=METRES)
    np.testing.assert_allclose(there(deviation.angle), angle, rtol=0, atol=RADIANS)
    assert deviation.statistics["norm"].rms == pytest.approx(np.sqrt(np.mean(distance**2)), abs=METRES)


@pytest.mark.slow
@pytest.mark.parametrize("align", ["none", "start", "rigid"])
@settings(max_examples=10, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), count=st.sampled_from([4, 17, 100]), moved=st.booleans())
@example(seed=11, count=500, moved=True)
def test_errors_of_trajectories_are_those_of_evo(
    align: AlignMode, seed: int, count: int, moved: bool
) -> None:
    """Of unrelated poses, and of the same ones in another frame with noise of 1 mm and 1 mrad."""
    rng = np.random.default_rng(seed)
    position, other = rng.uniform(-2, 2, (2, count, 3))
    turn, turned = (Rotation.random(count, rng=rng) for _ in range(2))
    if moved:
        frame = Rotation.from_rotvec([0.1, -0.2, 0.15])
        other = frame.apply(position) + rng.normal((0.3, 0.1, -0.2), 1e-3, (count, 3))
        turned = frame * turn * Rotation.from_rotvec(rng.normal(0, 1e-3, (count, 3)))
    reference, log = path_run(position, turn.as_quat()), path_run(other, turned.as_quat(), name="log")
    deviation = compare_runs(reference, [log], CompareOptions(align=align)).runs[0]
    assert len(deviation.sample) == count
    assert_agree(deviation, reference, log, align)


@pytest.mark.slow
@settings(max_examples=10, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_errors_of_irregular_logs_are_those_of_evo_at_their_rows(seed: int) -> None:
    """Both sides at the rows that are compared: the reference is interpolated there by SciPy."""
    rng = np.random.default_rng(seed)
    reference, log = (
        path_at(np.cumsum(rng.uniform(0.002, 0.006, 300)), rng, name) for name in ("reference", "log")
    )
    assert log.resampled
    one = compare_runs(reference, [log]).runs[0]
    at = log.log.t[one.sample]
    wanted = [np.interp(at, reference.log.t, column) for column in there(reference.log.tcp_position).T]
    turned = Slerp(reference.log.t, Rotation.from_quat(there(reference.log.tcp_rotation)))(at)
    moved = there(log.log.tcp_position)[one.sample], there(log.log.tcp_rotation)[one.sample]
    sides = ((np.column_stack(wanted), turned.as_quat()), moved)
    as_evos = [PoseTrajectory3D(p, q[:, [3, 0, 1, 2]], at) for p, q in sides]
    distance, angle = evo_errors(as_evos[0], as_evos[1], "none")
    np.testing.assert_allclose(one.delta[:, 3], distance, rtol=0, atol=1e-9)
    np.testing.assert_allclose(there(one.angle), angle, rtol=0, atol=1e-9)


def path_at(t: FloatArray, rng: np.random.Generator, name: str) -> Run:
    """Return the run of a path with an orientation, at these times in [s]."""
    turn = np.column_stack([np.sin(t), 0.5 * np.cos(t), t]) + rng.normal(0, 0.01, (len(t), 3))
    quat, position = Rotation.from_rotvec(turn).as_quat(), rng.uniform(-1, 1, (len(t), 3))
    return ingested(t - t[0], position=position, quaternions=quat, name=name)


@pytest.fixture(scope="module")
def exported(tmp_path_factory: pytest.TempPathFactory) -> tuple[list[Run], list[Path]]:
    """Two logs of one motion, ingested, and the TUM files that `urmpipe export` writes of them."""
    robot, read, folder = load_robot("urm6"), LogMap(unit={"": "rad"}), tmp_path_factory.mktemp("tum")
    logs = lay_thinned_logs(folder)
    runs = [ingest_log([logs / f"{name}.csv"], robot=robot, read=read) for name in ("coppeliasim", "matlab")]
    files = [folder / f"{run.name}.tum" for run in runs]
    for run, file in zip(runs, files, strict=True):
        export_result(run, file, ExportOptions("tum"))
    return runs, files


@pytest.mark.slow
@pytest.mark.parametrize("align", ["none", "start", "rigid"])
def test_what_is_exported_gives_evo_the_same_errors(
    align: AlignMode, exported: tuple[list[Run], list[Path]]
) -> None:
    (reference, log), files = exported
    deviation = compare_runs(reference, [log], CompareOptions(align=align)).runs[0]
    first, second = (read_tum_trajectory_file(file) for file in files)
    distance, angle = evo_errors(first, second, align)
    np.testing.assert_allclose(deviation.delta[:, 3], distance, rtol=0, atol=METRES)
    np.testing.assert_allclose(there(deviation.angle), angle, rtol=0, atol=RADIANS)
