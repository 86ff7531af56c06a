"""The motions without a closed form, integrated with 30 digits: the source of the numbers in the cases. Needs mpmath.

    integrated.py CASE    prints the numbers of a case: value and two derivatives by time at each asked time

The equations are those of minimal coordinates (Lagrange's). second.py has another formulation and another integrator.
"""

import sys

from mpmath import cos, matrix, lu_solve, mp, mpf, sin, sqrt

mp.dps = 30
STAGES, STEP = 10, mpf("0.01")  # order 20
G = mpf("9.81")


def step(f, y, h):
    """One step of Gragg, Bulirsch and Stoer: modified midpoint rule with 2, 4 … 2 STAGES parts, extrapolated in the square of the part."""
    table = []
    for k in range(1, STAGES + 1):
        part, before = h / (2 * k), y
        now = [a + part * b for a, b in zip(y, f(y))]
        for _ in range(2 * k - 1):
            before, now = now, [a + 2 * part * b for a, b in zip(before, f(now))]
        smooth = [(a + b + part * c) / 2 for a, b, c in zip(before, now, f(now))]
        row = [smooth]
        for j in range(1, k):
            share = mpf(k) ** 2 / mpf(k - j) ** 2 - 1
            row.append([a + (a - b) / share for a, b in zip(row[-1], table[-1][j - 1])])
        table.append(row)
    return table[-1][-1]


def flow(f, y, duration, event=None, size=STEP):
    """The state after `duration`, or where `event` first passes from positive to negative, and the time until then."""
    spent = mpf(0)
    while spent < duration:
        h = min(size, duration - spent)
        ahead = step(f, y, h)
        if event and event(y) > 0 > event(ahead):
            low, high, a, b = mpf(0), h, event(y), event(ahead)
            for _ in range(200):  # regula falsi (Illinois)
                middle = (low * b - high * a) / (b - a)
                found = step(f, y, middle)
                value = event(found)
                if abs(value) < mpf(10) ** -27:
                    break
                if value * b < 0:
                    low, a = high, b
                else:
                    a /= 2
                high, b = middle, value
            return found, spent + middle
        y, spent = ahead, spent + h
    return y, spent


def motion(f, y, times, event, strike):
    """States at the times, with one impact where `event` passes through zero."""
    y_at, until = flow(f, y, times[-1], event)
    after = strike(y_at)
    return [flow(f, y, t)[0] if t < until else flow(f, after, t - until)[0] for t in times]


class Rods:
    """A chain of rods in the plane of x and z, hinged in a row about y; `turn` is the direction of a rod at angle 0, the joint angles turn
    x to −z. Textbook equations in absolute angles: Σ B_jk (cos(a_j − a_k) a_k'' + sin(a_j − a_k) a_k'²) = g cos a_j Σ m a_ij."""

    def __init__(self, masses, lengths, turn):
        n = len(masses)
        self.n, self.turn, self.lengths = n, turn, lengths
        arm = [[lengths[j] if j < i else lengths[j] / 2 if j == i else mpf(0) for j in range(n)] for i in range(n)]
        self.b = [[sum(masses[i] * arm[i][j] * arm[i][k] for i in range(n)) for k in range(n)] for j in range(n)]
        self.own = [m * l**2 / 12 for m, l in zip(masses, lengths)]
        self.weight = [G * sum(masses[i] * arm[i][j] for i in range(n)) for j in range(n)]

    def mass(self, a):
        return matrix([[self.b[j][k] * cos(a[j] - a[k]) + (self.own[j] if j == k else 0) for k in range(self.n)] for j in range(self.n)])

    def rate(self, y):
        a, w = y[:self.n], y[self.n:2 * self.n]
        n = range(self.n)
        right = [cos(a[j]) * self.weight[j] - sum(self.b[j][k] * sin(a[j] - a[k]) * w[k] ** 2 for k in n) for j in n]
        return list(w) + list(lu_solve(self.mass(a), matrix(right)))

    def point(self, a, link, along):
        """Position of a point of a link, and its derivative by each angle."""
        lengths = self.lengths[:link] + [along]
        at = [sum(l * cos(x) for l, x in zip(lengths, a)), -sum(l * sin(x) for l, x in zip(lengths, a))]
        return at, [[-l * sin(x), -l * cos(x)] for l, x in zip(lengths, a)] + [[0, 0]] * (self.n - link - 1)

    def absolute(self, joint):
        return [sum(joint[:k + 1]) for k in range(self.n)]

    def joints(self, a):
        return [a[0]] + [y - x for x, y in zip(a, a[1:])]


