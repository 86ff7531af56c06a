"""Times of the Python package beside Pinocchio and MuJoCo.

    pip install carom pin mujoco
    python crates/carom-python/benches/beside.py

Prints the least time of repeated runs. The Rust times of the same work: `cargo run --release -p carom-study --example doors` (one
impact) and `--example batches` (batches). With RAYON_NUM_THREADS=1 batches use one core.
"""

import os
import pathlib
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


def states(chain, count):
    rng = np.random.default_rng(7)
    return rng.uniform(-2, 2, (count, chain.nq)), rng.uniform(-2, 2, (count, chain.nv))


def tell(what, seconds, count=1):
    print(f"{what:66} {seconds / count * 1e9:10.0f} ns", flush=True)


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
    print("one impact of one state")
    for robot in ("planar2", "arm7"):
        urdf = ROBOTS / f"{robot}.urdf"
        chain = carom.Chain.from_urdf(urdf)
        Q, QD = states(chain, 1)
        q, qd = Q[0], QD[0]
        qd = -qd if (chain.jacobian(q, "tip") @ qd)[0] < 0 else qd
        for law in (FRICTIONLESS, ENERGETIC):
            work = lambda: chain.impact(q, qd, frame="tip", normal=NORMAL, law=law)
            tell(f"{robot}: chain.impact, {law.name}", least(work, 20_000))
        tell(f"{robot}: chain.mass_matrix", least(lambda: chain.mass_matrix(q), 20_000))
        expected = chain.impact(q, qd, frame="tip", normal=NORMAL, law=FRICTIONLESS).qd_plus
        for name, make in (("Pinocchio", pinocchio_impact), ("MuJoCo", mujoco_impact)):
            try:
                impact = make(urdf)
                found = impact(q, qd)
            except Exception as missing:  # a peer that is not installed, or does not read the file
                print(f"{robot}: {name} is left out: {missing}")
                continue
            error = np.abs(found - expected).max() / np.abs(expected).max()
            tell(f"{robot}: {name}, frictionless (differs by {error:.0e})", least(lambda: impact(q, qd), 5_000))


def batches():
    print(f"\nbatches on {os.environ.get('RAYON_NUM_THREADS', os.cpu_count())} cores, for each state")
    for robot, law, count in (("planar2", FRICTIONLESS, 1_000_000), ("arm7", ENERGETIC, 100_000)):
        urdf = ROBOTS / f"{robot}.urdf"
        chain = carom.Chain.from_urdf(urdf)
        q, qd = states(chain, count)
        work = lambda: chain.impact(q, qd, frame="tip", normal=NORMAL, law=law)
        tell(f"{robot}: {count} impacts, {law.name}", least(work, 1), count)
    try:
        impact = pinocchio_impact(urdf)
    except ImportError as missing:
        return print(f"Pinocchio is left out: {missing}")

    def loop():
        for k in range(count):
            impact(q[k], qd[k])

    tell(f"{robot}: {count} impacts, a loop over Pinocchio, frictionless", least(loop, 1, runs=3), count)


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
