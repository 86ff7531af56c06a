"""PyBullet: restitution and friction with its defaults and with all thresholds zero, and contacts with stiffness and damping."""

import importlib.metadata
import math

import pybullet as bullet

import common

STEPS = 16  # between two samples, unless refined
GRID = [[0.0, 0.2, 0.4, 0.6, 0.8], [0.05, 0.15, 0.3, 0.6]]  # of carom


class Engine:
    peer, version = "PyBullet", importlib.metadata.version("pybullet")
    common_settings = {"step": f"1/{STEPS} of the interval of the samples", "damping": 0}
    parameters = [("e", 0.0, 1.0, GRID[0]), ("friction", 0.0, 1.0, GRID[1])]
    exact = False

    def __init__(self, urdf, gravity, spacing, refine):
        if not bullet.isConnected():
            bullet.connect(bullet.DIRECT)
        self.urdf, self.gravity, self.steps, self.dt = urdf, gravity, STEPS * refine, spacing / (STEPS * refine)

    def tune(self, values):
        self.values = values

    def contact(self, floor, links):
        restitution, friction = self.values
        # The coefficients of a pair are multiplied.
        bullet.changeDynamics(floor, -1, restitution=1.0, lateralFriction=1.0)
        for link in links:
            bullet.changeDynamics(self.body, link, restitution=restitution, lateralFriction=friction)

    def reset(self, q, qd):
        # A new world, since resetting keeps the contact cache of the last run.
        bullet.resetSimulation()
        bullet.setTimeStep(self.dt)
        bullet.setGravity(*self.gravity)
        floor = bullet.createMultiBody(0, bullet.createCollisionShape(bullet.GEOM_PLANE, planeNormal=[0, 0, 1]))
        self.body = bullet.loadURDF(self.urdf, flags=bullet.URDF_USE_INERTIA_FROM_FILE)
        if any(bullet.getDynamicsInfo(self.body, -1)[3]):
            raise ValueError("the centre of mass of the root link must be its origin")
        self.joints = range(bullet.getNumJoints(self.body))
        links = [-1, *self.joints]
        for link in links:
            bullet.changeDynamics(self.body, link, linearDamping=0, angularDamping=0, jointDamping=0, spinningFriction=0,
                                  rollingFriction=0, maxJointVelocity=1e6, activationState=bullet.ACTIVATION_STATE_DISABLE_SLEEPING)
        self.contact(floor, links)
        for joint in self.joints:
            bullet.setJointMotorControl2(self.body, joint, bullet.VELOCITY_CONTROL, force=0)
        if self.exact:
            for link in links:
                bullet.changeDynamics(self.body, link, contactProcessingThreshold=0)
            bullet.setPhysicsEngineParameter(restitutionVelocityThreshold=0, erp=0, contactERP=0, frictionERP=0, contactSlop=0,
                                             contactBreakingThreshold=1e-4, enableConeFriction=1, numSolverIterations=200,
                                             solverResidualThreshold=0)
        bullet.resetBasePositionAndOrientation(self.body, q[:3], q[3:7])
        bullet.resetBaseVelocity(self.body, common.turned(q[3:7], qd[:3]), common.turned(q[3:7], qd[3:6]))
        for joint, angle, rate in zip(self.joints, q[7:], qd[6:]):
            bullet.resetJointState(self.body, joint, angle, rate)

    def roll(self, q, qd, count):
        self.reset(q, qd)
        poses = [list(q)]
        for _ in range(count - 1):
            for _ in range(self.steps):
                bullet.stepSimulation()
            place, turn = bullet.getBasePositionAndOrientation(self.body)
            poses.append([*place, *turn, *(bullet.getJointState(self.body, joint)[0] for joint in self.joints)])
        return poses


class Default(Engine):
    method, settings = "restitution", Engine.common_settings


class Exact(Engine):
    method, exact = "restitution, thresholds 0", True
    settings = {**Engine.common_settings, "restitutionVelocityThreshold": 0, "contactProcessingThreshold": 0, "contactSlop": 0, "erp": 0,
                "contactERP": 0, "frictionERP": 0, "contactBreakingThreshold": 1e-4, "enableConeFriction": 1, "numSolverIterations": 200,
                "solverResidualThreshold": 0}


class Spring(Engine):
    method = "contactStiffness, contactDamping"
    settings = {**Engine.common_settings, "restitution": 0,
                "contactDamping": "that of a spring which returns e, with the mass of the root link"}
    parameters = [("e", 0.0, 1.0, [0.1, 0.3, 0.5]), ("friction", 0.0, 1.0, [0.05, 0.15, 0.3]), ("stiffness, N/m (log)", 3.0, 6.0, [4.0, 5.0])]

    def contact(self, floor, links):
        e, friction, stiffness = self.values
        mass = bullet.getDynamicsInfo(self.body, -1)[0]
        damping = 2.0 * common.spring_damping(min(max(e, 1e-3), 1.0)) * math.sqrt(stiffness * mass)
        bullet.changeDynamics(floor, -1, restitution=0.0, lateralFriction=1.0)
        for link in links:
            bullet.changeDynamics(self.body, link, restitution=0.0, lateralFriction=friction, contactStiffness=stiffness,
                                  contactDamping=damping)


METHODS = [Default, Exact, Spring]
