"""The scenes in MuJoCo. Its contacts are springs in acceleration space and have no coefficient of restitution."""

import itertools
import math
import xml.etree.ElementTree as xml

import mujoco
import numpy as np

import common

VERSION = mujoco.__version__
# Steps in the half period of the spring, so that the rebound depends on the damping and not on the step.
CONTACT_STEPS = 40


def plane_quaternion(normal):
    """The quaternion that rotates z into `normal`."""
    quaternion = np.zeros(4)
    mujoco.mju_quatZ2Vec(quaternion, np.array(normal, float))
    return quaternion


def on_free_base(path, link):
    """The URDF of a robot whose base is `link`, with the floating joint that MuJoCo wants in the file."""
    tree = xml.parse(path)
    xml.SubElement(tree.getroot(), "link", name="around")
    joint = xml.SubElement(tree.getroot(), "joint", name="free", type="floating")
    xml.SubElement(joint, "parent", link="around")
    xml.SubElement(joint, "child", link=link)
    return xml.tostring(tree.getroot(), encoding="unicode")


def model_of(scene):
    whole = len(scene["shapes"]) > 1
    if scene["floating"] and "chain" in scene:
        spec = mujoco.MjSpec.from_string(on_free_base(scene["urdf"], scene["tip"]))
    elif scene["floating"]:
        spec = mujoco.MjSpec()
        body = spec.worldbody.add_body(name="body")
        body.add_freejoint()
        body.mass, body.inertia, body.explicitinertial = scene["body"]["mass"], scene["body"]["inertia"], True
        if scene["box"]:
            body.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[x / 2 for x in scene["box"]])
        else:
            body.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[scene["tip_radius"], 0, 0])
    else:
        spec = mujoco.MjSpec.from_file(scene["urdf"])
    for number, geom in enumerate(spec.geoms):
        # Where the other pairs are out of reach, only the ball of the tip can touch, as in carom.
        tip = geom.type == (mujoco.mjtGeom.mjGEOM_BOX if scene["box"] else mujoco.mjtGeom.mjGEOM_SPHERE)
        tip = geom.parent != spec.worldbody if whole else tip
        geom.name = f"shape{number}" if tip else ""
        geom.contype, geom.conaffinity = (1, 2) if tip else (0, 0)
        if not scene["floating"]:
            geom.mass = 0.0  # the default density, that of water, would give mass to a link without inertia
    for k, shape in enumerate(scene["surfaces"]):
        common_keys = dict(name=f"surface{k}", contype=2, conaffinity=1)
        if k == 0 and (not whole or "halfspace" in shape):
            plane = scene["plane"]
            spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[1, 1, 1], pos=plane["point"],
                                    quat=plane_quaternion(plane["normal"]), **common_keys)
        else:
            box = shape["box"]
            spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, pos=box["centre"],
                                    size=[x / 2 for x in box["size"]], **common_keys)
    for name, target, effort in drives(scene):
        kp, kd = scene["drive"]["kp"], scene["drive"]["kd"]
        spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT, gaintype=mujoco.mjtGain.mjGAIN_FIXED,
                          gainprm=[kp] + [0] * 9, biastype=mujoco.mjtBias.mjBIAS_AFFINE, biasprm=[0, -kp, -kd] + [0] * 7,
                          forcelimited=True, forcerange=[-effort, effort])
    spec.option.gravity = scene["gravity"]
    return spec


def drives(scene):
    """Joint, target and largest torque of every drive."""
    drive = scene.get("drive", {"target": [], "effort": []})
    return list(zip(scene["joints"], drive["target"], drive["effort"]))


