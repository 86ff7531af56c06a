"""Robots as they are published: which carom and Pinocchio load, and whether M, J and the energies are the same.

    robots.py CAROM FOLDER [FOLDER...]

CAROM is the program, each FOLDER is searched for *.urdf. Every file is loaded by both, with a fixed and with a floating base, without
meshes. Where both load it, three random states are compared: mass matrix, Jacobian of a point of the deepest link in world axes,
kinetic and potential energy; differences are relative to the greatest entry. Prints a summary, the files that only one of them
loads, with the reason, and the largest differences. Exit status 1 if a difference is above 1e-12.
"""

import json
import os
import pathlib
import subprocess
import sys
import tempfile

import numpy as np
import pinocchio as pin

ROUNDING = 1e-12
STATES = 3
GRAVITY = (0.3, -0.2, -9.81)
POINT = (0.02, -0.03, 0.05)


class Refused(Exception):
    """A library does not load a file, or not in a way that can be compared."""


def carom(program, *arguments):
    done = subprocess.run([program, *arguments, "--json"], capture_output=True, text=True, timeout=120)
    if done.returncode != 0:
        raise Refused(done.stderr.strip().splitlines()[-1] if done.stderr.strip() else f"status {done.returncode}")
    return [json.loads(line) for line in done.stdout.splitlines()]


def pinocchio_model(path, floating):
    root = (pin.JointModelFreeFlyer(),) if floating else ()
    try:
        return pin.buildModelFromUrdf(str(path), *root)
    except Exception as error:  # the library raises several kinds
        raise Refused(str(error).strip().splitlines()[0]) from None


class Joints:
    """The coordinates of a robot in both orders: q_pin from q, and v_pin = T v."""

    def __init__(self, model, joints, order):
        kinds = {joint["name"]: joint for joint in joints}
        self.places, nq, nv = [], 0, 0
        for name in order:
            kind = kinds[name]["type"]
            width = {"floating": (7, 6)}.get(kind, (1, 1))
            if kind == "planar":
                raise Refused("planar joint: Pinocchio has its velocities in other axes")
            self.places.append((name, kind, nq, nv))
            nq, nv = nq + width[0], nv + width[1]
        self.nq, self.nv, self.model = nq, nv, model
        self.kinds = kinds
        self.T = np.zeros((model.nv, nv))
        for name, kind, _, v in self.places:
            joint = self.joint(name)
            self.T[joint.idx_v : joint.idx_v + joint.nv, v : v + joint.nv] = np.eye(joint.nv)
        own = {name: v for name, _, _, v in self.places}
        for name, joint in kinds.items():
            mimic = joint.get("mimic")
            if mimic and mimic["joint"] in own:
                self.T[self.joint(name).idx_v, own[mimic["joint"]]] = mimic["multiplier"]

    def joint(self, name):
        number = self.model.getJointId(name)
        if number >= self.model.njoints:
            raise Refused(f"Pinocchio has no joint {name}")
        return self.model.joints[number]

    def place(self, q_pin, name, value):
        joint = self.joint(name)
        if joint.nq == 2:
            q_pin[joint.idx_q : joint.idx_q + 2] = np.cos(value), np.sin(value)
        else:
            q_pin[joint.idx_q : joint.idx_q + joint.nq] = value

    def random(self, rng):
        """q in carom's order, and in Pinocchio's."""
        q, q_pin = np.zeros(self.nq), pin.neutral(self.model)
        values = {}
        for name, kind, at, _ in self.places:
            if kind == "floating":
                turn = rng.normal(size=4)
                value = np.concatenate([rng.normal(size=3), turn / np.linalg.norm(turn)])
                q[at : at + 7] = value
            else:
                low, high = self.kinds[name].get("lower"), self.kinds[name].get("upper")
                low, high = (-1.0 if low is None else max(low, -3.0)), (1.0 if high is None else min(high, 3.0))
                q[at] = value = rng.uniform(min(low, high), max(low, high))
                values[name] = value
            self.place(q_pin, name, value)
        for name, joint in self.kinds.items():
            mimic = joint.get("mimic")
            if mimic and mimic["joint"] in values:
                self.place(q_pin, name, mimic["multiplier"] * values[mimic["joint"]] + mimic["offset"])
        return q, q_pin


def difference(ours, theirs):
    ours, theirs = np.asarray(ours), np.asarray(theirs)
    return float(np.max(np.abs(ours - theirs), initial=0.0) / max(np.max(np.abs(theirs), initial=0.0), 1e-9))


