"""Compares impact laws on Kane and Levinson's double pendulum, and draws the Routh diagram with matplotlib.

Needs the package carom (README.md) and `pip install matplotlib`. Writes routh.png into the folder given by --out.
"""

import argparse
import pathlib

import numpy as np

import carom

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--out", type=pathlib.Path, default=pathlib.Path())
out = parser.parse_args().out

# Delassus matrix (1/kg) and contact velocity (m/s) of the tip that strikes the floor: tangent, normal.
H = np.array([[2.440338045696, 1.521308658011], [1.521308658011, 1.009560290504]])
u = np.array([-0.267174342835, -0.134202014333])
e, mu = 0.5, 0.5


def half_way(H, u):
    """A law of one's own: the impulse half way between no rebound and a full rebound, without friction."""
    return [0.0, -1.5 * u[1] / H[1, 1]]


laws = [law(e, mu) for law in (carom.Whittaker, carom.Newton, carom.Poisson, carom.Energetic, carom.ChatterjeeRuina, carom.Smith)]
outcomes = carom.law(H, u, [*laws, half_way])
for outcome in outcomes:
    flags = f"  {', '.join(outcome.flags)}" if outcome.flags else ""
    print(f"{outcome.law:16} {outcome.mode:12} u+ {outcome.u_plus}  energy ratio {outcome.energy_ratio:.4f}{flags}")

axes = carom.diagram(H, u, mu, outcomes).plot()
axes.figure.savefig(out / "routh.png", dpi=150)
print(f"written to {out / 'routh.png'}")
