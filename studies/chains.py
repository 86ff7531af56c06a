"""Census: continuation of periodic orbits of random planar chains that hammer on a shaking wall.

Each seed makes an arm of two or three links in the x-y plane (URDF), a scene and a problem of `carom orbit`, and follows the orbit
over a parameter. Seeds are taken in order until --count branches begin at an orbit with an impact. A row of results.jsonl is a seed.

    python studies/chains.py --carom target/release/carom --out census
"""

import argparse
import collections
import json
import pathlib
import subprocess
import time

import numpy as np

LAWS = "whittaker newton poisson energetic chatterjee-ruina smith brach frictionless".split()
LINK = """  <link name="link{k}">
    <inertial> <origin xyz="{centre} 0 0"/> <mass value="{mass}"/>
      <inertia ixx="{thin}" ixy="0" ixz="0" iyy="{inertia}" iyz="0" izz="{inertia}"/>
    </inertial>
  </link>
  <joint name="joint{k}" type="revolute">
    <parent link="{parent}"/> <child link="link{k}"/> <origin xyz="{at} 0 0"/> <axis xyz="0 0 1"/>
    <limit lower="-3.1" upper="3.1" velocity="100" effort="1000"/>
  </joint>
"""
TIP = """  <link name="tip"> <collision> <geometry><sphere radius="0.000001"/></geometry> </collision> </link>
  <joint name="probe" type="fixed"> <parent link="link{k}"/> <child link="tip"/> <origin xyz="{at} 0 0"/> </joint>
"""
SCENE = """[robot]
urdf = "robot.urdf"
q = {q}

[[surface]]
name = "wall"
shape = {{ halfspace = {{ point = [{wall}, 0, 0], normal = [-1, 0, 0] }} }}
motion = {{ amplitude = [{amplitude}, 0, 0], frequency = {frequency}, phase = -1.5707963267948966 }}

[contact]
law = "{law}"
restitution = {restitution}
friction = {friction}

[run]
gravity = [0, {gravity}, 0]
duration = 1
controller = "pd"
kp = {kp}
kd = {kd}
target = {target}
"""


def statics(lengths, centres, masses, inertias, q):
    """Position of the tip, its Jacobian, the mass matrix, and the torques that balance gravity 1 along -y."""
    n = len(q)
    along = np.stack([np.cos(np.cumsum(q)), np.sin(np.cumsum(q))], axis=1)
    across = np.stack([-along[:, 1], along[:, 0]], axis=1)
    sums = np.tril(np.ones((n, n)))  # angle of link i = sum of the joints up to i
    mass, torque = np.zeros((n, n)), np.zeros(n)
    for i in range(n):
        arms = np.where(np.arange(n) < i, lengths, 0.0)
        arms[i] = centres[i]
        jacobian = (across * arms[:, None]).T @ sums
        mass += masses[i] * jacobian.T @ jacobian + inertias[i] * np.outer(sums[i], sums[i])
        torque += masses[i] * jacobian[1]
    return lengths @ along, (across * lengths[:, None]).T @ sums, mass, torque


