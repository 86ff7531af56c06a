"""Accuracy asked, error obtained and processor time: CENIC, Drake's RK3 and carom. See README.md.

    accuracy.py OUT.json OUT.svg [--scene NAME...] [--draw]

Each program runs each scene with several accuracies (carom: tolerances). The error of a run is its largest error of a position (m) or
of a rotation (rad) of a body at the sampled times, against

- own: a reference solution of the same contact law, so that nothing but the integrator is measured,
- rigid: the outcome of rigid bodies at the end, where it is known.

References are integrations by scipy's DOP853 of equations that are written down here, or closed forms; where carom's contact has a memory
(the damping of a compliant contact depends on the speed at its first touch) its own run with the tightest tolerance.
Environment: CAROM, the program.
"""

import argparse
import csv
import json
import math
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time

import matplotlib

matplotlib.use("svg")
import matplotlib.pyplot as plt
import numpy as np
from pydrake.multibody.contact_solvers import IcfSolverParameters
from pydrake.systems.analysis import ResetIntegratorFromFlags, Simulator
from scipy.integrate import solve_ivp

import with_drake
from with_carom import CAROM, VERSION, start, toml
from adapter import parts, trees, urdf
import common
import judge
from mechanics import Moment, turn_of

GRAVITY = 9.81
UPRIGHT = (0, 0, 0, 1)
FLOOR = [{"point": [0, 0, 0], "normal": [0, 0, 1]}]
ACCURACIES = {"drake-cenic": [10.0**-k for k in range(2, 9)], "drake": [10.0**-k for k in range(2, 11)], "carom": [10.0**-k for k in (4, 6, 8, 10, 12)]}
TIGHTEST = 1e-13  # carom's tolerance for its own reference
SCHEMES = {"drake-cenic": "cenic", "drake": "runge_kutta3"}
NAMES = {"drake-cenic": "Drake, CENIC", "drake": "Drake, RK3", "carom": "carom"}
SLIP_SPEED = 1e-3  # below it friction is smoothed, m/s: the default of Drake and of carom
LONGEST = 0.1  # longest step, s: the default of Drake's simulator, of both integrators, and of carom
BUDGET = 120  # a run that takes longer is left out, with the tighter ones of its program, s
SHORT = 0.2  # processor time below which a run is repeated, s


def free(name, mass, inertia, spheres=()):
    return {"name": name, "parent": None, "joint": "free", "mass": mass, "inertia": inertia, "shapes": [{"sphere": r, "at": at} for r, at in spheres]}


def rod(name, parent, at):
    return {"name": name, "parent": parent, "joint": "hinge", "at": at, "axis": [0, 1, 0], "mass": 1, "centre": [0.5, 0, 0], "inertia": [1e-3, 1 / 12, 1 / 12]}


def placed(*bodies):
    """q of free bodies from positions and quaternions x y z w."""
    return [float(x) for position, quaternion in bodies for x in (*position, *quaternion)]


def scene(name, title, bodies, q, qd, times, planes=(), pairs=(), restitution=0.0, friction=0.0, speed=1.0, half_period=None, compliant=False, rigid=None):
    """`half_period` of a contact of 1 kg (s) gives the stiffness, `restitution` at `speed` the dissipation; `compliant`: carom's, too."""
    return {"name": name, "title": title, "times": times, "half_period": half_period, "compliant": compliant, "rigid": rigid, "scene": {
        "gravity": [0, 0, -GRAVITY], "bodies": bodies, "planes": list(planes), "pairs": list(pairs),
        "contact": {"restitution": restitution, "friction": friction}, "hint": {"speed": speed, "mass": 1.0}, "start": {"q": q, "qd": qd}}}


def sampled(end, count):
    return [round(end * (k + 1) / count, 9) for k in range(count)]


def slid(q, t):
    """The block on a rigid floor with Coulomb's friction 0.3, from 1 m/s."""
    left = min(t, 1 / (0.3 * GRAVITY))
    return [left - 0.3 * GRAVITY * left**2 / 2, *q[1:]]


