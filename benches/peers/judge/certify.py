"""Certifies the solutions by second methods: certify.py [CASE...]. Exit status 1 if a value disagrees beyond its bounds. Needs mpmath
and scipy.

For each run a second method makes the states at the asked times, from the scene alone. The judge's own measures are taken of them and
compared with the numbers in solutions/: they may differ by the bound that is stated there and the bound of the second method.
The numbers of motions without a closed form are integrated a third time, by integrated.py, whose 30 digits the numbers come from.
"""

import sys

import numpy as np
from mpmath import mp, mpf, sqrt
from scipy.optimize import linprog

import integrated
import judge
import second
import solve
from second import World, advance

DIGITS = 50
# Bounds of the second methods. Flights: formulas with 50 digits, rounded to doubles once for the measures.
BOUND = {"flights": 1e-14, "bodies": 2e-11, "statics": 1e-14}
# Ends of impacts of several laws: the second method gives all three.
LAWS = {"eccentric-laws": ("newton", "poisson", "energetic")}
WITHOUT = {"box-rest": "the transient depends on the law; statics gives the end for every second method alike"}
PARABOLAS = ("ball-e", "step", "zeno", "gradient-height", "grazing")


def flights(scene, times):
    """States of a ball that strikes a floor or a ceiling: parabolas with 50 digits, until the flights are shorter than 1e-25 s.

    h: gap, v: its rate, a: its acceleration in flight.
    """
    with mp.workdps(DIGITS):
        exact = lambda x: mpf(repr(float(x)))
        [plane], contact, q, qd = scene["planes"], scene["contact"], scene["start"]["q"], scene["start"]["qd"]
        side, e = exact(plane["normal"][2]), exact(contact["restitution"])
        base = exact(plane["point"][2]) + side * exact(scene["bodies"][0]["shapes"][0]["sphere"])
        h, v, a, now, states = side * (exact(q[2]) - base), side * exact(qd[2]), side * exact(scene["gravity"][2]), mpf(0), []
        for time in times:
            while True:
                square = v * v - 2 * a * h
                left = (v + sqrt(square)) / -a if a < 0 else (-v - sqrt(square)) / a if v < 0 < square else mp.inf
                if h == 0 and left < mpf(10) ** -25:
                    height, speed = mpf(0), mpf(0)
                    break
                if now + left > exact(time):
                    t = exact(time) - now
                    height, speed = h + v * t + a * t * t / 2, v + a * t
                    break
                h, v, now = mpf(0), -e * (v + a * left), now + left
            states.append({"t": time, "q": [*q[:2], float(base + side * height), *q[3:]], "qd": [*qd[:2], float(side * speed), *qd[3:]]})
        return states


def rocking(scene, times):
    """Maximal coordinates with one edge fixed; at a landing the impulse acts at the other edge, and the first one must leave the floor."""
    world, t, side, states = World(scene), 0.0, 1, []
    y, (width, _, height) = world.start(), scene["bodies"][0]["shapes"][0]["box"]
    edge = lambda side: ("plane", 0, np.array([side * width / 2, 0, -height / 2]), 0.0, np.array([0, 0, 1.0]), np.zeros(3), np.eye(3)[:2])
    for time in times:
        while t < time:
            falls = lambda y: world.gap(y, edge(-side)) if world.speed(y, edge(-side))[2] < 0 else 1.0
            y, t, landed = advance(world.rate([(edge(side), "sticks")]), y, t, time, [falls])
            if landed is not None:
                side = -side
                parts = y.reshape(1, 13)
                rows, mass = world.rows(y, edge(side))[0], world.weight(world.split(y)[1])
                change = np.linalg.solve(mass, rows.T)
                contact = scene["contact"]
                H, u = rows @ change, rows @ parts[0, 7:]
                parts[0, 7:] += change @ second.impulse(H, u, contact["friction"], contact["restitution"], "energetic")
                assert world.speed(y, edge(-side))[2] > 0
        states.append(world.told(y, time))
    return states


