"""Impacts: single, in batches, with derivatives, under every law and laws in Python."""

import pickle

import numpy as np
import pytest

import carom
from conftest import ROOT, close, states

LAWS = [
    carom.Frictionless(0.5),
    carom.Whittaker(0.5, 0.3),
    carom.Newton(0.5, 0.3),
    carom.Poisson(0.5, 0.3),
    carom.Energetic(0.5, 0.3),
    carom.ChatterjeeRuina(0.5, 0.3, 0.1),
    carom.Brach(0.5, 0.3),
    carom.Smith(0.5, 0.3),
]
NORMAL = np.array([0.2, -0.4, 0.8])


def approaching(chain, rng, count):
    """Random states whose last frame approaches along NORMAL."""
    q, qd = states(chain, rng, count)
    u_n = np.einsum("bij,bj->bi", chain.jacobian(q, chain.frames[-1]), qd) @ NORMAL
    return q, qd * -np.sign(u_n)[:, None]


@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.name)
def test_every_law_obeys_the_impact_equation(law, arm7, rng):
    q, qd = approaching(arm7, rng, 400)
    frame, point = arm7.frames[-1], (0.01, 0.02, -0.03)
    hit = arm7.impact(q, qd, frame=frame, point=point, normal=NORMAL, law=law)
    J, M = arm7.jacobian(q, frame, point), arm7.mass_matrix(q)
    # M (qd⁺ − qd⁻) = Jᵀ p, u = J qd, and the energies are those of M.
    close(np.einsum("bij,bj->bi", M, hit.qd_plus - qd), np.einsum("bij,bi->bj", J, hit.impulse), 1e-11)
    close(hit.u_minus, np.einsum("bij,bj->bi", J, qd), 1e-13)
    close(hit.u_plus, np.einsum("bij,bj->bi", J, hit.qd_plus), 1e-10)
    close(hit.energy_after, 0.5 * np.einsum("bi,bij,bj->b", hit.qd_plus, M, hit.qd_plus), 1e-10)
    close(hit.normal_work + hit.friction_work, hit.energy_after - hit.energy_before, 1e-10)
    if law.name in ("frictionless", "whittaker", "newton", "chatterjee-ruina", "brach", "smith"):
        met = ~hit.flagged("no-approach") & ~hit.flagged("jam")
        n = NORMAL / np.linalg.norm(NORMAL)
        close((hit.u_plus @ n)[met], -0.5 * (hit.u_minus @ n)[met], 1e-9)


@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.name)
def test_a_batch_equals_single_impacts(law, arm7, rng):
    q, qd = states(arm7, rng, 600)
    frame = arm7.frames[-1]
    batch = arm7.impact(q, qd, frame=frame, normal=NORMAL, law=law)
    assert len(batch) == 600 and "600 states" in repr(batch)
    for k in range(600):
        one = arm7.impact(q[k], qd[k], frame=frame, normal=NORMAL, law=law)
        for name in ("qd_plus", "impulse", "u_minus", "u_plus", "energy_before", "energy_after", "normal_work", "friction_work"):
            assert np.array_equal(getattr(one, name), getattr(batch, name)[k]), name
        assert one.mode == batch.mode[k] and one.law == law.name
        assert one.flags == [f.name.lower().replace("_", "-") for f in carom.Flags if f & batch.flag_bits[k]]
    assert {"open", "slip"} <= set(batch.mode) and batch.flagged("no-approach").any()


VECTORS = ("qd_plus", "impulse", "u_minus", "u_plus", "drive_impulse")
NUMBERS = ("energy_before", "energy_after", "energy_ratio", "normal_work", "friction_work", "drive_work")
WORDS = ("law", "mode", "flags")


