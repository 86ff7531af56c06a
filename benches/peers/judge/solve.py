"""Writes the solutions: solve.py [CASE...] [--out FOLDER]. For every case FOLDER/CASE.json (default solutions/), with each expectation as
numbers and a bound of their error.

Formulas are evaluated with 50 digits at the asked times, of the decimal numbers as they stand in the scene. Needs mpmath.
"""

import argparse
import ast
import json
import os

import numpy as np
from mpmath import mp, mpf

import judge
from closed import planar_impact

FOLDER = os.path.join(judge.HERE, "solutions")
DIGITS = 50
# Of a number of size 1: the rounding of the number itself, and of T, V and L at the start, which are doubles.
ROUNDING = 1e-15


def read(name):
    with open(os.path.join(FOLDER, f"{name}.json")) as file:
        return json.load(file)


class Exact(ast.NodeTransformer):
    """A formula with exact decimal numbers (0.1 is a tenth) and exact quotients (2/7)."""

    def visit_Constant(self, node):
        return ast.Call(ast.Name("exact", ast.Load()), [node], []) if isinstance(node.value, float) else node

    def visit_BinOp(self, node):
        self.generic_visit(node)
        return ast.Call(ast.Name("quotient", ast.Load()), [node.left, node.right], []) if isinstance(node.op, ast.Div) else node


def exact(value):
    """The decimal numbers that a double or a list of doubles was written as."""
    if isinstance(value, (list, tuple, np.ndarray)):
        return np.array([exact(it) for it in value], dtype=object)
    return mpf(repr(float(value)))


def bounce(h, e, g, t):
    """As in judge.py, through all impacts."""
    speed, left = mp.sqrt(2 * g * h), t - mp.sqrt(2 * h / g)
    if left < 0:
        return h - g * t * t / 2
    while speed > mpf(10) ** -30:
        speed *= e
        flight = 2 * speed / g
        if left < flight:
            return speed * left - g * left**2 / 2
        left -= flight
    return mpf(0)


NAMES = {name: getattr(mp, name) for name in ("sqrt", "sin", "cos", "asin", "pi", "hypot", "log")} | {
    "abs": abs, "max": max, "min": min, "sum": sum, "range": range, "exact": exact, "bounce": bounce, "planar_impact": planar_impact,
    "quotient": lambda a, b: (mpf(a) if isinstance(a, int) else a) / b, "norm": lambda v: mp.sqrt(sum(x * x for x in v)),
    "array": lambda values: np.array(values, dtype=object), "quarter": lambda m: mp.ellipk(m),
    "jacobi": lambda u, m: tuple(mp.ellipfun(name, u, m=m) for name in ("sn", "cn", "dn")),
    "near": lambda late, *parts: sum(np.array(part, dtype=object) * late**k / (1, 1, 2)[k] for k, part in enumerate(parts))}


def formula(text, names):
    return eval(compile(ast.fix_missing_locations(Exact().visit(ast.parse(str(text), mode="eval"))), "formula", "eval"), names)


class Start:
    """What a formula can use of a run: the start, the asked times and the parameters."""

    def __init__(self, scene, run, number):
        seen, start = judge.Seen(scene, []), scene["start"]
        self.names = {key: [number(value) for value in seen.names[key]] for key in ("T", "V", "P", "L")} | {
            "t": [number(time) for time in [0.0, *run["times"]]], "m": [number(body["mass"]) for body in scene["bodies"]],
            "q": [number(np.array(start["q"]))], "qd": [number(np.array(start["qd"]))],
            "e": number(scene["contact"]["restitution"]), "mu": number(scene["contact"]["friction"])}
        gravity = number(np.array(scene["gravity"], float))
        self.names["g"] = sum(x * x for x in gravity) ** 0.5
        self.names |= {name: number(value) for name, value in run.get("with", {}).items()}

    def __getattr__(self, name):
        return self.names[name]


def plain(value):
    if isinstance(value, (list, tuple, np.ndarray)):
        return [plain(it) for it in value]
    return float(value)


def solved(expected, names, rough):
    """An expectation as numbers. `rough`: the same names for double precision, in which the judge evaluates the formula."""
    names, rough, let = dict(NAMES, **names), dict(judge.MATHS, **rough), {}
    for name, text in expected.get("let", {}).items():
        names[name], rough[name] = formula(text, names), eval(str(text), rough)
        let[name] = plain(names[name])
    kind = next(key for key in ("value", "at_most", "at_least") if key in expected)
    value, double = formula(expected[kind], names), eval(str(expected[kind]), rough)
    found = {"name": expected["name"], "measure": expected["measure"], kind: plain(value)}
    if kind == "value":
        flat, other = (np.ravel(np.array(plain(it))) for it in (value, double))
        rounding = ROUNDING * max(1.0, np.max(np.abs(flat))) + float(np.max(np.abs(flat - other)))
        found["bound"] = float(f"{expected.get('bound', 0.0) + rounding:.1e}")
    return found | ({"let": let} if let else {})


def solution(case):
    number = lambda value: np.array(value, float) if isinstance(value, (list, np.ndarray)) else float(value)
    starts, runs = {}, {}
    for run in case["runs"]:
        scene = judge.scene_of(case, run)
        both = starts[run["run"]] = [Start(scene, run, kind) for kind in (exact, number)]
        expected = case.get("expect", []) + run.get("expect", [])
        runs[run["run"]] = {"times": run["times"], "expect": [solved(it, *(start.names for start in both)) for it in expected]}
    across = [solved(it, *({"of": lambda name, k=k: starts[name][k]} for k in (0, 1))) for it in case.get("across", [])]
    if across:
        runs["all"] = {"expect": across}
    return {"case": case["case"], "law": case["law"], "source": case["source"], "runs": runs}


def written(case):
    """The text of a solution: an expectation on each line."""
    found = solution(case)
    head = {key: found[key] for key in ("case", "law", "source")}
    text = lambda value: json.dumps(value, ensure_ascii=False)
    times = lambda run: f'"times": {text(run["times"])}, ' if "times" in run else ""
    runs = [f'  {text(name)}: {{{times(run)}"expect": [\n    ' + ",\n    ".join(map(text, run["expect"])) + "]}" for name, run in found["runs"].items()]
    return text(head)[:-1] + ', "runs": {\n' + ",\n".join(runs) + "}}\n"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("case", nargs="*", help="cases [default: all]")
    parser.add_argument("--out", default=FOLDER, help="folder of the solutions")
    args = parser.parse_args()
    os.makedirs(args.out, exist_ok=True)
    with mp.workdps(DIGITS):
        for case in judge.cases(args.case):
            with open(os.path.join(args.out, f"{case['case']}.json"), "w") as file:
                file.write(written(case))


if __name__ == "__main__":
    main()
