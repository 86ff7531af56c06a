"""carom: `carom simulate`, event-driven. The path of the program is in the environment variable CAROM."""

import csv
import math
import os
import subprocess
import tempfile

from adapter import Refused, floats, parts, serve, trees, urdf  # first: it makes `common` importable
import common

CAROM = os.environ.get("CAROM", "target/release/carom")
VERSION = subprocess.run([CAROM, "--version"], capture_output=True, text=True).stdout.split()[-1]
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


def toml(request, interval):
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
    lines += ["[run]", f"duration = {request['times'][-1]!r}", f"tolerance = {TOLERANCE[request['settings']]!r}",
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
            file.write(toml(request, interval))
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


serve(ABOUT, answer)
