"""Objects that do not change are copied and pickled; their copies answer the same."""

import copy
import pickle
import shutil
import tomllib

import numpy as np
import pytest

import carom
from conftest import ROOT, states

LAW = carom.Energetic(0.5, 0.3)


def own_law(H, u):
    return [0.0, 0.0, -1.2 * u[2] / H[2, 2]]


def brake(time, q, qd):
    return -0.4 * qd


def shown(value, name):
    """What an attribute of an object is, or why there is none."""
    try:
        return getattr(value, name)
    except ValueError as error:
        return str(error)


def plain(value):
    """What an object shows: numbers, words, and the same of what it holds."""
    if isinstance(value, np.ndarray):
        return value.dtype.kind, value.shape, value.tobytes() if value.dtype.kind != "U" else tuple(value.tolist())
    if isinstance(value, (list, tuple)):
        return tuple(map(plain, value))
    if isinstance(value, dict):
        return tuple((name, plain(part)) for name, part in value.items())
    if isinstance(value, carom.Chain):
        q = value.random_configuration(3)
        return repr(value), value.mass_matrix(q).tobytes(), tuple(value.joints), plain(value.joint_table), tuple(value.warnings)
    if isinstance(value, slice) or isinstance(value, float):
        return repr(value)
    if type(value).__module__ == "carom":
        names = [name for name in vars(type(value)) if not name.startswith("_") and not callable(shown(value, name))]
        held = value.numpy() if isinstance(value, carom.Table) else {name: shown(value, name) for name in names}
        return repr(value), plain(held), plain(list(value)) if isinstance(value, carom.Impacts) else ()
    return value


def made():
    """An object of each class that can be pickled."""
    arm = carom.Chain.from_urdf(ROOT / "robots/planar2.urdf")
    q, qd = states(arm, np.random.default_rng(4), 30)
    args = dict(frame="tip", normal=(-1, 0, 0))
    scene = carom.Scene.from_file(ROOT / "scenes/planar2.toml")
    bounce = carom.Scene.from_file(ROOT / "scenes/bounce.toml")
    table = carom.Scene.from_file(ROOT / "scenes/table.toml")
    changed = scene.with_law(carom.Newton(0.2), link="tip").with_law(own_law, surface=scene.surfaces[0]).with_start(qd=0.7 * scene.qd)
    changed = changed.with_controller(brake, rate=200).with_duration(0.4)
    study = carom.Study.from_file(ROOT / "studies/self_motion.toml")
    H, u = np.array([[2.44, 1.52], [1.52, 1.01]]), np.array([-0.267, -0.134])
    space = np.diag([2.0, 3.0, 1.0]), [0.3, 0.2, -1.0]
    met = arm.impact(q, qd, law=LAW, **args)
    near = ~met.flagged("no-approach")
    quadruped = carom.Chain.from_urdf(ROOT / "robots/quadruped.urdf", floating=True)
    foot = next(name for name in quadruped.frames if "foot" in name)
    landing = [quadruped.neutral(), -np.ones(quadruped.nv), [(foot, (0.1, y, -0.02)) for y in (-0.05, 0.05)], (0, 0, 1)]
    return {
        "chain of a file": arm,
        "chain of a text": carom.Chain.from_urdf((ROOT / "robots/arm7.urdf").read_text(), floating=True),
        "uniform chain": carom.Chain.uniform(3, 1.0, 2.0),
        "chain of a scene": scene.chain,
        "chain of a run": table.simulate().chain,
        "chain of a session": table.session().chain,
        "chain of a study": study.chain,
        "law": carom.ChatterjeeRuina(0.5, 0.3, -0.2),
        "law in Python": carom.PythonLaw(own_law, 0.2, 0.1, name="mine"),
        "impact": arm.impact(q[0], qd[0], law=LAW, derivatives=True, band=((0.2, 0.6), (0, 0.4)), saltation=True, **args),
        "impact of a batch": met[3],
        "impacts": arm.impact(q, qd, law=LAW, derivatives=True, **args),
        "outcome in the plane": carom.law(H, u, LAW),
        "outcome in space": carom.law(*space, carom.Poisson(0.5, 0.1)),
        "diagram": carom.diagram(H, u, 0.3, carom.law(H, u, [LAW])),
        "several points": quadruped.impact_at_points(*landing, restitution=0.5, friction=0.3),
        "contact problem": (problem := carom.ContactProblem(np.diag([1.0, 2, 3, 4]), [0.1, 0.2, -1, 2], kinds=["contact", "held"], friction=[0.3, 0])),
        "solution of a contact problem": problem.solve(),
        "energies": arm.energies(q, qd),
        "scene": scene,
        "changed scene": changed,
        "run": bounce.simulate(),
        "run with lasting contacts": table.simulate(),
        "run of a changed scene": changed.simulate(),
        "event": bounce.simulate().events[0],
        "table": table.simulate().event_table,
        "sensitivity": scene.sensitivity(),
        "study": study,
        "fit": carom.fit(chain=arm, q=q[near], qd_minus=qd[near], qd_plus=met.qd_plus[near], **args),
    }


