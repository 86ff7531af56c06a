"""A controller in Python brings an arm to a wall and presses on it; the run is recorded.

Called 500 times a second, it moves the tip with a given velocity towards the wall, by the inertia at the tip, and presses with a
given force while the tip is at the wall. A second run is a loop around a session, with a memory: it halves the velocity at each
impact.

Needs the package carom (README.md) and the folders robots/ and scenes/ of the repository. Writes states.csv into the folder given by --out,
and controller.rrd if the package is built with recordings.
"""

import argparse
import pathlib

import numpy as np

import carom

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--out", type=pathlib.Path, default=pathlib.Path())
out = parser.parse_args().out
repository = pathlib.Path(__file__).resolve().parents[3]

RATE = 500.0  # calls per second
SPEED = 0.2  # of the tip towards the wall, m/s
PRESS = 5.0  # N
WALL = 0.6364  # x of the wall, m

scene = carom.Scene.from_file(repository / "scenes/planar2.toml").with_law(carom.Energetic(0.35, 0.2)).with_duration(1.0)
arm = scene.chain
# From 0.3 s before the wall.
scene = scene.with_start(q=arm.integrate(scene.q, -scene.qd, 0.3))


def approach(q, qd, speed):
    """Joint forces for a velocity of the tip of (speed, 0): the operational-space inertia times the error of the velocity."""
    J = arm.jacobian(q, "tip")[:2]
    wanted = 40.0 * ([speed, 0.0] - J @ qd)  # m/s²
    return J.T @ np.linalg.solve(arm.delassus(q, "tip")[:2, :2], wanted) + arm.bias(q, qd)


def at_the_wall(q):
    return arm.position(q, "tip")[0] > WALL - 1e-4


def press(time, q, qd):
    """Towards the wall until the tip is there, then PRESS newtons, and a brake along the wall."""
    if not at_the_wall(q):
        return approach(q, qd, SPEED)
    J = arm.jacobian(q, "tip")[:2]
    return J.T @ [PRESS, -20.0 * (J @ qd)[1]]


run = scene.with_controller(press, rate=RATE).simulate(sample=0.01)
impacts = [event for event in run.events if event.kind == "impact"]
force = run.contacts["normal_force"][-1]
print(f"called at {RATE:.0f} Hz: {run}")
print(f"  {len(impacts)} impacts, the largest with {max(np.linalg.norm(event.impact.impulse) for event in impacts):.4f} N s")
print(f"  at the end the wall carries {force:.4f} N; the motors did {run.energy['drive']:.4f} J")

# The same as a loop of one's own, with a memory.
session, speed, bounces = scene.session(), SPEED, 0
while session.time < scene.duration - 1e-9:
    q, qd = session.q, session.qd
    session.set_forces(press(session.time, q, qd) if at_the_wall(q) else approach(q, qd, speed))
    for event in session.advance(min(1 / RATE, scene.duration - session.time)):
        if event.kind == "impact":
            bounces, speed = bounces + 1, 0.5 * speed
print(f"in a loop that halves the speed at each impact: {bounces} impacts, then {session.mode}")

run.states.write(out / "states.csv")
print(f"written to {out / 'states.csv'}")
if carom.can_record():
    carom.record(run, out / "controller.rrd")
    print(f"written to {out / 'controller.rrd'}; open it with: rerun {out / 'controller.rrd'}")
