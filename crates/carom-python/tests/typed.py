"""What type checkers know of the package. `.ci/python` gives this to `mypy --strict` and `pyright`, and it runs as a test.

A line with `type: ignore` is a mistake that a checker must find: one that it does not find is an error of its own.
"""

# pyright: reportUnnecessaryTypeIgnoreComment=true

from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from typing_extensions import assert_type

import carom

Vector = np.ndarray[tuple[int], np.dtype[np.float64]]
Matrix = np.ndarray[tuple[int, int], np.dtype[np.float64]]

arm = carom.Chain.uniform(2, 1.0, 1.0)
law = carom.Energetic(0.5, 0.3)
q, qd = [0.4, 0.7], [-0.8, 0.5]
many = arm.random_configuration(0, 20)
assert_type(many, Matrix)
assert_type(arm.neutral(), Vector)

# One state under one law, several laws, and a batch.
hit = arm.impact(q, qd, "tip", (0, 1, 0), law)
assert_type(hit, carom.Impact)
assert_type(hit.qd_plus, Vector)
assert_type(hit.mode, Literal["open", "stick", "slip", "reverse-slip"])
assert_type(arm.impact(q, hit.qd_plus, "tip", (0, 1, 0), law), carom.Impact)
assert_type(arm.impact(q, qd, "tip", (0, 1, 0), [law, carom.Newton(0.5)]), list[carom.Impact])
hits = arm.impact(many, qd, "tip", (0, 1, 0), law, derivatives=True)
assert_type(hits, carom.Impacts)
assert_type(hits.qd_plus, Matrix)
three, normals = np.ones((3, 2)), np.ones((3, 3))
assert_type(arm.impact(q, three, "tip", (0, 1, 0), law), carom.Impacts)
assert_type(arm.impact(q, [[1.0, 2.0], [0.5, -1.0]], "tip", (0, 1, 0), law), carom.Impacts)
assert_type(arm.impact(q, qd, "tip", normals, law), carom.Impacts)
assert_type(arm.impact(many, qd, "tip", (0, 1, 0), [law]), list[carom.Impacts])
assert_type(hits[3], carom.Impact)
assert_type(hits[2:4], carom.Impacts)
assert_type(hits[~hits.flagged("no-approach")], carom.Impacts)
assert_type([one.energy_ratio for one in hits], list[float])
assert_type(hits.flags, list[list[str]])
assert_type(hits.flag_bits, NDArray[np.uint8])


def own(H: NDArray[np.float64], u: NDArray[np.float64]) -> list[float]:
    return [0.0, 0.0, -u[2] / H[2, 2]]


assert_type(arm.impact(q, qd, "tip", (0, 1, 0), own), carom.Impact)
assert_type(arm.impact(q, qd, "tip", (0, 1, 0), carom.PythonLaw(own, 0.5)), carom.Impact)

# Plain numbers.
H, u = np.diag([2.0, 1.0]), [0.3, -1.0]
assert_type(carom.law(H, u, law), carom.Outcome)
assert_type(carom.law(H, u, law, branches=True), list[carom.Outcome])
assert_type(carom.law(H, u, [law]), list[carom.Outcome])
assert_type(carom.law(H, u, [law], branches=True), list[list[carom.Outcome]])

# Energies have names, and are still a pair.
assert_type(arm.energies(q, qd).kinetic, float)
assert_type(arm.energies(many, qd).potential, Vector)
kinetic, potential = arm.energies(q, qd)
assert_type(kinetic, float)
assert_type(arm.effective_mass(q, "tip", (0, 1, 0)), float)
assert_type(arm.joint_table, list[dict[str, Any]])

scene = carom.Scene.from_dict({"robot": {"urdf": "none"}}) if hits.law == "none" else None
if scene is not None:
    run = scene.simulate(sample=0.01, error=True)
    assert_type(run.q, Matrix)
    assert_type(run.events[0].impact, carom.Impact | None)
    assert_type(carom.map("study.toml"), carom.Table)
    loaded = scene.with_keys({"run.kp": 3.0, "run": {"gravity": np.zeros(3)}}).simulate(loads=True)
    assert_type(loaded.motors, Matrix)
    assert_type(loaded.loads, carom.Table)
    if loaded.events[0].loads is not None:
        assert_type(loaded.events[0].loads["bearings"]["elbow"]["force"], Vector)
        assert_type(loaded.events[0].loads["motors_plus"], Vector)
    assert_type(scene.runs(10), carom.Table)
    assert_type(scene.session().advance_to_event(1.0, loads=True), list[carom.Event])
    assert_type(scene.session().motors, Vector)
    assert_type(scene.sensitivity().events[0].time_by, Vector | None)
    assert_type(carom.chart(scene, budget=0.1), dict[str, Any])
    assert_type(carom.tosses("folder", law, start="given"), dict[str, Any])
    assert_type(carom.compare(data=["one", "two"], judge="early"), dict[str, Any])
    assert_type(carom.Chain.from_urdf("arm.urdf", rotor_inertia={"elbow": 0.1}, mass={"hand": 1}), carom.Chain)

try:
    carom.Chain()  # type: ignore[call-arg]
    carom.Impact()  # type: ignore[call-arg]
    carom.Energetic("0.5")  # type: ignore[arg-type]
    hits.flagged("no-aproach")  # type: ignore[arg-type]
    carom.tosses("folder", law, start="guessed")  # type: ignore[arg-type]
    hit.qdplus  # type: ignore[attr-defined]
    arm.impact(many, qd, "tip", (0, 1, 0), law, saltation=True)  # type: ignore[arg-type]
except TypeError:
    pass
