"""Networks as tables: written and read back they are equal, with another start, too."""

from __future__ import annotations

import json

import pytest

from random_networks import DOOR
from urmpipe_models.networks.file import load_network, network_names
from urmpipe_models.networks.mechanism import build_mechanism
from urmpipe_models.networks.tables import network_tables, with_start


@pytest.mark.parametrize("name", [*network_names(), "door"])
def test_a_network_comes_back_from_its_tables_as_json_and_so_does_one_with_another_start(name: str) -> None:
    network = load_network(DOOR if name == "door" else name)
    tables = network_tables(network)
    again = load_network(json.loads(json.dumps(tables, allow_nan=False)))
    assert again == network
    mechanism = build_mechanism(network)
    x = mechanism.start + 0.01
    moved = build_mechanism(load_network(network_tables(with_start(network, x.tolist()))))
    assert moved.start.tolist() == x.tolist()
    assert (moved.graph.roots, moved.graph.cuts) == (mechanism.graph.roots, mechanism.graph.cuts)


def test_an_arm_beyond_its_limits_comes_back_from_its_tables() -> None:
    network = load_network({"chains": {"arm": {"robot": "panda", "start": [0, 0, 0, 1.0, 0, 2, 0]}}})
    again = load_network(network_tables(network))
    assert [joint.start for joint in again.joints] == [joint.start for joint in network.joints]
