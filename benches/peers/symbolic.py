"""Straight-line C for one robot: the dynamics of a URDF of hinges, written out by CasADi.

    symbolic.py ROBOT.urdf OUT.c [--gravity X Y Z]

The file holds, as CasADi functions of dense column-major arrays: `mass` (q) -> M; `bias` (q, qd) -> C(q, qd) qd + g;
`inverse` (q, qd, qdd) -> tau; `forward` (q, qd, tau) -> qdd; `tip` (q) -> position of the link `tip`; `jacobian` (q) -> 3 x n; `drift` (q, qd) -> Jdot qd
and `rate` (q, qd) -> Jdot; `chain` (q, qd, normal, e) -> J, M, H = J M^-1 J^T, qd+ of the frictionless impact.
"""

import argparse
import math
import xml.etree.ElementTree as xml

import casadi
import numpy as np


def vector(element, key, default="0 0 0"):
    return np.array([float(x) for x in (element.get(key) if element is not None else default).split()])


def rotation(rpy):
    r, p, y = rpy
    turn = {k: np.array(m) for k, m in {
        "x": [[1, 0, 0], [0, math.cos(r), -math.sin(r)], [0, math.sin(r), math.cos(r)]],
        "y": [[math.cos(p), 0, math.sin(p)], [0, 1, 0], [-math.sin(p), 0, math.cos(p)]],
        "z": [[math.cos(y), -math.sin(y), 0], [math.sin(y), math.cos(y), 0], [0, 0, 1]],
    }.items()}
    return turn["z"] @ turn["y"] @ turn["x"]


def pose(element):
    origin = element.find("origin")
    return rotation(vector(origin, "rpy") if origin is not None and origin.get("rpy") else np.zeros(3)), (
        vector(origin, "xyz") if origin is not None and origin.get("xyz") else np.zeros(3))


def cross(v):
    return np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])


class Robot:
    """Hinges in an order in which parents come first; what is fixed is part of the link it hangs on."""

    def __init__(self, path):
        root = xml.parse(path).getroot()
        links = {it.get("name"): it for it in root.iter("link")}
        below = {}
        for joint in root.iter("joint"):
            below.setdefault(joint.find("parent").get("link"), []).append(joint)
        base = (set(links) - {j.find("child").get("link") for js in below.values() for j in js}).pop()
        self.parent, self.placement, self.axis, self.inertia, self.names, self.tip = [], [], [], [], [], None
        self.visit(links, below, base, -1, np.eye(3), np.zeros(3))

    def visit(self, links, below, name, body, turn, shift):
        """`turn`, `shift`: the link's frame in that of `body`, the last link that moves."""
        if name == "tip":
            self.tip = (body, shift)
        inertial = links[name].find("inertial")
        if inertial is not None and body >= 0:
            mass = float(inertial.find("mass").get("value"))
            at_turn, at = pose(inertial)
            i = {k: float(v) for k, v in inertial.find("inertia").items()}
            central = np.array([[i["ixx"], i["ixy"], i["ixz"]], [i["ixy"], i["iyy"], i["iyz"]], [i["ixz"], i["iyz"], i["izz"]]])
            whole = turn @ at_turn
            self.inertia[body] = self.inertia[body] + spatial(mass, shift + turn @ at, whole @ central @ whole.T)
        for joint in below.get(name, []):
            child, (j_turn, j_shift) = joint.find("child").get("link"), pose(joint)
            j_turn, j_shift = turn @ j_turn, shift + turn @ j_shift
            if joint.get("type") == "fixed":
                self.visit(links, below, child, body, j_turn, j_shift)
            else:
                axis = vector(joint.find("axis"), "xyz", "1 0 0")
                self.names.append(joint.get("name"))
                self.parent.append(body)
                self.placement.append((j_turn, j_shift))
                self.axis.append(axis / np.linalg.norm(axis))
                self.inertia.append(np.zeros((6, 6)))
                self.visit(links, below, child, len(self.parent) - 1, np.eye(3), np.zeros(3))


