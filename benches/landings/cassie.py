"""The landings of the biped Cassie: measured joint velocities, a model for `carom simulate`, and the prediction of a landing.

Data: DAIRLab `cassie_impact_dataset` (BSD-3), a table of joint positions, velocities and motor torques at 2 kHz, and `cassie_v2.urdf`.
The file lacks what the tree of a URDF cannot hold or what it does not say, and it is added here:

| part | model | source |
| --- | --- | --- |
| springs of knee and heel | joints with 1500 and 1250 N m/rad | MuJoCo Menagerie, `agility_cassie/cassie.xml` |
| rotors | reflected inertia of each motor | the same file, `armature` |
| rod from thigh to heel spring | a link with two hinges at the thigh and a `[[loop]]` of kind `point` at the heel spring | mass and inertia: the same file |
| toe | two balls of 0.1 mm at the ends of the line along which a toe touches | the URDF, where they have radius 0 |
| foot crank | inertia of 1e-6 kg m², which the file leaves out | |
| motors | the measured torques as a `torque_file`, and the damping of the URDF | the table |
"""

import collections
import csv
import json
import math
import os
import re
import subprocess
import tempfile
import xml.etree.ElementTree as xml

import numpy as np

CAROM = os.environ.get("CAROM", "target/release/carom")
DT = 5e-4  # between samples, s
SIDES = ("left", "right")
JOINTS = ("hip_roll", "hip_yaw", "hip_pitch", "knee", "knee_joint", "ankle_joint", "toe")  # of a leg, measured
MOTORS = ("hip_roll", "hip_yaw", "hip_pitch", "knee", "toe")
ROTORS = {"hip_roll": 0.038125, "hip_yaw": 0.038125, "hip_pitch": 0.09344, "knee": 0.09344, "toe": 0.01225}  # kg m²
SPRINGS = {"knee_joint": 1500.0, "ankle_spring_joint": 1250.0}  # N m/rad
THIGH = {"left": (0.0, 0.0, 0.045), "right": (0.0, 0.0, -0.045)}  # end of the rod
HEEL = (0.11877, -0.01, 0.0)  # its other end, on the heel spring
TOE = ((-0.0457, 0.112, 0.0), (0.088, 0.0, 0.0))  # ends of the line that touches
BALL = 1e-4  # m
FALL, WITHIN = 2.0, 5  # a landing: the knee spring's velocity falls by 2 rad/s within 5 samples


