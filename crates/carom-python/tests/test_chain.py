"""Loading, names, configurations, shapes and what is refused."""

import pickle
import re

import numpy as np
import pytest

import carom
from conftest import ROOT, close, states

ROD = """<robot name="rod"><link name="base"/>
  <link name="rod"><inertial><origin xyz="1 0 0"/><mass value="2"/>
    <inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
  <joint name="hinge" type="revolute"><parent link="base"/><child link="rod"/><axis xyz="0 0 1"/>
    <limit lower="-1" upper="2" velocity="3" effort="4"/></joint>
</robot>"""


def test_a_string_that_begins_with_a_tag_is_the_urdf():
    rod = carom.Chain.from_urdf(ROD)
    assert (rod.name, rod.nq, rod.nv, rod.joints, rod.frames) == ("rod", 1, 1, ["hinge"], ["base", "rod"])
    assert [a.tolist() for a in (rod.lower, rod.upper, rod.velocity_limit, rod.effort_limit)] == [[-1], [2], [3], [4]]
    assert rod.total_mass == 2 and "nq 1" in repr(rod)
    # M = I + m l².
    assert rod.mass_matrix([0.3]).tolist() == [[3.0]]
    row = rod.joint_table[0]
    assert (row["type"], row["parent"], row["child"], row["q"], row["mimic"]) == ("revolute", "base", "rod", slice(0, 1, 1), None)
    floating = carom.Chain.from_urdf(ROD, floating=True)
    assert (floating.nq, floating.nv) == (8, 7)
    assert floating.neutral().tolist() == [0, 0, 0, 0, 0, 0, 1, 0]


def test_bad_robots_raise_the_messages_of_the_command_line(tmp_path):
    with pytest.raises(carom.UrdfError, match=r"none\.urdf: cannot be read"):
        carom.Chain.from_urdf(tmp_path / "none.urdf")
    with pytest.raises(carom.UrdfError, match="line|<string>:"):
        carom.Chain.from_urdf("<robot name='r'>")
    with pytest.raises(carom.UrdfError, match="colour"):
        carom.Chain.from_urdf("<robot name='r'><link name='a' colour='red'/></robot>", strict=True)
    odd = carom.Chain.from_urdf("<robot name='r'><link name='a' colour='red'/></robot>")
    assert any("colour" in warning for warning in odd.warnings)
    with pytest.raises(TypeError, match="neither a path nor a string"):
        carom.Chain.from_urdf(3)
    # Each is an exception of carom and, for those who do not know carom, a ValueError.
    assert issubclass(carom.UrdfError, carom.CaromError) and issubclass(carom.UrdfError, ValueError)


def test_robot_descriptions_are_named_if_they_are_missing(monkeypatch):
    import sys

    monkeypatch.setitem(sys.modules, "robot_descriptions", None)
    with pytest.raises(ImportError, match="pip install robot_descriptions"):
        carom.Chain.from_robot_description("panda_description")


def test_a_robot_description_gives_file_and_packages(monkeypatch, tmp_path):
    import sys
    import types

    file = tmp_path / "rod.urdf"
    file.write_text(ROD)
    package, module = types.ModuleType("robot_descriptions"), types.ModuleType("robot_descriptions.rod_description")
    package.__path__ = []
    module.URDF_PATH, module.PACKAGE_PATH = str(file), str(tmp_path)
    monkeypatch.setitem(sys.modules, "robot_descriptions", package)
    monkeypatch.setitem(sys.modules, "robot_descriptions.rod_description", module)
    assert carom.Chain.from_robot_description("rod_description").name == "rod"
    with pytest.raises(ImportError, match="robot_descriptions.no_description: .*list` prints the names"):
        carom.Chain.from_robot_description("no_description")


def test_integrate_and_difference_are_inverse(rng):
    chain = carom.Chain.from_urdf(ROD, floating=True)
    q, qd = states(chain, rng, 50)
    # Rotations by at most half a turn are the difference of their ends.
    qd[:, 3:6] *= 3 / np.maximum(3, np.linalg.norm(qd[:, 3:6], axis=1))[:, None]
    moved = chain.integrate(q, qd, 1.0)
    close(np.linalg.norm(moved[:, 3:7], axis=1), np.ones(50), 1e-15)
    close(chain.difference(q, moved), qd, 1e-13)
    half = chain.integrate(chain.integrate(q, qd, 0.5), qd, 0.5)
    close(chain.difference(half, moved), np.zeros((50, 7)), 1e-13)


