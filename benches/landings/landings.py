"""Compares carom's impact laws on the landings of Cassie: landings.py FOLDER [--folds K] [--seed S] [--trials N] [--out FILE.json]

FOLDER holds `cassie_v2.urdf` and tables `landings*.csv`. Each landing is simulated by `carom simulate` from two samples before it to
the end of the window, with springs, rotors, rods, both toes and the measured motor torques (cassie.py). Error: root mean square of
the errors of the predicted jumps of the leg's seven measured joint velocities, rad/s, for windows of 5 and 7 ms.

For each law e, friction and an inertia of the toe's drive are fitted to the mean error at 7 ms, with the search of `carom compare` and
its protocol: folds of whole logs, so that both legs of a jump are in one fold; every landing is predicted by coefficients that were
fitted without its fold.
"""

import argparse
import concurrent.futures
import json
import math
import os
import random
import sys

import numpy as np

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path[:0] = [HERE, os.path.join(HERE, "..", "peers", "tosses")]
from cassie import SIDES, Landing, Model, joints_in_order, landing, read
from measure import estimate, without_refused
from tune import search, value

LAWS = ("frictionless", "whittaker", "newton", "poisson", "energetic", "chatterjee-ruina", "brach", "smith")
WINDOWS = (10, 14)  # samples: 5 and 7 ms
E = ("e", 0.0, 1.0, [0.0, 0.3])
FRICTION = ("friction", 0.0, 1.0, [0.3, 0.6, 0.9])
TOE = ("toe_inertia (log)", -3.0, 0.0, [-2.0, -1.0])
WITHOUT = {"without the inertia of the toe's drive": {"toe_inertia": 0.0}, "without rotors and the inertia of the toe's drive": {"rotors": False},
           "without rods": {"rods": False}, "without spring forces": {"springs": 0.0}, "without motor torques": {"torques": 0.0}}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder")
    parser.add_argument("--folds", type=int, default=5)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--trials", type=int, default=40)
    parser.add_argument("--laws", nargs="*", default=LAWS)
    parser.add_argument("--out", help="JSON file with the error of every landing")
    args = parser.parse_args()
    model, logs = Model(os.path.join(args.folder, "cassie_v2.urdf")), read(args.folder)
    order = joints_in_order(model)
    found = [(name, side, landing(log, side)) for name, log in logs.items() for side in SIDES]
    landings = [Landing(model, logs[name], name, side, k) for name, side, k in found
                if k is not None and k >= 3 and k + max(WINDOWS) + 2 <= len(logs[name])]
    names = sorted({one.name for one in landings})
    random.Random(args.seed).shuffle(names)
    fold_of = np.array([names.index(one.name) % args.folds for one in landings])
    pool = concurrent.futures.ThreadPoolExecutor(os.cpu_count())

    def errors(values_of):
        """Errors of all landings: one row for each, one column for each window; and the errors of each joint at the last."""
        both = list(pool.map(lambda k: landings[k].errors(values_of(k), WINDOWS, order), range(len(landings))))
        return np.array([one[0] for one in both]), [one[1] for one in both]

    rows = []
    for law in args.laws:
        parameters = [E, TOE] if law == "frictionless" else [E, FRICTION, TOE]
        named = lambda x: {"law": law, "e": 0.0, "friction": 0.0, **{p[0].removesuffix(" (log)"): float(value(p, v)) for p, v in zip(parameters, x)}}
        chosen, trials = search(parameters, lambda x: errors(lambda k: named(x))[0][:, -1], args.folds, fold_of, args.trials)
        judged, joints = errors(lambda k: named(chosen[fold_of[k]]))
        rows.append({"law": law, "trials": trials, "coefficients": [named(x) for x in chosen], "errors": judged.T.tolist()})
        print(f"{law}: {np.mean(judged, axis=0)}", file=sys.stderr, flush=True)
    rows.sort(key=lambda row: np.mean(row["errors"][-1]))
    best = rows[0]
    of_best = lambda k: best["coefficients"][fold_of[k]]
    for what, changed in WITHOUT.items():
        judged, _ = errors(lambda k: {**of_best(k), **changed})
        rows.append({"law": f"{best['law']}, {what}", "coefficients": None, "errors": judged.T.tolist()})
    still = [[float(np.sqrt(np.mean(one.jump(window) ** 2))) for one in landings] for window in WINDOWS]
    rows.append({"law": "no jump", "coefficients": None, "errors": still})
    _, joints = errors(of_best)

    print(f"{len(landings)} landings in {len(names)} logs, {args.folds} folds, seed {args.seed}, at most {args.trials} trials for each law\n")
    print("| law | coefficients | error at 7 ms, rad/s | error at 5 ms | difference to the best at 7 ms | refused |\n" + "| --- " * 6 + "|")
    spread = lambda values: "{:.2f} ± {:.2f}".format(*estimate(values))
    reference = np.array(best["errors"][-1])
    for row in rows:
        (early, _), (late, refused) = (without_refused(one) for one in row["errors"])
        told = ""
        if row["coefficients"]:
            several = [(sign, [one[key] for one in row["coefficients"]]) for key, sign in (("e", "e"), ("friction", "μ"), ("toe_inertia", "toe"))]
            told = ", ".join(f"{sign} {min(v):.3g}" + (f" … {max(v):.3g}" if max(v) > min(v) else "") for sign, v in several)
        print(f"| {row['law']} | {told} | {spread(late)} | {spread(early)} | {'–' if row is best else spread(late - reference)} | {refused} |")
    whole = np.array([one for one in joints if one is not None])
    print("\nroot mean square and mean of the errors of each joint at 7 ms (best law), rad/s: " + ", ".join(
        f"{joint} {math.sqrt(np.mean(column**2)):.2f} ({np.mean(column):+.2f})" for joint, column in zip(
            ("hip roll", "hip yaw", "hip pitch", "knee", "knee spring", "ankle", "toe"), whole.T)))
    if args.out:
        with open(args.out, "w") as file:
            json.dump({"seed": args.seed, "folds": args.folds, "landings": [[one.name, one.side, one.k] for one in landings],
                       "fold_of": fold_of.tolist(), "rows": rows}, file)


if __name__ == "__main__":
    main()
