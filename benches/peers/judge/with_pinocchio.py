"""Pinocchio's impulse: `aba` in a Runge–Kutta loop, the time of impact as the root of the gap, `impulseDynamics` there.

Pinocchio has no simulator: the loop, the gaps of spheres and the choice of the contact are written here. Its impulse is frictionless
(one row, the normal) with Newton's coefficient, for one contact or several at once. Lasting contact is not computed.
"""

import numpy as np
import pinocchio

from adapter import Refused, floats, has_limits, march, parts, serve
from mechanics import turn_of

STEP = {"default": 1e-3, "best": 1e-4}
SOURCE = "docs.ros.org, pinocchio, impulseDynamics (r_coeff)"
ABOUT = {"engine": "pinocchio", "version": pinocchio.__version__, "law": "Newton's e, frictionless",
         "no derivatives": "it has no derivatives of a run: computeImpulseDynamicsDerivatives is that of one impact that takes all components of a contact's velocity", "settings": {
    "default": {"method": "Runge–Kutta of this adapter, step 1 ms, root of the gap, impulseDynamics", "source": SOURCE},
    "best": {"method": "the same, step 0.1 ms", "source": SOURCE}}}
REST = 1e-7  # an approach of a contact below this speed lasts; then this adapter refuses, m/s


class Model:
    """The scene as a Pinocchio model, with functions of its state that the loop needs."""

    def __init__(self, scene):
        self.scene, self.model = scene, pinocchio.Model()
        self.model.gravity.linear = np.array(scene["gravity"], float)
        self.joints, self.balls = {}, []
        for body in scene["bodies"]:
            if body["joint"] == "free":
                kind = pinocchio.JointModelFreeFlyer()
            else:
                maker = {"hinge": pinocchio.JointModelRevoluteUnaligned, "slider": pinocchio.JointModelPrismaticUnaligned}
                kind = maker[body["joint"]](np.array(body["axis"], float))
            place = pinocchio.SE3(np.eye(3), np.array(body.get("at", [0, 0, 0]), float))
            joint = self.model.addJoint(self.joints.get(body["parent"], 0), kind, place, body["name"])
            centre, inertia = np.array(body.get("centre", [0, 0, 0]), float), np.diag(np.array(body["inertia"], float))
            self.model.appendBodyToJoint(joint, pinocchio.Inertia(body["mass"], centre, inertia), pinocchio.SE3.Identity())
            self.joints[body["name"]] = joint
            for shape in body.get("shapes", []):
                if "sphere" not in shape:
                    raise Refused("it has no contact detection; this adapter knows spheres only")
                self.balls.append((body["name"], joint, np.array(shape.get("at", [0, 0, 0]), float), shape["sphere"]))
        self.data, self.zero = self.model.createData(), np.zeros(self.model.nv)
        self.contacts = [("plane", ball, plane) for plane in scene["planes"] for ball in self.balls]
        pairs = {frozenset(pair) for pair in scene["pairs"]}
        self.contacts += [("pair", a, b) for a in self.balls for b in self.balls if a[0] < b[0] and frozenset((a[0], b[0])) in pairs]
        if has_limits(scene):
            for body in scene["bodies"]:
                if "limits" in body:
                    self.contacts += [("limit", body["name"], sign) for sign in (1, -1)]

    def start(self):
        q, v = [], []
        for body, own, rate in parts(self.scene, self.scene["start"]["q"], self.scene["start"]["qd"]):
            if body["joint"] == "free":
                turn = turn_of(np.array(own[3:], float) / np.linalg.norm(own[3:]))
                v += [*(turn.T @ np.array(rate[:3], float)), *(turn.T @ np.array(rate[3:], float))]
            else:
                v += rate
            q += own
        return np.array(q, float), np.array(v, float)

    def state(self, q, v):
        qd = []
        for body, own, rate in parts(self.scene, q, v):
            if body["joint"] == "free":
                turn = turn_of(own[3:])
                qd += [*(turn @ rate[:3]), *(turn @ rate[3:])]
            else:
                qd += [*rate]
        return {"q": floats(q), "qd": floats(qd)}

    def advanced(self, q, v, h):
        """One step of the classical Runge–Kutta method."""
        rate = lambda x, w: pinocchio.aba(self.model, self.data, x, w, self.zero).copy()
        move = lambda w, s: pinocchio.integrate(self.model, q, s * w)
        a1 = rate(q, v)
        v2 = v + 0.5 * h * a1
        a2 = rate(move(v, 0.5 * h), v2)
        v3 = v + 0.5 * h * a2
        a3 = rate(move(v2, 0.5 * h), v3)
        v4 = v + h * a3
        a4 = rate(move(v3, h), v4)
        return move((v + 2 * v2 + 2 * v3 + v4) / 6, h), v + h * (a1 + 2 * a2 + 2 * a3 + a4) / 6

    def centre(self, ball):
        return self.data.oMi[ball[1]].act(ball[2])

    def gaps(self, q):
        pinocchio.forwardKinematics(self.model, self.data, q)
        found = []
        for kind, a, b in self.contacts:
            if kind == "plane":
                found.append(np.array(b["normal"]) @ (self.centre(a) - np.array(b["point"])) - a[3])
            elif kind == "pair":
                found.append(np.linalg.norm(self.centre(a) - self.centre(b)) - a[3] - b[3])
            else:
                joint = self.model.joints[self.joints[a]]
                body = next(body for body in self.scene["bodies"] if body["name"] == a)
                found.append(b * (q[joint.idx_q] - body["limits"][0 if b > 0 else 1]))
        return np.array(found)

    def row(self, q, contact):
        kind, a, b = contact
        if kind == "limit":
            row = np.zeros(self.model.nv)
            row[self.model.joints[self.joints[a]].idx_v] = b
            return row

        def jacobian(ball):
            full = pinocchio.computeJointJacobian(self.model, self.data, q, ball[1])
            turn = self.data.oMi[ball[1]].rotation
            return turn @ (full[:3] - pinocchio.skew(ball[2]) @ full[3:])

        pinocchio.forwardKinematics(self.model, self.data, q)
        if kind == "plane":
            return np.array(b["normal"], float) @ jacobian(a)
        line = self.centre(a) - self.centre(b)
        return line / np.linalg.norm(line) @ (jacobian(a) - jacobian(b))


