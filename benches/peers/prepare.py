"""Converts scene files of carom to numbers that every peer can read: prepare.py OUT.json SCENE.toml...

Adds to the content of the file: the start velocity if it is given through the tip, the plane that the ball of the tip meets
first, and, for peers with compliant contacts, the effective mass and the approach speed of the tip.
"""

import itertools
import json
import os
import sys
import tomllib
import xml.etree.ElementTree as xml

import numpy as np
import pinocchio

import symbolic


def ball_of(urdf, link):
    for at in xml.parse(urdf).getroot().iter("link"):
        sphere = at.find("collision/geometry/sphere")
        if at.get("name") == link and sphere is not None:
            return float(sphere.get("radius"))
    return None


def box_of(urdf, link):
    """The edges of a link's box, m."""
    for at in xml.parse(urdf).getroot().iter("link"):
        box = at.find("collision/geometry/box")
        if at.get("name") == link and box is not None:
            return list(map(float, box.get("size").split()))
    return None


def plane_of(shape, centre):
    """The half-space, or the face of the box nearest to `centre`, as (point, normal)."""
    if "halfspace" in shape:
        normal = np.array(shape["halfspace"]["normal"], float)
        return np.array(shape["halfspace"]["point"], float), normal / np.linalg.norm(normal)
    middle, half = np.array(shape["box"]["centre"], float), np.array(shape["box"]["size"], float) / 2
    outside = (centre - middle) / half
    axis = int(np.argmax(np.abs(outside)))
    normal = np.zeros(3)
    normal[axis] = np.sign(outside[axis])
    return middle + half * normal, normal


def prepare(path):
    with open(path, "rb") as file:
        scene = tomllib.load(file)
    robot, run = scene["robot"], scene["run"]
    urdf = os.path.abspath(os.path.join(os.path.dirname(path), robot["urdf"]))
    floating = robot.get("floating", False)
    model = pinocchio.buildModelFromUrdf(urdf, pinocchio.JointModelFreeFlyer()) if floating else pinocchio.buildModelFromUrdf(urdf)
    data = model.createData()
    # q is in the order of the joints in the file. Pinocchio sorts branches by name, which leaves chains unchanged.
    q = np.array(robot["q"], float)
    if not floating:
        q = pinocchio_q(model, q)
    frame = model.getFrameId(robot.get("tip", "tip"))
    pinocchio.computeJointJacobians(model, data, q)
    pinocchio.updateFramePlacements(model, data)
    jacobian = pinocchio.getFrameJacobian(model, data, frame, pinocchio.LOCAL_WORLD_ALIGNED)[:3]
    centre = data.oMf[frame].translation
    mass = pinocchio.crba(model, data, q)
    mass = np.triu(mass) + np.triu(mass, 1).T
    gravity = np.array(run.get("gravity", [0, 0, 0]), float)
    out = {
        "name": os.path.splitext(os.path.basename(path))[0], "urdf": urdf, "floating": floating, "tip": robot.get("tip", "tip"),
        "tip_radius": ball_of(urdf, robot.get("tip", "tip")),
        "box": box_of(urdf, robot.get("tip", "tip")) if floating else None, "duration": run["duration"], "gravity": gravity.tolist(),
        "q": list(map(float, robot["q"])), "joints": [model.names[i] for i in range(1, model.njoints)],
        "surfaces": [it["shape"] for it in scene.get("surface", [])],
    }
    contact = scene.get("contact", {})
    out.update(restitution=contact.get("restitution", 0.0), friction=contact.get("friction", 0.0), law=contact.get("law"))
    qd = np.array(robot.get("qd", np.zeros(model.nv)), float)
    if out["surfaces"]:
        point, normal = plane_of(out["surfaces"][0], centre)
        if "tip_velocity" in robot:
            wish = robot["tip_velocity"]
            angle, along = np.radians(wish["angle_deg"]), np.array(wish["along"], float)
            along -= normal * (normal @ along)
            along /= np.linalg.norm(along)
            qd = np.linalg.pinv(jacobian) @ (wish["speed"] * (np.cos(angle) * along - np.sin(angle) * normal))
        if out["box"]:
            # The lowest corner strikes.
            arms = [data.oMf[frame].rotation @ (np.array(signs) * out["box"] / 2) for signs in itertools.product((-1, 1), repeat=3)]
            arm = min(arms, key=lambda it: normal @ it)
            centre = centre + arm
            turn = pinocchio.skew(arm)
            jacobian = jacobian - turn @ pinocchio.getFrameJacobian(model, data, frame, pinocchio.LOCAL_WORLD_ALIGNED)[3:]
            heights = sorted(normal @ (it - arm) for it in arms)
        inverse = normal @ jacobian @ np.linalg.solve(mass, jacobian.T @ normal)
        gap = normal @ (centre - point) - (out["tip_radius"] or 0.0)
        towards, pull = -(normal @ (jacobian @ qd)), -(normal @ gravity)
        speed = towards if not floating else np.sqrt(towards**2 + 2 * pull * gap)
        if out["box"] and abs(gap) < 1e-9:
            # It stands on an edge: the speed of a fall from the height of the edge that strikes next.
            gap, speed = 0.0, np.sqrt(2 * pull * next(it for it in heights if it > 1e-9))
        out.update(plane={"point": point.tolist(), "normal": normal.tolist()}, gap=gap, effective_mass=1 / inverse, approach=speed)
    out["qd"] = qd.tolist()
    if not floating:
        out["chain"] = hinges(urdf)
    if floating:
        body = model.inertias[1]
        out["body"] = {"mass": body.mass, "inertia": np.diag(body.inertia).tolist()}
    return out


def hinges(urdf):
    """The moving links, merged with the links fixed to them, parents first, for peers that read no URDF."""
    robot, links = symbolic.Robot(urdf), []
    for parent, (turn, shift), axis, inertia in zip(robot.parent, robot.placement, robot.axis, robot.inertia):
        mass = inertia[3, 3]
        centre = np.array([inertia[2, 4], inertia[0, 5], inertia[1, 3]]) / mass
        arm = symbolic.cross(centre)
        links.append({"parent": parent, "turn": turn.tolist(), "shift": shift.tolist(), "axis": axis.tolist(), "mass": mass,
                      "centre": centre.tolist(), "inertia": (inertia[:3, :3] - mass * arm @ arm.T).tolist()})
    body, at = robot.tip
    return {"links": links, "tip": {"link": body, "at": at.tolist()}}


def pinocchio_q(model, q):
    """q of Pinocchio, in which a continuous joint has two coordinates, cosine and sine."""
    full = pinocchio.neutral(model)
    for i in range(1, model.njoints):
        joint, value = model.joints[i], q[model.joints[i].idx_v]
        full[joint.idx_q : joint.idx_q + joint.nq] = [value] if joint.nq == 1 else [np.cos(value), np.sin(value)]
    return full


if __name__ == "__main__":
    scenes = [prepare(path) for path in sys.argv[2:]]
    with open(sys.argv[1], "w") as file:
        json.dump(scenes, file, indent=1)
