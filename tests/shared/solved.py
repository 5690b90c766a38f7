"""Solved targets made of joint values: their targets are where those bring the tool."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from urmpipe_models.arm.chain import Chain
from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_models.ik.solutions import Solutions, Targets, forward_targets
from urmpipe_pipeline.joint_log import SourceFile
from urmpipe_pipeline.provenance import build_provenance
from urmpipe_pipeline.solved_targets.result import IkResult

FILE = SourceFile("targets.csv", "0" * 64, 123)


def solved(
    name: str,
    chain: Chain,
    q: FloatArray,
    t_ns: IntArray | None = None,
    *,
    others: dict[str, FloatArray] | None = None,
    reasons: tuple[str, ...] = (),
    targets: Targets | None = None,
    **rest: Any,
) -> IkResult:
    """Return targets with the solution chosen for each.

    Args:
        name: What they are called.
        chain: The arm.
        q: The solution chosen for each target, shape (n, joints); NaN where there is none.
        t_ns: Their times, shape (n,), from any start; None without times.
        others: Further branches by name, shape (n, joints) each: all are requested then.
        reasons: Why a target has none, n of them.
        targets: Where the tool shall be; by default where the joint values bring it.
        rest: Other fields.
    """
    every = np.stack([q, *(others or {}).values()], axis=1)
    n, k = every.shape[:2]
    texts = np.full((n, k), "", dtype=np.object_)
    texts[:, 0] = reasons or ""
    start = 0 if t_ns is None or not len(t_ns) else int(t_ns[0])
    made = IkResult(
        name=name, robot=chain, method="iterative", row=np.arange(1, n + 1),
        t_ns=None if t_ns is None else t_ns - start, clock_start_ns=start,
        targets=forward_targets(chain, q) if targets is None else targets,
        solutions=Solutions(every, ("chosen", *(others or {})), texts), chosen=np.zeros(n, dtype=np.intp),
        position_error=np.zeros((n, k)), angle=np.zeros((n, k)), all_solutions=others is not None,
        branches=None, path=None,
        warnings=(), provenance=build_provenance("ik", {"robot": chain.name}, [FILE]),
    )  # fmt: skip
    return replace(made, **rest)
