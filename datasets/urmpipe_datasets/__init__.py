"""Robots, networks and sample logs, shipped as package data."""

from __future__ import annotations

from pathlib import Path

ROBOTS = Path(__file__).parent / "robots"
"""One TOML file a robot."""

NETWORKS = Path(__file__).parent / "networks"
"""One TOML file a kinematic network."""

LOGS = Path(__file__).parent / "logs"
"""The sample logs of `urmpipe demo`."""
