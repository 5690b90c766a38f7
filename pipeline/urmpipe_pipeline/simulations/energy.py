"""The energy balance of blocks: energy in, losses, stored energy, and what they do not account for.

What blocks exchange with each other is in none of the three. The residual is what the coupling of blocks
makes, whose values are held over a step, and the work of blocks that have no energies.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from urmpipe_models.elementwise import FloatArray

ENERGIES = ("energy_in", "energy_lost", "energy_stored")
"""Variables in [J] of which a balance is made, whatever block has them."""


@dataclass(frozen=True, slots=True, eq=False)
class EnergyBalance:
    """Energies of some blocks together, counted from the first sample.

    Attributes:
        supplied: Work done on the system from outside, at these blocks, in [J], shape (n,).
        dissipated: Heat and damping in [J], shape (n,).
        stored: Change of the stored energy in [J], shape (n,).
        initial: Stored at the first sample in [J], the sizes of all blocks added up.
    """

    supplied: FloatArray
    dissipated: FloatArray
    stored: FloatArray
    initial: float

    @property
    def residual(self) -> FloatArray:
        """What is not accounted for in [J], shape (n,): supplied - lost - stored."""
        with np.errstate(invalid="ignore"):
            return self.supplied - self.dissipated - self.stored

    @property
    def worst(self) -> int | None:
        """The sample of the largest absolute residual; None where it never has a value."""
        size = np.abs(self.residual)
        known = np.flatnonzero(np.isfinite(size))
        return int(known[np.argmax(size[known])]) if len(known) else None

    def share(self, residual: float) -> float:
        """Return a residual in [J] as a share of the largest energy; 0 where all are 0.

        What is stored at the first sample is among them: what a system
        that exchanges nothing gains is all residual.
        """
        sizes = np.abs(np.concatenate((self.supplied, self.dissipated, self.stored, [self.initial])))
        largest = float(np.max(sizes, where=np.isfinite(sizes), initial=0.0))
        return abs(residual) / largest if largest > 0.0 else 0.0

    def to_dict(self) -> dict[str, float | None]:
        """Return the energies and the residual at the last sample in [J]; None where there is no value."""
        named = {
            "supplied": self.supplied,
            "dissipated": self.dissipated,
            "stored": self.stored,
            "residual": self.residual,
        }
        ends = {key: float(values[-1]) if len(values) else np.nan for key, values in named.items()}
        return {key: value if np.isfinite(value) else None for key, value in ends.items()}


def energy_balance(signals: Iterable[tuple[str, FloatArray]]) -> EnergyBalance | None:
    """Return the balance of signals that are `ENERGIES`, each summed over all blocks; None without any.

    Args:
        signals: Names of variables with their values in [J], each shape (n, k). One of `ENERGIES` that no
            block has counts as 0.
    """
    sums: dict[str, FloatArray] = {}
    at_first = 0.0
    for variable, values in signals:
        with np.errstate(invalid="ignore"):
            change = (values - values[:1]).sum(axis=1)
            sums[variable] = sums.get(variable, 0.0) + change
        if variable == "energy_stored":
            at_first += float(np.nansum(np.abs(values[:1])))
    if not sums:
        return None
    none = np.zeros(len(next(iter(sums.values()))))
    supplied, lost, stored = (sums.get(variable, none) for variable in ENERGIES)
    return EnergyBalance(supplied, lost, stored, at_first)