def stacked(scene, times):
    """Rest is a solution if forces within the friction cones, at the corners of the faces, balance the weights: a linear program."""
    bodies, q = scene["bodies"], np.reshape(scene["start"]["q"], (-1, 7))
    g, mu, half = -scene["gravity"][2], scene["contact"]["friction"], bodies[0]["shapes"][0]["box"][0] / 2
    points = []
    for k in range(len(bodies)):
        low = q[k, :2] - half if k == 0 else np.maximum(q[k, :2], q[k - 1, :2]) - half
        high = q[k, :2] + half if k == 0 else np.minimum(q[k, :2], q[k - 1, :2]) + half
        assert np.isclose(q[k, 2], half * (2 * k + 1), rtol=0, atol=1e-15)
        points += [(k, np.array([x, y, q[k, 2] - half])) for x in (low[0], high[0]) for y in (low[1], high[1])]
    # Of each force the components x, y, z on the upper body; against them on the lower one.
    balance, right = np.zeros((6 * len(bodies), 3 * len(points))), np.zeros(6 * len(bodies))
    for number, (k, point) in enumerate(points):
        for body, sign in ((k, 1), (k - 1, -1)):
            if body >= 0:
                arm = point - q[body, :3]
                balance[6 * body:6 * body + 3, 3 * number:3 * number + 3] = sign * np.eye(3)
                turn = np.array([[0, -arm[2], arm[1]], [arm[2], 0, -arm[0]], [-arm[1], arm[0], 0]])
                balance[6 * body + 3:6 * body + 6, 3 * number:3 * number + 3] = sign * turn
    right[2::6] = [body["mass"] * g for body in bodies]
    cones = np.zeros((4 * len(points), 3 * len(points)))
    for number in range(len(points)):
        # |f_x| + |f_y| ≤ μ f_z lies within the cone.
        cones[4 * number:4 * number + 4, 3 * number:3 * number + 3] = [[a, b, -mu] for a in (1, -1) for b in (1, -1)]
    found = linprog(np.zeros(balance.shape[1]), A_ub=cones, b_ub=np.zeros(len(cones)), A_eq=balance, b_eq=right,
                    bounds=[(None, None), (None, None), (0, None)] * len(points))
    assert found.status == 0, found.message
    return [dict(scene["start"], t=time) for time in times]


def method(case):
    if case["case"] in PARABOLAS:
        return "flights", lambda scene, times, _: flights(scene, times)
    if case["case"] == "rocking-block":
        return "bodies", lambda scene, times, _: rocking(scene, times)
    if case["case"] == "stack":
        return "statics", lambda scene, times, _: stacked(scene, times)
    return "bodies", lambda scene, times, law: World(scene, law).run(times)


def differences(got, told):
    """The largest difference of a measure from its number, or by how much it passes its bound."""
    if "value" in told:
        return float(np.max(np.abs(np.array(got, float) - np.array(told["value"], float))))
    return max(0.0, got - told["at_most"] if "at_most" in told else told["at_least"] - got)


def certified(case, solution):
    """The method, and the largest difference as a share of what is allowed, with the difference itself."""
    kind, run_by = method(case)
    worst = (0.0, 0.0, "")
    for law in LAWS.get(case["case"], ("energetic",)):
        answers = [{"states": run_by(judge.scene_of(case, run), run["times"], law)} for run in case["runs"]]
        for row in judge.figure_of(case, case["runs"], answers)[0]:
            told = next(it for it in solution["runs"][row["run"]]["expect"] if it["name"] == row["name"])
            # Where a measure is a quotient of differences the method's error is multiplied: `scale` of the case does not know this.
            own = BOUND[kind] * (1e4 if "across" in case else 1)
            allowed = told.get("bound", 0.0) + own * max(1.0, np.max(np.abs(told.get("value", 1.0))))
            off = differences(row["got"], told)
            worst = max(worst, (off / allowed if np.isfinite(off) else np.inf, off, f"{row['run']}: {row['name']}"))
    return kind, worst


def numbers(case, solution):
    """The largest difference between the numbers of a case that are integrated and those of integrated.py, as a share of their bounds."""
    worst = (0.0, 0.0, "")
    for run in case["runs"]:
        for name, value in integrated.values(case, run).items():
            told = next(it for it in solution["runs"][run["run"]]["expect"] if it["name"] == name)
            flat = np.ravel(np.array([[float(x) for x in it] if isinstance(it, list) else [float(it)] for it in value]))
            off = float(np.max(np.abs(flat - np.ravel(told["value"]))))
            worst = max(worst, (off / told["bound"], off, f"{run['run']}: {name}"))
    return worst


def main():
    count = failed = 0
    for case in judge.cases(sys.argv[1:]):
        if case["case"] in WITHOUT:
            print(f"none   {case['case']:21} no second method: {WITHOUT[case['case']]}", flush=True)
            continue
        solution = solve.read(case["case"])
        kind, found = certified(case, solution)
        told = [(kind, found)] + ([("30 digits", numbers(case, solution))] if case["case"] in integrated.CASES else [])
        right = all(share <= 1 for _, (share, _, _) in told)
        count, failed = count + right, failed + (not right)
        text = "; ".join(f"{kind} {off:.1e} ({share:.1e} of the bound) {where}" for kind, (share, off, where) in told)
        print(f"{'agrees' if right else 'WRONG '} {case['case']:21} {text}", flush=True)
    print(f"{count} cases certified, {failed} disagree")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