def test_random_configurations_keep_the_limits_and_repeat_with_their_seed():
    chain = carom.Chain.from_urdf(ROD, floating=True)
    q = chain.random_configuration(5, 1000)
    assert q.shape == (1000, 8) and chain.random_configuration(5).shape == (8,)
    assert q[:, 7].min() >= -1 and q[:, 7].max() <= 2 and np.ptp(q[:, 7]) > 2.9
    close(np.linalg.norm(q[:, 3:7], axis=1), np.ones(1000), 1e-15)
    assert np.array_equal(q, chain.random_configuration(np.random.default_rng(5), 1000))
    assert chain.outside_limits(q[0]) == []
    assert "above its limit 2" in chain.outside_limits([0, 0, 0, 0, 0, 0, 1, 2.5])[0]


def mimicking(limits):
    """Joint m follows e: position −2 e + 0.3."""
    inertial = '<inertial><mass value="1"/><inertia ixx=".02" ixy="0" ixz="0" iyy=".02" iyz="0" izz=".02"/></inertial>'

    def joint(name, parent, child, limits, more=""):
        ends = f'<limit lower="{limits[0]}" upper="{limits[1]}" velocity="1" effort="1"/>'
        place = f'<parent link="{parent}"/><child link="{child}"/><axis xyz="0 0 1"/>'
        return f'<link name="{child}">{inertial}</link><joint name="{name}" type="revolute">{place}{ends}{more}</joint>'

    follows = '<mimic joint="e" multiplier="-2" offset="0.3"/>'
    links = joint("e", "a", "b", (-3, 3)) + joint("m", "b", "c", limits, follows)
    return carom.Chain.from_urdf(f'<robot name="r"><link name="a"/>{links}</robot>')


def test_random_configurations_keep_the_limits_of_mimic_joints():
    chain = mimicking((-3, 3))
    q = chain.random_configuration(5, 1000)
    assert -1.35 <= q.min() < -1.3 and 1.6 < q.max() <= 1.65
    assert not any(chain.outside_limits(row) for row in q)
    with pytest.raises(carom.ChainError, match="joint 'e': its limits and those of the joints that mimic it leave it no position"):
        mimicking((7, 9)).random_configuration()


CALLS = {
    "mass_matrix": lambda c, q, qd, **k: c.mass_matrix(q, **k),
    "jacobian": lambda c, q, qd, **k: c.jacobian(q, c.frames[-1], (0.1, 0.2, 0.3), **k),
    "full jacobian": lambda c, q, qd, **k: c.jacobian(q, c.frames[-1], full=True, **k),
    "pose": lambda c, q, qd, **k: c.pose(q, c.frames[-1], **k),
    "position": lambda c, q, qd, **k: c.position(q, c.frames[-1], **k),
    "bias": lambda c, q, qd, **k: c.bias(q, qd, gravity=(0, 0, -9.81), **k),
    "inverse_dynamics": lambda c, q, qd, **k: c.inverse_dynamics(q, qd, qd, gravity=(0, 0, -9.81), **k),
    "forward_dynamics": lambda c, q, qd, **k: c.forward_dynamics(q, qd, qd, gravity=(0, 0, -9.81), **k),
    "delassus": lambda c, q, qd, **k: c.delassus(q, c.frames[-1], (0.1, 0.2, 0.3), **k),
    "effective_mass": lambda c, q, qd, **k: c.effective_mass(q, c.frames[-1], (1, 2, 3), **k),
    "integrate": lambda c, q, qd, **k: c.integrate(q, qd, 0.1, **k),
    "difference": lambda c, q, qd, **k: c.difference(q, q[..., ::1] * 1.0, **k),
}


@pytest.mark.parametrize("name", CALLS)
def test_a_batch_equals_single_calls(name, arm7, rng):
    # More than the 256 states that one core computes at a time.
    q, qd = states(arm7, rng, 700)
    call = CALLS[name]
    batch = call(arm7, q, qd)
    single = np.array([call(arm7, q[k], qd[k]) for k in range(700)])
    assert batch.shape == single.shape
    assert np.array_equal(batch, single)
    # Any layout and any kind of real numbers.
    strided = np.zeros((700, 14))[:, ::2]
    strided[:] = q
    assert np.array_equal(call(arm7, strided, np.asfortranarray(qd)), batch)
    assert np.array_equal(call(arm7, q[::-1], qd[::-1]), batch[::-1])
    # Into the caller's array.
    out = np.full(batch.shape, np.nan)
    assert call(arm7, q, qd, out=out) is out
    assert np.array_equal(out, batch)
    assert call(arm7, q[:0], qd[:0]).shape == (0,) + batch.shape[1:]