def double_pendulum(case, run):
    rods, e, r, wall = Rods([mpf(1)] * 2, [mpf(1)] * 2, 0), mpf("0.5"), mpf("0.02"), mpf("0.5")

    def strike(y):
        a, w = y[:2], y[2:]
        row = [by[0] for by in rods.point(a, 1, mpf(1))[1]]
        push = lu_solve(rods.mass(a), matrix(row))
        u = sum(x * v for x, v in zip(row, w))
        p = -(1 + e) * u / sum(x * v for x, v in zip(row, push))
        return a + [v + p * x for v, x in zip(w, push)]

    states = motion(rods.rate, [mpf(0)] * 4, run["times"], lambda y: rods.point(y[:2], 1, mpf(1))[0][0] - wall - r, strike)
    kinetic = lambda y: sum(w * v for w, v in zip(y[2:], rods.mass(y[:2]) * matrix(y[2:]))) / 2
    energy = [kinetic(y) - sum(sin(x) * k for x, k in zip(y, rods.weight)) for y in states]
    whole = {"angles, rad": lambda y: rods.joints(y[:2]), "angular velocities, of 3 rad/s": lambda y: rods.joints(y[2:])}
    return {name: near(rods.rate, states, pick) for name, pick in whole.items()} | {"energy, of 10 J": energy}


def triple_chain(case, run):
    half = mp.pi / 2
    rods = Rods([mpf(2), mpf(1), mpf("0.5")], [mpf("0.4"), mpf("0.3"), mpf("0.2")], half)
    e, reach, m = mpf("0.6"), mpf("0.08"), mpf("0.3")
    start = [x + half for x in rods.absolute([mpf("0.2"), mpf("-0.3"), mpf("0.5")])]
    y = start + [mpf(0)] * 3 + [mpf("-0.4"), mpf("-0.5"), mpf(3), mpf(0)]  # the ball: x, z and their velocities
    rate = lambda y: rods.rate(y[:6]) + [y[8], y[9], mpf(0), -G]

    def between(y):
        at = rods.point(y[:3], 1, mpf("0.2"))[0]
        return [at[0] - y[6], at[1] - y[7]]

    def strike(y):
        d = between(y)
        size = sqrt(d[0] ** 2 + d[1] ** 2)
        n = [x / size for x in d]
        row = [by[0] * n[0] + by[1] * n[1] for by in rods.point(y[:3], 1, mpf("0.2"))[1]]
        push = lu_solve(rods.mass(y[:3]), matrix(row))
        u = sum(x * v for x, v in zip(row, y[3:6])) - n[0] * y[8] - n[1] * y[9]
        p = -(1 + e) * u / (sum(x * v for x, v in zip(row, push)) + 1 / m)
        return y[:3] + [v + p * x for v, x in zip(y[3:6], push)] + y[6:8] + [y[8] - p * n[0] / m, y[9] - p * n[1] / m]

    states = motion(rate, y, run["times"], lambda y: sum(x**2 for x in between(y)) - reach**2, strike)
    joints = lambda part: [part[0]] + [b - a for a, b in zip(part, part[1:])]
    return {"angles of the chain, rad": near(rate, states, lambda y: joints([x - half for x in y[:3]]), lambda y: joints(y[:3])),
            "angular velocities of the chain, of 3 rad/s": near(rate, states, lambda y: joints(y[3:6])),
            "velocity of the ball, m/s": near(rate, states, lambda y: [y[8], mpf(0), y[9]])}


def cart(case, run):
    M, m, c, stop, e = mpf(2), mpf(1), mpf("0.5"), mpf("0.3"), mpf("0.5")
    own = m / 12 + m * c**2
    mass = lambda y: matrix([[M + m, -m * c * cos(y[1])], [-m * c * cos(y[1]), own]])
    rate = lambda y: [y[2], y[3], *lu_solve(mass(y), matrix([-m * c * sin(y[1]) * y[3] ** 2, -m * G * c * sin(y[1])]))]

    def strike(y):
        push = lu_solve(mass(y), matrix([1, 0]))
        return [y[0], y[1], -e * y[2], y[3] - (1 + e) * y[2] * push[1] / push[0]]

    states = motion(rate, [mpf(0), mpf("0.8"), mpf(1), mpf(0)], run["times"], lambda y: stop - y[0], strike)
    return {"position and angle, m and rad": near(rate, states, lambda y: y[:2]),
            "velocities, of 3 m/s and 3 rad/s": near(rate, states, lambda y: y[2:])}


def sliding_rod(case, run):
    """y: elevation of the rod, its rate, velocity along. Contact at (a, b) from the centre; friction μ N against the slip, which is to −x."""
    mu, r, moment = mpf(str(run.get("change", {}).get("contact.friction", 0.5))), mpf("0.01"), mpf(1) / 12

    def normal(y):
        b = -sin(y[0]) / 2 - r
        turn = (mu * b + cos(y[0]) / 2) / moment  # −ω' = φ'' by N, with the sign of `rate`
        return (G - sin(y[0]) * y[1] ** 2 / 2) / (1 + cos(y[0]) / 2 * turn), turn

    def rate(y):
        n, turn = normal(y)
        return [y[1], -n * turn, mu * n]

    q = case["scene"]["start"]["q"]
    start = [2 * mp.atan2(-mpf(repr(q[4])), mpf(repr(q[6]))), mpf(0), mpf(case["scene"]["start"]["qd"][0])]
    states = [flow(rate, start, t, size=STEP / 10)[0] for t in run["times"]]
    assert all(normal(y)[0] > 0 and y[2] + (sin(y[0]) / 2 + r) * y[1] < 0 for y in states)
    return {"height of the centre, m": near(rate, states, lambda y: [r + sin(y[0]) / 2]),
            "velocity along, m/s": near(rate, states, lambda y: y[2:]),
            "angular velocity, of 2 rad/s": near(rate, states, lambda y: [-y[1]])}


