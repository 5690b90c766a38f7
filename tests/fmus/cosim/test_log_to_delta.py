"""The shipped system log-to-delta gives what `urmpipe compare` gives, sample by sample."""

from __future__ import annotations

import numpy as np
import pytest

import urmpipe
from urmpipe_datasets import LOGS
from urmpipe_fmus.cosim import Block, Recorded, load_system, prepare, simulate
from urmpipe_fmus.native import native_missing
from urmpipe_fmus.table import Table
from urmpipe_fmus.unit import Unit
from urmpipe_fmus.units import make_unit
from urmpipe_models.catalogue import load_robot
from urmpipe_pipeline.sources import read_log


def unit_of(block: Block) -> Unit:
    """Return the unit of a block of log-to-delta."""
    options = dict(block.options)
    robot = load_robot(options.pop("robot")) if "robot" in options else None
    if block.unit == "log_source":
        log = read_log([LOGS / options.pop("log")], None, robot)
        values = log.tcp_position if log.tcp_position is not None else log.q
        columns = [("p", "m", 3)] if log.tcp_position is not None else [("q", "rad", values.shape[1])]
        return make_unit(block.unit, table=Table(log.t_ns, values), columns=columns, **options)
    return make_unit(block.unit, **({"robot": robot} if robot else {}), **options)


def run(log: str) -> Recorded:
    recorded = simulate(prepare(load_system("log-to-delta", {"log": log}), unit_of))
    assert recorded.failed is None
    return recorded


@pytest.mark.slow
@pytest.mark.parametrize("log", ["coppeliasim.csv", "counter_rotating.csv", "matlab.csv"])
def test_delta_is_that_of_compare_sample_by_sample(log: str) -> None:
    if native_missing(()):
        pytest.skip(f"needs native FMUs: {native_missing(())}")
    recorded = run(log)
    (compared,) = urmpipe.compare(LOGS / "path.csv", [LOGS / log], robot="urm6").runs
    count = len(compared.t_ns)
    assert count > 7000
    assert np.array_equal(recorded.t_ns[:count], compared.t_ns - compared.t_ns[0])
    names = [*(f"delta[{i}]" for i in (1, 2, 3)), "norm"]
    found = np.column_stack([recorded.column("delta", name)[:count] for name in names])
    # the same formulas; np.hypot and C's sqrt may round the norm, of some mm, differently
    assert np.allclose(found, np.asarray(compared.delta), rtol=0.0, atol=1e-15)
    outside = recorded.column("delta", "out_of_tolerance")[:count].astype(bool)
    assert outside.sum() == (np.abs(found[:, :3]) > 0.0035).any(axis=1).sum()
