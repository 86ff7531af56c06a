"""Times of the Python package beside the Rust crates, Pinocchio and MuJoCo, in one run.

    pip install pin mujoco      # beside the package of this folder
    python crates/carom-python/benches/beside.py

Prints the least time of repeated runs. The Rust times of one impact are those of `cargo bench -p carom-study --bench doors`,
which the script runs before and after its own; without cargo they are left out. All compute with the same file and its inertias; the
results are compared. With RAYON_NUM_THREADS=1 batches use one core.
"""

import os
import pathlib
import re
import subprocess
import sys
import threading
import time

import numpy as np

import carom

ROBOTS = pathlib.Path(__file__).resolve().parents[3] / "robots"
NORMAL = (-1.0, 0.0, 0.0)
ENERGETIC, FRICTIONLESS = carom.Energetic(0.5, 0.3), carom.Frictionless(0.5)


def least(work, repeats, runs=7):
    """The least time of one call, s."""
    times = []
    for _ in range(runs):
        begin = time.perf_counter()
        for _ in range(repeats):
            work()
        times.append((time.perf_counter() - begin) / repeats)
    return min(times)


def least_in_pieces(work, count, size=1000):
    """The sum of the least times of the pieces of a long work, s: on a busy machine no long run is left alone."""
    return sum(least(lambda: work(range(first, min(first + size, count))), 1) for first in range(0, count, size))


def states(chain, count):
    rng = np.random.default_rng(7)
    return rng.uniform(-2, 2, (count, chain.nq)), rng.uniform(-2, 2, (count, chain.nv))


def tell(what, seconds, count=1):
    print(f"{what:66} {seconds / count * 1e9:10.0f} ns", flush=True)


def doors():
    """Least times of the Rust calls, s, by robot and name of the law; empty without cargo."""
    command = ["cargo", "run", "-q", "--release", "--locked", "-p", "carom-study", "--example", "doors"]
    try:
        lines = subprocess.run(command, cwd=ROBOTS.parent, capture_output=True, text=True, check=True).stdout.splitlines()
    except (OSError, subprocess.CalledProcessError) as missing:
        print(f"Rust is left out: {missing}")
        return {}
    robots, times = lines[0].split()[2:], {}
    for line in lines[1:]:
        if line.startswith("chain.impact"):
            law = "frictionless" if "Frictionless" in line else "energetic"
            numbers = re.findall(r"([\d.]+) \(", line[line.index("resolve(") + 8 :])
            times.update({(robot, law): float(number) * 1e-9 for robot, number in zip(robots, numbers)})
    return times


def pinocchio_impact(urdf):
    """The frictionless impact by Pinocchio's functions in sequence: M, J, one solution with M. It has no law with friction."""
    import pinocchio as pin

    model = pin.buildModelFromUrdf(str(urdf))
    data, frame, n = model.createData(), model.getFrameId("tip"), np.array(NORMAL)

    def impact(q, qd):
        pin.crba(model, data, q)
        J = pin.computeFrameJacobian(model, data, q, frame, pin.LOCAL_WORLD_ALIGNED)[:3]
        pin.cholesky.decompose(model, data)
        row = n @ J
        response = pin.cholesky.solve(model, data, row)
        return qd + response * (-1.5 * (row @ qd) / (row @ response))

    return impact


def mujoco_impact(urdf):
    """The same by MuJoCo's functions."""
    import mujoco

    # The tip has no mass: it is kept as a body of its own, and gets none from its collision shape.
    spec = mujoco.MjSpec.from_file(str(urdf))
    spec.compiler.fusestatic = False
    spec.compiler.inertiafromgeom = mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_FALSE
    model = spec.compile()
    data = mujoco.MjData(model)
    body, n = model.body("tip").id, np.array(NORMAL)
    J, response = np.zeros((3, model.nv)), np.zeros((1, model.nv))

    def impact(q, qd):
        data.qpos[:] = q
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_makeM(model, data)
        mujoco.mj_factorM(model, data)
        mujoco.mj_jacBody(model, data, J, None, body)
        row = n @ J
        mujoco.mj_solveM(model, data, response, row[None])
        return qd + response[0] * (-1.5 * (row @ qd) / (row @ response[0]))

    return impact


