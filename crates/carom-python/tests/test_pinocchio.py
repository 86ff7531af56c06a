"""The same quantities by Pinocchio, on all robots of example-robot-data and at random states.

Velocities are compared through the linear map T with v_pin = T v, which `to_pinocchio` of unit vectors gives: M = Tᵀ M_pin T,
J = J_pin T, tau = Tᵀ tau_pin. With mimic joints T is not square, and M = Tᵀ M_pin T is the mass matrix of the coupled joints.
"""

import importlib.metadata

import numpy as np
import pytest

import carom
from conftest import close, states

pin = pytest.importorskip("pinocchio")

# M, J and energies are sums of products without a division: rounding only.
ROUNDING = 1e-12

GRAVITY = np.array([0.3, -0.2, -9.81])
# What carom refuses, and Pinocchio reads.
REFUSED = {"alex_psyonic_hands": "mimic", "romeo_laas_small": "principal moment", "ur3": "link"}
ALL = [file.locate() for file in importlib.metadata.files("example-robot-data") if file.suffix == ".urdf"]
FILES = [file for file in ALL if file.stem not in REFUSED]
NAMES = [file.stem for file in FILES]


class Pair:
    """A robot in both libraries."""

    def __init__(self, file, floating):
        self.chain = carom.Chain.from_urdf(file, floating=floating, meshes=False)
        root = (pin.JointModelFreeFlyer(),) if floating else ()
        self.model = pin.buildModelFromUrdf(str(file), *root)
        self.model.gravity = pin.Motion(GRAVITY, np.zeros(3))
        self.data = self.model.createData()
        neutral = np.tile(self.chain.neutral(), (self.chain.nv, 1))
        self.T = self.chain.to_pinocchio(neutral, np.eye(self.chain.nv))[1].T
        assert self.T.shape == (self.model.nv, self.chain.nv)
        depth = [self.model.frames[self.model.getFrameId(name, pin.FrameType.BODY)].parentJoint for name in self.chain.frames]
        self.frame = self.chain.frames[int(np.argmax(depth))]

    def point_jacobian(self, q_pin, point):
        pin.computeJointJacobians(self.model, self.data, q_pin)
        pin.updateFramePlacements(self.model, self.data)
        frame = self.model.getFrameId(self.frame, pin.FrameType.BODY)
        whole = pin.getFrameJacobian(self.model, self.data, frame, pin.LOCAL_WORLD_ALIGNED)
        arm = self.data.oMf[frame].rotation @ point
        return (whole[:3] - pin.skew(arm) @ whole[3:]) @ self.T

    def mass_matrix(self, q_pin):
        upper = np.triu(pin.crba(self.model, self.data, q_pin))
        whole = upper + np.triu(upper, 1).T
        return self.T.T @ whole @ self.T


@pytest.fixture(scope="module", params=[False, True], ids=["fixed", "floating"])
def floating(request):
    return request.param


@pytest.mark.parametrize("file", FILES, ids=NAMES)
def test_dynamics_are_those_of_pinocchio(file, floating, rng):
    pair = Pair(file, floating)
    chain, model, data = pair.chain, pair.model, pair.data
    if chain.nv == 0:
        # Nothing moves.
        assert model.nv == 0 and chain.mass_matrix([]).shape == (0, 0)
        return
    point = np.array([0.02, -0.03, 0.05])
    Q, QD = states(chain, rng, 3)
    for q, qd in zip(Q, QD):
        q_pin, v_pin = chain.to_pinocchio(q, qd)
        close(v_pin, pair.T @ qd, 1e-15)
        J = pair.point_jacobian(q_pin, point)
        close(chain.jacobian(q, pair.frame, point), J, ROUNDING)
        frame = model.getFrameId(pair.frame, pin.FrameType.BODY)
        whole = pin.getFrameJacobian(model, data, frame, pin.LOCAL_WORLD_ALIGNED) @ pair.T
        close(chain.jacobian(q, pair.frame, full=True), np.vstack([whole[3:], whole[:3]]), ROUNDING)
        close(chain.pose(q, pair.frame), data.oMf[frame].homogeneous)
        close(chain.position(q, pair.frame), data.oMf[frame].translation)
        if chain.massless_links:
            with pytest.raises(carom.ChainError, match="no dynamics"):
                chain.forward_dynamics(q, qd)
            continue
        M = pair.mass_matrix(q_pin)
        close(chain.mass_matrix(q), M, ROUNDING)
        qdd = rng.normal(size=chain.nv)
        close(chain.inverse_dynamics(q, qd, qdd, gravity=GRAVITY), pair.T.T @ pin.rnea(model, data, q_pin, v_pin, pair.T @ qdd))
        by_q, by_qd = chain.inverse_dynamics_derivatives(q, qd, qdd, gravity=GRAVITY)
        pin.computeRNEADerivatives(model, data, q_pin, v_pin, pair.T @ qdd)
        close(by_q, pair.T.T @ data.dtau_dq @ pair.T)
        close(by_qd, pair.T.T @ data.dtau_dv @ pair.T)
        bias = pair.T.T @ pin.nonLinearEffects(model, data, q_pin, v_pin)
        close(chain.bias(q, qd, gravity=GRAVITY), bias)
        kinetic, potential = chain.energies(q, qd, gravity=GRAVITY)
        close(kinetic, pin.computeKineticEnergy(model, data, q_pin, v_pin), ROUNDING)
        close(potential, pin.computePotentialEnergy(model, data, q_pin), ROUNDING)
        # What divides by M has the error of its condition.
        error = 1e-14 * np.linalg.cond(M)
        if error > 1e-5:
            continue
        tau = rng.normal(size=chain.nv)
        expected = np.linalg.solve(M, tau - bias)
        if pair.T.shape[0] == pair.T.shape[1]:
            expected = np.linalg.solve(pair.T, pin.aba(model, data, q_pin, v_pin, np.linalg.solve(pair.T.T, tau)))
        close(chain.forward_dynamics(q, qd, tau, gravity=GRAVITY), expected, 10 * error + 1e-10)
        H = J @ np.linalg.solve(M, J.T)
        close(chain.delassus(q, pair.frame, point), H, error + 1e-10)