def test_a_state_of_a_batch_is_its_impact(arm7, rng):
    q, qd = states(arm7, rng, 40)
    args = dict(frame=arm7.frames[-1], normal=NORMAL, law=carom.ChatterjeeRuina(0.5, 0.3, 0.2), derivatives=True)
    batch = arm7.impact(q, qd, **args)
    for k, hit in enumerate(batch):
        one = arm7.impact(q[k], qd[k], **args)
        for name in VECTORS + NUMBERS:
            assert np.array_equal(getattr(hit, name), getattr(one, name)), name
            assert np.array_equal(getattr(hit, name), getattr(batch, name)[k]), name
        assert all(getattr(hit, name) == getattr(one, name) for name in WORDS) and repr(hit) == repr(one)
        assert batch.flags[k] == one.flags and batch.mode[k] == one.mode and batch.law == one.law
        assert {name: value.tolist() for name, value in hit.derivatives.items()} == {
            name: value.tolist() for name, value in one.derivatives.items()
        }
    assert k == 39 and {"no-approach"} < {*sum(batch.flags, []), ""}
    assert repr(batch[-1]) == repr(batch[39]) == repr(batch[np.int64(39)])
    met = ~batch.flagged("no-approach")
    for part, places in [(batch[5:30:2], np.arange(5, 30, 2)), (batch[met], np.flatnonzero(met)), (batch[[3, 1]], [3, 1])]:
        assert isinstance(part, carom.Impacts) and len(part) == len(places)
        assert np.array_equal(part.qd_plus, batch.qd_plus[places]) and repr(part[1]) == repr(batch[places[1]])
        assert np.array_equal(part.derivatives["q"], batch.derivatives["q"][places])
    for wrong, error in [(40, IndexError), (-41, IndexError), ((1, 2), TypeError), ("a", IndexError)]:
        with pytest.raises(error):
            batch[wrong]


def test_normals_points_and_coefficients_may_differ_between_states(arm7, rng):
    q, qd = states(arm7, rng, 300)
    normal, point = rng.normal(size=(300, 3)), 0.1 * rng.normal(size=(300, 3))
    e, mu = rng.uniform(0, 1, 300), rng.uniform(0, 0.8, 300)
    frame = arm7.frames[-1]
    batch = arm7.impact(q, qd, frame, normal, carom.Energetic(0.5, 0.3), point=point, restitution=e, friction=mu)
    for k in range(300):
        one = arm7.impact(q[k], qd[k], frame, normal[k], carom.Energetic(e[k], mu[k]), point=point[k])
        assert np.array_equal(batch.qd_plus[k], one.qd_plus) and np.array_equal(batch.impulse[k], one.impulse), k
    # One state under many coefficients; the law has the others.
    swept = arm7.impact(q[0], -qd[0], frame, normal[0], carom.ChatterjeeRuina(0.5, 0.3, 0.4), friction=mu)
    for k in (0, 7, 299):
        law = carom.ChatterjeeRuina(0.5, mu[k], 0.4)
        assert np.array_equal(swept.qd_plus[k], arm7.impact(q[0], -qd[0], frame, normal[0], law).qd_plus)
    own = arm7.impact(q[0], -qd[0], frame, normal[0], carom.Newton(0.5), restitution=0.25)
    assert isinstance(own, carom.Impact) and np.array_equal(own.qd_plus, arm7.impact(q[0], -qd[0], frame, normal[0], carom.Newton(0.25)).qd_plus)
    with pytest.raises(carom.StateError, match="q has 300 states but normal has 299"):
        arm7.impact(q, qd, frame, normal[:299], carom.Newton(0.5))
    with pytest.raises(carom.ImpactError, match="state 7: .*restitution"):
        arm7.impact(q, qd, frame, normal, carom.Newton(0.5), restitution=np.where(np.arange(300) == 7, 1.5, 0.5))
    with pytest.raises(carom.StateError, match=r"friction has the shape \(300, 1\)"):
        arm7.impact(q, qd, frame, normal, carom.Newton(0.5), friction=mu[:, None])
    with pytest.raises(TypeError, match="a function has its own"):
        arm7.impact(q, qd, frame, normal, newton, friction=mu)


