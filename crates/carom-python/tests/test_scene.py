"""Scenes, runs, tables, maps, fits and recordings."""

import json
import pickle
import tomllib

import numpy as np
import pytest

import carom
from conftest import ROOT, close

SCENES = sorted((ROOT / "scenes").glob("*.toml"))


@pytest.fixture(scope="module")
def bounce():
    return carom.Scene.from_file(ROOT / "scenes/bounce.toml").simulate()


@pytest.mark.parametrize("path", SCENES, ids=lambda path: path.stem)
def test_a_scene_from_a_dict_is_the_scene_of_the_file(path):
    file = carom.Scene.from_file(path)
    keys = tomllib.loads(path.read_text())
    own = carom.Scene.from_dict(keys, folder=path.parent)
    assert file.contacts == own.contacts and file.duration == own.duration and file.surfaces == own.surfaces
    assert np.array_equal(file.q, own.q) and np.array_equal(file.qd, own.qd)
    assert file.plan() == own.plan()
    assert str(len(file.contacts)) in repr(own)


def test_a_run_is_that_of_its_samples_events_and_energy(bounce):
    assert bounce.time.shape == (len(bounce.states),) and np.all(np.diff(bounce.time) >= 0)
    assert bounce.q.shape == (len(bounce.time), bounce.chain.nq) and bounce.qd.shape == (len(bounce.time), bounce.chain.nv)
    impacts = [event for event in bounce.events if event.kind == "impact"]
    assert impacts and bounce.stop_reason == "duration"
    energy = bounce.energy
    close(energy["end"], energy["start"] + energy["drive"] + energy["resistance"] - energy["lost_in_impacts"] + energy["error"], 1e-14)
    assert abs(energy["error"]) < 1e-8 * abs(energy["start"])
    for event in impacts:
        assert np.array_equal(event.impact.qd_plus, event.qd_plus)
        contact, point, impulse = event.impulses[0]
        assert contact == event.contact and point.shape == (3,)
        close(impulse, event.impact.impulse, 1e-15)
        # The ball, of radius 0.05, touches the floor.
        close(event.q[2], 0.05, 1e-12)
    close(impacts[0].time, np.sqrt(2 * 1.0 / 9.81), 1e-9)
    time, q, qd = bounce.last
    assert time == bounce.time[-1] and np.array_equal(q, bounce.q[-1]) and np.array_equal(qd, bounce.qd[-1])
    assert bounce.statistics["steps"] > 0 and "events" in repr(bounce) and "impact" in repr(impacts[0])


def test_an_impact_of_a_run_is_the_impact_of_its_state(bounce):
    scene = carom.Scene.from_file(ROOT / "scenes/planar2.toml")
    event = scene.simulate().events[0]
    hit = event.impact
    keys = tomllib.loads((ROOT / "scenes/planar2.toml").read_text())["contact"]
    law = carom.Energetic(keys["restitution"], keys["friction"])
    again = scene.chain.impact(event.q, event.qd_minus, frame="tip", normal=[-1, 0, 0], law=law)
    close(again.qd_plus, hit.qd_plus, 1e-12)
    assert bounce.events[0].contact


def test_sensitivities_of_a_run_are_differences_of_runs():
    keys = tomllib.loads((ROOT / "scenes/planar2.toml").read_text())
    keys["contact"]["friction"] = 0.1
    keys["run"]["tolerance"] = 1e-12
    scene = carom.Scene.from_dict(keys, folder=ROOT / "scenes")
    found = scene.sensitivity()
    names = ["q shoulder", "q elbow", "qd shoulder", "qd elbow"]
    assert found.names == [*names, "restitution", "friction"] and found.broken is None and "6" in repr(found)
    h = 1e-5

    def end(run):
        _, q, qd = run.last
        return np.concatenate([q, qd]), run.events[0].time

    def compare(j, more, less):
        (late, later), (soon, sooner) = end(more.simulate()), end(less.simulate())
        close(found.last_by[:, j], (late - soon) / (2 * h), 1e-6)
        close(found.events[0].time_by[j], (later - sooner) / (2 * h), 1e-6)

    for j, step in enumerate(h * np.eye(4)):
        compare(j, *(scene.with_start(scene.q + s * step[:2], scene.qd + s * step[2:]) for s in (1, -1)))
    law = [carom.Energetic(keys["contact"]["restitution"] + s * h, 0.1) for s in (1, -1)]
    compare(4, *(scene.with_law(law, link="tip") for law in law))
    run = scene.simulate()
    time, q, qd = run.last
    close(found.last[1], q, 1e-12)
    assert found.last[0] == time
    # The events are those of the run, each with its derivatives.
    assert [(it.kind, it.time, it.contact) for it in found.events] == [(it.kind, it.time, it.contact) for it in run.events]
    assert all(it.time_by.shape == (6,) for it in found.events) and run.events[0].time_by is None

    assert found.rows == names
    one = scene.sensitivity(["restitution", "qd", "q elbow"])
    assert one.names == ["restitution", "qd shoulder", "qd elbow", "q elbow"] and one.rows == names
    close(one.last_by, found.last_by[:, [4, 2, 3, 1]], 1e-14)
    close(one.events[0].time_by, found.events[0].time_by[[4, 2, 3, 1]], 1e-14)
    with pytest.raises(ValueError, match="'kp elbow' is no number of the scene: wrt has \"q\", \"qd\", q shoulder, .*, friction, and paths"):
        scene.sensitivity(["kp elbow"])
    with pytest.raises(TypeError, match=r"wrt is the text 'qd': give a list of names, \[\"qd\"\]"):
        scene.linear_run("qd")