def rocking(case, run):
    """An inverted pendulum about the edge: θ'' = −3 g/(4 R) sin(α − θ)."""
    if run["run"] == "released":
        return {}
    radius, alpha = sqrt(mpf("0.17")), mp.atan(mpf("0.25"))
    rate = lambda y: [y[1], -3 * G / (4 * radius) * sin(alpha - y[0])]
    start = [mpf(0), mpf(repr(run["change"]["start.qd"][4]))]
    name = run["expect"][1]["name"]
    states = [flow(rate, start, t)[0] for t in run["times"][:1]]
    return {name: near(rate, states, lambda y: [sin(y[0])])}


def hodograph(case, run):
    """Darboux' and Keller's equation du/dp = H (n − μ s/|s|) of the contact's velocity, up to u_n = 0."""
    scene = case["scene"]
    mu = mpf(str(run.get("change", {}).get("contact.friction", scene["contact"]["friction"])))
    x, y, z, w = (mpf(k) / 6 for k in (1, 3, -1, 5))
    turn = matrix([[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                   [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                   [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]])
    [shape] = scene["bodies"][0]["shapes"]
    arm = turn * matrix([mpf(str(k)) for k in shape["at"]]) - matrix([0, 0, mpf(str(shape["sphere"]))])
    moment = matrix(3)
    # The moments m (a² + b²)/12 of the block, as fractions: the case has their 16 digits.
    for k, of in enumerate((("0.2", "0.1"), ("0.3", "0.1"), ("0.3", "0.2"))):
        moment[k, k] = 12 / sum(mpf(length) ** 2 for length in of)
    inverse = turn * moment * turn.T
    cross = matrix([[0, -arm[2], arm[1]], [arm[2], 0, -arm[0]], [-arm[1], arm[0], 0]])
    H = mp.eye(3) - cross * inverse * cross
    u = matrix([mpf("0.5"), mpf("-0.2"), mpf(-1)])

    def rate(y):
        size = sqrt(y[0] ** 2 + y[1] ** 2)
        push = matrix([-mu * y[0] / size, -mu * y[1] / size, 1])
        return list(H * push) + list(push)

    if run["run"].endswith("sticks"):
        p = lu_solve(H, -u)
    else:
        p = matrix(flow(rate, list(u) + [mpf(0)] * 3, mpf(10), lambda y: -y[2], size=mpf("0.005"))[0][3:])
    return {"velocity, m/s": list(u + p), "angular momentum about the centre, of 0.01 kg m²/s": list(cross * p)}


def near(rate, states, pick, of_rate=None):
    """For each state: the picked values, and their first and second derivatives by time, by differences along the motion."""
    found = []
    for y in states:
        h = mpf(10) ** -6
        ahead, behind = step(rate, y, h), step(rate, y, -h)
        before, now, after = pick(behind), pick(y), pick(ahead)
        first = [(a - b) / (2 * h) for a, b in zip(after, before)]
        found.append([now, first, [(a - 2 * c + b) / h**2 for a, b, c in zip(after, before, now)]])
    return found


CASES = {"double-pendulum-wall": double_pendulum, "triple-chain": triple_chain, "cart-stop": cart, "sliding-rod": sliding_rod,
         "rocking-block": rocking,
         "corner-hodograph": hodograph}


def values(case, run):
    """The integrated values of a run by the name of the expectation, without derivatives; nested lists of numbers with 30 digits."""
    run = dict(run, times=[mpf(str(t)) for t in run["times"]])
    return {name: [it[0] if isinstance(it, list) else it for it in found] for name, found in CASES[case["case"]](case, run).items()}


def main():
    import judge
    [case] = judge.cases(sys.argv[1:2])
    for run in case["runs"]:
        found = CASES[case["case"]](case, dict(run, times=[mpf(str(t)) for t in run["times"]]))
        for name, value in found.items():
            plain = lambda it, digits: [plain(x, digits) for x in it] if isinstance(it, list) else mp.nstr(it, digits)
            whole = [[plain(it[0], 18), *(plain(x, 9) for x in it[1:])] if isinstance(it, list) else plain(it, 18) for it in value]
            print(run["run"], "|", name, "|", whole)


if __name__ == "__main__":
    main()