def test_laws_show_compare_and_travel():
    assert repr(carom.Energetic(0.5, 0.2)) == "carom.Energetic(restitution=0.5, friction=0.2)"
    assert carom.Energetic(0.5, 0.2) == carom.Energetic(0.5, 0.2) != carom.Newton(0.5, 0.2)
    for law in LAWS + [carom.Brach(0.5, impulse_ratio=-0.2)]:
        assert isinstance(law, carom.Law)
        assert pickle.loads(pickle.dumps(law)) == law
        assert hash(pickle.loads(pickle.dumps(law))) == hash(law)
    for bad in [lambda: carom.Energetic(1.5), lambda: carom.Newton(0.5, -1), lambda: carom.ChatterjeeRuina(0.5, 0.1, 2)]:
        with pytest.raises(carom.ImpactError, match="restitution|friction"):
            bad()
    with pytest.raises(TypeError, match="both friction and impulse_ratio"):
        carom.Brach(0.5, 0.2, 0.1)


def test_a_list_of_laws_gives_a_list(arm):
    hits = arm.impact([0.7854, -1.5708], [-0.15, 0.6], frame="tip", normal=[-1, 0, 0], law=LAWS)
    assert [hit.law for hit in hits] == [law.name for law in LAWS]
    assert "energetic" in repr(hits[4])


def test_derivatives_are_those_of_differences(arm7, rng):
    q, qd = approaching(arm7, rng, 3)
    law, frame, step = (0.5, 0.3), arm7.frames[-1], 1e-6
    batch = arm7.impact(q, qd, frame=frame, normal=NORMAL, law=carom.Energetic(*law), derivatives=True)
    for k in range(3):
        after = lambda q, qd, law=law: arm7.impact(q, qd, frame=frame, normal=NORMAL, law=carom.Energetic(*law)).qd_plus
        by = arm7.impact(q[k], qd[k], frame=frame, normal=NORMAL, law=carom.Energetic(*law), derivatives=True).derivatives
        for i, unit in enumerate(np.eye(7)):
            close(by["q"][:, i], (after(q[k] + step * unit, qd[k]) - after(q[k] - step * unit, qd[k])) / (2 * step), 1e-6)
            close(by["qd"][:, i], (after(q[k], qd[k] + step * unit) - after(q[k], qd[k] - step * unit)) / (2 * step), 1e-6)
        e, mu = law
        close(by["restitution"], (after(q[k], qd[k], (e + step, mu)) - after(q[k], qd[k], (e - step, mu))) / (2 * step), 1e-6)
        close(by["friction"], (after(q[k], qd[k], (e, mu + step)) - after(q[k], qd[k], (e, mu - step))) / (2 * step), 1e-6)
        for name, value in by.items():
            assert np.array_equal(batch.derivatives[name][k], value), name
    assert arm7.impact(q[0], qd[0], frame=frame, normal=NORMAL, law=carom.Energetic(*law)).derivatives is None


def test_bands_hold_and_reach_the_outcomes(arm):
    state = dict(q=[0.7854, -1.5708], qd=[-0.15, 0.6], frame="tip", normal=[-1, 0, 0])
    band = arm.impact(**state, law=carom.Energetic(0.3, 0.1), band=((0.2, 0.6), (0.0, 0.4))).band
    low, high = band["qd_plus"].T
    inside = [
        arm.impact(**state, law=carom.Energetic(e, mu)).qd_plus for e in np.linspace(0.2, 0.6, 9) for mu in np.linspace(0, 0.4, 9)
    ]
    assert np.all(inside >= low - 1e-12) and np.all(inside <= high + 1e-12)
    close([np.min(inside, axis=0), np.max(inside, axis=0)], [low, high], 0.02)
    assert band["evaluations"] > 0 and isinstance(band["exact"], bool)