def test_a_run_is_differentiated_by_any_number_of_the_scene():
    keys = tomllib.loads((ROOT / "scenes/planar2.toml").read_text())
    keys["contact"]["friction"] = 0.1
    keys["run"] |= {"tolerance": 1e-12, "gravity": [0, -9.81, 0]}
    assert "q" in keys["robot"]
    scene = carom.Scene.from_dict(keys, folder=ROOT / "scenes")
    wrt = ["contact.friction", "run.gravity[1]", "friction", "contact.restitution"]
    found = scene.sensitivity(wrt=wrt)
    assert found.names == wrt and found.broken is None
    close(found.last_by[:, 0], found.last_by[:, 2], 1e-9)  # the same number by its key and by its name
    for j, (path, value) in enumerate([("contact.friction", 0.1), ("run.gravity[1]", -9.81)]):
        h = 1e-4 * abs(value)
        _, *more = scene.with_keys({path: value + h}).simulate().last
        _, *less = scene.with_keys({path: value - h}).simulate().last
        close(found.last_by[:, j], (np.concatenate(more) - np.concatenate(less)) / (2 * h), 1e-6)
    linear = scene.linear_run(wrt)
    assert linear.names == wrt
    close(linear.vjp([0, 0, 1, 0]), found.last_by[2], 1e-12)
    close(linear.jvp([0, 2, 0, 0])[0], 2 * found.last_by[:, 1], 1e-12)
    with pytest.raises(carom.StateError, match=r"change has the shape \(2,\): \(4,\) for one state"):
        linear.jvp([1, 2])
    for path, message in [
        ("contact.law", "the scene has no number there"),
        ("contact.spin", "the scene has no number there"),
        ("surface.point", "surface is a list of 1"),
        ("robot.q[0]", "changes the start or the duration"),
        ("run.duration", "duration is no parameter of the motion"),
    ]:
        with pytest.raises(ValueError, match=message):
            scene.sensitivity([path])


def test_a_linear_run_and_its_transpose_are_the_columns_and_rows_of_the_sensitivity():
    scene = carom.Scene.from_file(ROOT / "scenes/planar2.toml")
    found, run = scene.sensitivity(), scene.linear_run()
    assert run.names == found.names and repr(run) == "<carom.LinearRun by 5 numbers, 1 events>"
    assert run.events == [(found.events[0].time, ["impact"])]
    close(run.last[2], found.last[2], 1e-14)
    for j, change in enumerate(np.eye(5)):
        last, times = run.jvp(change)
        close(last, found.last_by[:, j], 1e-12)
        close(times, found.events[0].time_by[[j]], 1e-12)
    for i, weights in enumerate(np.eye(4)):
        close(run.vjp(weights), found.last_by[i], 1e-12)
    close(run.vjp(np.zeros(4), [1.0]), found.events[0].time_by, 1e-12)
    # Batches are the matrices at once.
    last, times = run.jvp(np.eye(5))
    close(last, found.last_by.T, 1e-12)
    close(times, found.events[0].time_by[:, None], 1e-12)
    close(run.vjp(np.eye(4)), found.last_by, 1e-12)
    close(run.vjp(np.eye(4), [1.0]), found.last_by + found.events[0].time_by, 1e-12)
    with pytest.raises(carom.StateError, match=r"last has the shape \(1,\): \(4,\) for one state or \(B, 4\)"):
        run.vjp([1.0])
    with pytest.raises(carom.StateError, match="last has 4 states but times has 2"):
        run.vjp(np.eye(4), np.zeros((2, 1)))
    keys = tomllib.loads((ROOT / "scenes/bounce.toml").read_text())
    keys["run"]["method"] = "steps"
    with pytest.raises(carom.SimulationError, match="the run has no derivative: at 0 s time steps"):
        carom.Scene.from_dict(keys, folder=ROOT / "scenes").linear_run()


def test_a_run_without_derivatives_tells_where_they_end():
    keys = tomllib.loads((ROOT / "scenes/bounce.toml").read_text())
    keys["run"]["method"] = "steps"
    found = carom.Scene.from_dict(keys, folder=ROOT / "scenes").sensitivity()
    assert found.last_by is None and found.broken["time"] == 0 and "time steps" in found.broken["reason"]
    assert found.events and all(event.time_by is None for event in found.events)


def test_samples_are_at_the_interval_that_is_asked_for():
    scene = carom.Scene.from_file(ROOT / "scenes/planar2.toml").with_duration(0.1)
    run = scene.simulate(sample=0.01)
    between = [t for t in run.time if t not in [event.time for event in run.events]]
    close(between, np.linspace(0, 0.1, 11), 1e-12)


def test_another_start_and_another_law_give_another_run():
    scene = carom.Scene.from_file(ROOT / "scenes/planar2.toml")
    slower = scene.with_start(qd=0.5 * scene.qd)
    assert np.array_equal(slower.q, scene.q) and slower.simulate().events[0].time > scene.simulate().events[0].time
    plastic = scene.with_law(carom.Newton(0.0), link="tip").simulate().events[0].impact
    close(plastic.u_plus[0], 0.0, 1e-12)
    with pytest.raises(ValueError, match="name no contact of the scene: they are link2 on"):
        scene.with_law(carom.Newton(0.0), link="nobody")
    with pytest.raises(carom.StateError, match="one state"):
        scene.with_start(q=[scene.q])


