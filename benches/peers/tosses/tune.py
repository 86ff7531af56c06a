"""Tunes the contact parameters of an engine on the tosses of `carom compare --export`, and judges all tosses.

    tune.py MODULE CASES.json OUT.jsonl [--only SET...] [--trials N] [--given-too] [--steps FACTOR]

The search is a grid, then steps along each parameter from the best point of each fold, halved where none
is better; the folds share their trials. Parameters are fitted to the tosses that carom's are fitted to, from the fitted starts.
An engine module has `METHODS`, a list of classes with

    peer, version, method, settings      strings and a dictionary for the table
    parameters                           list of (name, low, high, grid); a name that ends in "(log)" is sought by its logarithm
    __init__(urdf, gravity, spacing, refine)   `spacing`: time between samples, s; `refine`: factor on the number of steps in it
    tune(values)                         sets the parameters
    roll(q, qd, count)                   configurations at `count` samples, the first of which is the start; in carom's conventions
"""

import argparse
import importlib
import json
import math
import multiprocessing
import os
import sys
import time

import numpy as np

sys.path[:0] = [os.path.dirname(os.path.abspath(__file__)), os.path.dirname(os.path.dirname(os.path.abspath(__file__)))]
import common
from measure import PARTS, pose_error

FIRST_STEP, FINEST = 0.08, 0.01  # of `carom compare`, as shares of the range
TASK = None


def start(method, data, refine):
    """A process' own engine for one set."""
    global TASK
    TASK = (method(data["urdf"], data["gravity"], spacing(data), refine), data)


def spacing(data):
    """The time between samples, s: the same in all tosses up to the digits of the table."""
    all_of_them = [case["times"][-1] / (len(case["times"]) - 1) for case in data["cases"]]
    middle = float(np.median(all_of_them))
    if max(abs(one / middle - 1.0) for one in all_of_them) > 1e-3:
        raise ValueError(f"{data['set']}: the tosses are sampled at different rates")
    return middle


def rolled(values, k, key, early):
    """The errors of one toss to its early end and, unless `early`, as a whole."""
    engine, data = TASK
    case = data["cases"][k]
    count = case["early"] + 1 if early else len(case["times"])
    try:
        engine.tune(values)
        poses = np.array(engine.roll(case[key]["q"], case[key]["qd"], count), float)
    except Exception as why:  # a refusal is a result
        print(f"toss {case['number']}: {type(why).__name__}: {why}", file=sys.stderr)
        return math.inf, math.inf
    error = lambda n: pose_error(poses[:n], case["poses"][:n], data["length"])
    return error(case["early"] + 1), error(count)


def call(task):
    return rolled(*task)


def value(parameter, x):
    return 10.0**x if parameter[0].endswith("(log)") else x


def search(parameters, errors_of, folds, fold_of, budget):
    """The parameters fitted for each fold without it, and the number of trials. `errors_of(x)`: errors of the fitted tosses."""
    trials = []

    def add(x):
        if len(trials) < budget and all(x != other for other, _ in trials):
            trials.append((x, np.array(errors_of(x))))

    def best(fold):
        return min(trials, key=lambda trial: trial[1][fold_of != fold].sum())[0]

    points = [()]
    for _, _, _, grid in parameters:
        points = [(*point, at) for point in points for at in grid]
    for point in points:
        add(point)
    at, step = [best(fold) for fold in range(folds)], [FIRST_STEP] * folds
    while len(trials) < budget and any(one >= FINEST for one in step):
        for fold in range(folds):
            if step[fold] < FINEST:
                continue
            for k, (_, low, high, _) in enumerate(parameters):
                for sign in (1.0, -1.0):
                    point = list(at[fold])
                    point[k] = min(max(point[k] + sign * step[fold] * (high - low), low), high)
                    add(tuple(point))
            found = best(fold)
            if found == at[fold]:
                step[fold] *= 0.5
            at[fold] = found
    return [best(fold) for fold in range(folds)], len(trials)


def judge(method, data, budget, refine, workers):
    begin = time.perf_counter()
    cases = data["cases"]
    fitted = [k for k, case in enumerate(cases) if case["fitted"]]
    fold_of = np.array([cases[k]["fold"] for k in fitted])
    early = data["horizon"] == "early"
    with multiprocessing.get_context("spawn").Pool(workers, start, (method, data, refine)) as pool:
        real = lambda x: [value(parameter, one) for parameter, one in zip(method.parameters, x)]

        def errors_of(x):
            found = pool.map(call, [(real(x), k, "fitted_start", early) for k in fitted], chunksize=4)
            return [one[0] if early else one[1] for one in found]

        chosen, trials = search(method.parameters, errors_of, data["folds"], fold_of, budget)
        parts = {}
        for key in ("fitted_start", "given_start"):
            tasks = [(real(chosen[case["fold"]]), k, key, False) for k, case in enumerate(cases)]
            found = pool.map(call, tasks, chunksize=4)
            for name, own, is_early in PARTS:
                if own == key:
                    parts[name] = [one[0] if is_early else one[1] for one in found]
    return {
        "set": data["set"], "peer": method.peer, "version": method.version, "method": method.method, "settings": method.settings,
        "seed": data["seed"], "folds": data["folds"], "fitted": len(fitted), "trials": trials, "budget": budget, "refine": refine,
        "parameters": {parameter[0].removesuffix(" (log)"): [value(parameter, x[k]) for x in chosen]
                       for k, parameter in enumerate(method.parameters)},
        "numbers": [case["number"] for case in cases], "errors": parts,
        "seconds": round(time.perf_counter() - begin, 1), "machine": common.machine(),
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("module", help="with_mujoco, with_bullet or with_drake, of this folder")
    parser.add_argument("cases")
    parser.add_argument("out")
    parser.add_argument("--only", nargs="*", help="names of sets")
    parser.add_argument("--methods", nargs="*", help="names of methods")
    parser.add_argument("--trials", type=int, help="budget [default: that of carom]")
    parser.add_argument("--refine", type=int, default=1, help="factor on the number of steps between samples")
    parser.add_argument("--workers", type=int, default=os.cpu_count())
    args = parser.parse_args()
    module = importlib.import_module(args.module)
    with open(args.cases) as file:
        sets = json.load(file)
    for data in sets:
        for method in module.METHODS:
            if (args.only and data["set"] not in args.only) or (args.methods and method.method not in args.methods):
                continue
            line = judge(method, data, args.trials or data["trials"], args.refine, args.workers)
            means = [f"{np.mean(errors):.5g}" for errors in line["errors"].values()]
            print(f"{data['set']}: {method.peer}, {method.method}: {line['trials']} trials, {line['seconds']} s, means {' '.join(means)}",
                  flush=True)
            with open(args.out, "a") as file:
                file.write(json.dumps(line) + "\n")


if __name__ == "__main__":
    main()