def test_the_saltation_matrix_of_a_bouncing_rod_is_the_closed_form():
    # A slider of one freedom on a plane under gravity g: Ξ = [[-e, 0], [(1+e) g/v, -e]].
    slider = carom.Chain.from_urdf(
        """<robot name="slider"><link name="base"/><link name="ball"><inertial><mass value="2"/>
        <inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
        <joint name="rail" type="prismatic"><parent link="base"/><child link="ball"/><axis xyz="0 0 1"/>
        <limit lower="-9" upper="9" velocity="9" effort="9"/></joint></robot>"""
    )
    e, g, v = 0.7, 9.81, -2.0
    hit = slider.impact(
        [0.0], [v], frame="ball", normal=(0, 0, 1), law=carom.Newton(e), saltation=True, gravity=(0, 0, -g)
    )
    close(hit.saltation["matrix"], [[-e, 0], [(1 + e) * -g / v, -e]], 1e-14)
    assert hit.saltation["closing"] == v


def test_held_joints_take_part(arm):
    state = dict(q=[0.7854, -1.5708], qd=[-0.15, 0.6], frame="tip", normal=[-1, 0, 0], law=carom.Frictionless(0.5))
    held = arm.impact(**state, joints=["shoulder"])
    assert held.qd_plus[0] == -0.15 and held.drive_impulse[1] == 0
    stiff = arm.impact(**state, joints=dict(stiffness=[1e12, 0.0], damping=0.0, contact_time=1e-2))
    close(stiff.qd_plus, held.qd_plus, 1e-6)
    both = arm.impact(np.tile(state["q"], (3, 1)), np.tile(state["qd"], (3, 1)), "tip", [-1, 0, 0], state["law"], joints=["shoulder"])
    assert np.array_equal(both.drive_impulse[2], held.drive_impulse)
    with pytest.raises(carom.ImpactError, match="joints locked"):
        arm.impact(**state, joints="locked")
    with pytest.raises(carom.ImpactError, match="'stuck'"):
        arm.impact(**state, joints="stuck")
    with pytest.raises(carom.ChainError, match="elbwo"):
        arm.impact(**state, joints=["elbwo"])


def test_a_saltation_matrix_of_held_joints_is_refused_as_their_derivatives(arm):
    state = dict(q=[0.7854, -1.5708], qd=[-0.15, 0.6], frame="tip", normal=[-1, 0, 0], law=carom.Frictionless(0.5))
    assert arm.impact(**state, joints="free", saltation=True).saltation is not None
    for joints in (["shoulder"], dict(stiffness=1.0, damping=1.0, contact_time=1e-3)):
        for wish in ("derivatives", "saltation"):
            with pytest.raises(carom.SimulationError, match="locked or impedance-weighted joints are not implemented"):
                arm.impact(**state, joints=joints, **{wish: True})


def test_one_stiffness_or_damping_is_that_of_all_joints_but_a_floating_base():
    free = carom.Chain.from_urdf(ROOT / "robots/quadruped.urdf", floating=True)
    foot = next(name for name in free.frames if "foot" in name)
    q, qd = (x[0] for x in states(free, np.random.default_rng(3), 1))
    qd = qd if (free.jacobian(q, foot) @ qd)[2] < 0 else -qd

    def hit(damping):
        joints = dict(stiffness=0.0, damping=damping, contact_time=0.01)
        return free.impact(q, qd, foot, (0, 0, 1), carom.Frictionless(0.5), joints=joints)

    each = np.full(free.nv, 100.0)
    each[:6] = 0.0
    assert np.array_equal(hit(100.0).qd_plus, hit(each).qd_plus)
    assert not hit(100.0).drive_impulse[:6].any() and hit(100.0).drive_impulse[6:].any()