def scenes():
    ball = lambda name: free(name, 1, [1e-3] * 3, [(0.05, [0, 0, 0])])
    feet = [(0.02, [x, y, -0.04]) for x in (-0.1, 0.1) for y in (-0.1, 0.1)]
    block = free("block", 1, [0.005, 0.005, 0.008], feet)
    column = [ball(f"ball{k + 1}") for k in range(5)]
    tilted = np.array([0.05, 0.08, 0.0, 1.0])
    tilted /= np.linalg.norm(tilted)
    return [
        scene("spin", "spinning body in free flight", [free("body", 1, [0.001, 0.002, 0.003])], placed(((0, 0, 0), UPRIGHT)),
              [1, 0, 3, 0.1, 8, 0.1], sampled(1.0, 10)),
        scene("pendulum", "double pendulum", [rod("upper", None, [0, 0, 0]), rod("lower", "upper", [1, 0, 0])], [0.0, 0.5], [0.0, 0.0], sampled(2.0, 20)),
        scene("bounce", "compliant ball, one bounce of 10 ms", [ball("ball")], placed(((0, 0, 0.15), UPRIGHT)), [0.0] * 6, sampled(0.28, 14), FLOOR,
              restitution=0.5, speed=math.sqrt(2 * GRAVITY * 0.1), half_period=1e-2, compliant=True),
        scene("drop", "ball that does not rebound, contact of 1 ms", [ball("ball")], placed(((0, 0, 0.15), UPRIGHT)), [0.0] * 6, sampled(0.5, 10), FLOOR,
              speed=math.sqrt(2 * GRAVITY * 0.1), half_period=1e-3,
              rigid=lambda q, t: [*q[:2], max(0.15 - GRAVITY * t * t / 2, 0.05), *q[3:]]),
        scene("slide", "block that slides to a stop", [block], placed(((0, 0, 0.06), UPRIGHT)), [1.0, 0, 0, 0, 0, 0], sampled(0.6, 12), FLOOR,
              friction=0.3, half_period=1e-3, rigid=slid),
        scene("foot", "block on four stiff feet falls tilted and comes to rest", [block], placed(((0, 0, 0.12), tilted)), [0.2, 0, 0, 0, 0, 0],
              sampled(1.0, 10), FLOOR, restitution=0.3, friction=0.5, half_period=3e-3, compliant=True),
        *(scene(name, title, column, placed(*(((0, 0, 0.051 + 0.101 * k), UPRIGHT) for k in range(5))), [0.0] * 30, sampled(end, 20), FLOOR,
                [[f"ball{k + 1}", f"ball{k + 2}"] for k in range(4)], restitution=0.3, speed=0.14, half_period=half_period, compliant=True,
                rigid=lambda q, t, end=end: placed(*(((0, 0, 0.05 + 0.1 * k), UPRIGHT) for k in range(5))) if t == end else None)
          for name, title, end, half_period in (("stack", "column of five balls falls 1 mm and comes to rest", 1.0, 1e-3),
                                                ("stack-rest", "the same column, contacts of 0.1 ms, 10 s", 10.0, 1e-4))),
    ]


def stiffness(case):
    return case["scene"]["hint"]["mass"] * (math.pi / case["half_period"]) ** 2



# --- reference solutions


def stribeck(slip, width):
    """Share of Coulomb's friction in Drake's continuous plant (its documentation, Stribeck friction with equal coefficients)."""
    x = np.minimum(slip / width, 1.0)
    return x**3 * (10 + x * (6 * x - 15))


def softened(slip, width):
    """The same in CENIC (Castro, Han & Masterjohn 2023), in the limit of short steps."""
    return slip / np.sqrt(slip**2 + width**2)


