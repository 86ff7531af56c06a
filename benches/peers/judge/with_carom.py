"""carom: `carom simulate`, event-driven. The path of the program is in the environment variable CAROM. Derivatives are those of the
Python package `carom`."""

import csv
import math
import os
import subprocess
import tempfile

import numpy as np

from adapter import Refused, floats, parts, serve, trees, urdf  # first: it makes `common` importable
import common
import derivatives
from mechanics import turn_of

try:
    import carom
except ImportError:
    carom = None  # only the derivatives need it

CAROM = os.environ.get("CAROM", "target/release/carom")
VERSION = subprocess.run([CAROM, "--version"], capture_output=True, text=True).stdout.split()[-1] if os.path.exists(CAROM) else carom.__version__
TOLERANCE = {"default": 1e-9, "best": 1e-13}
ABOUT = {"engine": "carom", "version": VERSION, "law": "Stronge's energetic law; several contacts: Moreau's", "settings": {
    "default": {"method": "event-driven, tolerance 1e-9", "source": "book/src/reference-scene.md"},
    "best": {"method": "event-driven, tolerance 1e-13", "source": "book/src/reference-scene.md, `tolerance`"}}}


def numbers(values):
    return "[" + ", ".join(repr(float(v)) for v in values) + "]"


def start(scene):
    """q and q̇ with the linear and angular velocity of a free body in its own axes."""
    q, qd = scene["start"]["q"], []
    for body, own, rate in parts(scene, q, scene["start"]["qd"]):
        free = body["joint"] == "free"
        qd += common.turned(own[3:], rate[:3], back=True) + common.turned(own[3:], rate[3:], back=True) if free else list(rate)
    return q, qd


def toml(request, interval, tolerance):
    scene, (q, qd) = request["scene"], start(request["scene"])
    contact = scene["contact"]
    lines = ["[robot]", 'urdf = "robot.urdf"', f"q = {numbers(q)}", f"qd = {numbers(qd)}", f'tip = "{scene["bodies"][0]["name"]}"']
    for plane in scene["planes"]:
        lines += ["[[surface]]", f"shape = {{ halfspace = {{ point = {numbers(plane['point'])}, normal = {numbers(plane['normal'])} }} }}"]
    lines += ["[contact]", 'law = "energetic"', f"restitution = {contact['restitution']!r}", f"friction = {contact['friction']!r}"]
    if "limit_restitution" in contact:
        lines.append(f"limit_restitution = {contact['limit_restitution']!r}")
    if scene["pairs"]:
        lines.append("links = [" + ", ".join(f'["{a}", "{b}"]' for a, b in scene["pairs"]) + "]")
    lines += ["[run]", f"duration = {request['times'][-1]!r}", f"tolerance = {tolerance!r}",
              f"gravity = {numbers(scene['gravity'])}", f"sample = {interval!r}"]
    return "\n".join(lines) + "\n"


def answer(request):
    scene, times = request["scene"], request["times"]
    interval = math.gcd(*(round(time * 1e6) for time in times)) / 1e6
    whole = [body for tree in trees(scene) for body in tree]
    if [body["name"] for body in whole] != [body["name"] for body in scene["bodies"]]:
        raise ValueError("the bodies of a tree must follow one another")
    with tempfile.TemporaryDirectory() as folder:
        at = lambda name: os.path.join(folder, name)
        with open(at("robot.urdf"), "w") as file:
            file.write(urdf(whole, world="world"))
        with open(at("scene.toml"), "w") as file:
            file.write(toml(request, interval, TOLERANCE[request["settings"]]))
        run = subprocess.run([CAROM, "simulate", at("scene.toml"), "--csv", at("motion.csv")], capture_output=True, text=True)
        if run.returncode:
            raise Refused(run.stderr.strip().splitlines()[-1].replace(folder + "/", ""))
        with open(at("motion.csv")) as file:
            rows = list(csv.DictReader(file))
    states = []
    for time in times:
        row, q, qd = rows[round(time / interval)], [], []
        for body, own, rate in parts(scene, *start(scene)):
            joint, free = f"{body['name']}_joint", body["joint"] == "free"
            # A joint that the plan leaves out has no column: it stays.
            read = lambda kind, k, rest: float(row.get(f"{kind}.{joint}.{k}" if free else f"{kind}.{joint}", rest))
            own = [read("q", k, value) for k, value in enumerate(own)]
            rate = [read("qd", k, value) for k, value in enumerate(rate)]
            q += own
            qd += common.turned(own[3:], rate[:3]) + common.turned(own[3:], rate[3:]) if free else rate
        states.append({"t": float(row["time"]), "q": floats(q), "qd": floats(qd)})
    return {"states": states, "used": {"tolerance": TOLERANCE[request["settings"]]}}