def test_arrays_of_a_batch_are_read_only(arm7, rng):
    """They are those of the results, which writing would change; those of one impact are copies."""
    import pickle

    q, qd = approaching(arm7, rng, 4)
    hits = arm7.impact(q, qd, arm7.frames[-1], NORMAL, carom.Energetic(0.5, 0.2), derivatives=True)
    before = hits[1].qd_plus.copy()
    for own in (hits, hits[1:3], hits[[1, 2]], pickle.loads(pickle.dumps(hits))):
        arrays = {name: getattr(own, name) for name in (
            "qd_plus", "impulse", "u_minus", "u_plus", "drive_impulse", "energy_before", "energy_after", "normal_work",
            "friction_work", "drive_work", "flag_bits")}
        for name, array in {**arrays, **own.derivatives}.items():
            with pytest.raises(ValueError, match="read-only"):
                array[...] = 1
            assert not array.flags.writeable, name
        own.derivatives.clear()
        assert own.derivatives.keys() == hits.derivatives.keys()
        own.energy_ratio[...] = 0
        own.mode[...] = "open"
    assert np.array_equal(hits[1].qd_plus, before) and hits.energy_ratio.any()
    one = hits[1]
    one.qd_plus[...] = 0
    assert np.array_equal(one.qd_plus, before)


def newton(H, u):
    """Newton's law without friction, e = 0.5, from contact axes."""
    p = np.zeros_like(u)
    p[-1] = -1.5 * u[-1] / H[-1, -1]
    return p


def test_a_law_in_python_equals_the_same_law_of_carom(arm7, rng):
    q, qd = states(arm7, rng, 300)
    args = dict(frame=arm7.frames[-1], normal=NORMAL)
    own, known = (arm7.impact(q, qd, law=law, **args) for law in (newton, carom.Frictionless(0.5)))
    for name in ("qd_plus", "impulse", "u_plus", "energy_after", "normal_work"):
        close(getattr(own, name), getattr(known, name), 1e-12)
    assert own.flags == known.flags
    one = arm7.impact(q[0], qd[0], law=carom.PythonLaw(newton, 0.5, 0.1, name="mine"), **args)
    assert one.law == "mine" and np.array_equal(one.qd_plus, own.qd_plus[0])
    H, u = np.array([[2.0, 0.5], [0.5, 1.0]]), np.array([1.0, -1.0])
    close(carom.law(H, u, newton).u_plus, carom.law(H, u, carom.Frictionless(0.5)).u_plus, 1e-15)


def test_exceptions_of_a_law_in_python_are_passed_on(arm):
    class Own(Exception):
        pass

    def failing(H, u):
        raise Own("no idea")

    state = dict(q=[0.7854, -1.5708], qd=[-0.15, 0.6], frame="tip", normal=[-1, 0, 0])
    with pytest.raises(Own, match="no idea"):
        arm.impact(**state, law=failing)
    with pytest.raises(Own, match="no idea"):
        arm.impact(np.tile(state["q"], (3, 1)), np.tile(state["qd"], (3, 1)), "tip", [-1, 0, 0], failing)
    for wrong, words in [(lambda H, u: [1.0], r"\(1,\).*\(3,\)"), (lambda H, u: "no", "real numbers"), (lambda H, u: None, "real")]:
        with pytest.raises(TypeError, match=words):
            arm.impact(**state, law=wrong)
    with pytest.raises(carom.ImpactError, match="finite"):
        arm.impact(**state, law=lambda H, u: [0, 0, np.nan])
    with pytest.raises(carom.ImpactError, match="no derivative"):
        arm.impact(**state, law=newton, derivatives=True)