def answer(request):
    scene, step = request["scene"], request.get("step") or STEP[request["settings"]]
    if scene["contact"]["friction"]:
        raise Refused("its impulse has no friction")
    model = Model(scene)
    q, v = model.start()
    restitution = scene["contact"].get("limit_restitution", 0.0) if has_limits(scene) else scene["contact"]["restitution"]
    now = [q, v]

    def strike(q, v, gaps):
        closed = [model.row(q, contact) for contact, gap in zip(model.contacts, gaps) if gap <= 1e-12]
        rows = np.array([row for row in closed if row @ v < 0.0])
        if not len(rows):
            return v
        if np.max(-rows @ v) < REST:
            raise Refused("bounces end in lasting contact, which it does not simulate")
        after = pinocchio.impulseDynamics(model.model, model.data, q, v, rows, restitution, 0.0).copy()
        if restitution == 0.0 and np.linalg.norm(scene["gravity"]) > 0:
            raise Refused("e = 0 ends in lasting contact, which it does not simulate")
        return after

    def advance(count):
        for _ in range(count):
            left, tried = step, 0
            while left > 0.0:
                q, v = now
                after, speed = model.advanced(q, v, left)
                # Contacts that have closed and still approach; a pair that touches and moves along together has not.
                closed = [k for k, gap in enumerate(model.gaps(after)) if gap < 0.0 and model.row(after, model.contacts[k]) @ speed < -1e-12]
                if not closed:
                    now[:] = after, speed
                    break
                tried += 1
                if tried > 50:
                    raise Refused("more than 50 impacts in one step: lasting contact, which it does not simulate")
                # The root of the least of their gaps by bisection, to rounding; the start may touch.
                low, high = 0.0, left
                while low < (middle := 0.5 * (low + high)) < high:
                    low, high = (middle, high) if model.gaps(model.advanced(q, v, middle)[0])[closed].min() > 0.0 else (low, middle)
                after, speed = model.advanced(q, v, high)
                now[:] = after, strike(after, speed, model.gaps(after))
                left -= high

    return {"states": march(request, step, advance, lambda: model.state(*now)), "used": {"step": step}}


serve(ABOUT, answer)
