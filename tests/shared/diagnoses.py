"""Diagnoses made by hand, with every field that a cause may have."""

from __future__ import annotations

from urmpipe_pipeline.comparison.deviation import Deviation
from urmpipe_pipeline.diagnosis.causes import (
    Alternative,
    Cause,
    RecordedTcpCheck,
    Unexplained,
    UnidentifiableCauses,
    UntestedCauses,
    rms,
)
from urmpipe_pipeline.diagnosis.result import Diagnosis
from urmpipe_pipeline.joint_log import LogWarning

SIGN = Cause(
    "joint_sign", "phi3", ("q3",), rms_before=0.4, rms_after=0.0015, rms_alone=0.0015,
    effect=0.8, exceeds_tolerance=True,
)  # fmt: skip
LENGTH = Cause(
    "link_length", "r_4", segment="p4", axis=(0.0, 0.0, 1.0), value=(0.0012,), unit="m", low=(0.0011,),
    high=(0.0013,), from_sample=3, equivalents=("d_5", "tool shift z"), rms_before=0.0015, rms_after=0.001,
    rms_alone=0.3995, effect=0.0012,
)  # fmt: skip
BASE = Cause(
    "base_rotation",
    "base",
    value=(0.0, 0.0, 0.002),
    unit="rad",
    low=(0.0, 0.0, 0.001),
    high=(0.0, 0.0, 0.003),
)
OFFSET = Cause("joint_offset", "phi1", ("q1",), value=(0.002,), unit="rad", low=(0.0019,), high=(0.0021,))

TWIN = Cause("link_length", "d_5", value=(-0.3,), unit="m", rms_before=0.001, rms_after=0.0009)


def diagnosis_of(one: Deviation) -> Diagnosis:
    """Return a diagnosis of a compared log that mends every second sample but for a hundredth."""
    before, mended = rms(one.delta[:, :3]), one.delta[::2, :3] / 100.0
    return Diagnosis(
        one.name, one.verdict, len(one.sample), "m", before, (SIGN, LENGTH),
        (Alternative((BASE,), "phi5"), Alternative((OFFSET,), "phi5")),
        (UntestedCauses(("tool_rotation",), "the reference has no orientation"),),
        Unexplained(rms(mended), "the digits of the log"), one.sample[::2], mended,
        (LogWarning("short", "the motion is short"),),
        unidentifiable=(UnidentifiableCauses((TWIN,), "it cancels r_4", "phi5"),),
        recorded_tcp=(RecordedTcpCheck("log", 5e-5, 1e-4, agrees=True),
                      RecordedTcpCheck("sim", 0.01, 0.02, agrees=False)),
        origin="sim",
    )  # fmt: skip
