"""What was found of a network: how it hangs together, its assemblies, what does not close, what moves."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from urmpipe_models.display import format_count, format_headline
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.math3d import to_quaternions
from urmpipe_models.networks.assembly import Assembly, ClosureError
from urmpipe_models.networks.file import Network
from urmpipe_models.networks.mechanism import Structure, build_mechanism
from urmpipe_models.networks.mobility import Mobility
from urmpipe_pipeline.joint_log import LogWarning
from urmpipe_pipeline.presentation.result import Result
from urmpipe_pipeline.provenance import Provenance
from urmpipe_pipeline.runs.run import SCHEMA

if TYPE_CHECKING:
    import pandas as pd


Command = Literal["check", "solve"]


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class NetworkResult(Result):
    """What was found of a network.

    Attributes:
        name: What the network is called.
        network: The network.
        command: Whether it was checked or solved: what `to_dict` tells.
        structure: tree, loops or closed chain.
        loops: Names of the joints and elements of each loop.
        clusters: Names of the bodies of each part that joints hold together.
        assemblies: Where everything closes, the nearest to the start first; none if nothing was found.
        distances: How far all assemblies that the search came to are from the start, in [rad] and lengths
            of the mechanism, rising, shape (k,): those of `assemblies` come first.
        nearest: The configuration that comes nearest to closing where nothing closes; else None.
        closure_errors: What does not close there, the largest first.
        mobility: Of the first assembly; None without.
        all_solutions: Whether all assemblies were requested.
        start_count: How many starts were tried until one closed, or for every assembly.
        reason: Why the search ended.
        warnings: What a person should know.
        provenance: How to repeat it.
        recording: Where it was written.
    """

    name: str
    network: Network
    command: Command
    structure: Structure
    loops: tuple[tuple[str, ...], ...]
    clusters: tuple[tuple[str, ...], ...]
    assemblies: tuple[Assembly, ...]
    distances: tuple[float, ...]
    nearest: Assembly | None
    closure_errors: tuple[ClosureError, ...]
    mobility: Mobility | None
    all_solutions: bool
    start_count: int
    reason: str
    warnings: tuple[LogWarning, ...]
    provenance: Provenance
    recording: Path | None = field(default=None, metadata={"stored": False})

    @property
    def verdict(self) -> Literal["pass", "fail"]:
        """Pass if it was assembled."""
        return "pass" if self.assemblies else "fail"

    @property
    def residual(self) -> float:
        """The largest gap of the first assembly, or of what comes nearest, in [m] and [rad]."""
        shown = self.assemblies[0] if self.assemblies else self.nearest
        return 0.0 if shown is None else shown.residual

    @property
    def variables(self) -> int:
        """Controls that can be set, free variables of joints, and six of each body that floats: how many."""
        return len(build_mechanism(self.network).variables)

    @property
    def kutzbach(self) -> int:
        """6 (bodies - 1) - sum of (6 - f) - elements - what controls take: variables less equations."""
        return self.variables - build_mechanism(self.network).rows

    def _headline(self) -> str:
        """Return its verdict, what it is and how much of it moves, and how many assemblies there are."""
        found = format_count(len(self.assemblies), "assembly").replace("assemblys", "assemblies")
        moves = self.mobility and f"{self.mobility.kind} of mobility {self.mobility.mobility}"
        return format_headline(self.name, self.verdict, self.structure, moves, found)

    def to_frame(self) -> pd.DataFrame:
        """Return one row an assembly: its variables in [m] and [rad], residual and mobility.

        A variable of several values has a column for each, numbered from 1.
        """
        import pandas as pd

        rows = [
            {"assembly": number, **_flat(one.values), "residual": one.residual, "mobility": one.mobility}
            for number, one in enumerate(self.assemblies, 1)
        ]
        return pd.DataFrame(rows, columns=None if rows else ["assembly", "residual", "mobility"])

    def to_dict(self) -> dict[str, Any]:
        """Return the object that `urmpipe network check --json` or `network solve --json` prints."""
        return self._checked() if self.command == "check" else self._solved()

    def _checked(self) -> dict[str, Any]:
        """Return what a check found; what only an assembly has is None without one."""
        moves = self.mobility
        return {
            "schema": SCHEMA,
            "name": self.name,
            "kind": moves and moves.kind,
            "structure": self.structure,
            "bodies": len(self.network.body_names),
            "variables": self.variables,
            "mobility": moves and moves.mobility,
            "kutzbach": self.kutzbach,
            "loops": [list(loop) for loop in self.loops],
            "clusters": [list(cluster) for cluster in self.clusters],
            "redundant": [
                {"joint": one.joint, "constraint": one.constraint}
                for one in (moves.redundant if moves else ())
            ],
            "passive": list(moves.passive) if moves else [],
            "special": moves and moves.special,
            "residual": self.residual,
            "assemblies": self._assemblies(),
            "closure_errors": self._gaps(),
            "warnings": [one.to_dict() for one in self.warnings],
            "output": str(self.recording) if self.recording else None,
        }

    def _solved(self) -> dict[str, Any]:
        """Return the assemblies, or how far from closing it is."""
        return {
            "schema": SCHEMA,
            "name": self.name,
            "assemblies": self._assemblies(),
            "distances": list(self.distances),
            "restarts": max(self.start_count - 1, 0),
            "reason": self.reason,
            "closure_errors": self._gaps(),
            "warnings": [one.to_dict() for one in self.warnings],
            "output": str(self.recording) if self.recording else None,
        }

    def _assemblies(self) -> list[dict[str, Any]]:
        """Return the variables and the poses of each assembly."""
        return [
            {
                "variables": {
                    name: values[0] if len(values) == 1 else list(values)
                    for name, values in one.values.items()
                },
                "poses": dict(zip(self.network.body_names, _poses(one.poses), strict=True)),
                "residual": one.residual,
                "mobility": one.mobility,
            }
            for one in self.assemblies
        ]

    def _gaps(self) -> list[dict[str, Any]]:
        """Return what does not close."""
        return [
            {"name": one.name, "loop": list(one.loop), "m": one.metres, "rad": one.radians}
            for one in self.closure_errors
        ]


def _poses(matrices: FloatArray) -> list[dict[str, list[float]]]:
    """Return positions in [m] and to_quaternions x, y, z, w with w >= 0 of poses, shape (bodies, 4, 4)."""
    quats = to_quaternions(matrices[:, :3, :3].reshape(-1, 9), "matrix")
    quats = np.where(quats[:, 3:] < 0.0, -quats, quats) + 0.0  # no -0
    positions = matrices[:, :3, 3] + 0.0
    return [
        {"position": position, "quat_xyzw": quat}
        for position, quat in zip(positions.tolist(), quats.tolist(), strict=True)
    ]


def _flat(values: dict[str, tuple[float, ...]]) -> dict[str, float]:
    """Return a value a name: of several of one owner numbered from 1."""
    return {
        name if len(some) == 1 else f"{name}_{k}": value
        for name, some in values.items()
        for k, value in enumerate(some, 1)
    }
