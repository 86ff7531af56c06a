"""Checks the judge with exact programs, right and with planted defects, and the closed forms of the derivatives by differences of a
program of its own: check.py. Exit status 1 if a verdict or a closed form is unexpected.

The exact programs are the closed form of a ball (example_adapter.py) and the second methods of certify.py (second_adapter.py); the latter
need mpmath and scipy, and are left out without them. No defect is planted for box-rest, which has no second method, nor for stack, whose
second method is the existence of forces and not a motion.
"""

import importlib.util
import os
import sys

import numpy as np

import derivatives
import judge

# What the judge must say of the example adapter with each defect: case → verdict.
EXPECTED = {
    "": {"ad-ball": "exact", "ad-ball-e": "exact", "ad-pair": "refused", "ball-e": "exact", "speed": "exact", "zeno": "exact", "step": "exact", "gradient-height": "exact", "arm-wall": "refused", "cradle": "refused"},
    "restitution": {"ball-e": "fails", "speed": "fails", "zeno": "fails", "step": "fails", "gradient-height": "fails"},
    "threshold": {"ball-e": "exact", "speed": "fails"},
    "no event": {"ad-ball": "fails"},
    "late": {"ball-e": "exact", "zeno": "within tolerance", "step": "degrades"},
}

# The same of the second methods, for the cases that the ball's closed form does not know.
SECOND = {
    "": {case: "exact" for case in (
        "friction", "rod-friction", "struck-chain", "joint-stop", "ladder", "sliding", "tennis-racket", "backspin", "rolling-slope",
        "slope-angle", "rocking-block", "percussion", "double-pendulum-wall", "pendulum-stop", "spin-bounce", "slip-stick-border", "billiards",
        "two-walls", "eccentric-laws", "sliding-rod", "triple-chain", "cart-stop", "two-legs", "pendulum-pair", "corner-hodograph")} |
        {"box-rest": "refused"},
    # The energy of joint-stop depends little on e: an error of e of 0.01 is within the tolerance there.
    "restitution": {case: "fails" for case in (
        "struck-chain", "percussion", "double-pendulum-wall", "pendulum-stop", "spin-bounce", "slip-stick-border", "billiards",
        "two-walls", "triple-chain", "cart-stop", "two-legs", "pendulum-pair")} |
        {"joint-stop": "within tolerance", "tennis-racket": "exact"},
    "friction": {case: "fails" for case in (
        "friction", "sliding", "backspin", "rolling-slope", "slope-angle", "sliding-rod", "spin-bounce", "corner-hodograph")} |
        {"percussion": "exact"},
    "inertia": {case: "fails" for case in ("tennis-racket", "backspin", "rod-friction")} | {"two-walls": "exact"},
    "smooth": {case: "fails" for case in (
        "friction", "rod-friction", "rocking-block", "billiards", "eccentric-laws", "two-legs")} | {"percussion": "exact"},
    # One direction of friction for the whole impact: wrong where the slip stops, reverses or turns, and nowhere else.
    "frozen": {case: "fails" for case in (
        "spin-bounce", "slip-stick-border", "eccentric-laws", "corner-hodograph")} | {"rod-friction": "exact", "two-walls": "exact"},
}


def flown(scene, time):
    """Positions of balls after `time`, from strike to strike; only frictionless impacts of equal balls or of a ball with the floor.

    The second route to the closed forms: it knows neither times of strikes nor derivatives, and finds each strike by bisection.
    """
    count, e = len(scene["bodies"]), scene["contact"]["restitution"]
    radius = scene["bodies"][0]["shapes"][0]["sphere"]
    x = np.reshape(scene["start"]["q"], (count, 7))[:, :3].astype(float)
    v = np.reshape(scene["start"]["qd"], (count, 6))[:, :3].astype(float)
    pieces = derivatives.forces(scene) if "force" in scene else np.zeros((1, 2))
    for piece in pieces:
        a, left = np.tile(np.array(scene["gravity"], float), (count, 1)), time / len(pieces)
        a[0, :2] += piece  # mass 1, the first body
        gap = lambda y: np.linalg.norm(y[1] - y[0]) - 2 * radius if count == 2 else y[0, 2] - radius
        while left > 0:
            at = lambda t: x + v * t + a * t * t / 2
            # The first of many short intervals at whose end the gap is closed and was open.
            grid = np.linspace(0, left, 200)[1:]
            end = next((t for k, t in enumerate(grid) if gap(at(t)) < 0 and gap(at(grid[k - 1] if k else 1e-9)) > 0), None)
            low, high = (left, left) if end is None else (end - grid[0], end)
            while end is not None and low < (middle := 0.5 * (low + high)) < high:
                low, high = (middle, high) if gap(at(middle)) > 0 else (low, middle)
            x, v, left = at(high), v + a * high, left - high if end is not None else 0.0
            if end is not None:
                n = (x[1] - x[0]) / np.linalg.norm(x[1] - x[0]) if count == 2 else np.array([0, 0, 1.0])
                if count == 2:
                    push = (1 + e) / 2 * ((v[0] - v[1]) @ n) * n
                    v = v + np.array([-push, push])
                else:
                    v = v - (1 + e) * (v[0] @ n) * n
    return np.hstack([x, np.tile([0, 0, 0, 1.0], (count, 1))]).ravel()


def closed_forms():
    """The largest error of value and derivatives of each case with a closed form, against `flown` and its differences of fourth order."""
    for case in judge.cases(None, gradients=True):
        if "derivative" not in case:
            continue
        scene, names = judge.scene_of(case, {}), dict(judge.MATHS)
        for name, formula in case.get("let", {}).items():
            names[name] = eval(formula, names)
        start, h = derivatives.point_of(scene, case["by"]), 1e-3

        def value(point):
            here = derivatives.put(scene, case["by"], map(float, point))
            return derivatives.value(case, flown(here, case["time"]), derivatives.forces(here))

        by = [(8 * (value(start + h * unit) - value(start - h * unit)) - value(start + 2 * h * unit) + value(start - 2 * h * unit)) / (12 * h)
              for unit in np.eye(len(start))]
        yield case["case"], max(abs(value(start) - eval(case["value"], names)), np.max(np.abs(by - np.array(eval(case["derivative"], names)))))


def main():
    here = os.path.dirname(os.path.abspath(__file__))
    wrong = 0
    for name, error in closed_forms():
        wrong += not error < 1e-9
        print(f"{'ok   ' if error < 1e-9 else 'WRONG'} closed form of {name}: {error:.1e}")
    programs = [("example", *item) for item in EXPECTED.items()]
    if importlib.util.find_spec("scipy") and importlib.util.find_spec("mpmath"):
        programs += [("second", *item) for item in SECOND.items()]
    else:
        print("left out: the second methods, which need mpmath and scipy")
    for program, defect, verdicts in programs:
        os.environ["DEFECT"] = defect
        adapter = judge.Adapter([sys.executable, os.path.join(here, f"{program}_adapter.py")])
        normal, derived = ([case for case in judge.cases(None, kind) if case["case"] in verdicts] for kind in (False, True))
        for case in normal + derived:
            found = judge.gradients(case, adapter) if case in derived else judge.judge(case, adapter, "best")
            right = found["verdict"] == verdicts[case["case"]]
            wrong += not right
            print(f"{'ok   ' if right else 'WRONG'} defect {defect or 'none':12} {judge.told(dict(found, engine=program))}")
        adapter.close()
    sys.exit(1 if wrong else 0)


if __name__ == "__main__":
    main()