class Run:
    def __init__(self, scene, dt, integrator=None, solref=None):
        spec = model_of(scene)
        for geom in spec.geoms:
            if geom.contype:
                sliding = scene["friction"]
                geom.condim = 3 if sliding else 1
                geom.friction = [sliding, 0, 0]
        spec.option.timestep = dt
        if integrator is not None:
            spec.option.integrator = integrator
        if solref is not None:
            spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
            spec.option.tolerance = 1e-15
            shapes = [geom.name for geom in spec.geoms if geom.name.startswith("shape")]
            for k, shape in itertools.product(range(len(scene["surfaces"])), shapes):
                # An explicit pair, since only pairs have separate reference parameters for friction: ten steps, the best of
                # those tried. The impedance is constant and close to one, the most rigid contact that the format allows.
                spec.add_pair(geomname1=shape, geomname2=f"surface{k}", condim=3 if scene["friction"] else 1,
                              friction=[scene["friction"], scene["friction"], 0, 0, 0], solref=solref,
                              solreffriction=[10 * dt, 1], solimp=[0.9999, 0.9999, 1e-3, 0.5, 2])
        self.model, self.scene, self.dt = spec.compile(), scene, dt
        self.data = mujoco.MjData(self.model)
        spheres = np.flatnonzero((self.model.geom_type == mujoco.mjtGeom.mjGEOM_SPHERE) & (self.model.geom_contype > 0))
        self.geom = spheres[0] if len(spheres) and scene["surfaces"] else -1
        self.body = self.model.geom_bodyid[self.geom]
        # Joint by joint, in the order of the scene.
        joints = [self.model.joint(name).id for name in scene["joints"]]
        self.at_q, self.at_qd = self.model.jnt_qposadr[joints], self.model.jnt_dofadr[joints]
        self.jacobian = np.zeros((3, self.model.nv))
        self.mass = np.zeros((self.model.nv, self.model.nv))

    def reset(self):
        mujoco.mj_resetData(self.model, self.data)
        q, qd = self.scene["q"], self.scene["qd"]
        if self.scene["floating"]:
            x, y, z, w = q[3:7]
            self.data.qpos[:7] = q[:3] + [w, x, y, z]
            self.data.qvel[:6] = common.turned([x, y, z, w], qd[:3]) + qd[3:6]
            q, qd = q[7:], qd[6:]
        self.data.qpos[self.at_q], self.data.qvel[self.at_qd] = q, qd
        self.data.ctrl[:] = [target for _, target, _ in drives(self.scene)]

    def step(self, count):
        mujoco.mj_step(self.model, self.data, nstep=count)

    def force(self):
        # Forces of the last step, whose contacts were detected at its start.
        return float(np.sum(self.data.efc_force[: self.data.nefc])) if self.data.ncon else 0.0

    def state(self):
        data = self.data
        if self.scene["floating"]:
            w, x, y, z = data.qpos[3:7]
            turn = [x, y, z, w]
            base = data.qpos[:3], turn, data.qvel[:3], common.turned(turn, data.qvel[3:6])
            if "chain" in self.scene:
                return common.based(*base, data.qpos[self.at_q], data.qvel[self.at_qd])
            return common.free_body(self.scene, *base)
        # Computed on a copy, so that the warm start and the state of the run stay unchanged.
        copy = getattr(self, "copy", None) or mujoco.MjData(self.model)
        self.copy = copy
        copy.qpos[:], copy.qvel[:] = data.qpos, data.qvel
        mujoco.mj_fwdPosition(self.model, copy)
        mujoco.mj_energyPos(self.model, copy)
        mujoco.mj_energyVel(self.model, copy)
        state = {"q": data.qpos[self.at_q], "qd": data.qvel[self.at_qd], "kinetic_energy": copy.energy[1], "potential_energy": copy.energy[0]}
        if self.geom >= 0:
            mujoco.mj_jac(self.model, copy, self.jacobian, None, copy.geom_xpos[self.geom], self.body)
            state["tip_velocity"] = self.jacobian @ data.qvel
        return state


def main():
    args = common.arguments(__doc__)
    for scene in common.scenes(args.scenes):
        if args.only and scene["name"] not in args.only:
            continue
        touches = bool(scene["surfaces"])
        for dt in common.STEPS:
            common.measure("mujoco", VERSION, scene, "default", "soft contact" if touches else None,
                           {"integrator": "Euler", "solref": "0.02 1"}, dt, lambda h: Run(scene, h), args)
            if not touches:
                common.measure("mujoco", VERSION, scene, "RK4", None, {"integrator": "RK4"}, dt,
                               lambda h: Run(scene, h, mujoco.mjtIntegrator.mjINT_RK4), args)
                continue
            ratio = common.spring_damping(scene["restitution"])

            def tuned(h, integrator):
                frequency = math.pi / (CONTACT_STEPS * h)
                return Run(scene, h, integrator, [-frequency**2, -2.0 * ratio * frequency])

            for name, integrator in (("Euler", mujoco.mjtIntegrator.mjINT_EULER), ("RK4", mujoco.mjtIntegrator.mjINT_RK4)):
                settings = {"integrator": name, "solref": f"direct, half period {CONTACT_STEPS} dt, damping ratio {ratio:.6f}",
                            "solimp": "0.9999 0.9999", "solreffriction": "10 dt, 1", "cone": "elliptic", "tolerance": 1e-15}
                common.measure("mujoco", VERSION, scene, f"direct solref, {name}", "linear spring and damper", settings, dt,
                               lambda h, i=integrator: tuned(h, i), args)


if __name__ == "__main__":
    main()
