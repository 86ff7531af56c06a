"""Periodic orbits: the closed forms of a ball on a shaken table."""

import math
import pathlib

import numpy as np
import pytest

import carom

ROOT = pathlib.Path(__file__).parents[3]
BALL = ROOT / "studies" / "atlas" / "ball.toml"


def test_the_orbit_has_the_multipliers_of_its_closed_form():
    found = carom.orbit(BALL)
    assert found["stability"] == "stable" and found["residual"] < 1e-10
    product = math.prod(math.hypot(*pair) for pair in found["multipliers"])
    assert product == pytest.approx(0.25, abs=1e-9)  # e²
    # A second route: the run from the orbit returns to it.
    states = carom.cycles(BALL, 4, start=(found["start"]["q"], found["start"]["qd"]))
    assert states["q"].shape == (4, 1) and states["qd"].shape == (4, 1)
    assert np.abs(states["qd"] - found["start"]["qd"]).max() < 1e-9


def test_a_branch_names_its_flip_and_its_end():
    branch = carom.orbit(BALL, branch=True)
    flip = math.hypot(2 * 1.25 / 2.25, math.pi / 3)
    assert [it["kind"] for it in branch["special"]] == ["flip"]
    assert branch["special"][0]["parameter"] == pytest.approx(flip, abs=1e-8)
    assert branch["points"][0]["parameter"] == 1.2 and "the end of the range" in branch["end"]


def test_the_doubled_branch_begins_at_the_flip():
    branch = carom.orbit(BALL, branch=True, doubled=1)
    (doubled,) = branch["doubled"]
    assert (branch["ended"], branch["passages"], doubled["passages"]) == ("range", 1, 2)
    assert doubled["points"][0]["parameter"] == pytest.approx(branch["special"][0]["parameter"], abs=1e-9)


def test_a_basin_counts_its_cells(tmp_path):
    axes = {"x": {"what": "qd z", "from": -1, "to": 2, "points": 3}, "y": {"what": "z", "from": 0.01, "to": 0.5, "points": 2}}
    keys = {"scene": "ball_scene.toml", "section": {"period": 0.1}, "basin": axes}
    found = carom.basin(keys, tmp_path / "basin.csv", svg=tmp_path / "basin.svg", folder=BALL.parent)
    assert (found["rows"], found["computed"], sum(found["outcomes"].values())) == (6, 6, 6)
    assert sum(it["cells"] for it in found["attractors"]) == found["outcomes"].get("settled", 0)
    assert len((tmp_path / "basin.csv").read_text().splitlines()) == 7 and (tmp_path / "basin.svg").exists()


def test_problems_are_dicts_too_and_wrong_ones_are_refused():
    keys = {"scene": "ball_scene.toml", "section": {"period": 0.1}, "with": {"contact.restitution": 0.6}}
    found = carom.orbit(keys, folder=BALL.parent)
    assert math.prod(math.hypot(*pair) for pair in found["multipliers"]) == pytest.approx(0.36, abs=1e-9)
    with pytest.raises(carom.StudyError, match="needs one of contact"):
        carom.orbit(keys | {"section": {}}, folder=BALL.parent)
    with pytest.raises(TypeError, match="neither a path nor a dict"):
        carom.orbit(3)


def test_doubled_and_value_need_a_branch_and_a_parameter():
    with pytest.raises(ValueError, match="cycles = 0: give 1 or more"):
        carom.cycles(BALL, 0)
    with pytest.raises(ValueError, match="give branch=True"):
        carom.orbit(BALL, doubled=1)
    with pytest.raises(carom.StudyError, match="has no .vary."):
        carom.cycles(ROOT / "studies/atlas/hammer2.toml", 2, value=1.3)
