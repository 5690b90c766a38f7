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


def test_tables_keep_every_kind_of_part_in_m_and_rad() -> None:
    parts = {
        "name": "kinds", "length_unit": "mm", "angle_unit": "deg", "ground": "base",
        "controls": {"s": {"start": 90, "upper": 200}, "t": {"value": "2 * s"}},
        "bodies": {"a": {}, "b": {}, "c": {}, "d": {"start": [1, 2, 3, 90, 0, 0]}},
        "joints": {
            "C": {"kind": "cylindrical", "bodies": ["base", "a"], "value": ["", "t / 2"], "start": [30, 0],
                  "lower": [-90, -500]},
            "H": {"kind": "helical", "bodies": ["a", "b"], "pitch": 5, "driven": "s", "upper": 360},
            "U": {"kind": "user", "bodies": ["b", "c"], "m": [1, 0, 0], "n": [0, "cos(0)", 0],
                  "a": ["s", 12.5, 0]},
            "G": {"kind": "global", "bodies": ["c", "base"], "a": [[1, 2, 3], [4, 5, 6]]},
        },
        "elements": {
            "gg": {"kind": "gg", "bodies": ["b", "d"], "a": [[1, 2, 3], [4, 5, 6]], "d": "t"},
            "eg": {"kind": "eg", "bodies": ["b", "d"], "n": [0, 0, 1], "a": [4, 5, 6], "h": "-s"},
            "crc": {"kind": "crc", "bodies": ["b", "d"], "n": [[1, 0, 0], [0, 1, 0]], "d": 3},
            "gc": {"kind": "gc", "bodies": ["b", "d"], "n": [0, 0, 1], "a": [[1, 2, 3], [4, 5, 6]], "d": 1},
            "gear": {"kind": "gear", "joints": ["C", "H"], "teeth": [20, -40], "offset": "t"},
            "rack": {"kind": "rack", "joints": ["H", "C"], "radius": -3},
        },
    }  # fmt: skip
    network = load_network(parts)
    assert load_network(network_tables(network)) == network
    assert network_tables(network)["joints"]["H"]["value"] == "(s) * pi / 180"