def test_a_law_in_python_resolves_the_impacts_of_a_scene():
    def half(H, u):
        calls.append(u)
        return [0, 0, -1.5 * u[2] / H[2, 2]]

    calls = []
    scene = carom.Scene.from_file(ROOT / "scenes/planar2.toml")
    own = scene.with_law(carom.PythonLaw(half, 0.5)).simulate()
    known = scene.with_law(carom.Frictionless(0.5)).simulate()
    assert len(calls) == len([event for event in own.events if event.kind == "impact"]) > 0
    assert own.events[0].impact.law == "half"
    close(own.q, known.q, 1e-10)

    def failing(H, u):
        raise KeyError("of the law")

    with pytest.raises(KeyError, match="of the law"):
        scene.with_law(failing).simulate()
    with pytest.raises(carom.CaromError, match="approaching"):
        scene.with_law(carom.PythonLaw(lambda H, u: [0, 0, 0], 0.0)).simulate()


def test_tables_are_the_same_by_every_door(bounce, tmp_path):
    pandas, polars, pyarrow = (pytest.importorskip(name) for name in ("pandas", "polars", "pyarrow"))
    pytest.importorskip("pyarrow.parquet")
    for table in (bounce.states, bounce.event_table, carom.Scene.from_file(ROOT / "scenes/table.toml").simulate(sample=0.05).contacts):
        arrow, columns = pyarrow.table(table), table.numpy()
        assert arrow.column_names == table.columns == list(columns) and arrow.num_rows == len(table) > 0
        for name in table.columns:
            words = arrow[name].to_pylist()
            expected = [w or None for w in columns[name].tolist()] if columns[name].dtype.kind == "U" else columns[name].tolist()
            assert words == expected, name
            assert table.to_polars()[name].cast(polars.String if columns[name].dtype.kind == "U" else polars.Float64).to_list() == expected
        assert isinstance(table.to_pandas(), pandas.DataFrame)
        table.write(tmp_path / "x.csv")
        read = pandas.read_csv(tmp_path / "x.csv")
        assert list(read.columns) == table.columns and np.array_equal(read["time"], table["time"])
        with pytest.raises(KeyError, match="the columns are"):
            table["none"]
        table.write(tmp_path / "x.parquet")
        told = pyarrow.parquet.read_metadata(tmp_path / "x.parquet").metadata
        units = json.loads(told[b"carom.units"])
        assert units["time"] == "s" and told[b"carom.version"].decode() == carom.__version__
        assert tomllib.loads(told[b"carom.scene"].decode())["run"]
    with pytest.raises(carom.StudyError, match="csv or .parquet"):
        bounce.states.write(tmp_path / "x.txt")
    assert "time" in bounce.states and "none" not in bounce.states


def test_words_that_an_event_does_not_have_are_empty():
    table = carom.Scene.from_file(ROOT / "scenes/table.toml").simulate().event_table
    kind, mode = table["kind"], table["mode"]
    assert {"impact"} < set(kind)
    assert np.array_equal(mode != "", kind == "impact")


def test_wrong_scenes_are_refused(tmp_path):
    keys = tomllib.loads((ROOT / "scenes/planar2.toml").read_text())
    with pytest.raises(carom.SimulationError, match="restitutoin.*did you mean"):
        carom.Scene.from_dict({**keys, "contact": {"restitutoin": 0.5}}, folder=ROOT / "scenes")
    with pytest.raises(TypeError, match="contact.law is Energetic"):
        carom.Scene.from_dict({**keys, "contact": {"law": carom.Energetic(0.5)}}, folder=ROOT / "scenes")
    with pytest.raises(carom.SimulationError, match="cannot be read"):
        carom.Scene.from_file(tmp_path / "none.toml")
    with pytest.raises(carom.SimulationError, match="<scene>: line 1"):
        carom.Scene.from_toml("[robot")
    arrays = {**keys, "robot": {**keys["robot"], "q": np.array(keys["robot"]["q"]), "urdf": ROOT / "robots/planar2.urdf"}}
    assert carom.Scene.from_dict(arrays).duration == keys["run"]["duration"]


@pytest.mark.parametrize("path", SCENES, ids=lambda path: path.stem)
def test_the_dict_of_a_scene_makes_the_scene(path):
    scene = carom.Scene.from_file(path)
    keys = scene.to_dict()
    assert keys == tomllib.loads(path.read_text())
    again = carom.Scene.from_dict(keys, folder=scene.folder)
    assert again.to_dict() == keys and again.contacts == scene.contacts and np.array_equal(again.qd, scene.qd)


def test_the_dict_of_a_changed_scene_has_its_start_and_duration():
    scene = carom.Scene.from_file(ROOT / "scenes/planar2.toml")
    changed = scene.with_start(q=scene.q + [0.02, 0], qd=[0.1, -0.2]).with_duration(0.25)
    again = carom.Scene.from_dict(changed.to_dict(), folder=changed.folder)
    assert np.array_equal(again.q, changed.q) and np.array_equal(again.qd, changed.qd) and again.duration == 0.25
    assert np.array_equal(again.simulate().q, changed.simulate().q)
    for other in (scene.with_law(carom.Newton(0.2)), scene.with_controller(lambda t, q, qd: [0, 0])):
        with pytest.raises(ValueError, match="no keys say"):
            other.to_dict()
    several = next(one for one in map(carom.Scene.from_file, SCENES) if isinstance(one.to_dict()["robot"], list))
    with pytest.raises(ValueError, match="start of several robots"):
        several.with_start(qd=several.qd).to_dict()


