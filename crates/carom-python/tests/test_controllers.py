"""Controllers in Python, and sessions."""

import tomllib

import numpy as np
import pytest

import carom
from conftest import ROOT, close

G = np.array([0.0, 0.0, -9.81])
# A hinge about y at the end of a column, with a rod of 1 m and 3 kg: M = m l²/3.
ROD = """<robot name="rod"><link name="base"/>
  <link name="rod"><inertial><origin xyz="0.5 0 0"/><mass value="3"/>
    <inertia ixx="1e-3" ixy="0" ixz="0" iyy="0.25" iyz="0" izz="0.25"/></inertial></link>
  <joint name="hinge" type="continuous"><parent link="base"/><child link="rod"/><axis xyz="0 -1 0"/></joint></robot>"""


def of(urdf, q, qd, floating=False, **run):
    """A scene of a robot without contacts under gravity."""
    robot = {"urdf": str(urdf), "q": list(map(float, q)), "qd": list(map(float, qd)), "floating": floating}
    return carom.Scene.from_dict({"robot": robot, "run": {"gravity": G.tolist(), "tolerance": 1e-10, **run}})


@pytest.fixture
def rod(tmp_path):
    path = tmp_path / "rod.urdf"
    path.write_text(ROD)
    return path


@pytest.mark.parametrize("rate", [None, 200.0])
def test_gravity_compensation_in_python_keeps_an_arm_at_rest(arm7, rate):
    q = 0.3 + 0.2 * np.arange(7)
    scene = of(ROOT / "robots/arm7.urdf", q, np.zeros(7), duration=0.5)
    assert np.abs(scene.simulate().q[-1] - q).max() > 0.1  # it falls without motors

    def hold(time, q, qd):
        return arm7.bias(q, np.zeros(7), gravity=G)

    run = scene.with_controller(hold, rate=rate).simulate()
    # The equilibrium is unstable at a rate of some 1/s: rounding grows by less than 1e3.
    assert np.abs(run.q - q).max() < 1e-12 and np.abs(run.qd).max() < 1e-12


def test_a_continuous_controller_is_the_controller_of_the_scene(arm7):
    kp, kd, target = 80.0, 6.0, np.linspace(-0.5, 0.8, 7)
    q, qd = 0.3 + 0.2 * np.arange(7), np.linspace(1, -1, 7)
    pd = {"controller": "pd", "kp": kp, "kd": kd, "target": target.tolist()}
    known = of(ROOT / "robots/arm7.urdf", q, qd, duration=0.6, **pd).simulate()
    scene = of(ROOT / "robots/arm7.urdf", q, qd, duration=0.6)
    own = scene.with_controller(lambda time, q, qd: kp * (target - q) - kd * qd).simulate()
    # The same function with the same steps; sums in another order.
    close(own.q, known.q, 1e-9)
    close(own.qd, known.qd, 1e-9)
    close(own.energy["drive"], known.energy["drive"], 1e-9)
    assert abs(own.energy["drive"]) > 1


def test_a_continuous_controller_acts_through_impacts():
    scene = carom.Scene.from_file(ROOT / "scenes/planar2.toml")
    arm = scene.chain
    # A force on the tip towards the wall.
    pull = lambda time, q, qd: arm.jacobian(q, "tip").T @ [1.0 + 0.5 * np.sin(20 * time), 0.0, 0.0]
    run = scene.with_controller(pull).simulate()
    assert sum(event.kind == "impact" for event in run.events) > 1
    assert abs(run.energy["error"]) < 1e-8 and abs(run.energy["drive"]) > 1e-5