def make(seed, folder):
    """Writes robot, scene and problem of a seed; returns what was chosen."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 4))
    lengths, masses = rng.uniform(0.15, 0.5, n), np.exp(rng.uniform(np.log(0.2), np.log(3), n))
    centres = lengths * rng.uniform(0.3, 0.7, n)
    inertias = masses * lengths**2 * rng.uniform(1 / 12, 1 / 8, n)
    bends = rng.uniform(0.4, 1.8, n - 1) * rng.choice([-1, 1], n - 1)
    q = np.append(rng.uniform(-1.2, 1.2), bends)
    tip, jacobian, mass, torque = statics(lengths, centres, masses, inertias, q)
    # Each joint by itself, with the others free, has these frequencies (Hz) and damping ratios.
    alone, own, ratio = 1 / np.diag(np.linalg.inv(mass)), rng.uniform(2, 6, n), rng.uniform(0.05, 0.5, n)
    kp, kd = alone * (2 * np.pi * own) ** 2, 2 * ratio * alone * 2 * np.pi * own
    amplitude, frequency, periods = rng.uniform(0.001, 0.008), rng.uniform(2, 8), int(rng.choice([1, 1, 1, 2]))
    law, gravity = str(rng.choice(LAWS)), float(rng.choice([0, -9.81]))
    restitution, friction = rng.uniform(0.1, 0.8), 0.0 if law == "frictionless" else rng.uniform(0, 0.5)
    # A period begins where the wall is farthest from the arm. The springs alone would hold the tip between one amplitude before the wall
    # and three behind it.
    behind = amplitude * rng.uniform(-1, 3)
    target = q + behind * np.linalg.pinv(jacobian)[:, 0] - gravity * torque / kp
    what = str(rng.choice(["frequency", "amplitude", "kp", "kd"]))
    low, high = (0.7, 1.5) if what == "frequency" else (0.5, 2.0)
    start, end = (low, high) if rng.integers(2) else (high, low)
    joint = int(rng.integers(n))
    sets = {f"run.{what}[{joint}]": f"share*{kp[joint] if what == 'kp' else kd[joint]}"}
    if what == "amplitude":
        sets = {"surface[0].motion.amplitude[0]": f"share*{-amplitude}"}
    if what == "frequency":
        sets = {"surface[0].motion.frequency": f"share*{frequency}", "section.period": f"{periods / frequency}/share"}
    folder.mkdir(parents=True, exist_ok=True)
    links = "".join(
        LINK.format(k=k + 1, parent=f"link{k}" if k else "base", at=lengths[k - 1] if k else 0, centre=centres[k],
                    mass=masses[k], inertia=inertias[k], thin=0.1 * inertias[k]) for k in range(n))
    urdf = f'<?xml version="1.0"?>\n<robot name="chain{seed}">\n  <link name="base"/>\n{links}{TIP.format(k=n, at=lengths[-1])}</robot>\n'
    (folder / "robot.urdf").write_text(urdf)
    (folder / "scene.toml").write_text(SCENE.format(
        q=q.tolist(), wall=tip[0] + 1e-5, amplitude=-amplitude, frequency=frequency, law=law, restitution=restitution,
        friction=friction, gravity=gravity, kp=kp.tolist(), kd=kd.tolist(), target=target.tolist()))
    formulas = ", ".join(f'"{path}" = "{formula}"' for path, formula in sets.items())
    (folder / "problem.toml").write_text(
        f'scene = "scene.toml"\nsection.period = {periods / frequency}\norbit.before = 60\norbit.tolerance = 1e-10\n\n[vary]\n'
        f'parameter = "share"\nfrom = {start}\nto = {end}\npoints = 400\nset = {{ {formulas} }}\n')
    return {"seed": seed, "links": n, "law": law, "restitution": restitution, "friction": friction, "gravity": gravity,
            "periods": periods, "frequency": frequency, "vary": what + (f"[{joint}]" if what[0] == "k" else ""),
            "from": start, "to": end}


def answer(carom, folder, limit, *options):
    """What `carom orbit` answers: an object, or an error as text."""
    command = [carom, "orbit", str(folder / "problem.toml"), "--json", "--quiet", *options]
    try:
        run = subprocess.run(command, capture_output=True, text=True, timeout=limit)
    except subprocess.TimeoutExpired:
        return "limit of time"
    if run.returncode not in (0, 1):
        raise RuntimeError(run.stderr)
    return run.stderr.strip() if run.returncode else json.loads(run.stdout)


def impacts(orbit):
    return sum(event["what"].startswith("impact") for event in orbit["events"])


def follow(carom, folder, limit):
    """Finds the orbit and follows its branch; `class`: no-orbit, no-impact, timeout (of the branch), branch."""
    orbit = answer(carom, folder, limit)
    if isinstance(orbit, str):
        return {"class": "no-orbit", "error": orbit}
    if not impacts(orbit):
        return {"class": "no-impact"}
    branch = answer(carom, folder, limit, "--branch")
    if isinstance(branch, str):
        return {"class": "timeout" if branch == "limit of time" else "no-orbit", "error": branch}
    first, last = branch["points"][0], branch["points"][-1]
    special = [{key: point[key] for key in ("kind", "parameter", "what")} for point in branch["special"]]
    return {"class": "branch", "ended": branch["ended"], "end": branch["end"], "points": len(branch["points"]),
            "last": last["parameter"], "impacts": [impacts(first), impacts(last)],
            "stability": [first["stability"], last["stability"]], "period": last["period"], "events": last["events"],
            "special": special}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--carom", default="carom", help="the program")
    parser.add_argument("--out", type=pathlib.Path, default=pathlib.Path("census"), help="folder for the results")
    parser.add_argument("--count", type=int, default=200, help="number of branches")
    parser.add_argument("--first", type=int, default=1, help="first seed")
    parser.add_argument("--limit", type=float, default=60, help="longest time of an answer, s")
    options = parser.parse_args()
    told, branches = collections.Counter(), 0
    options.out.mkdir(parents=True, exist_ok=True)
    with open(options.out / "results.jsonl", "w") as file:
        for seed in range(options.first, options.first + 10 * options.count):
            folder, begun = options.out / "seeds" / str(seed), time.monotonic()
            row = make(seed, folder) | follow(options.carom, folder, options.limit)
            row["seconds"] = round(time.monotonic() - begun, 2)
            print(json.dumps(row), file=file, flush=True)
            told[row.get("ended", row["class"])] += 1
            branches += row["class"] in ("branch", "timeout")
            if branches == options.count:
                break
    print(dict(told))


if __name__ == "__main__":
    main()