def test_a_scene_with_other_keys_is_the_scene_of_the_changed_dict():
    scene = carom.Scene.from_file(ROOT / "scenes/quadruped.toml")
    keys = scene.to_dict()
    keys["run"] |= {"kp": 200, "gravity": [0, 0, -1.62], "duration": 0.4}
    keys["run"]["target"]["fl_pitch"] = 0.6
    del keys["run"]["perturb"]
    keys["contact"]["friction"] = 0.5
    keys["surface"][0]["contact"] = {"restitution": 0.2}
    keys["robot"]["mass"] = {"trunk": 12}
    changes = {
        "run.kp": 200,
        "run": {"gravity": np.array([0, 0, -1.62]), "target": {"fl_pitch": 0.6}, "perturb": None},
        "run.duration": 0.4,
        "contact.friction": 0.5,
        "surface[0].contact.restitution": 0.2,
        "robot.mass.trunk": 12,
    }
    changed = scene.with_keys(changes)
    assert changed.to_dict() == keys
    assert scene.to_dict() == carom.Scene.from_file(ROOT / "scenes/quadruped.toml").to_dict()
    close(changed.chain.total_mass - scene.chain.total_mass, 12 - 8, 1e-12)
    # Start, duration, laws and functions stay, and keys that are given count.
    tilted = scene.with_start(q=scene.q + np.eye(len(scene.q))[7] * 0.1).with_duration(0.15)
    changes = {"run.kp": 200, "robot.q[8]": 0.3}
    plain, lively = tilted.with_keys(changes), tilted.with_law(carom.Newton(0.7)).with_keys(changes)
    assert lively.q[7] == tilted.q[7] and lively.q[8] == 0.3 and lively.duration == 0.15
    energies = [one.simulate().energy["lost_in_impacts"] for one in (plain, lively, plain.with_law(carom.Newton(0.7)))]
    assert energies[0] != energies[1] == energies[2]
    assert tilted.with_keys(changes).with_controller(lambda t, q, qd: 0 * qd).simulate().energy["drive"] == 0


@pytest.mark.parametrize(
    ("changes", "error", "message"),
    [
        ({"contact.restitutoin": 0.5}, carom.SimulationError, "<dict>: contact.restitutoin: unknown field"),
        ({"contact": {"restitution": 2}}, carom.SimulationError, "restitution"),
        ({"surface[3].friction": 0.5}, ValueError, r"surface\[3\].friction: surface has 1 entries, which count from 0"),
        ({"surface.friction": 0.5}, ValueError, r"surface.friction: surface is a list of 1: write surface\[0\]"),
        ({"run.duration.x": 0.5}, ValueError, "run.duration.x: duration is a float, which has no keys"),
        ({"contact[0].friction": 0.5}, ValueError, r"contact\[0\].friction: contact is no list: leave out \[0\]"),
        ({"robot.mass": {"tibb": 1}}, carom.ChainError, "no link is named 'tibb'; did you mean 'tip'"),
        ({"robot.mass": {"link1": -1}}, carom.ChainError, "mass of link1 is -1: it must be positive"),
        ({"run.max_events": 2**63}, ValueError, "run.max_events is 9223372036854775808: whole numbers go from -9223372036854775808 to"),
        ({"run.perturb": {"qd": 0.1, "seed": -1}}, carom.SimulationError, "seed"),
        ({1: 2}, TypeError, "the key 1 is not a string"),
        (["run.kp"], TypeError, "changes is not a dict"),
        ({"run.kp": object()}, TypeError, "run.kp is object"),
    ],
)
def test_wrong_changes_of_keys_are_refused_by_their_path(changes, error, message):
    scene = carom.Scene.from_file(ROOT / "scenes/planar2.toml")
    with pytest.raises(error, match=message) as refused:
        scene.with_keys(changes)
    assert "line " not in str(refused.value)


def test_runs_from_disturbed_starts_begin_with_that_of_the_scene():
    scene = carom.Scene.from_file(ROOT / "scenes/quadruped.toml").with_duration(0.3)
    table = scene.runs(4)
    assert list(table["run"]) == [0, 1, 2, 3] and set(table["outcome"]) == {"duration"}
    time, q, qd = scene.simulate().last
    columns = [name for name in table.columns if name.startswith("end.q")]
    assert [table[name][0] for name in ["end.time", *columns]] == [time, *q, *qd]
    assert len(set(table[columns[0]])) == 4
    parts = [scene.runs(4, shard=(part, 3)) for part in (1, 2, 3)]
    assert np.concatenate([part["run"] for part in parts]).tolist() == [0, 1, 2, 3]
    assert np.concatenate([part[columns[0]] for part in parts]).tolist() == table[columns[0]].tolist()
    with pytest.raises(ValueError, match="1 ≤ part ≤ parts"):
        scene.runs(4, shard=(0, 3))
    with pytest.raises(carom.SimulationError, match="no disturbance.*perturb"):
        carom.Scene.from_file(ROOT / "scenes/planar2.toml").runs(3)
    with pytest.raises(ZeroDivisionError):
        scene.with_law(lambda H, u: 1 / 0).runs(2)


def test_runs_disturb_numbers_by_their_keys_and_refuse_laws_of_their_own():
    keys = {"run.perturb": {"numbers": {"contact.restitution": 0.05, "run.gravity[2]": 0.1}, "distribution": "uniform", "seed": 2}}
    scene = carom.Scene.from_file(ROOT / "scenes/bounce.toml").with_keys(keys)
    table = scene.runs(50)
    e, g = table["contact.restitution"], table["run.gravity[2]"]
    assert (e[0], g[0]) == (0.8, -9.81) and np.abs(e - 0.8).max() <= 0.05 and np.ptp(e) > 0.08
    # The first impact is after a fall of 1 m.
    close(table["first_impact"], np.sqrt(2 / -g), 1e-9)
    # A start of one's own stays.
    lower = scene.with_start([0, 0, 0.55, 0, 0, 0, 1]).runs(3)
    close(lower["first_impact"], np.sqrt(2 * 0.5 / -lower["run.gravity[2]"]), 1e-9)
    with pytest.raises(ValueError, match="a law or a controller in Python"):
        scene.with_law(lambda H, u: [0, 0, -u[2] / H[2, 2]]).runs(2)
    with pytest.raises(carom.SimulationError, match="perturb.numbers.*restitutoin"):
        scene.with_keys({"run.perturb": {"numbers": {"contact.restitutoin": 0.1}}}).runs(2)