def test_the_forces_of_a_sampled_controller_are_constant_between_its_calls(rod):
    # M q'' = tau with tau = c t at the calls and constant between them: the speed is a sum, the position piecewise parabolic.
    c, rate, calls = 5.0, 50.0, []
    scene = of(rod, [0.0], [0.0], duration=0.51, gravity=[0, 0, 0])

    def ramp(time, q, qd):
        calls.append((time, q[0], qd[0]))
        return [c * time]

    run = scene.with_controller(ramp, rate=rate).simulate(sample=0.005)
    times = np.arange(26) / rate
    close([call[0] for call in calls], times, 1e-14)
    q, qd, h = 0.0, 0.0, 1 / rate
    for k, (time, seen_q, seen_qd) in enumerate(calls):
        close([seen_q, seen_qd], [q, qd], 1e-10)
        a = c * times[k] / 1.0
        q, qd = q + qd * h + a * h * h / 2, qd + a * h
    # Every sample once, also at the times of the calls.
    close(run.time, np.append(np.arange(102) * 0.005, 0.51), 1e-12)
    close(run.energy["drive"], 0.5 * run.last[2][0] ** 2, 1e-9)


def test_a_sampled_controller_approaches_the_continuous_one_with_its_rate(rod):
    scene = of(rod, [0.4], [0.0], duration=1.0)
    control = lambda time, q, qd: -30.0 * q - 2.0 * qd
    exact = scene.with_controller(control).simulate().last[1]
    errors = [np.abs(scene.with_controller(control, rate=rate).simulate().last[1] - exact).max() for rate in (200, 400, 800)]
    # A delay of half a period on average: an error of first order.
    assert 1.8 < errors[0] / errors[1] < 2.2 and 1.8 < errors[1] / errors[2] < 2.2, errors


def test_a_sampled_controller_is_called_through_impacts_and_lasting_contacts():
    scene = carom.Scene.from_file(ROOT / "scenes/table.toml").with_duration(0.45)
    calls = []

    def none(time, q, qd):
        calls.append(time)
        return np.zeros(7)

    off, own = scene.simulate(), scene.with_controller(none, rate=100).simulate()
    close(calls, np.arange(45) / 100, 1e-14)
    # The integration starts anew at every call: the same motion to its tolerance, amplified by the impacts.
    close(own.last[1], off.last[1], 1e-5)
    assert [event.kind for event in own.events] == [event.kind for event in off.events]
    assert {"impact", "sliding"} <= {event.kind for event in own.events}


def test_motors_do_not_drive_a_floating_base(tmp_path):
    base = '<link name="base"><inertial><mass value="2"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>'
    rod = tmp_path / "floating.urdf"
    rod.write_text(ROD.replace('<link name="base"/>', base))
    qd = [0.1, 0.2, 0.3, 0, 0, 0, 0]
    for rate in (None, 100):
        scene = of(rod, [0, 0, 0, 0, 0, 0, 1, 0], qd, floating=True, duration=0.2, gravity=[0, 0, 0])
        free = scene.simulate().last
        assert np.abs(free[1] - scene.q).max() > 0.01
        lifted = scene.with_controller(lambda t, q, qd: [1e3] * 6 + [0.0], rate=rate).simulate().last
        close(lifted[1], free[1], 1e-12)


class Own(Exception):
    pass


@pytest.mark.parametrize("rate", [None, 100.0])
def test_an_exception_of_a_controller_arrives_as_it_is(rod, rate):
    raised = Own("at this time")

    def failing(time, q, qd):
        if time > 0.05:
            raise raised
        return [0.0]

    scene = of(rod, [0.4], [0.0], duration=0.2)
    with pytest.raises(Own) as caught:
        scene.with_controller(failing, rate=rate).simulate()
    assert caught.value is raised
    assert "failing" in "".join(str(entry) for entry in caught.traceback)
    for result, error, words in [
        ([0.0, 0.0], TypeError, r"\(2,\).*\(1,\)"),
        (None, TypeError, "the result of the controller"),
        ([np.nan], carom.SimulationError, "controller '<lambda>': at 0 s its force 0 is NaN"),
    ]:
        with pytest.raises(error, match=words):
            scene.with_controller(lambda time, q, qd: result, rate=rate).simulate()
    with pytest.raises(ValueError, match="positive"):
        scene.with_controller(failing, rate=0.0)
    with pytest.raises(TypeError, match="time, q and qd"):
        scene.with_controller(3)