def test_energies_of_a_batch_equal_single_calls(arm7, rng):
    q, qd = states(arm7, rng, 300)
    kinetic, potential = arm7.energies(q, qd, gravity=(0, 0, -9.81))
    close(kinetic, 0.5 * np.einsum("bi,bij,bj->b", qd, arm7.mass_matrix(q), qd), 1e-13)
    single = [arm7.energies(q[k], qd[k], gravity=(0, 0, -9.81)) for k in range(300)]
    assert np.array_equal(np.stack([kinetic, potential], axis=1), np.array(single))
    assert isinstance(single[0][0], float)


def test_one_state_beside_a_batch_serves_all(arm7, rng):
    q, qd = states(arm7, rng, 300)
    assert np.array_equal(arm7.bias(q[0], qd), arm7.bias(np.tile(q[0], (300, 1)), qd))
    assert np.array_equal(arm7.bias(q, qd[0]), arm7.bias(q, np.tile(qd[0], (300, 1))))


def test_numbers_of_other_kinds_are_converted(arm):
    whole = arm.mass_matrix(np.array([1, 2], dtype=np.int32))
    assert np.array_equal(whole, arm.mass_matrix([1.0, 2.0]))
    assert np.array_equal(whole, arm.mass_matrix(np.array([1, 2], dtype=">f8")))
    assert np.array_equal(whole, arm.mass_matrix(np.array([1, 2], dtype=np.float32)))
    misaligned = np.frombuffer(b"\0" + np.array([1.0, 2.0]).tobytes(), dtype=np.uint8)[1:].view(np.float64)
    assert not misaligned.flags.aligned
    assert np.array_equal(whole, arm.mass_matrix(misaligned))


@pytest.mark.parametrize(
    "q, error, words",
    [
        (np.zeros(3), carom.StateError, r"\(3,\).*\(2,\).*\(B, 2\).*shoulder, elbow"),
        (np.zeros((2, 2, 2)), carom.StateError, r"\(2, 2, 2\)"),
        (1.0, carom.StateError, r"shape \(\)"),
        ([], carom.StateError, r"\(0,\)"),
        ([0.0, np.nan], carom.StateError, r"q\[1\] is NaN"),
        ([[0.0, 0.0], [np.inf, 0.0]], carom.StateError, r"state 1: q\[0\] is inf"),
        (np.zeros(2, dtype=complex), TypeError, "complex128.*real numbers"),
        (["a", "b"], TypeError, "real numbers"),
        ([[0.0], [0.0, 1.0]], TypeError, "q is no array"),
        (None, TypeError, "real numbers"),
    ],
)
def test_wrong_configurations_are_refused_with_a_message(arm, q, error, words):
    with pytest.raises(error, match=words):
        arm.mass_matrix(q)


def test_the_first_of_several_bad_states_is_named(arm7, rng):
    q, _ = states(arm7, rng, 5000)
    q[4000, 1] = q[2000, 2] = q[3000, 3] = np.nan
    for _ in range(10):
        with pytest.raises(carom.StateError, match=r"state 2000: q\[2\]"):
            arm7.mass_matrix(q)


def test_batches_of_different_lengths_are_refused(arm):
    with pytest.raises(carom.StateError, match="q has 3 states but qd has 4"):
        arm.bias(np.zeros((3, 2)), np.zeros((4, 2)))


def test_an_out_that_does_not_fit_is_refused(arm):
    q = np.zeros((5, 2))
    for out, error, words in [
        (np.zeros((5, 2)), carom.StateError, r"shape \(5, 2\).*\(5, 2, 2\)"),
        (np.zeros((5, 2, 2), dtype=np.float32), TypeError, "float64"),
        (np.zeros((5, 2, 4))[:, :, ::2], carom.StateError, "contiguous"),
        ([0.0], TypeError, "numpy.empty"),
    ]:
        with pytest.raises(error, match=words):
            arm.mass_matrix(q, out=out)
    locked = np.zeros((5, 2, 2))
    locked.flags.writeable = False
    with pytest.raises(carom.StateError, match="written"):
        arm.mass_matrix(q, out=locked)


