"""Simulates a scene under a law of one's own and looks at its tables.

Needs the package carom (README.md) and the folders robots/ and scenes/ of the repository. Writes events.csv into the folder given by --out.
"""

import argparse
import pathlib

import numpy as np

import carom

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--out", type=pathlib.Path, default=pathlib.Path())
out = parser.parse_args().out
repository = pathlib.Path(__file__).resolve().parents[3]


def softening(H, u):
    """Newton's law without friction, with a restitution that falls with the approach speed."""
    e = 1 / (1 + 2 * abs(u[2]))
    return [0.0, 0.0, -(1 + e) * u[2] / H[2, 2]]


scene = carom.Scene.from_file(repository / "scenes/bounce.toml")
print(scene)
for what in scene.plan()["kept"]:
    print(f"  {what['what']:11} {what['choice']}")

for law in (carom.Newton(0.8), carom.PythonLaw(softening, restitution=0.5)):
    run = scene.with_law(law).simulate(sample=0.01)
    impacts = [event for event in run.events if event.kind == "impact"]
    ratios = [-event.impact.u_plus[2] / event.impact.u_minus[2] for event in impacts]
    print(f"\n{law}: {run}")
    print("  restitution of each impact:", np.round(ratios[:6], 4))
    print(f"  energy lost {run.energy['lost_in_impacts']:.4f} J, error of the balance {run.energy['error']:.1e} J")

run.event_table.write(out / "events.csv")
print(f"\nwritten to {out / 'events.csv'}")
