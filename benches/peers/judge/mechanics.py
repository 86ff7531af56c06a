"""Kinematics, energy and momentum of a scene's bodies, for the measures of the cases. Independent of every engine."""

import numpy as np

from adapter import parts


def turn_of(quaternion):
    x, y, z, w = quaternion
    return np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ])


def turn_about(axis, angle):
    axis = np.array(axis, float) / np.linalg.norm(axis)
    k = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    return np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k


class Moment:
    """Everything the measures need at one time: `q`, `qd`, energies `T`, `V`, momentum `P`, angular momentum `L` about the origin."""

    def __init__(self, scene, q, qd):
        self.q, self.qd = np.array(q, float), np.array(qd, float)
        self.frames, moving = {}, {}
        self.T, self.V, self.P, self.L = 0.0, 0.0, np.zeros(3), np.zeros(3)
        gravity = np.array(scene["gravity"], float)
        for body, own, rate in parts(scene, self.q, self.qd):
            if body["joint"] == "free":
                at, turn, speed, spin = own[:3], turn_of(own[3:] / np.linalg.norm(own[3:])), rate[:3], rate[3:]
            else:
                above, above_turn = self.frames.get(body["parent"], (np.zeros(3), np.eye(3)))
                above_speed, above_spin = moving.get(body["parent"], (np.zeros(3), np.zeros(3)))
                axis = above_turn @ np.array(body["axis"], float)
                arm = above_turn @ np.array(body["at"], float)
                hinge = body["joint"] == "hinge"
                if not hinge:
                    arm = arm + axis * own[0]
                at, turn = above + arm, above_turn @ turn_about(body["axis"], own[0]) if hinge else above_turn
                spin = above_spin + (axis * rate[0] if hinge else 0.0)
                speed = above_speed + np.cross(above_spin, arm) + (0.0 if hinge else axis * rate[0])
            self.frames[body["name"]], moving[body["name"]] = (at, turn), (speed, spin)
            arm = turn @ np.array(body.get("centre", [0, 0, 0]), float)
            centre, velocity, mass = at + arm, speed + np.cross(spin, arm), body["mass"]
            own_momentum = turn @ (np.array(body["inertia"], float) * (turn.T @ spin))
            self.T += 0.5 * (mass * velocity @ velocity + spin @ own_momentum)
            self.V -= mass * gravity @ centre
            self.P = self.P + mass * velocity
            self.L = self.L + mass * np.cross(centre, velocity) + own_momentum

    def point(self, body, at):
        """Position of the point `at` (axes of the body) in the world."""
        origin, turn = self.frames[body]
        return origin + turn @ np.array(at, float)

    def axis(self, body, axis):
        """The direction `axis` of the body in world axes."""
        return self.frames[body][1] @ np.array(axis, float)
