"""What the peers' programs share: the scenes as numbers, the clock, and the lines they write.

A program defines how to `build` a scene with one value of its knob, and the class `build` returns defines

    reset()            back to the start (not timed)
    step(count)        advances `count` steps, the timed call; without instruments
    dt                 length of one step, s
    state()            {"q", "qd", "tip_velocity", "kinetic_energy", "potential_energy"} now, in carom's conventions;
                       of a free body also "velocity", its centre's in the world
    force()            what pushes at the contact over the step just made: zero without contact (any unit)

and hands `measure` its instances. Only the standard library is used here: Siconos runs under the system's Python.
"""

import argparse
import json
import math
import os
import platform
import statistics
import sys
import time


def scenes(path):
    with open(path) as file:
        return json.load(file)


def machine():
    name = platform.processor() or platform.machine()
    try:
        with open("/proc/cpuinfo") as file:
            name = next((line.split(":", 1)[1].strip() for line in file if line.startswith("model name")), name)
    except OSError:
        pass
    return {"cpu": name, "cores": os.cpu_count(), "system": f"{platform.system()} {platform.release()}"}


def arguments(description):
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("scenes", help="scenes.json, as prepare.py writes it")
    parser.add_argument("--out", default="/dev/stdout", help="file that lines are appended to (engines print on stdout)")
    parser.add_argument("--only", nargs="*", help="names of scenes")
    parser.add_argument("--repeats", type=int, default=3, help="runs of which the median time is given")
    parser.add_argument("--budget", type=float, default=20.0, help="s that one line may take; dearer knobs are left out")
    parsed = parser.parse_args()
    global OUT
    OUT = parsed.out
    return parsed


OUT = "/dev/stdout"


def emit(line):
    with open(OUT, "a") as file:
        file.write(json.dumps(line) + "\n")


# Values of the knob that all steppers get, s; every scene's duration is a multiple of the largest.
STEPS = (5e-3, 1e-3, 2.5e-4, 1e-4, 2.5e-5, 1e-5)


def first_impact(run, duration):
    """The state at the end of the last step of the first contact, the run's apexes (of a free ball), and the last state."""
    run.reset()
    steps, touching, after, apexes = round(duration / run.dt), None, None, []
    before = run.state()
    for k in range(steps):
        if after and not run.floating:
            run.step(steps - k)  # nothing more to see but the end
            break
        run.step(1)
        if not after and run.force() > 0.0:
            touching = dict(run.state(), time=(k + 1) * run.dt)
        elif touching and not after:
            # Who finds the moment of impact himself has kept the state right after it.
            after = getattr(run, "impact", None) or touching
        if run.floating:
            now = run.state()
            if before["velocity"][2] > 0.0 >= now["velocity"][2]:
                # Between two steps of a flight the apex is where the velocity's line crosses zero.
                share = before["velocity"][2] / (before["velocity"][2] - now["velocity"][2])
                apexes.append([(k + share) * run.dt, before["q"][2] + 0.5 * before["velocity"][2] * share * run.dt])
            before = now
    return after, apexes, run.state()


def numbers(state):
    kept = ("time", "q", "qd", "tip_velocity", "kinetic_energy", "potential_energy")
    return {key: as_list(state[key]) for key in kept if key in state}


def as_list(value):
    if hasattr(value, "tolist"):
        value = value.tolist()
    return [float(x) for x in value] if isinstance(value, (list, tuple)) else float(value)


def finite(value):
    if isinstance(value, dict):
        return all(finite(v) for v in value.values())
    if isinstance(value, list):
        return all(finite(v) for v in value)
    return value is None or isinstance(value, str) or math.isfinite(value)


def write(peer, version, scene, method, law, settings, knob, value, wall_time, result):
    line = {
        "scene": scene["name"], "method": method, "peer": peer, "version": version, "law": law, "settings": settings,
        "knob": knob, "value": value, "wall_time_s": wall_time, "result": result, "machine": machine(),
    }
    if not finite(result):
        line["result"], line["failure"] = None, "the state is no longer finite"
    emit(line)


