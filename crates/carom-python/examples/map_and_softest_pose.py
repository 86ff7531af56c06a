"""Where the tip of a two-link arm reverses its tangential velocity, and the pose with the smallest joint load.

Needs the package carom (README.md), `pip install matplotlib`, and the folders robots/ and studies/ of the repository. Writes reversal.png into the folder
given by --out.
"""

import argparse
import pathlib

import matplotlib.pyplot as plt
import numpy as np

import carom

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--out", type=pathlib.Path, default=pathlib.Path())
out = parser.parse_args().out
repository = pathlib.Path(__file__).resolve().parents[3]

# A study as a dict: the elbow and the approach angle of the arm of Pagilla and Yu, the shoulder at 45°.
study = carom.Study.from_dict(
    {
        "robot": {"urdf": repository / "robots/planar2.urdf"},
        "joints": {"shoulder": 0.7854, "elbow": {"from": -2.4, "to": 2.4, "count": 241}},
        "impact": {
            "normal": [-1, 0, 0],
            "along": [0, -1, 0],
            "approach_deg": {"from": 10, "to": 90, "count": 81},
            "speed": 0.2,
            "law": "energetic",
            "restitution": 0.35,
        },
        "map": {"quantities": ["tangential_after", "impulse", "limit_share"]},
    }
)
table = carom.map(study)
classes, counts = np.unique(table["class"], return_counts=True)
print(f"{len(table)} rows:", ", ".join(f"{name} {count}" for name, count in zip(classes, counts)))

shape = tuple(count for _, count in study.axes)
elbow, angle, after = (table[name].reshape(shape) for name in ("q.elbow", "approach_deg", "tangential_after"))
figure, axes = plt.subplots()
size = np.nanmax(np.abs(after))
mesh = axes.pcolormesh(elbow, angle, after, cmap="RdBu", vmin=-size, vmax=size, shading="nearest")
axes.contour(elbow, angle, (table["class"] == "reverses").reshape(shape).astype(float), [0.5], colors="k")
axes.set(xlabel="elbow, rad", ylabel="approach angle, degrees", title="inside the line the tip reverses")
figure.colorbar(mesh, label="tangential velocity after the impact, m/s")
figure.savefig(out / "reversal.png", dpi=150)
print(f"written to {out / 'reversal.png'}")

advice = carom.Study.from_file(repository / "studies/self_motion.toml").advise()
best = advice["best"][0]
print(f"{advice['goal']} {advice['column']}: {best['values']['limit_share']:.4f} at q {best['q'].round(3)}")
if best["self_motion"]:
    q, values = best["self_motion"]
    print(f"along the self-motion: {values['limit_share']:.4f} at q {q.round(3)}")
