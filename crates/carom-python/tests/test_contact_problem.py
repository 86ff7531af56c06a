"""Contact problems by themselves: laws of several contacts, and the problems that time steps solve."""

import numpy as np
import pytest

import carom
from conftest import ROOT, close


def violations(problem, found):
    """How far a solution is from Coulomb's law and Signorini's condition with restitution, relative to speeds and impulses: overlap
    velocity, pull, both at once, beyond the cone, power that friction could take more."""
    p, u = found.impulse.reshape(-1, 3), found.u_plus.reshape(-1, 3)
    target = u[:, 2] + problem.restitution * np.minimum(problem.u_minus[2::3], 0.0)
    speed, most = np.abs(problem.u_free).max(), np.abs(p).max() or 1.0
    slip, push, reach = np.linalg.norm(u[:, :2], axis=1), np.linalg.norm(p[:, :2], axis=1), problem.friction * p[:, 2]
    taken = -(p[:, :2] * u[:, :2]).sum(axis=1)
    return [(-target).max() / speed, (-p[:, 2]).max() / most, np.abs(target * p[:, 2]).max() / (speed * most),
            (push - reach).max() / most, np.abs(reach * slip - taken).max() / (speed * most)]


def test_impulses_obey_coulomb_and_signorini(rng):
    for count in (1, 2, 5, 12):
        for rank in (3 * count, max(3, 2 * count)):
            J = rng.normal(size=(3 * count, rank))
            H = J @ J.T
            u = J @ rng.normal(size=rank)
            problem = carom.ContactProblem(H, u, friction=rng.uniform(0.0, 1.0, count), restitution=0.0)
            found = problem.solve()
            assert found.solved and found.residual <= 1e-12
            close(found.u_plus, u + H @ found.impulse, 1e-12)
            # Singular problems have large impulses; errors are those of velocities of 1e-12 and the entries of H.
            assert max(violations(problem, found)) <= 1e-10


def test_restitution_refers_to_the_velocities_before():
    # A ball of 2 kg that a force has slowed down from 3 to 1 m/s leaves with half of 3 m/s.
    problem = carom.ContactProblem(np.eye(3) / 2, [0, 0, -1.0], u_minus=[0, 0, -3.0], restitution=0.5)
    close(problem.solve().u_plus, [0, 0, 1.5])
    close(problem.solve().impulse, [0, 0, 5.0])


def test_the_laws_of_several_contacts_part_on_newtons_cradle():
    cradle = carom.ContactProblem([[2, -1], [-1, 2]], [-1, 0], restitution=1.0, kinds=["stop", "stop"])

    def balls(**how):
        p = cradle.solve(**how).impulse
        return [1 - p[0], p[0] - p[1], p[1]]

    close(balls(), [-1 / 3, 2 / 3, 2 / 3])
    close(balls(law="sequential"), [0, 0, 1])
    # Compression ends at the common velocity 1/3, with impulses 2/3 and 1/3, which restitution doubles.
    close(balls(law="poisson"), [-1 / 3, 2 / 3, 2 / 3])


def test_rows_of_every_kind():
    # A mass of 1 kg held in one direction, braked by dry friction in another, against a stop in the third.
    kinds = ["held", "dry", "stop"]
    problem = carom.ContactProblem(np.eye(3), [1.0, 1.0, -1.0], kinds=kinds, bounds=[0, 0.25, 0], restitution=[0, 0, 0.5])
    close(problem.solve().u_plus, [0, 0.75, 0.5])
    assert problem.kinds == kinds and problem.bounds.tolist() == [np.inf, 0.25, np.inf]
    again = carom.ContactProblem(problem.delassus, problem.u_free, friction=problem.friction, restitution=problem.restitution,
                                 u_minus=problem.u_minus, kinds=problem.kinds, bounds=problem.bounds)
    assert again.solve().impulse.tobytes() == problem.solve().impulse.tobytes()