def singles():
    print("one impact of one state, 64 states in turn")
    rust = doors()
    own = {}
    for robot in ("planar2", "arm7"):
        urdf = ROBOTS / f"{robot}.urdf"
        chain = carom.Chain.from_urdf(urdf)
        Q, QD = states(chain, 64)
        approach = [(chain.jacobian(q, "tip") @ qd)[0] for q, qd in zip(Q, QD)]
        QD *= np.sign(approach)[:, None]
        pairs = list(zip(Q, QD))

        def each(impact):
            # Short runs, as in Rust: on a busy machine some of them are not interrupted.
            return least(lambda: [impact(q, qd) for q, qd in pairs], 1, runs=2000) / len(pairs)

        for law in (FRICTIONLESS, ENERGETIC):
            own[robot, law.name] = each(lambda q, qd: chain.impact(q, qd, frame="tip", normal=NORMAL, law=law))
            tell(f"{robot}: chain.impact, {law.name}", own[robot, law.name])
        tell(f"{robot}: chain.mass_matrix", each(lambda q, qd: chain.mass_matrix(q)))
        expected = [chain.impact(q, qd, frame="tip", normal=NORMAL, law=FRICTIONLESS).qd_plus for q, qd in pairs]
        for name, make in (("Pinocchio", pinocchio_impact), ("MuJoCo", mujoco_impact)):
            try:
                impact = make(urdf)
            except ImportError as missing:
                print(f"{robot}: {name} is left out: {missing}")
                continue
            found = [impact(q, qd) for q, qd in pairs]
            error = np.abs(np.subtract(found, expected)).max() / np.abs(expected).max()
            tell(f"{robot}: {name}, frictionless (differs by {error:.0e})", each(impact))
    again = doors()
    for key, seconds in own.items():
        if key in rust:
            least_rust = min(rust[key], again.get(key, rust[key]))
            print(f"{key[0]}, {key[1]}: in Rust {least_rust * 1e9:.0f} ns, the call from Python adds {(seconds - least_rust) * 1e9:.0f} ns")


def batches():
    print(f"\nbatches on {os.environ.get('RAYON_NUM_THREADS', os.cpu_count())} cores, for each state")
    for robot, law, count in (("planar2", FRICTIONLESS, 1_000_000), ("arm7", ENERGETIC, 100_000)):
        urdf = ROBOTS / f"{robot}.urdf"
        chain = carom.Chain.from_urdf(urdf)
        q, qd = states(chain, count)
        tell(f"{robot}: {count} impacts, {law.name}", least(lambda: chain.impact(q, qd, frame="tip", normal=NORMAL, law=law), 1), count)
    batch = lambda k: chain.impact(q[k.start : k.stop], qd[k.start : k.stop], frame="tip", normal=NORMAL, law=law)
    own = least_in_pieces(batch, count)
    tell(f"{robot}: the same in batches of 1000", own, count)
    for name, make in (("Pinocchio", pinocchio_impact), ("MuJoCo", mujoco_impact)):
        try:
            impact = make(urdf)
        except ImportError as missing:
            print(f"{name} is left out: {missing}")
            continue

        peer = least_in_pieces(lambda piece: [impact(q[k], qd[k]) for k in piece], count)
        tell(f"{robot}: {count} impacts, a loop over {name}, frictionless", peer, count)
        print(f"the batches with friction take {own / peer:.2f} of the time of the loop without")


def threads():
    """Two threads beside one, each with batches on one core."""
    chain = carom.Chain.from_urdf(ROBOTS / "arm7.urdf")
    q, qd = states(chain, 50_000)
    work = lambda: chain.impact(q, qd, frame="tip", normal=NORMAL, law=ENERGETIC)

    def both():
        pair = [threading.Thread(target=work) for _ in range(2)]
        [thread.start() for thread in pair]
        [thread.join() for thread in pair]

    one, two = least(lambda: (work(), work()), 1), least(both, 1)
    print(f"\ntwo batches after one another {one * 1e3:.1f} ms, in two threads {two * 1e3:.1f} ms: {two / one:.2f} of the time")


if __name__ == "__main__":
    if "--threads" in sys.argv:
        threads()
    else:
        singles()
        batches()
        # The number of cores of a batch is set when the package is first used.
        subprocess.run([sys.executable, __file__, "--threads"], env={**os.environ, "RAYON_NUM_THREADS": "1"}, check=True)
