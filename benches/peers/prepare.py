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


# Scenes in which other links than the tip come into contact.
WHOLE = ("table", "quadruped")


def shapes_of(urdf, tip, whole):
    """The shapes that can touch: those of all moving links, or of the tip; centre and rotation in the axes of the link."""
    root, found = xml.parse(urdf).getroot(), []
    base = {it.get("name") for it in root.iter("link")} - {it.find("child").get("link") for it in root.iter("joint")}
    for link in root.iter("link"):
        name = link.get("name")
        if name != tip and (not whole or name in base):
            continue
        for collision in link.iter("collision"):
            [shape] = collision.find("geometry")
            if shape.tag not in ("sphere", "box", "cylinder"):
                raise ValueError(f"{name}: the peers have no {shape.tag}")
            turn, at = symbolic.pose(collision)
            keys = ("size",) if shape.tag == "box" else ("radius", "length") if shape.tag == "cylinder" else ("radius",)
            size = [float(x) for key in keys for x in shape.get(key).split()]
            found.append({"link": name, "kind": shape.tag, "size": size, "at": at.tolist(), "turn": turn.tolist()})
    return found


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
    # q is in the order of the joints in the file. Pinocchio sorts branches by name, as those of the files here are.
    q = np.array(robot["q"], float)
    if not floating:
        q = pinocchio_q(model, q)
    gravity = np.array(run.get("gravity", [0, 0, 0]), float)
    name, tip = os.path.splitext(os.path.basename(path))[0], robot.get("tip", "tip")
    shapes = shapes_of(urdf, tip, name in WHOLE)
    # The shape that strikes first, in `quadruped` a foot.
    first = next((it for it in shapes if it["link"] == tip and (model.njoints == 2 or not floating)), None)
    first = first or next((it for it in shapes if it["kind"] == "sphere"), {"link": tip, "kind": None})
    ball = {"sphere": first.get("size", [None])[0]}.get(first["kind"])
    box = first["size"] if first["kind"] == "box" and floating else None
    out = {
        "name": name, "urdf": urdf, "floating": floating, "tip": tip, "tip_radius": ball, "box": box, "shapes": shapes,
        "duration": run["duration"], "gravity": gravity.tolist(), "q": list(map(float, robot["q"])),
        "joints": [model.names[i] for i in range(1 + floating, model.njoints)],
        "surfaces": [it["shape"] for it in scene.get("surface", [])],
    }
    contact = scene.get("contact", {})
    out.update(restitution=contact.get("restitution", 0.0), friction=contact.get("friction", 0.0), law=contact.get("law"))
    qd = np.array(robot.get("qd", np.zeros(model.nv)), float)
    if out["surfaces"]:
        point, normal = plane_of(out["surfaces"][0], placement(model, data, q, first["link"]).translation)
        jacobian = strike(model, data, q, first["link"])
        if "tip_velocity" in robot:
            wish = robot["tip_velocity"]
            angle, along = np.radians(wish["angle_deg"]), np.array(wish["along"], float)
            along -= normal * (normal @ along)
            along /= np.linalg.norm(along)
            qd = np.linalg.pinv(jacobian[:3]) @ (wish["speed"] * (np.cos(angle) * along - np.sin(angle) * normal))
        start, rate = q, qd
        if not floating and not qd.any():
            start, rate = fall(model, data, q, gravity, lambda at: normal @ (at - point) - (ball or 0.0), first["link"])
            jacobian = strike(model, data, start, first["link"])
        pose, arm, heights = placement(model, data, start, first["link"]), np.zeros(3), []
        if box:
            # The lowest corner strikes.
            arms = [pose.rotation @ (np.array(signs) * box / 2) for signs in itertools.product((-1, 1), repeat=3)]
            arm = min(arms, key=lambda it: normal @ it)
            heights = sorted(normal @ (it - arm) for it in arms)
        jacobian = jacobian[:3] - pinocchio.skew(arm) @ jacobian[3:]
        mass = pinocchio.crba(model, data, start)
        mass = np.triu(mass) + np.triu(mass, 1).T
        inverse = normal @ jacobian @ np.linalg.solve(mass, jacobian.T @ normal)
        gap = normal @ (pose.translation + arm - point) - (ball or 0.0)
        towards, pull = -(normal @ (jacobian @ rate)), -(normal @ gravity)
        speed = towards if not floating else np.sqrt(towards**2 + 2 * pull * gap)
        if box and abs(gap) < 1e-9:
            # It stands on an edge: the speed of a fall from the height of the edge that strikes next.
            gap, speed = 0.0, np.sqrt(2 * pull * next(it for it in heights if it > 1e-9))
        out.update(plane={"point": point.tolist(), "normal": normal.tolist()}, gap=gap, effective_mass=1 / inverse, approach=speed)
    out["qd"] = qd.tolist()
    if model.njoints > 1 + floating:
        out["chain"] = hinges(urdf)
    if floating:
        body = model.inertias[1]
        if np.abs(body.lever).max() > 0:
            raise ValueError(f"{urdf}: the origin of a free body is its centre of mass here")
        out["body"] = {"mass": body.mass, "inertia": np.diag(body.inertia).tolist()}
    if run.get("controller") == "pd":
        target = dict(zip(out["joints"], out["q"][7 * floating :])) | run["target"]
        out["drive"] = {"kp": float(run["kp"]), "kd": float(run["kd"]), "target": [target[it] for it in out["joints"]],
                        "effort": model.effortLimit[6 * floating :].tolist()}
        if not run.get("effort_limits"):
            raise ValueError(f"{path}: the drives of the peers here have effort limits")
    return out