def test_a_box_at_rest_is_carried_by_the_impulses_of_a_step():
    text = (ROOT / "scenes/box.toml").read_text().replace("../robots", str(ROOT / "robots"))
    scene = carom.Scene.from_toml(text).with_start(q=[0, 0, 0.025, 0, 0, 0, 1], qd=np.zeros(6))
    session, step = scene.session(), 1e-3
    session.advance(0.1)
    problem = session.contact_problem(step)
    assert set(problem.kinds) == {"contact"} and len(problem.kinds) >= 3
    carried = problem.solve().impulse.reshape(-1, 3)[:, 2].sum()
    mass = session.chain.mass_matrix(session.q)[0, 0]
    close(carried, mass * 9.81 * step, 1e-9)


def test_a_step_of_a_scene_is_the_solution_of_its_problem():
    text = (ROOT / "scenes/quadruped.toml").read_text().replace("../robots", str(ROOT / "robots"))
    scene = carom.Scene.from_toml(text.replace("[run]", '[run]\nmethod = "steps"\ncontact_step = 1e-3', 1))
    session, step, tried = scene.session(), 1e-3, 0
    for _ in range(300):
        problem, before = session.contact_problem(step), session.q
        session.advance(step)
        touched = session.contacts
        if len(problem.kinds) == 0:
            assert len(touched) == 0
            continue
        forces = problem.solve(tolerance=1e-10).impulse / step
        normal = np.array([forces[row] for row in np.flatnonzero(np.array(problem.kinds) == "contact") * 3 + 2])
        close(np.sort(np.asarray(touched["normal_force"])), np.sort(normal), 1e-6)
        tried += 1
    assert tried >= 20


@pytest.mark.parametrize("given, words", [
    (dict(delassus=np.eye(2)), r"delassus has the shape \(2, 2\), but u_free has 3 numbers"),
    (dict(delassus=-np.eye(3)), "positive"),
    (dict(u_free=[0, 0, np.nan]), "u_free"),
    (dict(friction=[0.1, 0.2]), "friction has 2 numbers for 1 constraints"),
    (dict(friction=-0.1), "friction"),
    (dict(restitution=2.0), "restitution"),
    (dict(kinds=["stop"] * 3, friction=0.5), "friction is 0.5 for constraint 0, which is a 'stop': only 'contact' has one"),
    (dict(kinds=["stop", "dry", "held"]), "give bounds"),
    (dict(kinds=["stop", "glue", "held"]), r"kinds\[1\] is 'glue': the kinds are contact, stop, dry, held"),
    (dict(bounds=1.0), "bounds is 1 for constraint 0, which is a 'contact'"),
    (dict(u_minus=[0, 0]), r"u_minus has the shape \(2,\)"),
])
def test_wrong_problems_are_refused_by_name(given, words):
    with pytest.raises(carom.CaromError, match=words):
        carom.ContactProblem(**{"delassus": np.eye(3), "u_free": [0, 0, -1.0]} | given)


@pytest.mark.parametrize("given, words", [
    (dict(law="newton"), "the laws of several points are moreau, poisson, sequential, energetic"),
    (dict(law="poisson", start=[0, 0, 0]), "start has no effect"),
    (dict(relative_stiffness=[1.0]), "relative_stiffness has no effect"),
    (dict(start=[0, 0]), "start has the shape"),
    (dict(tolerance=np.nan), "tolerance is NaN"),
    (dict(law="energetic", exponent=0.0), "exponent"),
])
def test_wrong_wishes_for_a_solution_are_refused_by_name(given, words):
    with pytest.raises(carom.CaromError, match=words):
        carom.ContactProblem(np.eye(3), [0, 0, -1.0]).solve(**given)


@pytest.mark.parametrize("step", [0.0, -1e-3, np.nan, np.inf])
def test_a_step_that_is_no_time_is_refused(step):
    with pytest.raises(carom.SimulationError, match="step"):
        carom.Scene.from_file(ROOT / "scenes/bounce.toml").session().contact_problem(step)
