"""DART (`dartpy`): generalised coordinates, contacts as a linear complementarity problem, Newton's coefficient for each contact."""

import os
import tempfile
from importlib.metadata import version

import dartpy as dart
import numpy as np

from adapter import Refused, floats, has_limits, march, parts, serve, trees, urdf

STEP = {"default": 1e-3, "best": 1e-4}
SOURCE = "docs.ros.org, dartsim: World, DynamicsAspect; dart/constraint/ContactConstraint.cpp (thresholds)"
ABOUT = {"engine": "dart", "version": version("dartpy"), "law": "Newton's e for each contact if the rebound exceeds 0.1 m/s, Coulomb as a pyramid", "settings": {
    "default": {"method": "step 1 ms, restitution and friction set, all else default", "source": SOURCE},
    "best": {"method": "step 0.1 ms, collision detector Bullet (exact spheres and planes)", "source": SOURCE}}}


def skeleton_of(tree, name):
    handle, path = tempfile.mkstemp(suffix=".urdf")
    with os.fdopen(handle, "w") as file:
        file.write(urdf(tree))
    try:
        skeleton = dart.utils.DartLoader().parseSkeleton(path)
    finally:
        os.remove(path)
    if skeleton is None:
        raise ValueError("the loader returned nothing")
    skeleton.setName(name)
    return skeleton


def turn_of(transform):
    w, x, y, z = dart.math.Quaternion(transform.rotation()).wxyz()
    return [x, y, z, w]


def answer(request):
    scene, settings = request["scene"], request["settings"]
    contact, step = scene["contact"], request.get("step") or STEP[settings]
    if has_limits(scene) and contact.get("limit_restitution", 0.0) > 0.0:
        raise Refused("joint limits have no coefficient of restitution")
    world = dart.simulation.World()
    if settings == "best":
        world.setCollisionDetector(dart.simulation.CollisionDetectorType.BULLET)
    world.setTimeStep(step)
    world.setGravity(scene["gravity"])
    # Coefficients of restitution of a pair are multiplied, of friction the smaller one counts.
    own = contact["restitution"] if scene["planes"] else np.sqrt(contact["restitution"])
    bodies = {}
    for k, tree in enumerate(trees(scene)):
        skeleton = skeleton_of(tree, f"tree{k}")
        for body in tree:
            node = bodies[body["name"]] = skeleton.getBodyNode(body["name"])
            for i in range(node.getNumShapeNodes()):
                aspect = node.getShapeNode(i).getDynamicsAspect()
                if aspect is not None:
                    aspect.setRestitutionCoeff(own)
                    aspect.setFrictionCoeff(contact["friction"])
            if "limits" in body:
                node.getParentJoint().setLimitEnforcement(True)
        world.addSkeleton(skeleton)
    for k, plane in enumerate(scene["planes"]):
        ground = dart.dynamics.Skeleton(f"plane{k}")
        _, node = ground.createWeldJointAndBodyNodePair()
        normal = np.array(plane["normal"], float)
        shape = node.createShapeNode(dart.dynamics.PlaneShape(normal, np.array(plane["point"], float)))
        shape.createCollisionAspect()
        shape.createDynamicsAspect()
        shape.getDynamicsAspect().setRestitutionCoeff(1.0)
        shape.getDynamicsAspect().setFrictionCoeff(1e3)
        world.addSkeleton(ground)
    for body, own_q, rate in parts(scene, scene["start"]["q"], scene["start"]["qd"]):
        joint = bodies[body["name"]].getParentJoint()
        if body["joint"] == "free":
            pose = dart.math.Isometry3()
            x, y, z, w = own_q[3:]
            pose.set_rotation(dart.math.Quaternion(w, x, y, z).to_rotation_matrix())
            pose.set_translation(own_q[:3])
            joint.setTransform(pose)
            joint.setLinearVelocity(rate[:3])
            joint.setAngularVelocity(rate[3:])
        else:
            joint.setPosition(0, own_q[0])
            joint.setVelocity(0, rate[0])

    def advance(count):
        for _ in range(count):
            world.step()

    def state():
        q, qd = [], []
        for body in scene["bodies"]:
            node = bodies[body["name"]]
            if body["joint"] == "free":
                pose = node.getWorldTransform()
                q += [*pose.translation(), *turn_of(pose)]
                qd += [*node.getLinearVelocity(), *node.getAngularVelocity()]
            else:
                q.append(node.getParentJoint().getPosition(0))
                qd.append(node.getParentJoint().getVelocity(0))
        return {"q": floats(q), "qd": floats(qd)}

    return {"states": march(request, step, advance, state), "used": {"step": step}}


serve(ABOUT, answer)