class Model:
    def __init__(self, path):
        with open(path) as file:
            text = file.read()
        text = re.sub(r"<visual>.*?</visual>", "", text, flags=re.S)
        root = xml.fromstring(text)
        for inertial in root.iter("inertial"):
            if inertial.find("inertia") is None:
                xml.SubElement(inertial, "inertia", **{k: "1e-6" if k[1] == k[2] else "0" for k in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")})
        for sphere in root.iter("sphere"):
            sphere.set("radius", str(BALL))
        for joint in root.iter("joint"):
            if joint.get("type") == "revolute":
                joint.set("type", "continuous")  # the limits are not reached within a landing
        for side in SIDES:
            self.link(root, f"rod_turn_{side}", 1e-3, (0, 0, 0), (1e-6, 1e-6, 1e-6))
            self.link(root, f"rod_{side}", 0.1567, (0.24719, 0, 0), (3.754e-6, 0.004487, 0.004488))
            self.hinge(root, f"rod_z_{side}", f"thigh_{side}", f"rod_turn_{side}", THIGH[side], "0 0 1")
            self.hinge(root, f"rod_y_{side}", f"rod_turn_{side}", f"rod_{side}", (0, 0, 0), "0 1 0")
        self.root, self.text = root, xml.tostring(root, encoding="unicode")
        numbers = lambda joint, key: [float(x) for x in (joint.find("origin").get(key) if joint.find("origin") is not None else "0 0 0").split()]
        self.tree = {}  # link: parent, joint, place, rotation, axis
        for joint in root.findall("joint"):
            if joint.find("origin") is not None:
                for key in ("xyz", "rpy"):
                    joint.find("origin").attrib.setdefault(key, "0 0 0")
            axis = joint.find("axis") if joint.get("type") == "continuous" else None
            self.tree[joint.find("child").get("link")] = (
                joint.find("parent").get("link"), joint.get("name"), np.array(numbers(joint, "xyz")), rpy(numbers(joint, "rpy")),
                None if axis is None else np.array([float(x) for x in axis.get("xyz").split()]))

    @staticmethod
    def link(root, name, mass, centre, inertia):
        inertial = xml.SubElement(xml.SubElement(root, "link", name=name), "inertial")
        xml.SubElement(inertial, "origin", xyz=" ".join(map(str, centre)))
        xml.SubElement(inertial, "mass", value=str(mass))
        xml.SubElement(inertial, "inertia", ixx=str(inertia[0]), iyy=str(inertia[1]), izz=str(inertia[2]), ixy="0", ixz="0", iyz="0")

    @staticmethod
    def hinge(root, name, parent, child, place, axis):
        joint = xml.SubElement(root, "joint", name=name, type="continuous")
        xml.SubElement(joint, "parent", link=parent)
        xml.SubElement(joint, "child", link=child)
        xml.SubElement(joint, "origin", xyz=" ".join(map(str, place)))
        xml.SubElement(joint, "axis", xyz=axis)

    def frame(self, link, base, angles):
        """Place and rotation of a link in the world. `base`: place, rotation; `angles`: by joint name, 0 where not named."""
        if link not in self.tree:
            return base
        parent, joint, place, turn, axis = self.tree[link]
        at, of = self.frame(parent, base, angles)
        turn = of @ turn
        return at + of @ place, turn if axis is None else turn @ exponential(axis * angles.get(joint, 0.0))

    def point(self, link, offset, base, angles):
        at, turn = self.frame(link, base, angles)
        return at + turn @ np.array(offset)


def rpy(angles):
    (a, b, c), (x, y, z) = angles, np.eye(3)
    return exponential(c * z) @ exponential(b * y) @ exponential(a * x)


def exponential(v):
    angle = np.linalg.norm(v)
    if angle == 0.0:
        return np.eye(3)
    x, y, z = v / angle
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + math.sin(angle) * k + (1 - math.cos(angle)) * k @ k


def rotation(w, x, y, z):
    return np.eye(3) + 2 * np.array([[-y * y - z * z, x * y - w * z, x * z + w * y], [x * y + w * z, -x * x - z * z, y * z - w * x],
                                     [x * z - w * y, y * z + w * x, -x * x - y * y]])


def read(folder):
    """The logs, each a list of rows; the name of the table does not matter."""
    tables = [name for name in sorted(os.listdir(folder)) if name.startswith("landings") and name.endswith(".csv")]
    logs = collections.defaultdict(list)
    for name in tables:
        with open(os.path.join(folder, name)) as file:
            for row in csv.DictReader(file):
                logs[row["log"]].append({key: float(value) for key, value in row.items()})
    return dict(logs)


def rates(log, side):
    return np.array([[row[f"{joint}_{side}dot"] for joint in JOINTS] for row in log])


def landing(log, side):
    """Index of the landing of a side; None without one."""
    spring = rates(log, side)[:, JOINTS.index("knee_joint")]
    mean = np.convolve(spring, np.ones(3) / 3, "valid")  # mean[k] is that of the samples k to k + 2
    found = [k for k in range(1, len(mean) - WITHIN) if mean[k - 1 + WITHIN] - mean[k - 1] <= -FALL]
    return found[0] if found else None


class Landing:
    """A landing of one leg: the state two samples before it, and the measured jumps."""

    def __init__(self, model, log, name, side, k):
        self.model, self.log, self.name, self.side, self.k = model, log, name, side, k
        row, before = log[k - 2], log[k - 3 : k]
        mean = lambda key: np.mean([it[key] for it in before])
        names = [joint for _, joint, _, _, axis in model.tree.values() if axis is not None and not joint.startswith("rod_")]
        self.angles = {joint: row[joint] for joint in names}
        self.speeds = {joint: mean(joint + "dot") for joint in names}
        self.quaternion = np.array([row[f"base_q{c}"] for c in "wxyz"])
        self.quaternion /= np.linalg.norm(self.quaternion)
        self.base = (np.array([row[f"base_{c}"] for c in "xyz"]), rotation(*self.quaternion))
        self.velocity, self.spin = (np.array([mean(f"base_{kind}{c}") for c in "xyz"]) for kind in "vw")
        self.lengths = {}
        for side_ in SIDES:
            self.close_rod(side_)
        self.floor = self.height()

    def later(self, t):
        """Base and angles after the time t at constant velocities."""
        base = (self.base[0] + t * self.velocity, exponential(t * self.spin) @ self.base[1])
        return base, {joint: angle + t * self.speeds.get(joint, 0.0) for joint, angle in self.angles.items()}

    def close_rod(self, side):
        """Velocity of the heel spring, which has no encoder, from the length of the rod; angles and velocities of the rod."""
        model, spring, t = self.model, f"ankle_spring_joint_{side}", 1e-6

        def rod(at):
            base, angles = at
            place, turn = model.frame(f"thigh_{side}", base, angles)
            return turn.T @ (model.point(f"heel_spring_{side}", HEEL, base, angles) - place) - np.array(THIGH[side])

        length = lambda at: np.linalg.norm(rod(at))
        rate = (length(self.later(t)) - length(self.later(-t))) / (2 * t)
        moved = lambda angle: (self.base, {**self.angles, spring: self.angles[spring] + angle})
        self.speeds[spring] -= rate / ((length(moved(t)) - length(moved(-t))) / (2 * t))
        turns = lambda at: np.array([math.atan2(rod(at)[1], rod(at)[0]), -math.asin(rod(at)[2] / length(at))])
        now, change = turns((self.base, self.angles)), (turns(self.later(t)) - turns(self.later(-t))) / (2 * t)
        for axis, angle, speed in zip("zy", now, change):
            self.angles[f"rod_{axis}_{side}"], self.speeds[f"rod_{axis}_{side}"] = float(angle), float(speed)
        self.lengths[side] = float(length((self.base, self.angles)))

    def height(self):
        """Height of the floor: that of the toe's lowest point at the sample of the landing, but below both toes at the start."""
        row = self.log[self.k]
        base = (np.array([row[f"base_{c}"] for c in "xyz"]), rotation(*(row[f"base_q{c}"] for c in "wxyz")))
        lowest = lambda side, base, angles: min(self.model.point(f"toe_{side}", end, base, angles)[2] for end in TOE)
        own = lowest(self.side, base, row)
        return float(min([own] + [lowest(side, self.base, self.angles) - 2 * BALL for side in SIDES]) - BALL)

    def jump(self, window):
        """The measured change of the seven joint velocities."""
        measured = rates(self.log, self.side)
        return measured[self.k + window - 1 : self.k + window + 2].mean(axis=0) - measured[self.k - 3 : self.k].mean(axis=0)

    def scene(self, values, window, order):
        turn = self.base[1]
        w, x, y, z = self.quaternion
        q = [*self.base[0], x, y, z, w, *(self.angles[joint] for joint in order)]
        qd = [*(turn.T @ self.velocity), *(turn.T @ self.spin), *(self.speeds[joint] for joint in order)]
        rotors = {f"{motor}_{side}": inertia + (values["toe_inertia"] if motor == "toe" else 0.0)
                  for side in SIDES for motor, inertia in ROTORS.items() if values.get("rotors", True)}
        lines = ["[robot]", 'urdf = "robot.urdf"', "floating = true", f"q = {numbers(q)}", f"qd = {numbers(qd)}",
                 "rotor_inertia = { " + ", ".join(f"{joint} = {inertia!r}" for joint, inertia in rotors.items()) + " }",
                 "[[surface]]", f"shape = {{ halfspace = {{ point = [0.0, 0.0, {self.floor!r}], normal = [0.0, 0.0, 1.0] }} }}",
                 "[contact]", f'law = "{values["law"]}"', f"restitution = {values['e']!r}", f"friction = {values['friction']!r}"]
        for side in SIDES:
            for joint, stiffness in SPRINGS.items():
                stiffness *= values.get("springs", 1.0)
                lines += ["[[spring]]", f'joint = "{joint}_{side}"', f"stiffness = {stiffness!r}"]
            if values.get("rods", True):
                lines += ["[[loop]]", f'name = "rod {side}"', 'joint = "point"', f'first = {{ link = "rod_{side}", xyz = {numbers([self.lengths[side], 0, 0])} }}',
                          f'second = {{ link = "heel_spring_{side}", xyz = {numbers(HEEL)} }}']
        lines += ["[run]", f"duration = {(window + 3) * DT!r}", "gravity = [0.0, 0.0, -9.81]", f"sample = {DT!r}", "tolerance = 1e-6",
                  'controller = "torque-file"', 'torque_file = "torques.csv"']
        return "\n".join(lines) + "\n"

    def simulated(self, values, window, order):
        """The rates of the leg's seven joints at the samples from the start; None and the reason if carom refuses the scene."""
        with tempfile.TemporaryDirectory() as folder:
            at = lambda name: os.path.join(folder, name)
            with open(at("robot.urdf"), "w") as file:
                file.write(self.model.text)
            with open(at("scene.toml"), "w") as file:
                file.write(self.scene(values, window, order))
            with open(at("torques.csv"), "w") as file:
                file.write("time," + ",".join(order) + "\n")
                for j in range(window + 5):
                    row = self.log[min(self.k - 2 + j, len(self.log) - 1)]
                    torque = lambda joint: row.get(f"{joint}_motor", 0.0) * values.get("torques", 1.0)
                    file.write(f"{j * DT!r}," + ",".join(repr(torque(joint)) for joint in order) + "\n")
            run = subprocess.run([CAROM, "simulate", at("scene.toml"), "--csv", at("motion.csv")], capture_output=True, text=True, timeout=120)
            if run.returncode:
                return None, run.stderr.strip().replace(folder, "")
            with open(at("motion.csv")) as file:
                rows = list(csv.DictReader(file))
        return np.array([[float(row[f"qd.{joint}_{self.side}"]) for joint in JOINTS] for row in rows]), ""

    def errors(self, values, windows, order):
        """Root mean square of the error of the seven jumps, rad/s, for each window; infinite if refused."""
        moved, why = self.simulated(values, max(windows), order)
        if moved is None:
            print(f"log {self.name}, {self.side}: {why}")
            return [math.inf for _ in windows], None
        start = np.array([self.speeds[f"{joint}_{self.side}"] for joint in JOINTS])
        apart = [moved[window + 1 : window + 4].mean(axis=0) - start - self.jump(window) for window in windows]
        return [float(np.sqrt(np.mean(one**2))) for one in apart], apart[-1]


def numbers(values):
    return "[" + ", ".join(repr(float(value)) for value in values) + "]"


def joints_in_order(model):
    """Names of the joints in the order of carom's q."""
    with tempfile.TemporaryDirectory() as folder:
        path = os.path.join(folder, "robot.urdf")
        with open(path, "w") as file:
            file.write(model.text)
        told = subprocess.run([CAROM, "inspect", path, "--floating", "--json"], capture_output=True, text=True, check=True).stdout
    return [joint["name"] for joint in json.loads(told)["joints"] if joint["type"] not in ("floating", "fixed")]
