"""A second method for the cases: rigid bodies in maximal coordinates, joints and closed contacts as constraints with multipliers, DOP853.

It shares no equation with integrated.py (minimal coordinates) or with carom (recursions over the chain), and none with the closed forms of
the cases. The equations are those of textbooks: Newton and Euler for each body, J a = −J' v for each constraint, and for an impact
Darboux' and Keller's du/dp = H (n − μ s/|s|) with Newton's, Poisson's or Stronge's end. Needs numpy and scipy.

What it does not do: impacts of several contacts with friction, and closed contacts of several points that are not those of one body
sliding or resting on a floor. certify.py names the cases that have other second methods.
"""

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

CLOSED, STILL = 1e-10, 1e-8  # gaps (m) and velocities (m/s) below which a contact is closed, or stays closed
ACCURACY = {"method": "DOP853", "rtol": 1e-13, "atol": 1e-15}


def cross(a, b):
    """As np.cross, which is slow for single vectors."""
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def matrix(quaternion):
    x, y, z, w = quaternion / np.sqrt(quaternion @ quaternion)
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                     [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                     [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]])


def beside(axis):
    """Two directions across an axis, as rows."""
    return np.linalg.svd(np.array(axis, float)[None])[2][1:]


def advance(f, y, begin, end, events=()):
    """The solution at `end`, or where the first event passes from positive to negative, with the number of that event.

    The time of the event comes from Newton's method with new integrations, since dense output is less accurate than the steps.
    """
    marks = []
    for event in events:
        mark = lambda t, y, event=event: event(y)
        mark.terminal, mark.direction = True, -1
        marks.append(mark)
    found = solve_ivp(f, (begin, end), y, events=marks or None, **ACCURACY)
    if found.status != 1:
        return found.y[:, -1], end, None
    which = next(k for k, times in enumerate(found.t_events) if len(times))
    before, base, at = found.t[-2], found.y[:, -2], found.t[-1]
    for _ in range(4):
        now = solve_ivp(f, (before, at), base, **ACCURACY).y[:, -1] if at > before else base
        h = 1e-7
        slope = (events[which](now + h * f(at, now)) - events[which](now - h * f(at, now))) / (2 * h)
        at -= events[which](now) / slope if slope else 0.0
    return (solve_ivp(f, (before, at), base, **ACCURACY).y[:, -1] if at > before else base), at, which


def impulse(H, u, mu, e, law):
    """Impulse of one contact, along (t1, t2, n), from the velocity u before. H: change of velocity by impulse."""
    if mu == 0.0:
        return np.array([0, 0, -(1 + e) * u[2] / H[2, 2]])
    size = lambda y: np.hypot(y[0], y[1])
    y, p, most, work = np.concatenate([u, np.zeros(3), [0.0]]), 0.0, None, 0.0  # velocity, impulse, work of the normal force
    sticks, fixed = False, None
    while True:
        if size(y) < 1e-12 and not sticks:
            # From no slip: sticks if friction suffices, else slips in the direction that keeps itself.
            hold = -np.linalg.lstsq(H[:2, :2], H[:2, 2])[0]  # a plane mechanism cannot move across its plane
            sticks = np.linalg.norm(hold) <= mu
            if not sticks:
                turn = lambda angle: H[:2] @ [-mu * np.cos(angle), -mu * np.sin(angle), 1]
                away = lambda angle: cross([*turn(angle), 0], [np.cos(angle), np.sin(angle), 0])[2]
                grid = np.linspace(-np.pi, np.pi, 721) + 1e-3
                roots = [brentq(away, a, b, xtol=1e-15) for a, b in zip(grid, grid[1:]) if away(a) * away(b) <= 0]
                angle = next(x for x in roots if turn(x) @ [np.cos(x), np.sin(x)] > 0)
                fixed = np.array([np.cos(angle), np.sin(angle)])
        if sticks and e == 0.0:
            return -np.linalg.lstsq(H, u)[0]

        def rate(_, y):
            slip = fixed if fixed is not None else y[:2] / size(y) if not sticks else None
            push = np.array([*hold, 1]) if sticks else np.array([*(-mu * slip), 1])
            return np.concatenate([H @ push, push, [y[2]]])

        events = []
        if not sticks and fixed is None:
            first = y[:2] / size(y)
            events.append(lambda y: first @ y[:2])
        ends = {"newton": lambda y: -e * u[2] - y[2], "poisson": lambda y: (1 + e) * (most or 0) - y[5],
                "energetic": lambda y: (1 - e**2) * work - y[6]}
        events.append((lambda y: -y[2]) if most is None else ends[law])
        if events[-1](y) <= 0:
            return y[3:6]
        y, p, which = advance(rate, y, p, p + 1e3, events)
        if which < len(events) - 1:
            # The slip along its first direction is zero: it has stopped, or only turned.
            y[:2] = 0 if size(y) < 1e-9 else y[:2]
        elif most is None:
            most, work = y[5], y[6]
            if e == 0.0:
                return y[3:6]
        else:
            return y[3:6]


