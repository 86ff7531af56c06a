"""Aims: the closed forms of a mass that bounces; feedback along motions."""

import math
import pathlib
import tomllib

import numpy as np
import pytest

import carom

ROOT = pathlib.Path(__file__).parents[3]
AIMS = ROOT / "studies" / "aims"
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


def test_arguments_without_effect_are_refused():
    with pytest.raises(ValueError, match="seed: .* give starts, too"):
        carom.aim(KEYS, seed=3, folder=AIMS)
    path = next(AIMS.glob("*.toml"))
    for function in (carom.aim, carom.orbit, lambda *a, **k: carom.cycles(*a, 2, **k)):
        with pytest.raises(ValueError, match="folder: it is for the file names in a dict"):
            function(path, folder=AIMS)


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


def test_feedback_along_a_motion_is_a_scene_and_a_table(tmp_path):
    scene = carom.Scene.from_file(ROOT / "scenes" / "planar2.toml")
    found = scene.feedback(torque=10, table="gains.csv")
    assert found["motors"] == ["shoulder", "elbow"] and found["impacts"] == 1
    assert found["growth"]["with"] < 0.1 * found["growth"]["without"]
    (tmp_path / "gains.csv").write_text(found["table"])
    keys = tomllib.loads(found["scene"])
    keys["robot"]["urdf"] = str(ROOT / "robots" / "planar2.urdf")
    tracked = carom.Scene.from_dict(keys, folder=tmp_path)
    ends = [np.concatenate([run.q[-1], run.qd[-1]]) for run in (scene.simulate(), tracked.simulate())]
    np.testing.assert_allclose(ends[1], ends[0], atol=1e-7)
    with pytest.raises(carom.SimulationError, match="'wrist' is no joint with one coordinate: there are shoulder, elbow"):
        scene.feedback(joints=["wrist"])
    with pytest.raises(ValueError, match="no keys say a law"):
        scene.with_law(carom.Newton(0.5)).feedback()
