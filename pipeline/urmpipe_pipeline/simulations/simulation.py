"""What a co-simulation recorded: named arrays with units, a table (`to_frame`) and JSON (`to_dict`)."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from urmpipe_models.arm.chain import Chain
from urmpipe_models.display import format_count, format_headline
from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_models.errors import CosimulationError
from urmpipe_pipeline.comparison.deviation import Verdict
from urmpipe_pipeline.comparison.verdict import DeltaMeterResult
from urmpipe_pipeline.joint_log import LogWarning, ns_to_seconds
from urmpipe_pipeline.presentation.result import Result
from urmpipe_pipeline.provenance import Provenance, list_assumptions
from urmpipe_pipeline.runs.run import SCHEMA
from urmpipe_pipeline.simulations.energy import ENERGIES, EnergyBalance, energy_balance

if TYPE_CHECKING:
    import pandas as pd

SLOW = "on-python"
"""The kind of the warning that a simulation ran slowly, which says nothing about its values."""

ValueType = Literal["Real", "Integer", "Boolean"]

BlockKind = Literal["unit", "file", "fmu"]
"""A unit of urmpipe's own, a user's unit in a Python file, or any FMU."""


def _floats(values: FloatArray) -> FloatArray:
    """Return values as floats: those that are stay as they are, also where they are not read yet."""
    known = getattr(values, "dtype", None) == np.float64
    return values if known else np.asarray(values, dtype=np.float64)


@dataclass(frozen=True, slots=True, eq=False)
class Signal:
    """One variable of a block over time; an array of them, such as chain.phi, if its values have columns.

    Attributes:
        block: Name of the block in its system.
        variable: Name of the variable in its block.
        values: In `unit`, shape (n,), or (n, size) for an array; 0 and 1 for a Boolean.
        unit: As FMI spells it: rad, m/s, N.m; empty for a number without a unit.
        display_unit: The unit that people like to see, such as deg; empty for the unit itself.
        type: Real, or Integer or Boolean for numbers that stand for one.
        description: One line for people.
    """

    block: str
    variable: str
    values: FloatArray
    unit: str = ""
    display_unit: str = ""
    type: ValueType = "Real"
    description: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "values", _floats(self.values))

    @property
    def name(self) -> str:
        """block.variable."""
        return f"{self.block}.{self.variable}"

    @property
    def columns(self) -> FloatArray:
        """The values in the signal's own unit with a column a scalar, shape (n, size); of a scalar (n, 1)."""
        return self.values if self.values.ndim > 1 else self.values[:, np.newaxis]

    @property
    def variables(self) -> tuple[str, ...]:
        """Names of its scalars in the block, as FMI writes them: `phi`, or `phi[1]`, `phi[2]`, ..."""
        if self.values.ndim == 1:
            return (self.variable,)
        return tuple(f"{self.variable}[{i}]" for i in range(1, self.values.shape[1] + 1))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of its scalars in the system: `chain.phi[1]`, ..."""
        return tuple(f"{self.block}.{variable}" for variable in self.variables)

    @property
    def is_energy(self) -> bool:
        """Whether it is a part of the energy balance."""
        return self.unit == "J" and self.variable in ENERGIES


@dataclass(frozen=True, slots=True)
class Setting:
    """What a variable of a block had before the first step.

    Attributes:
        variable: Its scalar's name, such as `theta[1]`.
        value: In `unit`.
        unit: As FMI spells it.
        causality: What FMI calls its part: parameter, input, output, local.
        from_system: Whether the system gave it; else it is the block's own.
    """

    variable: str
    value: float
    unit: str = ""
    causality: str = "parameter"
    from_system: bool = False


@dataclass(frozen=True, slots=True)
class SimulatedBlock:
    """A block of a system.

    Attributes:
        name: Its name in the system.
        kind: unit, file or fmu.
        source: Which: the name of the unit, or that of the file without folders.
        content: The GUID of its FMU, or the hash of the unit that was run.
        settings: Its parameters, and the start values of its states and inputs.
        description: One line for people.
    """

    name: str
    kind: BlockKind
    source: str
    content: str
    settings: tuple[Setting, ...] = ()
    description: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class SimulatedArm:
    """The arm that a block of kinematics is, and how it moved.

    Attributes:
        block: Name of the block.
        chain: The arm.
        q: Joint values in [rad] or [m], shape (n, joints).
    """

    block: str
    chain: Chain
    q: FloatArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "q", _floats(self.q))


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Simulation(Result):
    """A co-simulated system: its blocks and connections, and every signal until its end or its failure.

    Attributes:
        name: The system's name.
        description: One line for people.
        t_ns: Times of the samples in integer [ns], rising, shape (n,); n is 0 if it failed at once.
        step: Communication step in [s]; not every step need be a sample.
        signals: What was recorded, a block's signals one after the other.
        system_svg: The system as a drawing.
        system_text: The system file (TOML).
        blocks: The blocks, in the order of the system file.
        connections: Which source each connected input has: "chain.phi": "repolarizer.q".
        failed: Why it ended early; None if it did not. What was recorded until then stays.
        warnings: What a person should know.
        provenance: How to repeat it.
        arms: The arms of blocks of kinematics; the first is drawn as solids, the others as lines.
        verdicts: One a delta meter.
        recording: Where it was written.
        loop_seconds: How long its steps took in [s]; 0 if that is not known: it is not stored.
    """

    name: str
    description: str
    t_ns: IntArray
    step: float
    signals: tuple[Signal, ...]
    system_svg: str
    system_text: str
    blocks: tuple[SimulatedBlock, ...]
    failed: str | None
    warnings: tuple[LogWarning, ...]
    provenance: Provenance
    connections: Mapping[str, str] = field(default_factory=dict)
    arms: tuple[SimulatedArm, ...] = ()
    verdicts: tuple[DeltaMeterResult, ...] = ()
    recording: Path | None = field(default=None, metadata={"stored": False})
    loop_seconds: float = field(default=0.0, metadata={"stored": False})

    def __post_init__(self) -> None:
        object.__setattr__(self, "t_ns", np.asarray(self.t_ns, dtype=np.int64))
        faults = [f"simulation {self.name}: {fault}" for fault in self._faults()]
        if faults:
            raise CosimulationError(*faults)

    def _faults(self) -> Iterator[str]:
        """Yield what does not fit together."""
        count = len(self.t_ns)
        if (np.diff(self.t_ns) <= 0).any():
            yield "found times that do not rise, allowed: rising times"
        shaped = [one for one in self.signals if one.values.ndim in (1, 2) and len(one.values) == count]
        for one in self.signals:
            if one not in shaped:
                allowed = f"({count},) or ({count}, size)"
                yield f"{one.name}: found values of shape {one.values.shape}, allowed: {allowed}"
        for name, times in Counter(name for one in shaped for name in {one.name, *one.names}).items():
            if times > 1:
                yield f"{name}: found {times} signals of this name, allowed: one"
        for judged in self.verdicts:
            if not 0 <= judged.sample < count:
                yield f"verdict of {judged.block}: found sample {judged.sample}, allowed: 0 to {count - 1}"
        for arm in self.arms:
            if arm.q.shape != (count, len(arm.chain.coordinates)):
                allowed = f"({count}, {len(arm.chain.coordinates)})"
                yield f"arm of {arm.block}: found joints of shape {arm.q.shape}, allowed: {allowed}"

    @property
    def t(self) -> FloatArray:
        """Times of the samples in [s], shape (n,)."""
        return ns_to_seconds(self.t_ns)

    @property
    def duration(self) -> float:
        """From the first to the last sample in [s]; 0 without any."""
        return float(self.t_ns[-1] - self.t_ns[0]) / 1e9 if len(self.t_ns) else 0.0

    @property
    def verdict(self) -> Verdict | None:
        """Fail if it failed or a delta meter did; None if nothing was to be judged."""
        if self.failed is not None or any(one.verdict == "fail" for one in self.verdicts):
            return "fail"
        return "pass" if self.verdicts else None

    @property
    def assumptions(self) -> tuple[str, ...]:
        """What the verdict takes for granted of the logs that were played; nothing without one."""
        if not self.verdicts:
            return ()
        return list_assumptions(
            (one.assumption, one.about or "a log") for one in self.warnings if one.assumption
        )

    @property
    def judged_worst(self) -> DeltaMeterResult | None:
        """The worst verdict: one that failed, of these what uses up most or lacks a value; None without."""
        return max(self.verdicts, key=_severity, default=None)

    @property
    def energy(self) -> EnergyBalance | None:
        """The energy balance of all blocks that have energies; None without one."""
        return energy_balance((one.variable, one.columns) for one in self.signals if one.is_energy)

    def signal(self, name: str) -> Signal:
        """Return the signal `block.variable`.

        Raises:
            CosimulationError: If there is none of that name.
        """
        found = {one.name: one for one in self.signals}
        if name not in found:
            raise CosimulationError(f"found no signal {name}, allowed: {', '.join(found) or 'none'}")
        return found[name]

    def _headline(self) -> str:
        """Return its verdict, why it failed, and how much it recorded."""
        end = f"failed ({self.failed})" if self.failed is not None else self.verdict
        samples = f"{format_count(len(self.t_ns), 'sample')} in {self.duration:g} s"
        return format_headline(self.name, end, format_count(len(self.signals), "signal"), samples)

    def to_frame(self) -> pd.DataFrame:
        """Return one row a sample: t [s], then a column a scalar signal, such as `chain.phi[1]`."""
        import pandas as pd

        columns = {"t": self.t}
        for one in self.signals:
            columns |= dict(zip(one.names, one.columns.T, strict=True))
        return pd.DataFrame(columns)

    def to_dict(self) -> dict[str, Any]:
        """Return the object that `urmpipe simulate --json` prints."""
        t, energy = self.t, self.energy
        return {
            "schema": SCHEMA,
            "name": self.name,
            "step": self.step,
            "samples": len(t),
            "duration": self.duration,
            "blocks": [
                {"name": one.name, "kind": one.kind, "source": one.source, "content": one.content}
                for one in self.blocks
            ],
            "signals": [scalar for one in self.signals for scalar in _scalars(one, t)],
            "energy": energy.to_dict() if energy else None,
            "failed": self.failed,
            "verdict": self.verdict,
            "assumptions": list(self.assumptions),
            "verdicts": [one.to_dict() for one in self.verdicts],
            "warnings": [one.to_dict() for one in self.warnings],
            "recording": str(self.recording) if self.recording else None,
        }


def _severity(one: DeltaMeterResult) -> tuple[bool, float]:
    """Return how bad a verdict is, to be held against others."""
    return one.verdict == "fail", math.inf if one.utilisation is None else one.utilisation


def _scalars(signal: Signal, t: FloatArray) -> Iterator[dict[str, Any]]:
    """Yield the JSON object of each scalar of a signal."""
    for name, values in zip(signal.names, signal.columns.T, strict=True):
        yield {"name": name, "unit": signal.unit, "type": signal.type, **extremes(values, t)}


def extremes(values: FloatArray, t: FloatArray) -> dict[str, float | None]:
    """Return the first and the last value, the least and the largest, and when these first stand.

    Values are in any unit, shape (n,), at times in [s], shape (n,); of none that is finite, all are None.
    """
    known = np.flatnonzero(np.isfinite(values))
    if not len(known):
        return dict.fromkeys(("first", "last", "min", "t_min", "max", "t_max"))
    ends = {"first": float(values[0]), "last": float(values[-1])}
    low, high = known[np.argmin(values[known])], known[np.argmax(values[known])]
    return {
        **{name: value if math.isfinite(value) else None for name, value in ends.items()},
        "min": float(values[low]),
        "t_min": float(t[low]),
        "max": float(values[high]),
        "t_max": float(t[high]),
    }