MADE = made()


@pytest.mark.parametrize("kind", MADE)
def test_copies_and_pickles_show_what_the_object_shows(kind):
    own = MADE[kind]
    shown = plain(own)
    for other in (pickle.loads(pickle.dumps(own)), copy.copy(own), copy.deepcopy(own), pickle.loads(pickle.dumps(copy.deepcopy(own)))):
        assert type(other) is type(own) and plain(other) == shown


def test_every_class_is_pickled_or_says_why_not():
    session = MADE["scene"].session()
    linear = MADE["scene"].linear_run(["q"])
    for changing, words in [(session, "restart"), (session.save(), "restart"), (linear, "linear_run")]:
        for travel in (pickle.dumps, copy.deepcopy):
            with pytest.raises(TypeError, match=words):
                travel(changing)
    classes = {getattr(carom, name) for name in carom.__all__ if isinstance(getattr(carom, name), type)}
    tried = {base for own in [*MADE.values(), session, session.save(), linear] for base in type(own).__mro__}
    left = {one for one in classes - tried if not issubclass(one, (Exception, int, carom.Law))}
    assert left == set()


def test_a_pickled_scene_simulates_as_before():
    for kind in ("scene", "changed scene"):
        one, other = MADE[kind], pickle.loads(pickle.dumps(MADE[kind]))
        assert plain(one.simulate()) == plain(other.simulate())


def test_the_pickle_of_a_chain_has_its_urdf_and_that_of_a_scene_notices_other_files(tmp_path):
    for name in ("robots", "scenes"):
        shutil.copytree(ROOT / name, tmp_path / name)
    urdf = tmp_path / "robots/planar2.urdf"
    text = urdf.read_text()
    chain, scene = carom.Chain.from_urdf(urdf), carom.Scene.from_file(tmp_path / "scenes/planar2.toml")
    keys = tomllib.loads((tmp_path / "scenes/planar2.toml").read_text())
    given = carom.Scene.from_dict(keys, folder=tmp_path / "scenes")
    shown, pickled = plain(chain), [pickle.dumps(scene), pickle.dumps(given)]
    (tmp_path / "scenes/planar2.toml").unlink()
    assert all(plain(pickle.loads(one).chain) == plain(scene.chain) for one in pickled)
    urdf.write_text(text.replace("<robot", "<!-- another one --><robot", 1))
    for one in pickled:
        with pytest.raises(ValueError, match=r"planar2\.urdf has changed since this was pickled"):
            pickle.loads(one)
    urdf.unlink()
    assert plain(pickle.loads(pickle.dumps(chain))) == shown


def test_a_law_that_python_cannot_pickle_is_named():
    with pytest.raises((AttributeError, pickle.PicklingError), match="lambda"):
        pickle.dumps(carom.PythonLaw(lambda H, u: [0, 0, 0]))