def test_a_comparison_finds_the_law_that_made_the_data(rng):
    H = rng.normal(size=(60, 3, 4))
    H = H @ H.transpose(0, 2, 1)
    u = rng.normal(size=(60, 3)) - [0, 0, 3]
    after = [carom.law(h, v, carom.Poisson(0.6, 0.3)).u_plus for h, v in zip(H, u)]
    found = carom.compare(delassus=H, u_minus=u, u_plus=after, name="own", folds=3)
    rows = found["comparisons"][0]["rows"]
    best = min((row for row in rows if not row.get("effects")), key=lambda row: row["mean"])
    assert best["law"] == "poisson" and best["mean"] < 1e-5
    assert found["folds"] == 3 and "poisson" in found["markdown"] and found["svg"]["own"].startswith("<svg")
    with pytest.raises(carom.FitError, match="number of folds is 1"):
        carom.compare(delassus=H, u_minus=u, u_plus=after, folds=1)
    with pytest.raises(TypeError, match="nothing is given.*or data"):
        carom.compare()
    with pytest.raises(carom.FitError):
        carom.compare(data=ROOT / "scenes")


def test_a_chart_has_the_errors_of_the_methods():
    scene = carom.Scene.from_file(ROOT / "scenes/planar2.toml").with_duration(0.2)
    chart = carom.chart(scene, budget=0.05)
    assert min(run["at_end"] for run in chart["runs"] if "at_end" in run) < 1e-6
    assert chart["csv"].startswith("method") and chart["svg"].startswith("<svg")
    with pytest.raises(ValueError, match="no compliant contact"):
        carom.chart(scene, stiffness=True)
    with pytest.raises(ValueError, match="budget is 0"):
        carom.chart(scene, budget=0)


def test_simulated_tosses_of_a_free_flight_have_no_error(tmp_path):
    cube = "<robot name='cube'><link name='cube'><inertial><mass value='1'/><inertia ixx='1' iyy='1' izz='1' ixy='0' ixz='0' iyz='0'/>"
    cube += "</inertial><collision><geometry><box size='0.1 0.1 0.1'/></geometry></collision></link></robot>"
    (tmp_path / "cube.urdf").write_text(cube)
    rows = [(0, t, t, 0, 2 - 4.905 * t * t, 1, 0, 0, 0, 1, 0, -9.81 * t, 0, 0, 0) for t in np.arange(0, 0.3, 0.01)]
    head = "toss,t,px,py,pz,qw,qx,qy,qz,vx,vy,vz,wx,wy,wz"
    (tmp_path / "tosses.csv").write_text("\n".join([head, *(",".join(map(str, row)) for row in rows)]))
    found = carom.tosses(tmp_path, carom.Newton(0.1, 0.3))
    assert found["tosses"] == 1 and found["last"]["position_mean"] < 1e-9 and found["each"][0]["events"] == 0
    with pytest.raises(carom.FitError, match="start is 'guessed'"):
        carom.tosses(tmp_path, carom.Newton(0.1), start="guessed")
    with pytest.raises(carom.FitError, match="length is -1"):
        carom.tosses(tmp_path, carom.Newton(0.1), length=-1)


def test_loads_of_a_run_are_those_of_its_impacts():
    run = carom.Scene.from_file(ROOT / "scenes/strike7.toml").simulate(sample=0.005, loads=True)
    chain, event = run.chain, next(it for it in run.events if it.impact)
    contact, point, impulse = event.impulses[0]
    frame = contact.split(" on ")[0]
    pose = chain.pose(event.q, frame)
    point = pose[:3, :3].T @ (point - pose[:3, 3])
    alone = chain.impact_loads(event.q, event.qd_plus - event.qd_minus, frame, impulse, point=point)
    close(event.loads["joint_impulse"], alone["joint_impulse"], 1e-12)
    for joint, own in alone["bearings"].items():
        close(event.loads["bearings"][joint]["force"], own["force"], 1e-12)
    table = run.loads
    assert list(table["joint"]) == list(event.loads["bearings"]) * sum(it.loads is not None for it in run.events)
    assert run.motors.shape == (len(run.time), chain.nv) and not run.motors.any()
    assert run.states.columns[-1] == f"motor.{chain.joints[-1]}"


def test_forces_of_motors_are_those_of_the_controller():
    scene = carom.Scene.from_file(ROOT / "scenes/racket.toml").with_duration(0.4)
    kp, kd, target = (scene.to_dict()["run"][name] for name in ("kp", "kd", "target"))
    run = scene.simulate(loads=True)
    for name, force in zip(run.chain.joints, run.motors.T):
        k = run.chain.joints.index(name)
        expected = kp[name] * (target[name] - run.q[:, k]) - kd[name] * run.qd[:, k] if name in kp else 0 * force
        close(force, expected, 1e-10)
    struck = [event for event in run.events if event.loads]
    assert struck and np.abs(struck[0].loads["motors_plus"] - struck[0].loads["motors_minus"]).max() > 0.01
    session = scene.session()
    events = session.advance_to_event(1.0, loads=True)
    assert np.array_equal(events[0].loads["motors_plus"], struck[0].loads["motors_plus"])
    close(session.motors, events[0].loads["motors_plus"], 1e-10)
    own = scene.with_controller(lambda t, q, qd: np.arange(len(qd)), rate=100).simulate(loads=True)
    assert own.motors[0, 1] == 1 and not own.motors[:, 4:].any()