def test_a_session_is_the_run_of_its_scene():
    scene = carom.Scene.from_file(ROOT / "scenes/planar2.toml")
    run, session, events = scene.simulate(), scene.session(), []
    assert session.time == 0 and np.array_equal(session.q, scene.q) and session.chain.joints == run.chain.joints
    while session.time < scene.duration - 1e-12:
        events += session.advance(min(0.05, scene.duration - session.time))
    close(session.time, scene.duration, 1e-12)
    assert [event.kind for event in events] == [event.kind for event in run.events]
    # The times of impacts after a bounce amplify the tolerance of the integration.
    close([event.time for event in events], [event.time for event in run.events], 1e-6)
    close(session.q, run.last[1], 1e-5)
    close(session.energy["lost_in_impacts"], run.energy["lost_in_impacts"], 1e-8)
    assert session.mode == run.mode and "Session" in repr(session)


def test_a_session_stops_at_events_and_repeats_from_a_saved_state():
    session = carom.Scene.from_file(ROOT / "scenes/bounce.toml").session()
    assert session.advance_to_event(0.1) == [] and session.time == 0.1
    saved = session.save()
    first = session.advance_to_event(10.0)
    # Dropped from 1 m.
    close(session.time, np.sqrt(2 * 1.0 / 9.81), 1e-9)
    assert first[0].kind == "impact" and first[0].time == session.time
    end = session.q
    session.restore(saved)
    assert session.time == 0.1
    session.advance_to_event(10.0)
    assert np.array_equal(session.q, end)
    session.restart(session.q + np.eye(len(session.q))[2], 0 * session.qd)
    close(session.advance_to_event(10.0)[0].time - first[0].time, np.sqrt(2 * 1.0 / 9.81), 1e-9)
    other = carom.Scene.from_file(ROOT / "scenes/planar2.toml").session()
    with pytest.raises(carom.SimulationError, match="another simulation"):
        other.restore(saved)
    with pytest.raises(carom.SimulationError, match="duration"):
        session.advance(-1.0)


def test_a_session_moves_with_the_forces_that_are_set(rod):
    session = of(rod, [0.0], [0.0], duration=1.0, gravity=[0, 0, 0]).session()
    session.set_forces([2.0])
    session.advance(0.3)
    # M = 1 kg m².
    close([session.qd[0], session.q[0]], [0.6, 0.09], 1e-9)
    close(session.energy["drive"], 2.0 * 0.09, 1e-9)
    assert session.mode == "free" and len(session.contacts) == 0
    with pytest.raises(carom.StateError, match=r"forces.*\(1,\)"):
        session.set_forces([1.0, 2.0])
    with pytest.raises(ValueError, match="set_forces"):
        of(rod, [0.0], [0.0], duration=1.0).with_controller(lambda t, q, v: [0], rate=10).session()
    with pytest.raises(Own):
        def failing(time, q, qd):
            raise Own

        of(rod, [0.0], [0.0], duration=1.0).with_controller(failing).session().advance(0.1)


def test_a_session_tells_when_it_has_had_its_events():
    keys = tomllib.loads((ROOT / "scenes/bounce.toml").read_text())
    keys["run"]["max_events"] = 3
    session = carom.Scene.from_dict(keys, folder=ROOT / "scenes").session()
    with pytest.raises(carom.SimulationError, match="max_events"):
        for _ in range(1000):
            session.advance(0.1)


def test_the_contacts_of_a_session_carry_its_weight():
    scene = carom.Scene.from_file(ROOT / "scenes/table.toml")
    session = scene.session()
    session.advance(scene.duration)
    own, run = session.contacts, scene.simulate(sample=scene.duration / 4).contacts
    assert own.columns == run.columns and len(own) > 0
    close(own["normal_force"], run["normal_force"][-len(own):], 1e-5)
