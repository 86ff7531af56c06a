"""The scenes in PyBullet: reduced coordinates, Newton's coefficient per contact, semi-implicit Euler steps."""

import importlib.metadata
import os
import tempfile
import xml.etree.ElementTree as xml

import numpy as np
import pybullet as bullet

import common

VERSION = importlib.metadata.version("pybullet")


def without_made_up_mass(path):
    """A copy of the URDF with explicit zero inertia of links without one, to which PyBullet gives 1 kg and 1 kg m2 otherwise."""
    tree = xml.parse(path)
    for link in tree.getroot().iter("link"):
        if link.find("inertial") is None:
            inertial = xml.SubElement(link, "inertial")
            xml.SubElement(inertial, "mass", value="0")
            xml.SubElement(inertial, "inertia", **{key: "0" for key in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")})
    handle, copy = tempfile.mkstemp(suffix=".urdf")
    os.close(handle)
    tree.write(copy)
    return copy


class Run:
    def __init__(self, scene, dt, tuned):
        self.scene, self.dt, self.tuned = scene, dt, tuned
        bullet.resetSimulation()
        bullet.setTimeStep(dt)
        bullet.setGravity(*scene["gravity"])
        flags = bullet.URDF_USE_INERTIA_FROM_FILE | bullet.URDF_USE_IMPLICIT_CYLINDER
        urdf = without_made_up_mass(scene["urdf"])
        self.body = bullet.loadURDF(urdf, useFixedBase=not scene["floating"], flags=flags)
        os.remove(urdf)
        links = range(bullet.getNumJoints(self.body))
        info = {k: bullet.getJointInfo(self.body, k) for k in links}
        self.joints = [k for k in links if info[k][2] in (bullet.JOINT_REVOLUTE, bullet.JOINT_PRISMATIC)]
        number = {info[k][12].decode(): k for k in links}
        self.tip = number.get(scene["tip"], -1)
        touching = {number.get(it["link"], -1) for it in scene["shapes"]}
        surfaces = []
        for k, shape in enumerate(scene["surfaces"]):
            if k == 0 and ("halfspace" in shape or len(scene["shapes"]) == 1):
                at = scene["plane"]["point"]
                shape = bullet.createCollisionShape(bullet.GEOM_PLANE, planeNormal=scene["plane"]["normal"])
            else:
                at = shape["box"]["centre"]
                shape = bullet.createCollisionShape(bullet.GEOM_BOX, halfExtents=[x / 2 for x in shape["box"]["size"]])
            surfaces.append(bullet.createMultiBody(0, shape, basePosition=at))
        for surface in surfaces:
            # The coefficients of a pair are multiplied. Only the links of the scene's shapes can touch.
            bullet.changeDynamics(surface, -1, restitution=1.0, lateralFriction=1.0)
            for link in [-1, *links]:
                bullet.setCollisionFilterPair(self.body, surface, link, -1, int(link in touching))
        for link in [-1, *links]:
            bullet.changeDynamics(self.body, link, restitution=scene["restitution"], lateralFriction=scene["friction"],
                                  spinningFriction=0, rollingFriction=0)
            if tuned:
                bullet.changeDynamics(self.body, link, linearDamping=0, angularDamping=0, jointDamping=0,
                                      contactProcessingThreshold=0, maxJointVelocity=1e6)
        for joint in self.joints:
            bullet.setJointMotorControl2(self.body, joint, bullet.VELOCITY_CONTROL, force=0)
        self.drive = scene.get("drive")
        if tuned:
            bullet.setPhysicsEngineParameter(restitutionVelocityThreshold=0, erp=0, contactERP=0, frictionERP=0,
                                             contactSlop=0, contactBreakingThreshold=1e-9,
                                             numSolverIterations=200, solverResidualThreshold=0)

    def reset(self):
        # A new world, since resetting keeps the contact cache of the last run.
        self.__init__(self.scene, self.dt, self.tuned)
        q, qd = self.scene["q"], self.scene["qd"]
        if self.scene["floating"]:
            bullet.resetBasePositionAndOrientation(self.body, q[:3], q[3:7])
            bullet.resetBaseVelocity(self.body, common.turned(q[3:7], qd[:3]), common.turned(q[3:7], qd[3:6]))
            q, qd = q[7:], qd[6:]
        for joint, angle, rate in zip(self.joints, q, qd):
            bullet.resetJointState(self.body, joint, angle, rate)

    def step(self, count):
        drive = self.drive
        for _ in range(count):
            if drive:
                # Its own position control has gains without units.
                states = bullet.getJointStates(self.body, self.joints)
                torques = [max(-most, min(most, drive["kp"] * (target - state[0]) - drive["kd"] * state[1]))
                           for state, target, most in zip(states, drive["target"], drive["effort"])]
                bullet.setJointMotorControlArray(self.body, self.joints, bullet.TORQUE_CONTROL, forces=torques)
            bullet.stepSimulation()

    def force(self):
        return sum(point[9] for point in bullet.getContactPoints(self.body))

    def state(self):
        if self.scene["floating"]:
            base = *bullet.getBasePositionAndOrientation(self.body), *bullet.getBaseVelocity(self.body)
            if not self.joints:
                return common.free_body(self.scene, *base)
        q, qd = np.array([bullet.getJointState(self.body, k)[:2] for k in self.joints]).T
        if self.scene["floating"]:
            return common.based(*base, q, qd)
        state = {"q": q, "qd": qd, "kinetic_energy": 0.5 * qd @ np.array(bullet.calculateMassMatrix(self.body, list(q))) @ qd}
        if self.tip >= 0:
            state["tip_velocity"] = bullet.getLinkState(self.body, self.tip, computeLinkVelocity=1)[6]
        return state


def main():
    args = common.arguments(__doc__)
    bullet.connect(bullet.DIRECT)
    for scene in common.scenes(args.scenes):
        if args.only and scene["name"] not in args.only:
            continue
        law = "newton, coulomb" if scene["surfaces"] else None
        for dt in common.STEPS:
            common.measure("pybullet", VERSION, scene, "default", law, {}, dt, lambda h: Run(scene, h, False), args)
            settings = {"restitutionVelocityThreshold": 0, "contactProcessingThreshold": 0, "contactSlop": 0, "erp": 0, "contactBreakingThreshold": 1e-9,
                        "contactERP": 0, "damping": 0, "numSolverIterations": 200, "solverResidualThreshold": 0}
            common.measure("pybullet", VERSION, scene, "thresholds 0", law, settings, dt, lambda h: Run(scene, h, True), args)


if __name__ == "__main__":
    main()
