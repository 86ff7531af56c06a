"""First impact of a published arm: a Panda taps a table with its flange, free and with its joints held.

Needs the package carom (README.md) and `pip install example-robot-data`; with `pip install robot_descriptions` use
`carom.Chain.from_robot_description("panda_description")` instead.
"""

import importlib.metadata

import numpy as np

import carom

robots = [file.locate() for file in importlib.metadata.files("example-robot-data") or []]
panda = next(file for file in robots if file.name == "panda.urdf")
arm = carom.Chain.from_urdf(panda, meshes=False)
print(arm)

q = arm.neutral()
q[:7] = [0.0, 0.4, 0.0, -2.0, 0.0, 2.4, 0.8]
# Joint velocities of least norm with which the flange goes down at 0.3 m/s and forwards at 0.1 m/s.
J = arm.jacobian(q, "panda_link8")
qd = np.linalg.pinv(J) @ [0.1, 0.0, -0.3]

hit = dict(frame="panda_link8", normal=(0, 0, 1))
for joints in ("free", arm.joints[:4]):
    print(f"\njoints held: {'none' if joints == 'free' else ', '.join(joints)}")
    laws = [carom.Frictionless(0.5), carom.Energetic(0.5, 0.3), carom.ChatterjeeRuina(0.5, 0.3)]
    for impact in arm.impact(q, qd, law=laws, joints=joints, **hit):
        jump = np.abs(impact.qd_plus - qd).max()
        print(
            f"{impact.law:16} {impact.mode:12} impulse {np.linalg.norm(impact.impulse):.4f} N s, "
            f"largest joint jump {jump:.3f} rad/s, energy ratio {impact.energy_ratio:.3f}"
        )

# The softest of many poses: 20 000 in one call.
rng = np.random.default_rng(1)
poses = q + 0.4 * rng.normal(size=(20_000, arm.nq)) * (np.arange(arm.nq) < 7)
mass = arm.effective_mass(poses, "panda_link8", (0, 0, 1))
print(f"\neffective mass: {mass[np.argmin(mass)]:.2f} to {np.max(mass[np.isfinite(mass)]):.2f} kg over {len(poses)} poses")