def test_wrong_requests_are_refused(arm):
    q, qd = [0.7854, -1.5708], [-0.15, 0.6]
    law = carom.Energetic(0.5, 0.2)
    for words, error, call in [
        ("fixed to the world", carom.ImpactError, lambda: arm.impact(q, qd, "base", [-1, 0, 0], law)),
        ("direction", carom.ChainError, lambda: arm.impact(q, qd, "tip", [0, 0, 0], law)),
        ("singular direction", carom.ImpactError, lambda: arm.impact(q, qd, "tip", [0, 0, 1], law)),
        ("law is str", TypeError, lambda: arm.impact(q, qd, "tip", [-1, 0, 0], "energetic")),
        ("law is a class", TypeError, lambda: arm.impact(q, qd, "tip", [-1, 0, 0], carom.Energetic)),
        (r"normal has the shape \(2,\)", carom.StateError, lambda: arm.impact(q, qd, "tip", [-1, 0], law)),
        (r"qd\[0\] is NaN", carom.StateError, lambda: arm.impact(q, [np.nan, 0], "tip", [-1, 0, 0], law)),
        ("state 1: qd", carom.StateError, lambda: arm.impact([q, q], [qd, [0, np.inf]], "tip", [-1, 0, 0], law)),
        ("saltation=True", TypeError, lambda: arm.impact(q, qd, "tip", [-1, 0, 0], law, gravity=(0, 0, 0))),
        ("one state", TypeError, lambda: arm.impact([q], [qd], "tip", [-1, 0, 0], law, saltation=True)),
        ("name is 'glow', and no flag is named so", carom.ImpactError, lambda: arm.impact([q], [qd], "tip", [-1, 0, 0], law).flagged("glow")),
    ]:
        with pytest.raises(error, match=words):
            call()
    empty = arm.impact(np.zeros((0, 2)), np.zeros((0, 2)), "tip", [-1, 0, 0], law)
    assert len(empty) == 0 and empty.qd_plus.shape == (0, 2) and empty.mode.shape == (0,)


def test_plain_numbers_have_all_branches():
    # A rod at 60° whose lower end slides on a floor as rough as 1.5: the impact without collision.
    H, u = np.array([[3.25, -1.299038105676658], [-1.299038105676658, 1.75]]), np.array([-1.0, 0.0])
    still, jump = carom.law(H, u, carom.Energetic(0.0, 1.5), branches=True)
    assert still.impulse.tolist() == [0, 0] and {"jam", "non-unique"} <= set(jump.flags)
    close(jump.impulse, [0.4375, 0.32475953], 1e-8)
    with pytest.raises(carom.StateError, match=r"H has the shape \(3, 3\)"):
        carom.law(np.eye(3), [1.0, -1.0], carom.Newton(0.5))
    with pytest.raises(carom.ImpactError, match="symmetric"):
        carom.law([[1.0, 0.5], [0.0, 1.0]], [1.0, -1.0], carom.Newton(0.5))
    hit = carom.law(np.diag([2.0, 1.0]), [1.0, -1.0], carom.Newton(0.5, 0.1))
    assert hit.coefficients["newton"] == 0.5 and hit.mode == "slip" and "newton" in repr(hit)


def test_a_diagram_has_the_impulse_of_each_law():
    H, u = np.array([[2.44, 1.52], [1.52, 1.01]]), np.array([-0.267, -0.134])
    outcomes = carom.law(H, u, [carom.Newton(0.5, 0.5), carom.Poisson(0.5, 0.5), carom.Energetic(0.5, 0.5)])
    drawn = carom.diagram(H, u, 0.5, outcomes)
    marks = {mark["name"]: mark["at"] for mark in drawn["marks"] if mark["symbol"] == "law"}
    for outcome in outcomes:
        assert np.array_equal(marks[outcome.law], outcome.impulse)
    assert drawn["svg"].startswith("<svg") and drawn["window"].shape == (2, 2) and drawn["shapes"]
    with pytest.raises(carom.ImpactError, match="approach"):
        carom.diagram(H, -u, 0.5, outcomes)
    for friction in (-0.3, np.nan):
        with pytest.raises(carom.ImpactError, match="friction is .*: it must be finite and 0 or more"):
            carom.diagram(H, u, friction, outcomes)


