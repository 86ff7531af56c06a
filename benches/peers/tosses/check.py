"""Two routes to the error of a roll-out: `carom tosses`, and `carom simulate` from an exported start with the measure of this folder.

    check.py CASES.json [COUNT]

The two must agree up to rounding while impacts are located (the early part of most tosses), and to 1 % where time steps are computed,
which do not begin at the same instants.
"""

import csv
import json
import os
import shutil
import statistics
import subprocess
import sys
import tempfile

from measure import pose_error

CAROM = os.environ.get("CAROM", "target/release/carom")
LAW, E, MU, TOLERANCE, STEP = "energetic", 0.27, 0.21, 1e-5, 1e-3
EXACT, CLOSE = 1e-12, 1e-2  # relative: the median of the early parts, all


def numbers(values):
    return "[" + ", ".join(repr(float(v)) for v in values) + "]"


def simulated(data, case, key, folder):
    count = len(case["times"])
    interval = case["times"][-1] / (count - 1)
    lines = ["[robot]", f'urdf = "{os.path.abspath(data["urdf"])}"', "floating = true", f"q = {numbers(case[key]['q'])}",
             f"qd = {numbers(case[key]['qd'])}", "[[surface]]",
             "shape = { halfspace = { point = [0.0, 0.0, 0.0], normal = [0.0, 0.0, 1.0] } }", "[contact]", f'law = "{LAW}"',
             f"restitution = {E}", f"friction = {MU}", "[run]", f"duration = {case['times'][-1]!r}", f"tolerance = {TOLERANCE!r}",
             f"contact_step = {STEP!r}", f"gravity = {numbers(data['gravity'])}", f"sample = {interval!r}"]
    scene, motion = os.path.join(folder, "scene.toml"), os.path.join(folder, "motion.csv")
    with open(scene, "w") as file:
        file.write("\n".join(lines) + "\n")
    subprocess.run([CAROM, "simulate", scene, "--csv", motion], capture_output=True, text=True, check=True)
    with open(motion) as file:
        rows = list(csv.DictReader(file))
    names = [name for name in rows[0] if name.startswith("q.")]
    return [[float(row[name]) for name in names] for row in rows][:count]


def measured(data, start, cases, folder):
    """What `carom tosses` tells of some tosses, by their numbers."""
    whole, robot = os.path.split(data["urdf"])
    numbers = {str(case["number"]) for case in cases}
    with open(os.path.join(whole, "tosses.csv")) as table, open(os.path.join(folder, "tosses.csv"), "w") as some:
        some.writelines(line for k, line in enumerate(table) if k == 0 or line.split(",")[0] in numbers)
    shutil.copy(data["urdf"], folder)
    command = [CAROM, "tosses", folder, "--robot", robot, "--law", LAW, "--restitution", str(E), "--friction", str(MU), "--tolerance",
               str(TOLERANCE), "--contact-step", str(STEP), "--start", start, "--length", str(data["length"]), "--json"]
    told = json.loads(subprocess.run(command, capture_output=True, text=True, check=True).stdout)
    return {one["toss"]: one for one in told["each"]}


def main():
    with open(sys.argv[1]) as file:
        sets = json.load(file)
    count = int(sys.argv[2]) if len(sys.argv) > 2 else 8
    for data in sets:
        parts = {"early": [], "whole": []}
        for start, key in (("fitted", "fitted_start"), ("given", "given_start")):
            with tempfile.TemporaryDirectory() as folder:
                each = measured(data, start, data["cases"][:count], folder)
            for case in data["cases"][:count]:
                with tempfile.TemporaryDirectory() as folder:
                    poses = simulated(data, case, key, folder)
                for part, end in (("early", case["early"] + 1), ("whole", len(poses))):
                    ours = pose_error(poses[:end], case["poses"][:end], data["length"])
                    theirs = each[case["number"]][part]
                    apart = abs(ours / theirs - 1.0)
                    parts[part].append(apart)
                    if len(poses) != len(case["times"]) or apart > CLOSE:
                        sys.exit(f"{data['set']}, toss {case['number']}, {start}, {part}: {ours!r} here, {theirs!r} by carom tosses")
        exact = statistics.median(parts["early"])
        told = f"{data['set']}: relative differences from carom's measure, {2 * count} roll-outs: early {exact:.1e} (median)"
        print(f"{told}, {max(parts['early']):.1e} (largest), whole {max(parts['whole']):.1e} (largest)")
        if exact > EXACT:
            sys.exit(f"{data['set']}: the median of the early parts must be below {EXACT}")


if __name__ == "__main__":
    main()
