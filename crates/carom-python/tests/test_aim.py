"""Aims: the closed forms of a mass that bounces."""

import math
import pathlib

import pytest

import carom

AIMS = pathlib.Path(__file__).parents[3] / "studies" / "aims"
KEYS = {
    "scene": "bounce_scene.toml",
    "unknown": [{"number": "contact.restitution", "from": 0.1, "to": 0.9}],
    "condition": [{"value": "impulse", "contact": "mass", "equals": 12.0}],
}


def test_the_coefficient_that_gives_an_impulse_is_that_of_the_closed_form():
    found = carom.aim(KEYS, folder=AIMS)
    assert found["end"] == "met" and found["torques"] is None
    assert found["unknowns"][0]["found"] == pytest.approx(12 / math.sqrt(2 * 9.8 * 4) - 1, abs=1e-9)
    # The scene that is written has it.
    run = carom.Scene.from_toml(found["scene"], AIMS).simulate()
    assert run.events[0].impact.impulse[2] == pytest.approx(12, abs=1e-8)


def test_many_starts_and_torques():
    found = carom.aim(KEYS, starts=5, seed=3, folder=AIMS)
    assert found["starts"] == {"count": 5, "reached": 5, "failed": {}}
    found = carom.aim(AIMS / "nail.toml")
    assert found["torques"].startswith("time,shoulder,elbow") and found["cost"] < -30


def test_what_is_not_reached_is_an_error():
    with pytest.raises(carom.StudyError, match="not reached after"):
        carom.aim(KEYS | {"condition": [{"value": "z", "equals": 9.0}]}, folder=AIMS)
    with pytest.raises(carom.StudyError, match="nothing is asked"):
        carom.aim({k: v for k, v in KEYS.items() if k != "condition"}, folder=AIMS)