def test_points_that_stick_project_the_velocity_and_one_point_is_an_impact():
    """q̇ projected onto the motions that leave a toe line at rest, by numpy's pseudo-inverse; a face has redundant points."""
    quadruped = carom.Chain.from_urdf(ROOT / "robots/quadruped.urdf", floating=True)
    foot = next(name for name in quadruped.frames if "foot" in name)
    rng = np.random.default_rng(7)
    q, qd = (x[0] for x in states(quadruped, rng, 1))
    points = [(foot, (0.1, y, -0.02)) for y in (-0.05, 0.05)]
    hit = quadruped.impact_at_points(q, qd, points, (0, 0, 1), sticks=True)
    rows = np.vstack([quadruped.jacobian(q, frame, point=point) for frame, point in points])
    half = np.linalg.inv(np.linalg.cholesky(quadruped.mass_matrix(q)))
    jump = -half.T @ np.linalg.pinv(rows @ half.T, rcond=1e-9) @ (rows @ qd)
    # 1e-9: rounding times the condition number of H.
    close(hit.qd_plus, qd + jump, 1e-9)
    assert hit.impulses.shape == (2, 3) and np.abs(hit.u_plus).max() < 1e-9 < np.abs(hit.u_minus).max()
    assert hit.energy_after < hit.energy_before and hit.residual < 1e-9 and "2 points" in repr(hit)

    one = quadruped.impact_at_points(q, qd, points[:1], [(0, 0, 1)], restitution=0.5, joints="locked")
    same = quadruped.impact(q, qd, foot, (0, 0, 1), carom.Frictionless(0.5), point=points[0][1], joints="locked")
    close(one.qd_plus, same.qd_plus, 1e-12)
    with pytest.raises(carom.ImpactError, match="the laws of several points are moreau, poisson, sequential"):
        quadruped.impact_at_points(q, qd, points, (0, 0, 1), law="newton")
    smooth = quadruped.impact_at_points(q, qd, points[:1], (0, 0, 1), restitution=0.5, law="energetic", joints="locked")
    close(smooth.qd_plus, one.qd_plus, 1e-9)
    with pytest.raises(carom.ImpactError, match="energetic law"):
        quadruped.impact_at_points(q, qd, points, (0, 0, 1), law="energetic", friction=0.2)
    with pytest.raises(carom.StateError, match="relative_stiffness has 1 numbers for 2 points"):
        quadruped.impact_at_points(q, qd, points, (0, 0, 1), law="energetic", relative_stiffness=[1.0])
    with pytest.raises(carom.StateError, match="normal has 3 rows"):
        quadruped.impact_at_points(q, qd, points, np.eye(3))
    with pytest.raises(carom.StateError, match=r"restitution has the shape \(2,\): give one number, that of every point"):
        quadruped.impact_at_points(q, qd, points, (0, 0, 1), restitution=np.array([0.1, 0.2]))
    with pytest.raises(carom.ImpactError, match="StruckPoint|points"):
        quadruped.impact_at_points(q, qd, [], (0, 0, 1))


@pytest.mark.parametrize("given, words", [
    (dict(joints=dict(stiffness=1, damping=1, contact_time=1e-3, stifness=3)), "joints has 'stifness'"),
    (dict(law=carom.Frictionless(0.5), friction=0.3), "friction has no effect: the law 'frictionless' has none"),
])
def test_arguments_that_nothing_uses_are_refused(arm, given, words):
    args = dict(frame="tip", normal=(-1, 0, 0), law=carom.Energetic(0.5, 0.2)) | given
    with pytest.raises(TypeError, match=words):
        arm.impact([0.3, 0.4], [1, 1], **args)


@pytest.mark.parametrize("given, words", [
    (dict(sticks=True, friction=0.3), "friction has no effect with sticks=True"),
    (dict(exponent=1.2), "exponent has no effect under the law 'moreau'"),
    (dict(law="poisson", relative_stiffness=[1.0]), "relative_stiffness has no effect under the law 'poisson'"),
])
def test_arguments_of_several_points_that_nothing_uses_are_refused(arm, given, words):
    with pytest.raises(carom.ImpactError, match=words):
        arm.impact_at_points([0.3, 0.4], [1, 1], [("tip", (0, 0, 0))], (-1, 0, 0), **given)