@pytest.mark.skipif(not carom.can_record(), reason="this wheel is built without recordings")
def test_recordings_of_loads_have_the_forces_of_motors_and_the_impulses_through_joints(tmp_path):
    rerun = pytest.importorskip("rerun.experimental")
    scene = carom.Scene.from_file(ROOT / "scenes/racket.toml").with_duration(0.4)
    entities = {}
    for loads in (False, True):
        path = tmp_path / f"{loads}.rrd"
        carom.record(scene.simulate(loads=loads), path)
        entities[loads] = {str(chunk.entity_path) for chunk in rerun.RrdReader(path).stream()}
    assert entities[True] - entities[False] == {"/series/motor", "/series/through/force", "/series/through/moment"}


def test_loads_are_there_only_where_they_are_asked_for():
    scene = carom.Scene.from_file(ROOT / "scenes/planar2.toml").with_duration(0.3)
    run = scene.simulate()
    assert all(event.loads is None for event in run.events) and not any("motor" in name for name in run.states.columns)
    for name in ("motors", "loads"):
        with pytest.raises(ValueError, match="simulate.loads=True"):
            getattr(run, name)
    with pytest.warns(UserWarning, match="loads: the impulses through joints are not determined, because loops"):
        looped = carom.Scene.from_file(ROOT / "scenes/four_bar.toml").simulate(loads=True)
    assert any("loops carry" in text for text in looped.warnings)


def test_messages_about_dicts_name_keys_and_no_lines():
    keys = tomllib.loads((ROOT / "scenes/planar2.toml").read_text())
    surface = keys["surface"]
    for wrong, message in [
        ({}, "<dict>: missing field `robot`"),
        ({"contact": {}}, "<dict>: missing field `robot`"),
        ({**keys, "robot": {"q": [0, 0]}}, "<dict>: robot: missing field `urdf`"),
        ({**keys, "robot": {**keys["robot"], "q": True}}, "<dict>: robot.q: a list of numbers, a table of numbers"),
        ({**keys, "contact": {"restitutoin": 0.5}}, "<dict>: contact.restitutoin: unknown field"),
        ({**keys, "surface": [*surface, {"nme": 1}]}, r"<dict>: surface\[1\].nme: unknown field"),
        ({**keys, "contact": {"pair": [{"link": "tip"}, {"frict": 1}]}}, r"<dict>: contact.pair\[1\].frict: unknown field"),
    ]:
        with pytest.raises(carom.SimulationError, match=message) as refused:
            carom.Scene.from_dict(wrong, folder=ROOT / "scenes")
        assert "line" not in str(refused.value).replace("mass-spring", "")
    with pytest.raises(carom.StudyError, match="<dict>: joints.elbow.form: unknown field"):
        carom.Study.from_dict({"robot": {"urdf": "x"}, "joints": {"elbow": {"form": 1}}})
    # A text has lines.
    with pytest.raises(carom.SimulationError, match="<scene>: line 2"):
        carom.Scene.from_toml("[robot]\nurfd = 'x'")


def test_all_names_of_the_package_keep_those_of_python():
    names = {}
    exec("from carom import *", names)
    import builtins

    assert not {name for name in names if name != "__builtins__"} & set(vars(builtins))
    assert names["Chain"] is carom.Chain and callable(carom.map)


def test_a_map_in_memory_is_the_map_of_the_file(tmp_path):
    pandas = pytest.importorskip("pandas")
    study = carom.Study.from_file(ROOT / "studies/self_motion.toml")
    table = carom.map(study)
    assert len(study) == len(table) and study.columns == table.columns
    assert carom.map(ROOT / "studies/self_motion.toml", tmp_path / "map.csv") is None
    read = pandas.read_csv(tmp_path / "map.csv")
    for name in table.columns:
        if table[name].dtype.kind == "f":
            assert np.array_equal(read[name], table[name], equal_nan=True), name
        else:
            assert read[name].fillna("").astype(str).tolist() == table[name].tolist(), name
    part = study.table(5, 9)
    assert np.array_equal(part["impulse"], table["impulse"][5:9], equal_nan=True)
    keys = tomllib.loads((ROOT / "studies/self_motion.toml").read_text())
    assert carom.map(keys, folder=ROOT / "studies")["impulse"].tobytes() == table["impulse"].tobytes()
    best = study.advise()["best"][0]
    fulfil = table["approach_deg"] >= 60
    assert best["values"]["limit_share"] == np.nanmin(table["limit_share"][fulfil])
    assert study.svg("impulse").startswith("<svg") and study.units["impulse"] == "N s" and study.axes
    with pytest.raises(carom.StudyError, match="quantites"):
        carom.Study.from_dict({**keys, "map": {"quantites": ["impulse"]}}, folder=ROOT / "studies")
    with pytest.raises(TypeError, match="neither a Study"):
        carom.map(3)