def sliders(bodies):
    """URDF of free bodies that move in the plane z = 0 without turning, as slides along x and y: their motors are the forces."""
    text = ['<link name="world"/>']
    for body in bodies:
        name, [shape] = body["name"], body["shapes"]
        text.append(f'<link name="{name}_slide"/><link name="{name}"><inertial><mass value="{float(body["mass"])!r}"/>'
                    '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
                    f'<collision><geometry><sphere radius="{shape["sphere"]!r}"/></geometry></collision></link>')
        for axis, parent, child in (("1 0 0", "world", f"{name}_slide"), ("0 1 0", f"{name}_slide", name)):
            text.append(f'<joint name="{child}_joint" type="prismatic"><parent link="{parent}"/><child link="{child}"/><axis xyz="{axis}"/>'
                        '<limit lower="-1e3" upper="1e3" effort="1e9" velocity="1e9"/></joint>')
    return '<?xml version="1.0"?>\n<robot name="plane">\n' + "\n".join(text) + "\n</robot>\n"


def gradient(request):
    if carom is None:
        raise Refused("its Python package is not installed (benches/peers/judge/run --gradients builds it)")
    steered = "force" in request["scene"]
    with tempfile.TemporaryDirectory() as folder:
        def scene_at(point):
            scene = derivatives.put(request["scene"], request["by"], map(float, point))
            whole = dict(request, scene=scene)
            text, shape = toml(whole, request["times"][-1], TOLERANCE[request["settings"]]), urdf(scene["bodies"], world="world")
            if steered:
                # Constant in each piece: two rows of a table of the motors' forces, whose numbers are parameters.
                shape, pieces, length = sliders(scene["bodies"]), scene["force"]["pieces"], request["times"][-1] / len(scene["force"]["pieces"])
                name = scene["force"]["body"]
                q, qd = ([x for _, *both in parts(scene, scene["start"]["q"], scene["start"]["qd"]) for x in both[k][:2]] for k in (0, 1))
                lines = [f"q = {numbers(q)}" if line.startswith("q = ") else f"qd = {numbers(qd)}" if line.startswith("qd = ") else line
                         for line in text.splitlines()]
                text = "\n".join(lines) + '\ncontroller = "torque-file"\ntorque_file = "forces.csv"\n'
                with open(os.path.join(folder, "forces.csv"), "w") as file:
                    names = [body["name"] for body in scene["bodies"]]
                    file.write("time," + ",".join(f"{it}_slide_joint,{it}_joint" for it in names) + "\n")
                    for k, (x, y) in enumerate(pieces):
                        row = ",".join(f"{x!r},{y!r}" if it == name else "0,0" for it in names)
                        file.writelines(f"{time!r},{row}\n" for time in (k * length, (k + 1) * length))
            with open(os.path.join(folder, "robot.urdf"), "w") as file:
                file.write(shape)
            return scene, carom.Scene.from_toml(text, folder)

        def last(scene, q):
            """The final q in the order of the request."""
            if not steered:
                return q
            return np.concatenate([[*q[2 * k:2 * k + 2], *own[2:]] for k, (_, own, _) in enumerate(parts(scene, scene["start"]["q"], scene["start"]["qd"]))])

        at = {}

        def made(point):
            """The scene is read once: this is not part of the times."""
            key = tuple(point)
            if key not in at:
                at[key] = scene_at(point)
            return at[key]

        def value(point):
            scene, ready = made(point)
            return derivatives.value(request, last(scene, ready.simulate(sample=request["times"][-1]).last[1]), derivatives.forces(scene))

        keys = [path for path in request["by"] if path.startswith("contact.")]

        def slope(point):
            scene, ready = made(point)
            run = ready.linear_run(["torque"] if steered else ["q", "qd", *keys])
            q = run.last[1]
            by_q, by_u = derivatives.slopes(request, last(scene, q), derivatives.forces(scene))
            # Of a free body the changes of the package are along the axes of the body.
            weights, places, start_of = [], {}, 0
            for number, (body, own, _) in enumerate(parts(scene, scene["start"]["q"], scene["start"]["qd"])):
                if steered:
                    weights += [*by_q[7 * number:7 * number + 2]]
                    continue
                turn = turn_of(q[start_of + 3:start_of + 7])
                weights += [*(turn.T @ by_q[start_of:start_of + 3]), 0, 0, 0]
                for axis in range(3):
                    places["q", start_of + axis] = places["qd", 6 * number + axis] = (number, turn_of(own[3:])[axis])
                start_of += 7
            found = run.vjp([*weights, *[0.0] * len(weights)])
            if steered:
                names = dict(zip(run.names, found))
                name, pieces = scene["force"]["body"], len(scene["force"]["pieces"])
                rows = [[names[f"torque {joint} {2 * k + 1}"] + names[f"torque {joint} {2 * k + 2}"] for joint in (f"{name}_slide_joint", f"{name}_joint")]
                        for k in range(pieces)]
                return np.ravel(rows) + by_u
            count, result = 6 * len(scene["bodies"]), []
            for path in request["by"]:
                if path in keys:
                    result.append(found[2 * count + keys.index(path)])
                    continue
                _, kind, index = path.split(".")
                number, axes = places[kind, int(index)]
                begin = 6 * number + (count if kind == "qd" else 0)
                result.append(axes @ found[begin:begin + 3])
            return result

        return derivatives.reply(request, value, slope, "linear_run and vjp: variational equations and saltation through the events",
                                 tolerance=TOLERANCE[request["settings"]])


if __name__ == "__main__":
    serve(ABOUT, answer, gradient)