def compare(program, path, floating, model, rng):
    """The largest differences of M, J, kinetic and potential energy of a robot."""
    base = ("--floating",) if floating else ()
    about = carom(program, "inspect", str(path), "--no-meshes", *base)[0]
    # The floating joint of a robot whose root link is named "world" has this name twice.
    parents = {joint["child"]: joint["parent"] for joint in about["joints"] if joint["child"] != joint["parent"]}
    joints = {joint["child"]: joint for joint in about["joints"]}

    def depth(link):
        count = 0
        while link in parents:
            count, link = count + (joints[link]["type"] != "fixed"), parents[link]
        return count

    links = list(parents) or [about["joints"][0]["child"]] if about["joints"] else []
    if about["nv"] == 0 or not links:
        return None
    tip = max(links, key=depth)
    order = [joint["name"] for joint in about["joints"] if joint["type"] != "fixed" and not joint.get("mimic")]
    map_ = Joints(model, about["joints"], order)
    if (map_.nq, map_.nv) != (about["nq"], about["nv"]):
        raise Refused("the order of the coordinates is not that of the joints")
    states = [map_.random(rng) + (rng.normal(size=map_.nv),) for _ in range(STATES)]
    with tempfile.NamedTemporaryFile("w", suffix=".jsonl") as file:
        for q, _, qd in states:
            file.write(json.dumps({"q": list(q), "qd": list(qd)}) + "\n")
        file.flush()
        numbers = [",".join(map(str, vector)) for vector in (POINT, GRAVITY)]
        options = ("--tip", tip, f"--point={numbers[0]}", f"--gravity={numbers[1]}", "--joints", ",".join(order))
        answers = carom(program, "dynamics", str(path), "--no-meshes", *base, *options, "--states", file.name)
    model.gravity = pin.Motion(np.array(GRAVITY), np.zeros(3))
    data = model.createData()
    frame = model.getFrameId(tip, pin.FrameType.BODY)
    worst = np.zeros(4)
    for (_, q_pin, qd), answer in zip(states, answers, strict=True):
        v_pin = map_.T @ qd
        upper = np.triu(pin.crba(model, data, q_pin).reshape(model.nv, model.nv))
        mass = map_.T.T @ (upper + np.triu(upper, 1).T) @ map_.T
        pin.computeJointJacobians(model, data, q_pin)
        pin.updateFramePlacements(model, data)
        whole = pin.getFrameJacobian(model, data, frame, pin.LOCAL_WORLD_ALIGNED).reshape(6, -1)
        arm = data.oMf[frame].rotation @ np.array(POINT)
        jacobian = (whole[:3] - pin.skew(arm) @ whole[3:]) @ map_.T
        kinetic = pin.computeKineticEnergy(model, data, q_pin, v_pin)
        potential = pin.computePotentialEnergy(model, data, q_pin)
        # a potential is a sum of terms that cancel: relative to that of the whole mass at a distance of 1 m
        scale = max(abs(potential), 9.81 * about["total_mass"], 1e-9)
        found = (
            difference(answer["mass_matrix"], mass),
            difference(answer["jacobian"], jacobian),
            difference(answer["kinetic_energy"], kinetic),
            abs(answer["potential_energy"] - potential) / scale,
        )
        worst = np.maximum(worst, found)
    return worst


def main():
    program, folders = sys.argv[1], sys.argv[2:]
    files = sorted(path for folder in folders for path in pathlib.Path(folder).rglob("*.urdf"))
    common = os.path.commonpath(folders) if folders else ""
    rng = np.random.default_rng(18)
    both = ours = theirs = neither = compared = 0
    only_pinocchio, only_carom, apart, worst = [], [], [], np.zeros(4)
    for number, path in enumerate(files, 1):
        name = os.path.relpath(path, common)
        print(f"{number}/{len(files)} {name}", file=sys.stderr)
        reasons = {}
        try:
            carom(program, "inspect", str(path), "--no-meshes")
        except Refused as reason:
            reasons["carom"] = str(reason).replace(str(path), "").strip(": ")
        try:
            pinocchio_model(path, False)
        except Refused as reason:
            reasons["pinocchio"] = str(reason)
        if len(reasons) == 2:
            neither += 1
        elif "carom" in reasons:
            theirs += 1
            only_pinocchio.append(f"{name}: {reasons['carom']}")
        elif "pinocchio" in reasons:
            ours += 1
            only_carom.append(f"{name}: {reasons['pinocchio']}")
        else:
            both += 1
            for floating in (False, True):
                try:
                    found = compare(program, path, floating, pinocchio_model(path, floating), rng)
                except Refused as reason:
                    apart.append(f"{name}{', floating' * floating}: {reason}")
                    continue
                if found is None:
                    continue
                compared += 1
                worst = np.maximum(worst, found)
                if found.max() > ROUNDING:
                    apart.append(f"{name}{', floating' * floating}: M {found[0]:.1e}, J {found[1]:.1e}, T {found[2]:.1e}, V {found[3]:.1e}")
    loads = both + theirs
    share = 100 * both / loads if loads else 0
    print(f"{len(files)} files: both load {both}, only carom {ours}, only Pinocchio {pin.__version__} {theirs}, neither {neither}")
    print(f"of the {loads} that Pinocchio loads carom loads {share:.1f} %")
    print(f"{compared} robots compared; largest differences: M {worst[0]:.1e}, J {worst[1]:.1e}, T {worst[2]:.1e}, V {worst[3]:.1e}")
    for title, lines in [
        ("only Pinocchio loads", only_pinocchio),
        ("only carom loads", only_carom),
        ("not compared, or different", apart),
    ]:
        print(f"{title}: {len(lines)}")
        for line in lines:
            print(f"  {line}")
    sys.exit(1 if worst.max() > ROUNDING else 0)


if __name__ == "__main__":
    main()