@pytest.mark.parametrize("name", REFUSED)
def test_robots_that_pinocchio_alone_reads_are_refused_for_what_is_wrong_in_them(name):
    with pytest.raises(carom.UrdfError, match=REFUSED[name]):
        carom.Chain.from_urdf(next(file for file in ALL if file.stem == name), meshes=False)


@pytest.mark.parametrize("file", FILES, ids=NAMES)
def test_the_order_of_pinocchio_has_an_inverse(file, floating, rng):
    chain = carom.Chain.from_urdf(file, floating=floating, meshes=False)
    q, qd = states(chain, rng, 4)
    back_q, back_qd = chain.from_pinocchio(*chain.to_pinocchio(q, qd))
    # A joint without limits comes back as the angle from -π to π, in which it was drawn.
    close(back_q, q, 1e-14)
    assert np.array_equal(back_qd, qd)


@pytest.mark.parametrize("stem", ["panda", "ur5_robot", "kinova", "xarm7", "talos_reduced", "solo12"])
def test_the_frictionless_impulse_is_that_of_pinocchio(stem, rng):
    pair = Pair(FILES[NAMES.index(stem)], stem in ("talos_reduced", "solo12"))
    chain = pair.chain
    q, qd = states(chain, rng, 1)
    q, qd = q[0], qd[0]
    q_pin, _ = chain.to_pinocchio(q, qd)
    J, M = pair.point_jacobian(q_pin, np.zeros(3)), pair.mass_matrix(q_pin)
    normal = rng.normal(size=3)
    normal /= np.linalg.norm(normal)
    normal *= -np.sign(normal @ J @ qd)
    e = 0.6
    response = np.linalg.solve(M, J.T @ normal)
    impulse = -(1 + e) * (normal @ J @ qd) / (normal @ J @ response)
    hit = chain.impact(q, qd, frame=pair.frame, normal=normal, law=carom.Frictionless(e))
    error = 1e-14 * np.linalg.cond(M) + 1e-10
    close(hit.impulse, impulse * normal, error)
    close(hit.qd_plus, qd + response * impulse, error)


def test_most_robots_are_compared():
    assert len(FILES) >= 60 and len(REFUSED) <= 5


def test_impulses_through_joints_are_those_of_pinocchio():
    """The recursive Newton-Euler algorithm of Pinocchio at rest, for an acceleration that is the jump and a force that is the impulse:
    its data.f is the wrench through each joint, in the axes of the joint, which are those of the child link. Rounding of sums."""
    file = next(file for file in FILES if file.stem == "panda")
    pair, rng = Pair(file, False), np.random.default_rng(5)
    chain, model, data = pair.chain, pair.model, pair.data
    model.gravity = pin.Motion(np.zeros(3), np.zeros(3))
    frame = model.getFrameId(pair.frame, pin.FrameType.BODY)
    for _ in range(20):
        q, change, impulse = chain.random_configuration(rng=rng), rng.normal(size=chain.nv), rng.normal(size=3)
        point = rng.normal(size=3)
        loads = chain.impact_loads(q, change, pair.frame, impulse, point=point)
        q_pin = chain.to_pinocchio(q, change)[0]
        close(loads["joint_impulse"], pair.point_jacobian(q_pin, point).T @ impulse)
        forces = [pin.Force.Zero() for _ in range(model.njoints)]
        local = data.oMf[frame].rotation.T @ impulse
        forces[model.frames[frame].parentJoint] = model.frames[frame].placement.act(pin.Force(local, np.cross(point, local)))
        pin.rnea(model, data, q_pin, np.zeros(model.nv), pair.T @ change, forces)
        assert len(loads["bearings"]) == model.njoints - 1
        for joint, own in loads["bearings"].items():
            theirs = data.f[model.getJointId(joint)]
            close(np.concatenate([own["force"], own["moment"]]), np.concatenate([theirs.linear, theirs.angular]), 1e-11)


def test_tool_velocities_are_those_of_the_jacobian_of_pinocchio():
    file = next(file for file in FILES if file.stem == "ur5_robot")
    pair, rng = Pair(file, False), np.random.default_rng(6)
    chain, u = pair.chain, np.array([0.3, -0.2, 0.5])
    for _ in range(20):
        q = chain.random_configuration(rng=rng)
        jacobian = pair.point_jacobian(chain.to_pinocchio(q, np.zeros(chain.nv))[0], np.zeros(3))
        close(chain.tool_velocity(q, pair.frame, u, motion="least-norm"), np.linalg.pinv(jacobian) @ u, 1e-8)
        inverse = np.linalg.inv(pair.mass_matrix(chain.to_pinocchio(q, np.zeros(chain.nv))[0]))
        least = inverse @ jacobian.T @ np.linalg.solve(jacobian @ inverse @ jacobian.T, u)
        close(chain.tool_velocity(q, pair.frame, u), least, 1e-7)
    with pytest.raises(ValueError, match="motion: 'fast' is none of least-energy, least-norm, without-rotation"):
        chain.tool_velocity(q, pair.frame, u, motion="fast")