def spatial(mass, centre, central):
    """Inertia about the frame's origin, angular part first."""
    c = cross(centre)
    return np.block([[central + mass * c @ c.T, mass * c], [mass * c.T, mass * np.eye(3)]])


def skew(v):
    return casadi.vertcat(
        casadi.horzcat(0, -v[2], v[1]), casadi.horzcat(v[2], 0, -v[0]), casadi.horzcat(-v[1], v[0], 0))


class Dynamics:
    def __init__(self, robot, q):
        self.robot, self.n = robot, len(robot.parent)
        self.local = []
        for i in range(self.n):
            (turn, shift), a = robot.placement[i], robot.axis[i]
            k, s, c = cross(a), casadi.sin(q[i]), casadi.cos(q[i])
            # Rodrigues with a a^T written out, so that an axis along x, y or z leaves nothing but s and c.
            spin = casadi.SX(np.outer(a, a)) + c * casadi.SX(np.eye(3) - np.outer(a, a)) + s * casadi.SX(k)
            self.local.append((casadi.sparsify(casadi.mtimes(casadi.SX(turn), spin)), casadi.SX(shift)))

    def motion_to(self, i, v):
        """A motion of the parent's frame, seen from link i's: (w, v) -> (R'w, R'(v - r x w))."""
        turn, shift = self.local[i]
        w, u = v[:3], v[3:]
        return casadi.vertcat(turn.T @ w, turn.T @ (u - casadi.cross(shift, w)))

    def force_from(self, i, f):
        """A force on link i, about the parent's origin: (R m + r x R f, R f)."""
        turn, shift = self.local[i]
        force = turn @ f[3:]
        return casadi.vertcat(turn @ f[:3] + casadi.cross(shift, force), force)

    def subspace(self, i):
        return casadi.sparsify(casadi.SX(np.concatenate([self.robot.axis[i], np.zeros(3)])))

    def inverse(self, qd, qdd, gravity):
        v, a, f = [], [], []
        for i in range(self.n):
            p, s = self.robot.parent[i], self.subspace(i)
            if p < 0:
                turn = self.local[i][0]
                vel, acc = casadi.SX(6, 1), casadi.vertcat(casadi.SX(3, 1), turn.T @ casadi.SX(-np.array(gravity)))
            else:
                vel, acc = self.motion_to(i, v[p]), self.motion_to(i, a[p])
            vel = vel + s * qd[i]
            w, u, sw = vel[:3], vel[3:], s[:3] * qd[i]
            acc = acc + s * qdd[i] + casadi.vertcat(casadi.cross(w, sw), casadi.cross(u, sw))
            inertia = casadi.sparsify(casadi.SX(self.robot.inertia[i]))
            momentum = inertia @ vel
            f.append(inertia @ acc + casadi.vertcat(
                casadi.cross(w, momentum[:3]) + casadi.cross(u, momentum[3:]), casadi.cross(w, momentum[3:])))
            v.append(vel)
            a.append(acc)
        tau = [None] * self.n
        for i in reversed(range(self.n)):
            tau[i] = self.subspace(i).T @ f[i]
            p = self.robot.parent[i]
            if p >= 0:
                f[p] = f[p] + self.force_from(i, f[i])
        return casadi.vertcat(*tau)

    def mass(self):
        composite = [casadi.sparsify(casadi.SX(it)) for it in self.robot.inertia]
        m = casadi.SX(self.n, self.n)
        for i in reversed(range(self.n)):
            p = self.robot.parent[i]
            if p >= 0:
                turn, shift = self.local[i]
                zero = casadi.SX(3, 3)
                x = casadi.vertcat(casadi.horzcat(turn.T, zero), casadi.horzcat(-turn.T @ casadi.sparsify(skew(shift)), turn.T))
                composite[p] = composite[p] + x.T @ composite[i] @ x
            f = composite[i] @ self.subspace(i)
            m[i, i] = self.subspace(i).T @ f
            j = i
            while self.robot.parent[j] >= 0:
                f = self.force_from(j, f)
                j = self.robot.parent[j]
                m[i, j] = m[j, i] = self.subspace(j).T @ f
        return m

    def tip(self):
        body, at = self.robot.tip
        at = casadi.SX(at)
        while body >= 0:
            turn, shift = self.local[body]
            at, body = turn @ at + shift, self.robot.parent[body]
        return at

    def jacobian(self):
        turns, shifts = [], []
        for i in range(self.n):
            p, (turn, shift) = self.robot.parent[i], self.local[i]
            turns.append(turn if p < 0 else turns[p] @ turn)
            shifts.append(shift if p < 0 else shifts[p] + turns[p] @ shift)
        body, at = self.robot.tip
        point, columns = shifts[body] + turns[body] @ casadi.SX(at), [casadi.SX(3, 1)] * self.n
        while body >= 0:
            columns[body] = casadi.cross(turns[body] @ casadi.SX(self.robot.axis[body]), point - shifts[body])
            body = self.robot.parent[body]
        return casadi.horzcat(*columns)