def placement(model, data, q, link):
    pinocchio.framesForwardKinematics(model, data, q)
    return data.oMf[model.getFrameId(link)]


def strike(model, data, q, link):
    """The Jacobian of a link's origin, linear part first, in axes of the world."""
    pinocchio.computeJointJacobians(model, data, q)
    return pinocchio.getFrameJacobian(model, data, model.getFrameId(link), pinocchio.LOCAL_WORLD_ALIGNED)


def fall(model, data, q, gravity, gap, link, step=1e-4):
    """q and its rate where a chain without drives first closes the gap, which it does from rest; to the step."""
    model.gravity.linear = gravity
    rate = np.zeros(model.nv)
    for _ in range(100_000):
        if gap(placement(model, data, q, link).translation) <= 0.0:
            return q, rate
        middle = rate + step / 2 * pinocchio.aba(model, data, q, rate, np.zeros(model.nv))
        half = pinocchio.integrate(model, q, step / 2 * rate)
        rate = rate + step * pinocchio.aba(model, data, half, middle, np.zeros(model.nv))
        q = pinocchio.integrate(model, q, step * middle)
    raise ValueError("the tip does not reach the surface")


def hinges(urdf):
    """The moving links, merged with the links fixed to them, parents first, for peers that read no URDF."""
    robot, links = symbolic.Robot(urdf), []
    ranges = {it.get("name"): it.find("limit") for it in xml.parse(urdf).getroot().iter("joint") if it.get("type") == "revolute"}
    for name, parent, (turn, shift), axis, inertia in zip(robot.names, robot.parent, robot.placement, robot.axis, robot.inertia):
        mass = inertia[3, 3]
        centre = np.array([inertia[2, 4], inertia[0, 5], inertia[1, 3]]) / mass
        arm = symbolic.cross(centre)
        links.append({"parent": parent, "turn": turn.tolist(), "shift": shift.tolist(), "axis": axis.tolist(), "mass": mass,
                      "centre": centre.tolist(), "inertia": (inertia[:3, :3] - mass * arm @ arm.T).tolist(),
                      "limits": [float(ranges[name].get(key)) for key in ("lower", "upper")] if name in ranges else None})
    # Which moving link carries a link, and its pose there; -1 is the base.
    places = {name: {"link": body, "turn": turn.tolist(), "shift": shift.tolist()} for name, (body, turn, shift) in robot.places.items()}
    return {"links": links, "places": places}


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