def bodies_rate(case, smoothed):
    """ẏ of free bodies with spheres that touch planes: y is position, quaternion x y z w, velocity, angular velocity in world axes, of one body after the other."""
    world = case["scene"]
    bodies, count = world["bodies"], len(world["bodies"])
    mass, inertia = np.array([body["mass"] for body in bodies]), np.array([body["inertia"] for body in bodies])
    owner = np.array([k for k, body in enumerate(bodies) for _ in body["shapes"]], int)
    radius = np.array([shape["sphere"] for body in bodies for shape in body["shapes"]])
    arms = np.array([shape["at"] for body in bodies for shape in body["shapes"]], float).reshape(-1, 3)
    contact, gravity = world["contact"], np.array(world["gravity"], float)
    k, width = stiffness(case) if case["half_period"] else 0.0, SLIP_SPEED
    damping = common.hunt_crossley(max(contact["restitution"], 0.01), world["hint"]["speed"])

    planes = [(np.array(plane["normal"], float), np.array(plane["point"], float)) for plane in world["planes"]]

    def cross(a, b):
        return np.array([a[..., 1] * b[..., 2] - a[..., 2] * b[..., 1], a[..., 2] * b[..., 0] - a[..., 0] * b[..., 2],
                         a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]]).T

    def pushed(depth, normal, u):
        """The forces of contacts with the penetrations `depth`, where the surfaces move with `u` relative to the other ones."""
        rise = (u * normal).sum(1)
        push = k * depth * np.maximum(0.0, 1 - damping * rise)
        force = push[:, None] * normal
        if contact["friction"]:
            slip = u - rise[:, None] * normal
            speed = np.sqrt((slip * slip).sum(1))
            force -= (contact["friction"] * push * smoothed(speed, width) / np.maximum(speed, 1e-300))[:, None] * slip
        return force

    def rate(t, y):
        y = y.reshape(count, 13)
        x, quaternion, v, w = y[:, :3], y[:, 3:7], y[:, 7:10], y[:, 10:]
        turns = np.array([turn_of(it) for it in quaternion / np.sqrt((quaternion**2).sum(1))[:, None]])
        force, torque = mass[:, None] * gravity, np.zeros((count, 3))
        centres = x[owner] + (turns[owner] @ arms[:, :, None])[:, :, 0]
        for normal, point in planes:
            depth = radius - (centres - point) @ normal
            near = np.flatnonzero(depth > 0)
            if len(near):
                own, depth = owner[near], depth[near]
                arm = centres[near] - (radius[near] - depth / 2)[:, None] * normal - x[own]
                f = pushed(depth, normal[None, :], v[own] + cross(w[own], arm))
                np.add.at(force, own, f)
                np.add.at(torque, own, cross(arm, f))
        out = np.empty((count, 13))
        out[:, :3], out[:, 7:10] = v, force / mass[:, None]
        out[:, 3:6] = 0.5 * (w * quaternion[:, 3:] + cross(w, quaternion[:, :3]))
        out[:, 6] = -0.5 * (w * quaternion[:, :3]).sum(1)
        own = (turns.transpose(0, 2, 1) @ w[:, :, None])[:, :, 0]
        moment = (turns.transpose(0, 2, 1) @ torque[:, :, None])[:, :, 0]
        out[:, 10:] = (turns @ ((moment - cross(own, inertia * own)) / inertia)[:, :, None])[:, :, 0]
        return out.ravel()

    return rate


def column_rate(case):
    """ẏ of equal balls of 1 kg one above the other on the floor: y is their heights and velocities."""
    world, k = case["scene"], stiffness(case)
    radius, damping = world["bodies"][0]["shapes"][0]["sphere"], common.hunt_crossley(world["contact"]["restitution"], world["hint"]["speed"])

    def rate(t, y):
        z, v = np.split(y, 2)
        depth = np.concatenate([[radius - z[0]], 2 * radius - np.diff(z)])
        push = k * np.maximum(depth, 0.0) * np.maximum(0.0, 1 - damping * np.diff(v, prepend=0.0))
        return np.concatenate([v, push - np.append(push[1:], 0.0) - GRAVITY])
    return rate