def test_a_fit_finds_the_coefficients_that_made_the_data(arm7, rng):
    frame, normal = arm7.frames[-1], (0, 0, 1)
    q, qd = arm7.random_configuration(rng, 60), rng.normal(size=(60, 7))
    hit = arm7.impact(q, qd, frame=frame, normal=normal, law=carom.Poisson(0.62, 0.23))
    met = ~hit.flagged("no-approach")
    fit = carom.fit(chain=arm7, q=q[met], qd_minus=qd[met], qd_plus=hit.qd_plus[met], frame=frame, normal=normal, law="poisson", train=0.5)
    close([fit.coefficients[name]["value"] for name in ("restitution", "friction")], [0.62, 0.23], 1e-5)
    assert fit.errors.shape == (met.sum(),) and fit.errors.max() < 1e-5 and fit.fitted_to == "velocities"
    assert fit.train["count"] + fit.test["count"] == met.sum() == len(fit.trained) and "poisson" in repr(fit)
    H = rng.normal(size=(40, 3, 4))
    H = H @ H.transpose(0, 2, 1)
    u = rng.normal(size=(40, 3)) - [0, 0, 3]
    after = [carom.law(h, v, carom.Energetic(0.4, 0.3)).u_plus for h, v in zip(H, u)]
    fit = carom.fit(delassus=H, u_minus=u, u_plus=after)
    close([fit.coefficients[name]["value"] for name in ("restitution", "friction")], [0.4, 0.3], 1e-5)
    with pytest.raises(carom.FitError, match="impact 0: .*does not approach"):
        carom.fit(delassus=H, u_minus=-u, u_plus=after)
    assert fit.test is None and list(carom.fit(delassus=H, u_minus=u, u_plus=after, law="frictionless").coefficients) == ["restitution"]
    with pytest.raises(carom.StateError, match=r"\(40, 3, 3\)"):
        carom.fit(delassus=H, u_minus=u[:, :2], u_plus=after)
    with pytest.raises(TypeError, match="nothing is given"):
        carom.fit()
    with pytest.raises(TypeError, match="u_plus is missing"):
        carom.fit(delassus=H, u_minus=u)
    with pytest.raises(carom.FitError, match="no URDF"):
        carom.fit(tosses=ROOT / "scenes")
    json.dumps(fit.coefficients)


records = pytest.mark.skipif(not carom.can_record(), reason="this wheel is built without recordings")


@pytest.mark.skipif(carom.can_record(), reason="this wheel is built with recordings")
def test_a_wheel_without_recordings_says_how_to_get_them(bounce, tmp_path):
    with pytest.raises(carom.RecordError, match="--no-default-features"):
        carom.record(bounce, tmp_path / "run.rrd")
    assert list(tmp_path.iterdir()) == []


@records
def test_a_recording_is_complete_or_not_there(bounce, tmp_path):
    path = tmp_path / "run.rrd"
    carom.record(bounce, path)
    assert path.read_bytes()[:3] == b"RRF"
    with pytest.raises(carom.RecordError, match="no/such/run.rrd"):
        carom.record(bounce, tmp_path / "no/such/run.rrd")


def logged(path):
    """What a recording holds: for each entity and column of data the values on each timeline."""
    rerun = pytest.importorskip("rerun.experimental")
    [recording] = rerun.RrdReader(path).recordings()
    rows = {}
    for chunk in rerun.RrdReader(path).stream(store=recording):
        entity = str(chunk.entity_path)
        if entity.startswith("/__properties"):  # the name of the recording, its own
            continue
        table = chunk.to_record_batch().to_pydict()
        for column in table:
            if not column.endswith("RowId") and column != "log_time":  # both differ between two writings of one run
                rows.setdefault((entity, column), []).extend(map(repr, table[column]))
    return {key: sorted(values) for key, values in rows.items()}, recording


def written_by_rerun(run, path):
    """A recording in place of one of carom's: an entity in time, one without, and a second timeline."""
    rerun = pytest.importorskip("rerun")
    stream = rerun.RecordingStream("carom", recording_id="theirs")
    stream.save(path)
    stream.log("ground", rerun.Points3D([[0, 0, 0], [1, 0, 0]]), static=True)
    for k, time in enumerate(run.time):
        stream.set_time("time", duration=time)
        stream.set_time("event", sequence=k)
        stream.log("robot/q", rerun.Scalars(run.q[k]))
    stream.disconnect()


@pytest.mark.parametrize("writer", [pytest.param(None, marks=records, id="carom"), pytest.param(written_by_rerun, id="rerun")])
def test_a_recording_stream_gets_what_the_file_has_and_keeps_its_own(bounce, tmp_path, monkeypatch, writer):
    rerun = pytest.importorskip("rerun")
    if writer:
        monkeypatch.setattr(carom._carom, "record", writer)
    carom.record(bounce, tmp_path / "file.rrd")
    stream = rerun.RecordingStream("own", recording_id="mine")
    stream.save(tmp_path / "stream.rrd")
    stream.log("note", rerun.TextLog("before"), static=True)
    carom.record(bounce, stream)
    stream.log("note", rerun.TextLog("after"), static=True)
    stream.disconnect()
    (expected, _), (found, recording) = logged(tmp_path / "file.rrd"), logged(tmp_path / "stream.rrd")
    assert (recording.application_id, recording.recording_id) == ("own", "mine")
    own = {key for key in found if key[0] == "/note"}
    assert own
    assert max(len(values) for (_, column), values in expected.items() if column == "time") >= len(bounce.time)
    assert {key: found[key] for key in found.keys() - own} == expected


@pytest.mark.parametrize("to", [None, 3, object()])
def test_a_recording_goes_to_a_path_or_a_stream(bounce, to):
    with pytest.raises(TypeError, match="RecordingStream"):
        carom.record(bounce, to)