def together(H, u, e):
    """Impulses of several frictionless contacts (Moreau): u+ ≥ −e u−, p ≥ 0, complementary, by trying all sets of active contacts."""
    n, want = len(u), -e * np.minimum(u, 0)
    for code in range(2**n - 1, -1, -1):
        on = [k for k in range(n) if code >> k & 1]
        p = np.zeros(n)
        if on:
            p[on] = np.linalg.lstsq(H[np.ix_(on, on)], (want - u)[on], rcond=None)[0]
        if (p > -1e-12).all() and (u + H @ p >= want - 1e-12).all():
            return p
    raise ValueError("no solution")


class World:
    def __init__(self, scene, law="energetic"):
        self.scene, self.law, self.bodies, self.n = scene, law, scene["bodies"], len(scene["bodies"])
        self.number = {body["name"]: k for k, body in enumerate(self.bodies)}
        self.gravity = np.array(scene["gravity"], float)
        self.mu, self.e = scene["contact"]["friction"], scene["contact"]["restitution"]
        self.limit_e = scene["contact"].get("limit_restitution", 0.0)
        self.contacts = []
        for k, body in enumerate(self.bodies):
            for shape in body.get("shapes", []):
                at = np.array(shape.get("at", [0, 0, 0]), float) - self.centre(k)
                for plane in scene["planes"]:
                    normal, point = np.array(plane["normal"], float), np.array(plane["point"], float)
                    signs = [[a, b, c] for a in (-1, 1) for b in (-1, 1) for c in (-1, 1)]
                    corners = [at] if "sphere" in shape else [at + np.array(shape["box"]) / 2 * sign for sign in signs]
                    self.contacts += [("plane", k, corner, shape.get("sphere", 0.0), normal, point, beside(normal)) for corner in corners]
            if "limits" in body:
                self.contacts += [("limit", k, 1, -body["limits"][0]), ("limit", k, -1, body["limits"][1])]
        for one, other in scene["pairs"]:
            i, j = self.number[one], self.number[other]
            at = lambda k, shape: np.array(shape.get("at", [0, 0, 0])) - self.centre(k)
            self.contacts += [("pair", i, j, at(i, a), at(j, b), a["sphere"], b["sphere"])
                              for a in self.bodies[i]["shapes"] for b in self.bodies[j]["shapes"]]

    def centre(self, k):
        return np.array(self.bodies[k].get("centre", [0, 0, 0]), float)

    # State: of each body position of the centre, quaternion, velocity, angular velocity, all in world axes.
    def split(self, y):
        y = y.reshape(self.n, 13)
        return y[:, :3], [matrix(q) for q in y[:, 3:7]], y[:, 7:10], y[:, 10:]

    def start(self):
        y, i, j = np.zeros((self.n, 13)), 0, 0
        q, qd, origin = self.scene["start"]["q"], self.scene["start"]["qd"], {None: (np.zeros(3), np.eye(3), np.zeros(3), np.zeros(3))}
        for k, body in enumerate(self.bodies):
            if body["joint"] == "free":
                x, turn = np.array(q[i:i + 3], float), matrix(np.array(q[i + 3:i + 7], float))
                v, w = np.array(qd[j:j + 3], float), np.array(qd[j + 3:j + 6], float)
                i, j = i + 7, j + 6
            else:
                x0, turn0, v0, w0 = origin[body["parent"]]
                axis, arm = turn0 @ np.array(body["axis"], float), turn0 @ np.array(body["at"], float)
                if body["joint"] == "hinge":
                    x, turn = x0 + arm, turn0 @ Rotation.from_rotvec(q[i] * np.array(body["axis"], float)).as_matrix()
                    v, w = v0 + cross(w0, arm), w0 + axis * qd[j]
                else:
                    arm = arm + axis * q[i]
                    x, turn, v, w = x0 + arm, turn0, v0 + cross(w0, arm) + axis * qd[j], w0
                i, j = i + 1, j + 1
            origin[body["name"]] = x, turn, v, w
            arm = turn @ self.centre(k)
            y[k] = np.concatenate([x + arm, Rotation.from_matrix(turn).as_quat(), v + cross(w, arm), w])
        return y.ravel()

    def joint(self, y, k):
        """Position and velocity of the joint of body k."""
        x, turn, v, w = self.split(y)
        body, parent = self.bodies[k], self.number.get(self.bodies[k]["parent"])
        turn0, w0 = (turn[parent], w[parent]) if parent is not None else (np.eye(3), np.zeros(3))
        axis = np.array(body["axis"], float)
        if body["joint"] == "hinge":
            return float(Rotation.from_matrix(turn0.T @ turn[k]).as_rotvec() @ axis), float(turn0 @ axis @ (w[k] - w0))
        if parent is not None:
            raise NotImplementedError("a slide on a moving body")
        return float(axis @ (x[k] - turn[k] @ self.centre(k) - np.array(body["at"]))), float(axis @ v[k])

    def told(self, y, t):
        """The state in the coordinates of the protocol."""
        x, turn, v, w = self.split(y)
        q, qd = [], []
        for k, body in enumerate(self.bodies):
            if body["joint"] == "free":
                arm = turn[k] @ self.centre(k)
                q, qd = q + [*(x[k] - arm), *Rotation.from_matrix(turn[k]).as_quat()], qd + [*(v[k] - cross(w[k], arm)), *w[k]]
            else:
                own, rate = self.joint(y, k)
                q, qd = q + [own], qd + [rate]
        return {"t": t, "q": [float(a) for a in q], "qd": [float(a) for a in qd]}

    def weight(self, turn):
        M = np.zeros((6 * self.n, 6 * self.n))
        for k, body in enumerate(self.bodies):
            M[6 * k:6 * k + 3, 6 * k:6 * k + 3] = body["mass"] * np.eye(3)
            M[6 * k + 3:6 * k + 6, 6 * k + 3:6 * k + 6] = turn[k] @ np.diag(body["inertia"]) @ turn[k].T
        return M

    def place(self, k, arm, w):
        """Rows of the velocity of a point of body k at `arm` from its centre, and the part of its acceleration without rates."""
        rows = np.zeros((3, 6 * self.n))
        if k is None:
            return rows, np.zeros(3)
        rows[:, 6 * k:6 * k + 3] = np.eye(3)
        rows[:, 6 * k + 3:6 * k + 6] = -np.array([[0, -arm[2], arm[1]], [arm[2], 0, -arm[0]], [-arm[1], arm[0], 0]])
        return rows, cross(w[k], cross(w[k], arm))

    def joints(self, y):
        """Rows and −J' v of all joints."""
        _, turn, _, w = self.split(y)
        rows, bias = [np.zeros((0, 6 * self.n))], [np.zeros(0)]
        for k, body in enumerate(self.bodies):
            if body["joint"] == "free":
                continue
            parent = self.number.get(body["parent"])
            turn0, w0 = (turn[parent], w[parent]) if parent is not None else (np.eye(3), np.zeros(3))
            axis = np.array(body["axis"], float)
            across = beside(axis) @ turn0.T  # two directions across the axis, fixed in the parent
            about = np.zeros((3, 6 * self.n))
            about[:, 6 * k + 3:6 * k + 6] = np.eye(3)
            if parent is not None:
                about[:, 6 * parent + 3:6 * parent + 6] = -np.eye(3)
            one, first = self.place(k, -turn[k] @ self.centre(k), w)
            other, second = self.place(parent, turn0 @ (np.array(body["at"], float) - (self.centre(parent) if parent is not None else 0)), w)
            if body["joint"] == "hinge":
                rows += [one - other, across @ about]
                bias += [second - first, -np.array([cross(w0, b) @ (w[k] - w0) for b in across])]
            else:
                rows += [across @ one, about]
                bias += [-across @ first, np.zeros(3)]
        return np.vstack(rows), np.concatenate(bias)

    def gap(self, y, contact):
        x, turn, _, _ = self.split(y)
        if contact[0] == "limit":
            return contact[2] * self.joint(y, contact[1])[0] + contact[3]
        if contact[0] == "plane":
            _, k, at, radius, normal, point, _ = contact
            return normal @ (x[k] + turn[k] @ at - point) - radius
        _, i, j, a, b, ra, rb = contact
        return np.linalg.norm(x[i] + turn[i] @ a - x[j] - turn[j] @ b) - ra - rb

    def rows(self, y, contact):
        """Rows of the velocity of the contact along (t1, t2, n) (a limit has n alone), and −J' v of n and of the point along t1, t2."""
        x, turn, v, w = self.split(y)
        if contact[0] == "limit":
            k, body = contact[1], self.bodies[contact[1]]
            parent, rows = self.number.get(body["parent"]), np.zeros((1, 6 * self.n))
            axis = np.array(body["axis"], float) if parent is None else turn[parent] @ np.array(body["axis"], float)
            part = 3 if body["joint"] == "hinge" else 0
            rows[0, 6 * k + part:6 * k + part + 3] = contact[2] * axis
            if parent is not None:
                rows[0, 6 * parent + part:6 * parent + part + 3] = -contact[2] * axis
            return rows, np.zeros(1)  # without J' of a moving axis: limits of joints on the world are held, others only strike
        if contact[0] == "plane":
            _, k, at, radius, normal, _, across = contact
            arm = turn[k] @ at
            rows, _ = self.place(k, arm - radius * normal, w)
            bias = cross(w[k], cross(w[k], arm))  # the point of contact stays below the centre of the sphere
            return np.vstack([across @ rows, normal @ rows]), -np.array([*(across @ bias), normal @ bias])
        _, i, j, a, b, ra, rb = contact
        a, b = turn[i] @ a, turn[j] @ b
        n = x[i] + a - x[j] - b
        n /= np.linalg.norm(n)
        rows = self.place(i, a - ra * n, w)[0] - self.place(j, b + rb * n, w)[0]
        return np.vstack([beside(n) @ rows, n @ rows]), None

    def rate(self, held):
        """The equation of motion with the contacts `held`: a list of (contact, "free", "slips" or "sticks")."""
        def f(_, y):
            return self.solve(y, held)[0]
        return f

    def solve(self, y, held):
        x, turn, v, w = self.split(y)
        M, (J, bias) = self.weight(turn), self.joints(y)
        forces = np.zeros(6 * self.n)
        for k, body in enumerate(self.bodies):
            own = turn[k] @ np.diag(body["inertia"]) @ turn[k].T
            forces[6 * k:6 * k + 3], forces[6 * k + 3:6 * k + 6] = body["mass"] * self.gravity, -cross(w[k], own @ w[k])
        columns, speeds = J.T, np.hstack([v, w]).ravel()
        for contact, kind in held:
            rows, more = self.rows(y, contact)
            if kind == "sticks":
                J, columns, bias = np.vstack([J, rows]), np.hstack([columns, rows.T]), np.concatenate([bias, more])
                continue
            column = rows[-1]
            if kind == "slips":
                slip = rows[:2] @ speeds
                column = column - self.mu * slip / max(np.linalg.norm(slip), 1e-300) @ rows[:2]
            J, columns, bias = np.vstack([J, rows[-1:]]), np.hstack([columns, column[:, None]]), np.append(bias, more[-1])
        inverse = np.linalg.inv(M)
        left, right = J @ inverse @ columns, bias - J @ inverse @ forces
        # Several points of one floor are redundant: the least multipliers.
        multipliers = np.linalg.lstsq(left, right, rcond=1e-12)[0] if len(held) > 1 else np.linalg.solve(left, right)
        a = (inverse @ (forces + columns @ multipliers)).reshape(self.n, 6)
        quaternions = y.reshape(self.n, 13)[:, 3:7]
        turned = np.array([0.5 * np.concatenate([w[k] * q[3] + cross(w[k], q[:3]), [-w[k] @ q[:3]]]) for k, q in enumerate(quaternions)])
        return np.hstack([v, turned, a]).ravel(), multipliers[len(self.joints(y)[1]):]

    def speed(self, y, contact):
        _, _, v, w = self.split(y)
        return self.rows(y, contact)[0] @ np.hstack([v, w]).ravel()

    def strike(self, y, hits, law):
        _, turn, v, w = self.split(y)
        M, (J, _) = self.weight(turn), self.joints(y)
        rows = [self.rows(y, hit)[0] for hit in hits]
        if len(hits) > 1 and self.mu:
            raise NotImplementedError("several impacts with friction at a time")
        rows = rows[0] if len(hits) == 1 else np.vstack([it[-1:] for it in rows])
        whole = np.block([[M, -J.T], [J, np.zeros((len(J), len(J)))]])
        changes = np.linalg.solve(whole, np.vstack([rows.T, np.zeros((len(J), len(rows)))]))[:6 * self.n]
        H, u = rows @ changes, rows @ np.hstack([v, w]).ravel()
        if len(hits) > 1:
            p = together(H, u, self.e)
        elif hits[0][0] == "limit":
            p = -(1 + self.limit_e) * u / H[0, 0]
        else:
            p = impulse(H, u, self.mu, self.e, law)
        y = y.reshape(self.n, 13).copy()
        y[:, 7:] += (changes @ p).reshape(self.n, 6)
        return y.ravel()

    def holds(self, y):
        """The closed contacts that stay closed, and how: by the force that holding them needs."""
        still = [it for it in self.contacts if abs(self.gap(y, it)) < CLOSED and abs(self.speed(y, it)[-1]) < STILL]
        if not still or not np.any(self.gravity):
            return [], still
        kinds = []
        for it in still:
            slip = np.linalg.norm(self.speed(y, it)[:-1]) if it[0] == "plane" else 0.0
            kinds.append("slips" if self.mu and it[0] == "plane" and slip > 1e-9 else "free")
        if self.mu and "free" in kinds and all(it[0] == "plane" for it in still):
            # No slip: sticks, if the friction of all points together suffices; else slips against it.
            force = self.solve(y, [(it, "sticks") for it in still])[1].reshape(-1, 3).sum(axis=0)
            if np.hypot(*force[:2]) <= self.mu * force[2]:
                return [(it, "sticks") for it in still], still
            start = y.reshape(self.n, 13)
            start[still[0][1], 7:10] -= 3e-12 * force[:2] @ still[0][6] / np.hypot(*force[:2])  # the direction of the slip that begins
            return [(it, "slips") for it in still], still
        return list(zip(still, kinds)), still

    def run(self, times):
        y, t, states = self.start(), 0.0, []
        for time in times:
            while t < time:
                closed = [it for it in self.contacts if self.gap(y, it) < CLOSED]
                hits = [it for it in closed if self.speed(y, it)[-1] < -STILL]
                if hits:
                    y = self.strike(y, hits, self.law)
                    continue
                held, still = self.holds(y)
                others = [it for it in self.contacts if not any(it is other for other in still)]
                events = [lambda y, it=it: self.gap(y, it) for it in others]
                kinds = {kind for _, kind in held}
                if held and kinds == {"slips"}:
                    first = self.speed(y, held[0][0])[:2]
                    first = first / np.linalg.norm(first)
                    events.append(lambda y: first @ self.speed(y, held[0][0])[:2])
                if kinds == {"free"}:
                    events += [lambda y, k=k: self.solve(y, held)[1][k] for k in range(len(held))]
                y, t, which = advance(self.rate(held), y, t, time, events)
                y = y.copy()
                for k in range(self.n):
                    y[13 * k + 3:13 * k + 7] /= np.linalg.norm(y[13 * k + 3:13 * k + 7])
                if which is not None and which >= len(others):
                    if kinds == {"slips"}:
                        y = self.stop(y, held)
                    else:
                        # A contact whose force ends is open: without this it would be held again.
                        self.contacts = [it for it in self.contacts if it is not held[which - len(others)][0]]
            states.append(self.told(y, time))
        return states

    def stop(self, y, held):
        """The end of slip: the rest of rounding is removed, so that it counts as no slip."""
        parts = y.reshape(self.n, 13)
        rows = np.vstack([self.rows(y, it)[0][:2] for it, _ in held])
        speeds = parts[:, 7:].ravel()
        parts[:, 7:] -= (np.linalg.pinv(rows) @ (rows @ speeds)).reshape(self.n, 6)
        return y
