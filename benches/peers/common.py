"""Shared by the programs of the peers: reading of scenes, timing, and writing of results.

Each program passes `measure` a function `build` that builds a scene with one value of the varied parameter. The object that
`build` returns has

    reset()            return to the start (not timed)
    step(count)        advance by `count` steps without reading states (timed)
    dt                 length of one step, s
    state()            current {"q", "qd", "tip_velocity", "kinetic_energy", "potential_energy"} in carom's conventions;
                       for a free body also "velocity", of its centre in world axes
    force()            contact force over the last step in any unit; zero without contact

Only the standard library is used here, since Siconos runs under the Python of the system.
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
    parser.add_argument("scenes", help="scenes.json, as written by prepare.py")
    parser.add_argument("--out", default="/dev/stdout", help="file to which lines are appended (some libraries print to stdout)")
    parser.add_argument("--only", nargs="*", help="names of scenes")
    parser.add_argument("--repeats", type=int, default=3, help="number of timed runs; their median is the result")
    parser.add_argument("--budget", type=float, default=20.0, help="longest time for one line, s; values of the parameter that take longer are left out")
    parsed = parser.parse_args()
    global OUT
    OUT = parsed.out
    return parsed


OUT = "/dev/stdout"


def emit(line):
    with open(OUT, "a") as file:
        file.write(json.dumps(line) + "\n")


# Parts of a timed run; its time is checked after each.
PARTS = 50

# Step lengths of all time-stepping methods, s; the duration of every scene is a multiple of the largest.
STEPS = (5e-3, 1e-3, 2.5e-4, 1e-4, 2.5e-5, 1e-5)


def first_impact(run, duration):
    """The state at the end of the last step of the first contact, the apexes of a free ball, and the last state."""
    run.reset()
    steps, touching, after, apexes = round(duration / run.dt), None, None, []
    if run.lasting:
        run.step(steps)
        return None, [], run.state()
    before = run.state()
    for k in range(steps):
        if after and not run.floating:
            run.step(steps - k)  # only the last state is still needed
            break
        run.step(1)
        if not after and run.force() > 0.0:
            touching = dict(run.state(), time=(k + 1) * run.dt)
        elif touching and not after:
            # Peers that locate the impact keep the state right after it.
            after = getattr(run, "impact", None) or touching
        if run.floating:
            now = run.state()
            if before["velocity"][2] > 0.0 >= now["velocity"][2]:
                # Between two steps of a flight the velocity is linear in time; the apex is its zero.
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
    """Writes one line: times the run, then repeats it reading states. A failure is written as a line with the reason."""
    try:
        run = build(value)
        run.floating = scene["floating"] and "chain" not in scene
        # A contact that is closed at the start is no impact, and one without restitution does not end.
        run.lasting = bool(scene["surfaces"]) and (scene["gap"] == 0.0 or scene["restitution"] == 0.0)
        steps = round(scene["duration"] / run.dt)
        # A short run estimates whether the whole fits the budget; reading states adds about 50 us for each step in Python.
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
            # In parts, since a contact may take longer than the flight before it.
            for part in range(PARTS):
                run.step(steps * (part + 1) // PARTS - steps * part // PARTS)
                if time.perf_counter() - begin > args.budget / (args.repeats + 1):
                    print(f"{peer}: {scene['name']}, {method}: {knob} {value} ended, over the budget", file=sys.stderr)
                    return
            times.append(time.perf_counter() - begin)
        after, apexes, last = first_impact(run, scene["duration"])
        result = {"final": dict(numbers(last), time=steps * run.dt)}
        result["after_impact"] = numbers(after) if after else None
        if apexes:
            result["apexes"] = apexes
        settings = dict(settings, **getattr(run, "settings", {}))
        write(peer, version, scene, method, law, settings, knob, value, statistics.median(times), result)
    except Exception as why:  # an exception of a peer is written as its result
        print(f"{peer}: {scene['name']}, {method}, {knob} {value}: {type(why).__name__}: {why}", file=sys.stderr)
        line = {"scene": scene["name"], "method": method, "peer": peer, "version": version, "law": law,
                "settings": settings, "knob": knob, "value": value, "wall_time_s": None, "result": None,
                "failure": f"{type(why).__name__}: {str(why).splitlines()[0] if str(why) else ''}", "machine": machine()}
        emit(line)


def spring_damping(restitution):
    """Damping ratio at which a linear spring and damper that cannot pull returns `restitution`.

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
    """`vector` rotated by a unit quaternion, or by its inverse if `back`."""
    x, y, z, w = xyzw
    x, y, z = (-x, -y, -z) if back else (x, y, z)
    a, b, c = vector
    # v + 2 w (r x v) + 2 r x (r x v)
    p, q, r = y * c - z * b, z * a - x * c, x * b - y * a
    return [a + 2 * (w * p + y * r - z * q), b + 2 * (w * q + z * p - x * r), c + 2 * (w * r + x * q - y * p)]


def based(position, xyzw, velocity, spin, angles, rates):
    """The state of a robot on a free base in carom's conventions, from the base's position, quaternion, velocity and angular
    velocity in the world, and the joints."""
    position, xyzw, velocity, spin, angles, rates = (list(map(float, it)) for it in (position, xyzw, velocity, spin, angles, rates))
    return {"q": position + xyzw + angles, "qd": turned(xyzw, velocity, back=True) + turned(xyzw, spin, back=True) + rates}


def free_body(scene, position, xyzw, velocity, spin):
    """The state of a free body in carom's conventions, from position, quaternion, velocity and angular velocity in the world."""
    mass, inertia = scene["body"]["mass"], scene["body"]["inertia"]
    dot = lambda a, b: sum(x * y for x, y in zip(a, b))
    position, xyzw, velocity, spin = ([float(x) for x in it] for it in (position, xyzw, velocity, spin))
    own = turned(xyzw, spin, back=True)
    return {
        "q": position + xyzw,
        "qd": turned(xyzw, velocity, back=True) + own,
        "velocity": velocity,
        "tip_velocity": velocity,
        "kinetic_energy": 0.5 * (mass * dot(velocity, velocity) + sum(i * w * w for i, w in zip(inertia, own))),
        "potential_energy": -mass * dot(scene["gravity"], position),
    }


# No finite dissipation returns 0.
LEAST_RESTITUTION = 0.01


def hunt_crossley(restitution, speed):
    """Dissipation a, s/m, with which k x^n (1 + a x') returns exactly `restitution` at the approach `speed`, m/s.

    a v is the root of ln((1 + y) / (1 - e y)) = y (1 + e): v dv / (1 + a v) integrated from v to -e v is zero.
    """
    e = max(restitution, LEAST_RESTITUTION)
    if e >= 1.0:
        return 0.0
    low, high = 1e-9, (1.0 - 1e-13) / e
    for _ in range(300):
        y = 0.5 * (low + high)
        short = math.log1p(y) - math.log1p(-e * y) - y * (1.0 + e) < 0.0
        low, high = (y, high) if short else (low, y)
    return 0.5 * (low + high) / speed