def test_errors_of_a_run_hold_against_a_tighter_one():
    scene = carom.Scene.from_file(ROOT / "scenes/planar3.toml")
    run = scene.simulate(error=True)
    exact = scene.with_keys({"run.tolerance": 1e-12}).simulate()
    assert run.error["tighter"] == [pytest.approx(1e-10)] and "unknown" not in run.error
    nv = run.chain.nv
    assert run.q_error.shape == run.qd_error.shape == (len(run.time), nv)
    # At the time of an event the sample is before it in one run and may be after it in the other.
    calm = np.min(np.abs(run.time[:, None] - [event.time for event in run.events]), axis=1) > 1e-6
    assert np.all(np.abs(run.q - exact.q)[calm] <= 10 * run.q_error[calm])
    assert np.all(np.abs(run.qd - exact.qd)[calm] <= 10 * run.qd_error[calm])
    np.testing.assert_array_equal(run.q_error[-1], run.error["final"]["q"])
    first, true = run.events[0], exact.events[0]
    assert abs(first.time - true.time) <= 10 * first.time_error
    names = run.states.columns
    assert [name for name in names if name.startswith("error.")][0].startswith("error.q.")
    assert "time_error" in run.event_table.columns
    again = pickle.loads(pickle.dumps(run))
    assert again.error == run.error and again.events[0].time_error == first.time_error
    plain = scene.simulate()
    assert plain.error is None and plain.events[0].time_error is None
    with pytest.raises(ValueError, match="error=True"):
        plain.q_error


def test_a_scene_with_an_accuracy_chooses_its_tolerance():
    text = (ROOT / "scenes/planar3.toml").read_text().replace("[run]", "[run]\naccuracy = 1e-6")
    scene = carom.Scene.from_toml(text, folder=ROOT / "scenes")
    run = scene.simulate(error=True)
    largest = max(*run.error["final"]["q"], *run.error["final"]["qd"])
    assert 1e-12 < largest < 1e-6
    decisions = {decision["what"]: decision for decision in scene.plan()["kept"]}
    assert "accuracy = 1e-6" in decisions["accuracy"]["why"]
    assert scene.sensitivity(wrt=["q"]).broken is None
    strict = carom.Scene.from_toml(text.replace("1e-6", "1e-17"), folder=ROOT / "scenes")
    with pytest.raises(carom.SimulationError, match="rounding prevents"):
        strict.simulate()


def test_wishes_that_have_no_effect_are_refused():
    scene = carom.Scene.from_file(ROOT / "scenes/planar2.toml")
    law = scene.with_law(carom.Newton(0.5))
    with pytest.raises(ValueError, match="on surface 1.* another law, and what with_law gave to the scene acts in place of it"):
        law.with_keys({"contact.restitution": 0.9})
    with pytest.raises(ValueError, match="what with_law gave"):
        law.sensitivity(["contact.restitution"])
    assert law.with_keys({"run.duration": 0.2}).duration == 0.2
    own = scene.with_controller(lambda t, q, qd: -qd)
    with pytest.raises(ValueError, match="another controller, and what with_controller gave"):
        own.with_keys({"run.controller": "constant", "run.torque": [1, 1]})
    assert own.with_keys({"run.gravity": [0, 0, 0]}).duration == scene.duration
    rated = scene.with_controller(lambda t, q, qd: -qd, rate=50)
    for ask in (rated.sensitivity, rated.linear_run, lambda: rated.simulate(error=True)):
        with pytest.raises(ValueError, match="has a rate, 50 Hz"):
            ask()
    with pytest.raises(ValueError, match=r"surface\[0\]: None takes a key out, and this is an entry of a list"):
        scene.with_keys({"surface[0]": None})
    with pytest.raises(ValueError, match="duration is no parameter"):
        scene.sensitivity(["run.duration"])


def test_durations_and_states_that_do_not_fit_are_refused():
    scene = carom.Scene.from_file(ROOT / "scenes/bounce.toml")
    for duration in (-1, 0, np.nan):
        with pytest.raises(carom.SimulationError, match="duration is"):
            scene.with_duration(duration)
    with pytest.raises(ValueError, match="joints is empty"):
        carom.Scene.from_file(ROOT / "scenes/planar2.toml").feedback(joints=[])
    # A ball on another floor: as many numbers, but another contact.
    text = (ROOT / "scenes/bounce.toml").read_text().replace("../robots", str(ROOT / "robots"))
    other = carom.Scene.from_toml(text.replace('"floor"', '"ground"')).session()
    with pytest.raises(carom.SimulationError, match="ball on floor.*belongs to another simulation"):
        other.restore(scene.session().save())


def test_numbers_of_things_must_not_be_negative_and_are_named():
    scene = carom.Scene.from_file(ROOT / "scenes/planar2.toml")
    chain = carom.Chain.from_urdf(ROOT / "robots/planar2.urdf")
    for ask, name in [
        (lambda: scene.runs(-1), "count"),
        (lambda: scene.runs(3, shard=(-1, 2)), "shard"),
        (lambda: scene.feedback(rows=-1), "rows"),
        (lambda: chain.random_configuration(size=-1), "size"),
        (lambda: carom.Chain.uniform(-1, 1.0, 1.0), "links"),
        (lambda: carom.cycles(ROOT / "studies/compass.toml", -1), "cycles"),
        (lambda: carom.cycles(ROOT / "studies/compass.toml", 1, skip=2**70), "skip"),
        (lambda: carom.orbit(ROOT / "studies/compass.toml", branch=True, doubled=-1), "doubled"),
        (lambda: carom.aim(ROOT / "studies/aims/racket.toml", starts=-1), "starts"),
        (lambda: carom.aim(ROOT / "studies/aims/racket.toml", seed=-1), "seed"),
    ]:
        with pytest.raises(TypeError, match=rf"out of range: give a whole number that is not negative\n.*'{name}'"):
            ask()
