"""PyBullet: reduced coordinates, Newton's coefficient for each contact, semi-implicit Euler steps."""

import importlib.metadata
import os
import tempfile

import numpy as np
import pybullet as bullet

from adapter import Refused, floats, has_limits, march, parts, serve, trees, urdf

STEP = {"default": 1 / 240, "best": 1e-4}
ABOUT = {"engine": "pybullet", "version": importlib.metadata.version("pybullet"), "law": "Newton's e for each contact, Coulomb", "settings": {
    "default": {"method": "step 1/240 s, restitution and lateral friction set, all else default; damping of joints 0", "source": "PyBullet Quickstart Guide"},
    "best": {"method": "step 0.1 ms, restitutionVelocityThreshold, contactProcessingThreshold, contactSlop, erp, contactERP and damping 0, "
                       "contactBreakingThreshold 1e-9 in collisions (1e-4 m for e = 0), 200 iterations, cone friction",
             "source": "PyBullet Quickstart Guide, setPhysicsEngineParameter and changeDynamics; github.com/bulletphysics/bullet3/issues/1530"}}}
FLAGS = bullet.URDF_USE_INERTIA_FROM_FILE


def load(tree):
    handle, path = tempfile.mkstemp(suffix=".urdf")
    with os.fdopen(handle, "w") as file:
        text = urdf(tree)
        # A link without inertia would get 1 kg.
        nothing = '<inertial><mass value="0"/><inertia ixx="0" iyy="0" izz="0" ixy="0" ixz="0" iyz="0"/></inertial>'
        file.write(text.replace('<link name="world"/>', f'<link name="world">{nothing}</link>'))
    try:
        return bullet.loadURDF(path, useFixedBase=tree[0]["joint"] != "free", flags=FLAGS)
    finally:
        os.remove(path)


def answer(request):
    scene, best = request["scene"], request["settings"] == "best"
    contact, step = scene["contact"], request.get("step") or STEP[request["settings"]]
    if has_limits(scene) and contact.get("limit_restitution", 0.0) > 0.0:
        raise Refused("joint limits have no coefficient of restitution in reduced coordinates")
    bullet.resetSimulation()
    bullet.setTimeStep(step)
    bullet.setGravity(*scene["gravity"])
    where = {}
    for tree in trees(scene):
        body = load(tree)
        links = {bullet.getJointInfo(body, k)[12].decode(): k for k in range(bullet.getNumJoints(body))}
        where |= {part["name"]: (body, links.get(part["name"], -1)) for part in tree}
    planes = []
    for plane in scene["planes"]:
        shape = bullet.createCollisionShape(bullet.GEOM_PLANE, planeNormal=plane["normal"])
        planes.append(bullet.createMultiBody(0, shape, basePosition=plane["point"]))
        # The coefficients of a pair are multiplied.
        bullet.changeDynamics(planes[-1], -1, restitution=1.0, lateralFriction=1.0)
    pairs = {frozenset(pair) for pair in scene["pairs"]}
    # In pairs of bodies the product must be that of the scene.
    root = lambda value: value if scene["planes"] else np.sqrt(value)
    for name, (body, link) in where.items():
        bullet.changeDynamics(body, link, restitution=root(contact["restitution"]), lateralFriction=root(contact["friction"]),
                              spinningFriction=0, rollingFriction=0, jointDamping=0)
        if best:
            bullet.changeDynamics(body, link, linearDamping=0, angularDamping=0, contactProcessingThreshold=0, maxJointVelocity=1e6)
        for other, (its, at) in where.items():
            if other > name:
                bullet.setCollisionFilterPair(body, its, link, at, int(frozenset((name, other)) in pairs))
        if scene["bodies"] and link >= 0:
            bullet.setJointMotorControl2(body, link, bullet.VELOCITY_CONTROL, force=0)
    if best:
        bullet.setPhysicsEngineParameter(
            restitutionVelocityThreshold=0, erp=0, contactERP=0, frictionERP=0, contactSlop=0, enableConeFriction=1,
            contactBreakingThreshold=1e-9 if contact["restitution"] else 1e-4, numSolverIterations=200, solverResidualThreshold=0)
    for part, own, rate in parts(scene, scene["start"]["q"], scene["start"]["qd"]):
        body, link = where[part["name"]]
        if part["joint"] == "free":
            bullet.resetBasePositionAndOrientation(body, own[:3], own[3:])
            bullet.resetBaseVelocity(body, rate[:3], rate[3:])
        else:
            bullet.resetJointState(body, link, own[0], rate[0])

    def advance(count):
        for _ in range(count):
            bullet.stepSimulation()

    def state():
        q, qd = [], []
        for part, _, _ in parts(scene, scene["start"]["q"], scene["start"]["qd"]):
            body, link = where[part["name"]]
            if part["joint"] == "free":
                for both, new in zip((q, qd), (bullet.getBasePositionAndOrientation(body), bullet.getBaseVelocity(body))):
                    both += [*new[0], *new[1]]
            else:
                angle, rate = bullet.getJointState(body, link)[:2]
                q.append(angle)
                qd.append(rate)
        return {"q": floats(q), "qd": floats(qd)}

    return {"states": march(request, step, advance, state), "used": {"step": step}}


bullet.connect(bullet.DIRECT)
serve(ABOUT, answer)