def test_unknown_names_are_refused_with_the_nearest(arm):
    with pytest.raises(carom.ChainError, match="tpi.*tip"):
        arm.jacobian([0, 0], "tpi")
    with pytest.raises(carom.ChainError, match="direction"):
        arm.effective_mass([0, 0], "tip", (0, 0, 0))
    assert arm.effective_mass([0, 0], "tip", (0, 0, 1)) == np.inf
    with pytest.raises(carom.ChainError, match="motion: 'foo' is none of least-energy, least-norm, without-rotation"):
        arm.tool_velocity([0.3, 0.4], "tip", (1, 0, 0), motion="foo")


def test_a_uniform_chain_has_the_inertia_of_a_rod():
    rod = carom.Chain.uniform(5, length=2.0, mass=3.0)
    close(rod.mass_matrix(rod.neutral())[0, 0], 3.0 * 2.0**2 / 3, 1e-14)
    with pytest.raises(carom.ChainError, match="positive"):
        carom.Chain.uniform(0, length=1.0, mass=1.0)


def test_rotors_and_masses_of_a_robot_are_those_that_are_given(arm):
    q = np.array([0.3, -0.8])
    bare = arm.mass_matrix(q)
    geared = carom.Chain.from_urdf(ROOT / "robots/planar2.urdf", rotor_inertia={"elbow": 0.25})
    close(geared.mass_matrix(q) - bare, [[0, 0], [0, 0.25]])
    again = pickle.loads(pickle.dumps(geared))
    close(again.mass_matrix(q), geared.mass_matrix(q), 0)
    # Twice the mass of every link, with its inertia.
    masses = {"link1": 10, "elbow_stator": 24, "link2": 5.378}
    close(carom.Chain.from_urdf(ROOT / "robots/planar2.urdf", mass=masses).mass_matrix(q), 2 * bare)
    # The inertia of the last link changes by 0.004 kg m² about the axis of both joints.
    text = (ROOT / "robots/planar2.urdf").read_text()
    own = [float(x) for x in re.findall(r'<inertia ixx="(\S+)".*?iyy="(\S+)".*?izz="(\S+)"', text, flags=re.DOTALL)[-1]]
    inertia = {"link2": [own[0], 0, 0, own[1], 0, own[2] + 0.004]}
    heavy = carom.Chain.from_urdf(ROOT / "robots/planar2.urdf", inertia=inertia)
    close(heavy.mass_matrix(q) - bare, np.full((2, 2), 0.004))
    close(pickle.loads(pickle.dumps(heavy)).mass_matrix(q), heavy.mass_matrix(q), 0)
    for wrong, why in [
        ([1, 0, 0, 1, 0, -1], "its principal moments must be positive and finite"),
        ([1, 0, 0, 1, 0, 3], "no body has a principal moment above the sum of the other two"),
    ]:
        with pytest.raises(carom.ChainError, match=f"inertia of .* is .*: {why}"):
            carom.Chain.from_urdf(ROOT / "robots/planar2.urdf", inertia={"link2": wrong})
    with pytest.raises(carom.StateError, match="inertia of 'link1' has 5 numbers: give six"):
        carom.Chain.from_urdf(ROOT / "robots/planar2.urdf", inertia={"link1": [1, 2, 3, 4, 5]})
    with pytest.raises(carom.ChainError, match="no link is named 'lnk1'; did you mean 'link1'"):
        carom.Chain.from_urdf(ROOT / "robots/planar2.urdf", mass={"lnk1": 1})
    with pytest.raises(carom.ChainError, match="mass of .* is 1: only a link with a mass"):
        carom.Chain.from_urdf(ROOT / "robots/planar2.urdf", mass={"base": 1})
    with pytest.raises(carom.ChainError, match="elbw"):
        carom.Chain.from_urdf(ROOT / "robots/planar2.urdf", rotor_inertia={"elbw": 1})


def test_numbers_that_are_not_finite_and_batches_where_one_state_is_needed_are_refused(arm):
    for call in (lambda: arm.integrate([0, 0], [1, 1], np.nan), lambda: arm.jacobian([0, 0], "tip", (0, np.inf, 0)),
                 lambda: arm.bias([0, 0], [1, 1], gravity=(0, 0, np.nan)), lambda: arm.outside_limits(np.zeros((2, 2)))):
        with pytest.raises(carom.StateError):
            call()