def functions(path, gravity):
    robot = Robot(path)
    n = len(robot.parent)
    q, qd, qdd, tau = (casadi.SX.sym(name, n) for name in ("q", "qd", "qdd", "tau"))
    normal, e = casadi.SX.sym("normal", 3), casadi.SX.sym("e")
    dynamics = Dynamics(robot, q)
    mass, jacobian = dynamics.mass(), dynamics.jacobian()
    # M = L D L^T written out; the three rows of J and the impulse go through the triangle once.
    l, d = casadi.SX.eye(n), [None] * n
    for j in range(n):
        d[j] = mass[j, j] - sum(l[j, k] ** 2 * d[k] for k in range(j))
        for i in range(j + 1, n):
            l[i, j] = (mass[i, j] - sum(l[i, k] * l[j, k] * d[k] for k in range(j))) / d[j]
    half = [None] * n
    for i in range(n):
        half[i] = jacobian[:, i].T - sum(l[i, k] * half[k] for k in range(i))
    h = sum(half[i].T @ half[i] / d[i] for i in range(n))
    impulse = -(1 + e) * (normal.T @ (jacobian @ qd)) / (normal.T @ h @ normal)

    def back(y):
        """L^-T D^-1 y."""
        x = [y[i] / d[i] for i in range(n)]
        for i in reversed(range(n)):
            x[i] = x[i] - sum(l[k, i] * x[k] for k in range(i + 1, n))
        return casadi.vertcat(*x)

    after = qd + back([half[i] @ normal * impulse for i in range(n)])
    bias = dynamics.inverse(qd, casadi.SX(n, 1), gravity)
    driven = [None] * n
    for i in range(n):
        driven[i] = tau[i] - bias[i] - sum(l[i, k] * driven[k] for k in range(i))
    rate = casadi.reshape(casadi.jtimes(casadi.vec(jacobian), q, qd), 3, n)
    out = {
        "mass": ([q], [mass]),
        "bias": ([q, qd], [bias]),
        "inverse": ([q, qd, qdd], [dynamics.inverse(qd, qdd, gravity)]),
        "forward": ([q, qd, tau], [back(driven)]),
        "tip": ([q], [dynamics.tip()]),
        "jacobian": ([q], [jacobian]),
        "rate": ([q, qd], [rate]),
        "drift": ([q, qd], [rate @ qd]),
        "chain": ([q, qd, normal, e], [jacobian, mass, h, after]),
    }
    dense = lambda them: [casadi.densify(x) for x in them]
    return n, [casadi.Function(name, ins, dense(outs), {"cse": True}) for name, (ins, outs) in out.items()]


def write(path, out, gravity):
    n, made = functions(path, gravity)
    code = casadi.CodeGenerator("robot.c")
    for function in made:
        code.add(function)
    with open(out, "w") as file:
        file.write(f"enum {{ DOF = {n} }};\n" + code.dump())


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("urdf")
    parser.add_argument("out")
    parser.add_argument("--gravity", nargs=3, type=float, default=[0, 0, 0])
    args = parser.parse_args()
    write(args.urdf, args.out, args.gravity)