def measure(peer, version, scene, method, law, settings, value, build, args, knob="dt"):
    """One line: times the bare run, then repeats it watching. What fails is a line as well, with the reason."""
    try:
        run = build(value)
        run.floating = scene["floating"]
        steps = round(scene["duration"] / run.dt)
        # A first short stretch says whether the whole fits the budget; watching costs some 50 us a step on top, in Python.
        for _ in range(2):
            run.reset()
            begin = time.perf_counter()
            run.step(min(steps, 50))
        cost = (time.perf_counter() - begin) / min(steps, 50)
        if steps * (cost * (args.repeats + 1) + 5e-5) > args.budget:
            print(f"{peer}: {scene['name']}, {method}: {knob} {value} left out, over the budget", file=sys.stderr)
            return
        times = []
        for _ in range(args.repeats):
            run.reset()
            begin = time.perf_counter()
            run.step(steps)
            times.append(time.perf_counter() - begin)
        after, apexes, last = first_impact(run, scene["duration"])
        result = {"final": dict(numbers(last), time=steps * run.dt)}
        result["after_impact"] = numbers(after) if after else None
        if apexes:
            result["apexes"] = apexes
        settings = dict(settings, **getattr(run, "settings", {}))
        write(peer, version, scene, method, law, settings, knob, value, statistics.median(times), result)
    except Exception as why:  # a peer that throws is a result, not a reason to stop
        print(f"{peer}: {scene['name']}, {method}, {knob} {value}: {type(why).__name__}: {why}", file=sys.stderr)
        line = {"scene": scene["name"], "method": method, "peer": peer, "version": version, "law": law,
                "settings": settings, "knob": knob, "value": value, "wall_time_s": None, "result": None,
                "failure": f"{type(why).__name__}: {str(why).splitlines()[0] if str(why) else ''}", "machine": machine()}
        emit(line)


def spring_damping(restitution):
    """Damping ratio at which a linear spring and damper that may not pull gives back `restitution`.

    The contact ends where the force k x + c v comes to zero: tan(w t) = -2 z s / (1 - 2 z z) with s = sqrt(1 - z z).
    """
    def rebound(z):
        s = math.sqrt(1.0 - z * z)
        phase = math.atan2(2.0 * z * s, 2.0 * z * z - 1.0)
        return math.exp(-z * phase / s) * abs(math.cos(phase) - z / s * math.sin(phase))

    low, high = 0.0, 1.0 - 1e-12
    for _ in range(200):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if rebound(middle) > restitution else (low, middle)
    return 0.5 * (low + high)


def turned(xyzw, vector, back=False):
    """`vector` turned by a unit quaternion, or back by its inverse."""
    x, y, z, w = xyzw
    x, y, z = (-x, -y, -z) if back else (x, y, z)
    a, b, c = vector
    # v + 2 w (r x v) + 2 r x (r x v)
    p, q, r = y * c - z * b, z * a - x * c, x * b - y * a
    return [a + 2 * (w * p + y * r - z * q), b + 2 * (w * q + z * p - x * r), c + 2 * (w * r + x * q - y * p)]


def free_body(scene, position, xyzw, velocity, spin):
    """A free ball's state in carom's conventions, from the world's: position, quaternion, velocity, angular velocity."""
    mass, inertia = scene["body"]["mass"], scene["body"]["inertia"][0]
    dot = lambda a, b: sum(x * y for x, y in zip(a, b))
    position, xyzw, velocity, spin = ([float(x) for x in it] for it in (position, xyzw, velocity, spin))
    return {
        "q": position + xyzw,
        "qd": turned(xyzw, velocity, back=True) + turned(xyzw, spin, back=True),
        "velocity": velocity,
        "tip_velocity": velocity,
        "kinetic_energy": 0.5 * (mass * dot(velocity, velocity) + inertia * dot(spin, spin)),
        "potential_energy": -mass * dot(scene["gravity"], position),
    }


def hunt_crossley(restitution, speed):
    """Dissipation a, s/m, with which k x^n (1 + a x') gives back `restitution` of the approach `speed` exactly.

    a v is the root of ln((1 + y) / (1 - e y)) = y (1 + e): v dv / (1 + a v) integrated from v to -e v is zero.
    """
    e = restitution
    if e >= 1.0:
        return 0.0
    low, high = 1e-9, (1.0 - 1e-13) / e
    for _ in range(300):
        y = 0.5 * (low + high)
        short = math.log1p(y) - math.log1p(-e * y) - y * (1.0 + e) < 0.0
        low, high = (y, high) if short else (low, y)
    return 0.5 * (low + high) / speed