def pendulum_rate(case):
    """Two equal rods (m = 1 kg, centre at 0.5 m, I = 1/12 kg m²) on hinges about y, the angles down from the horizontal x axis."""
    def rate(t, y):
        a, b, da, db = y[0], y[0] + y[1], y[2], y[2] + y[3]  # absolute angles
        c, s = math.cos(b - a), math.sin(b - a)
        mass = np.array([[4 / 3, c / 2], [c / 2, 1 / 3]])
        right = np.array([db**2 * s / 2 + 1.5 * GRAVITY * math.cos(a), -da**2 * s / 2 + 0.5 * GRAVITY * math.cos(b)])
        dda, ddb = np.linalg.solve(mass, right)
        return np.array([y[2], y[3], dda, ddb - dda])
    return rate


def settled(case):
    """The column at rest: each contact carries the balls above it. From 0.5 s on, where the motion has died out by e⁻³⁰ and less."""
    count = len(case["scene"]["bodies"])
    sunk = np.cumsum([(count - k) * GRAVITY / stiffness(case) for k in range(count)])
    return [placed(*(((0, 0, 0.05 + 0.1 * k - sunk[k]), UPRIGHT) for k in range(count)))] * len(case["times"])


def equations(case, smoothed):
    """Right-hand side and start of the equations of motion, and the scene's q from their solution."""
    world = case["scene"]
    q, qd = (np.array(world["start"][key], float) for key in ("q", "qd"))
    if world["bodies"][0]["joint"] == "hinge":
        return pendulum_rate(case), np.concatenate([q, qd]), lambda y: y[:2]
    if world["pairs"]:
        return column_rate(case), np.concatenate([q[2::7], qd[2::6]]), lambda y: placed(*(((0, 0, z), UPRIGHT) for z in y[:len(y) // 2]))
    pieces = [np.concatenate([own, speed]) for _, own, speed in parts(world, q, qd)]
    return bodies_rate(case, smoothed), np.concatenate(pieces), lambda y: y.reshape(-1, 13)[:, :7].ravel()


def integrated(case, smoothed):
    """The reference q at the sampled times, and its own error: the change by a tolerance ten times looser."""
    found = []
    rate, y, positions = equations(case, smoothed)
    for tolerance in (1e-10, 1e-11):
        with np.errstate(over="ignore", invalid="ignore"):  # a step that is rejected may be far off
            run = solve_ivp(rate, (0, case["times"][-1]), y, method="DOP853", t_eval=case["times"], rtol=tolerance, atol=tolerance * 1e-2, max_step=LONGEST)
        found.append([positions(it) for it in run.y.T])
    return found[1], difference(case, *found)


# --- errors


def difference(case, motion, reference):
    """The largest difference of a position (m) or rotation (rad) of a body; times without a reference do not count."""
    world, largest = case["scene"], 0.0
    still = np.zeros(len(world["start"]["qd"]))
    for q, known in zip(motion, reference):
        if known is None:
            continue
        one, other = Moment(world, q, still), Moment(world, known, still)
        for name in one.frames:
            (x, a), (y, b) = one.frames[name], other.frames[name]
            largest = max(largest, np.linalg.norm(x - y), 2 * math.asin(min(1.0, np.linalg.norm(a - b) / math.sqrt(8))))
    return largest


# --- the programs


def drake(case, engine, accuracy):
    world = case["scene"]
    diagram, plant = with_drake.plant_of(world, 0.0, case["half_period"])
    plant.set_stiction_tolerance(SLIP_SPEED)
    simulator = Simulator(diagram)
    integrator = ResetIntegratorFromFlags(simulator, SCHEMES[engine], LONGEST)
    integrator.set_target_accuracy(accuracy)
    if engine == "drake-cenic":
        # Its solver stops at a thousandth of the accuracy, but by default not below 1e-8, which adds to the error.
        integrator.SetSolverParameters(IcfSolverParameters(min_tolerance=1e-15))
    context = plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    with_drake.put(world, plant, context)
    simulator.Initialize()
    begin, motion = time.process_time(), []
    for at in case["times"]:
        simulator.AdvanceTo(at)
        motion.append(with_drake.state(world, plant, context)["q"])
    return motion, time.process_time() - begin, {"steps": integrator.get_num_steps_taken()}


def carom(case, tolerance):
    world, times = case["scene"], case["times"]
    bodies = [body for tree in trees(world) for body in tree]
    with tempfile.TemporaryDirectory() as folder:
        at = lambda name: os.path.join(folder, name)
        with open(at("robot.urdf"), "w") as file:
            file.write(urdf(bodies, world="world"))

        text = toml({"scene": world, "times": times}, times[0], tolerance) + "perturb = { q = 1e-300 }\n"
        if case["compliant"]:
            text += f"[contact.compliance]\nstiffness = {stiffness(case)!r}\nexponent = 1\nslip_speed = {SLIP_SPEED!r}\n"
        with open(at("scene.toml"), "w") as file:
            file.write(text)

        def timed(*options):
            before = resource.getrusage(resource.RUSAGE_CHILDREN)
            run = subprocess.run([CAROM, "simulate", at("scene.toml"), *options], capture_output=True, text=True)
            after = resource.getrusage(resource.RUSAGE_CHILDREN)
            if run.returncode:
                raise RuntimeError(run.stderr.strip().splitlines()[-1].replace(folder + "/", ""))
            return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime

        seconds = timed("--out", at("motion.csv"))
        if seconds < SHORT:
            # Several runs in one process: its start, which does not count, may take longer than a run.
            more = min(50, math.ceil(SHORT / seconds))
            one, many = (timed("--runs", str(count), "--threads", "1") for count in (1, 1 + more))
            seconds = (many - one) / more
        with open(at("motion.csv")) as file:
            rows = list(csv.DictReader(file))
    motion = []
    for time_of in times:
        row, q = rows[round(time_of / times[0])], []
        for body, own, _ in parts(world, *start(world)):
            joint, is_free = f"{body['name']}_joint", body["joint"] == "free"
            # A joint that the plan leaves out has no column: it stays.
            q += [float(row.get(f"q.{joint}.{k}" if is_free else f"q.{joint}", value)) for k, value in enumerate(own)]
        motion.append(q)
    return motion, seconds, {}


def measured(case, engine, accuracy):
    """Motion, and the median processor time of five runs, or that of one if it is long."""
    if engine == "carom":
        return carom(case, accuracy)
    motion, seconds, more = drake(case, engine, accuracy)
    if seconds < SHORT:
        seconds = statistics.median([seconds] + [drake(case, engine, accuracy)[1] for _ in range(4)])
    return motion, seconds, more


def measure(case):
    """All runs of one scene, as rows, and the references' own errors."""
    known = [case["rigid"](case["scene"]["start"]["q"], at) for at in case["times"]] if case["rigid"] else None
    references, rows = {}, []
    for engine, smoothed in (("drake-cenic", softened), ("drake", stribeck)):
        if engine == "drake" and not case["scene"]["contact"]["friction"]:
            references[engine] = references["drake-cenic"]
        else:
            references[engine] = (settled(case), 0.0) if case["name"] == "stack-rest" else integrated(case, smoothed)
    if case["name"] in ("foot", "stack"):
        tightest = carom(case, TIGHTEST)[0]
        references["carom"] = tightest, difference(case, carom(case, 100 * TIGHTEST)[0], tightest)
    else:
        references["carom"] = (known, 0.0) if known else references["drake-cenic"]
    for engine, accuracies in ACCURACIES.items():
        for accuracy in accuracies:
            row = {"scene": case["name"], "engine": engine, "asked": accuracy}
            try:
                motion, seconds, more = measured(case, engine, accuracy)
            except RuntimeError as why:
                rows.append(row | {"failed": str(why).splitlines()[0]})
                continue
            rows.append(row | {"own": float(difference(case, motion, references[engine][0])), "rigid": float(difference(case, motion, known)) if known else None,
                               "seconds": seconds} | more)
            print(json.dumps(rows[-1]), file=sys.stderr, flush=True)
            if seconds > BUDGET:
                break
    return rows, {engine: float(error) for engine, (_, error) in references.items()}


# --- the picture


COLOURS = {"drake-cenic": "#d6604d", "drake": "#e5a50a", "carom": "#2166ac"}
MARKS = {"drake-cenic": "o", "drake": "s", "carom": "^"}


def picture(told, path):
    plt.rcParams.update({"svg.fonttype": "none", "svg.hashsalt": "accuracy", "font.family": "sans-serif", "font.size": 8})
    figure, axes = plt.subplots(2, (len(told["scenes"]) + 1) // 2, figsize=(13, 7.2), squeeze=False, layout="constrained")
    for axis, about in zip(axes.flat, told["scenes"]):
        for engine in ACCURACIES:
            rows = [row for row in told["runs"] if row["scene"] == about["scene"] and row["engine"] == engine and "own" in row]
            # The logarithm has no zero: an error of none is drawn at the last digit.
            # Times below 0.1 ms are not resolved, since the start of the program is subtracted.
            seconds, errors = [max(row["seconds"], 1e-4) for row in rows], [max(row["own"], 1e-16) for row in rows]
            axis.loglog(seconds, errors, marker=MARKS[engine], color=COLOURS[engine], linewidth=1.2, markersize=4, label=NAMES[engine])
            for row, x, y in zip(rows, seconds, errors):
                axis.annotate(f"{round(math.log10(row['asked']))}", (x, y), textcoords="offset points", xytext=(4, 3), fontsize=6.5, color=COLOURS[engine])
        axis.set_title(about["title"], fontsize=8.5)
        axis.grid(True, which="major", linewidth=0.3)
        axis.minorticks_off()
    for axis in axes.flat[len(told["scenes"]):]:
        axis.remove()
    for axis in axes[-1]:
        axis.set_xlabel("processor time, s")
    for axis in axes[:, 0]:
        axis.set_ylabel("error obtained, m or rad")
    handles, labels = axes.flat[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3, frameon=False, title="numbers at the points: exponent of the accuracy asked")
    figure.savefig(path, metadata={"Date": None, "Creator": None})


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scene", nargs="+", help="scenes to run [default: all]; what the file holds about the others stays")
    parser.add_argument("--draw", action="store_true", help="draw the picture of the file only")
    parser.add_argument("out")
    parser.add_argument("drawing")
    args = parser.parse_args()
    told = {"scenes": [], "runs": []}
    if os.path.exists(args.out):
        with open(args.out) as file:
            told = json.load(file)
    for case in [] if args.draw else scenes():
        if args.scene and case["name"] not in args.scene:
            continue
        rows, errors = measure(case)
        about = {"scene": case["name"], "title": case["title"], "duration": case["times"][-1], "reference errors": errors}
        told["scenes"] = [it for it in told["scenes"] if it["scene"] != case["name"]] + [about]
        told["runs"] = [row for row in told["runs"] if row["scene"] != case["name"]] + rows
    order = [case["name"] for case in scenes()]
    told = {"machine": common.machine(), "versions": {"drake": with_drake.ABOUT["version"], "carom": VERSION},
            "scenes": sorted(told["scenes"], key=lambda it: order.index(it["scene"])), "runs": sorted(told["runs"], key=lambda it: order.index(it["scene"]))}
    with open(args.out, "w") as file:
        file.write(judge.lines(told))
    picture(told, args.drawing)


if __name__ == "__main__":
    main()
