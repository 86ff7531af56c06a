"""Compares impact laws on Kane and Levinson's double pendulum, and draws the Routh diagram with matplotlib.

Needs the package carom (README.md) and `pip install matplotlib`. Writes routh.png into the folder given by --out.
"""

import argparse
import pathlib

import matplotlib.pyplot as plt
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

drawn = carom.diagram(H, u, mu, outcomes)
figure, axes = plt.subplots(figsize=(7, 6))
for shape in drawn["shapes"]:
    for k, piece in enumerate(shape["pieces"]):
        label = shape["name"] if k == 0 else None
        if shape["stroke"] == "area":
            axes.fill(*piece.T, color=shape["colour"], alpha=0.5, label=label)
        else:
            axes.plot(*piece.T, color=shape["colour"], lw=2 if shape["stroke"] == "thick" else 1, label=label)
for mark in drawn["marks"]:
    axes.plot(*mark["at"], "o" if mark["symbol"] == "law" else "s", color=mark["colour"], label=mark["name"])
axes.set(title=drawn["title"], xlabel=drawn["axes"][0], ylabel=drawn["axes"][1], xlim=drawn["window"][0], ylim=drawn["window"][1])
axes.set_aspect("equal" if drawn["equal_scales"] else "auto")
axes.legend(fontsize=7)
figure.savefig(out / "routh.png", dpi=150)
print(f"written to {out / 'routh.png'}")
