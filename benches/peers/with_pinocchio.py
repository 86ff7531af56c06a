"""The scenes in Pinocchio: `aba` in a fixed-step Runge-Kutta loop, and `impulseDynamics` where the gap closes.

Pinocchio has no simulator; the loop, the search for the time of impact and the gap between ball and plane are written
here. Its impulse is frictionless (one row, the normal) with Newton's coefficient.
"""

import numpy as np
import pinocchio

import common
from prepare import pinocchio_q

VERSION = pinocchio.__version__


class Run:
    def __init__(self, scene, dt):
        joint = [pinocchio.JointModelFreeFlyer()] if scene["floating"] else []
        self.model, self.scene, self.dt = pinocchio.buildModelFromUrdf(scene["urdf"], *joint), scene, dt
        self.model.gravity.linear = np.array(scene["gravity"])
        self.data, self.watch = self.model.createData(), self.model.createData()
        self.frame, self.zero = self.model.getFrameId(scene["tip"]), np.zeros(self.model.nv)
        self.plane = scene.get("plane") and tuple(np.array(scene["plane"][key]) for key in ("point", "normal"))

    def reset(self):
        q = np.array(self.scene["q"])
        self.q = q if self.scene["floating"] else pinocchio_q(self.model, q)
        self.v, self.touching, self.time, self.impact = np.array(self.scene["qd"]), False, 0.0, None

    def advanced(self, q, v, h):
        """One step of the classical Runge-Kutta method from (q, v)."""
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

    def gap(self, q):
        pinocchio.forwardKinematics(self.model, self.data, q)
        centre = pinocchio.updateFramePlacement(self.model, self.data, self.frame).translation
        return self.plane[1] @ (centre - self.plane[0]) - self.scene["tip_radius"]

    def row(self, q, data):
        jacobian = pinocchio.computeFrameJacobian(self.model, data, q, self.frame, pinocchio.LOCAL_WORLD_ALIGNED)
        return (self.plane[1] @ jacobian[:3])[None, :]

    def step(self, count):
        for _ in range(count):
            self.touching, left = False, self.dt
            while left > 0.0:
                q, v = self.advanced(self.q, self.v, left)
                if self.plane is None or self.gap(q) >= 0.0 or (self.row(q, self.data) @ v)[0] >= 0.0:
                    self.q, self.v = q, v
                    self.time += left
                    break
                # The gap has closed within this step: its time is found by false position with halved weights (Illinois).
                low, high, at_low, at_high, side = 0.0, left, self.gap(self.q), self.gap(q), 0
                if at_low <= 0.0:
                    high = 0.0
                while high - low > 1e-15 * left and at_high < -1e-16:
                    middle = high - at_high * (high - low) / (at_high - at_low)
                    if not low < middle < high:
                        break
                    value = self.gap(self.advanced(self.q, self.v, middle)[0])
                    if value > 0.0:
                        low, at_low, at_high, side = middle, value, at_high / 2 if side > 0 else at_high, 1
                    else:
                        high, at_high, at_low, side = middle, value, at_low / 2 if side < 0 else at_low, -1
                if high > 0.0:
                    self.q, self.v = self.advanced(self.q, self.v, high)
                self.time, left = self.time + high, left - high
                row = self.row(self.q, self.data)
                if (row @ self.v)[0] >= 0.0:
                    continue
                self.v = pinocchio.impulseDynamics(
                    self.model, self.data, self.q, self.v, row, self.scene["restitution"], 0.0).copy()
                self.touching = True
                if self.impact is None:
                    self.impact = dict(self.state(), time=self.time)

    def force(self):
        return 1.0 if self.touching else 0.0

    def state(self):
        model, data, q, v = self.model, self.watch, self.q, self.v
        jacobian = pinocchio.computeFrameJacobian(model, data, q, self.frame, pinocchio.LOCAL_WORLD_ALIGNED)[:3]
        state = {
            "q": q, "qd": v, "tip_velocity": jacobian @ v,
            "kinetic_energy": pinocchio.computeKineticEnergy(model, data, q, v),
            "potential_energy": pinocchio.computePotentialEnergy(model, data, q),
        }
        if self.scene["floating"]:
            state["velocity"] = state["tip_velocity"]
        else:
            angles = [q[j.idx_q] if j.nq == 1 else np.arctan2(q[j.idx_q + 1], q[j.idx_q]) for j in model.joints[1:]]
            state["q"] = np.array(angles)
        return state


def main():
    args = common.arguments(__doc__)
    for scene in common.scenes(args.scenes):
        # The scene `ball` needs friction in impacts and a box; boxes and robots with several contacts need contacts that last.
        if args.only and scene["name"] not in args.only or len(scene["surfaces"]) > 1:
            continue
        if scene["box"] or len(scene["shapes"]) > 1:
            continue
        law = "newton, frictionless" if scene["surfaces"] else None
        for dt in common.STEPS:
            common.measure("pinocchio", VERSION, scene, "aba, RK4, impulseDynamics", law,
                           {"integrator": "RK4 of this file, in Python", "event": "root of the gap, to rounding"}, dt,
                           lambda h: Run(scene, h), args)


if __name__ == "__main__":
    main()
