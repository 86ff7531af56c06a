"""Writes generated URDFs: a uniform chain, and the tree of a humanoid (robots/humanoid29.urdf).

    models.py chain LINKS [--length M] [--mass KG]   pinned at the origin, along x at q = 0, turning about z
    models.py humanoid                               29 joints: waist 3, legs 6 each, arms 7 each; fixed pelvis
"""

import argparse
import math

# Density of the humanoid's links, kg/m3, which are cylinders; a mixture of plastic and metal, as in arm7.urdf.
DENSITY = 1500.0


def inertial(mass, centre, principal):
    xyz = " ".join(repr(x) for x in centre)
    ixx, iyy, izz = (repr(x) for x in principal)
    return (
        f'    <inertial>\n      <origin xyz="{xyz}"/>\n      <mass value="{mass!r}"/>\n'
        f'      <inertia ixx="{ixx}" ixy="0" ixz="0" iyy="{iyy}" iyz="0" izz="{izz}"/>\n    </inertial>\n'
    )


def tip(parent, xyz, radius=1e-6):
    xyz = " ".join(repr(x) for x in xyz)
    return (
        f'  <link name="tip">\n    <collision><geometry><sphere radius="{radius!r}"/></geometry></collision>\n  </link>\n'
        f'  <joint name="probe" type="fixed">\n    <parent link="{parent}"/>\n    <child link="tip"/>\n'
        f'    <origin xyz="{xyz}"/>\n  </joint>\n'
    )


def joint(name, parent, child, xyz, axis):
    xyz, axis = (" ".join(repr(x) for x in it) for it in (xyz, axis))
    return (
        f'  <joint name="{name}" type="continuous">\n    <parent link="{parent}"/>\n    <child link="{child}"/>\n'
        f'    <origin xyz="{xyz}"/>\n    <axis xyz="{axis}"/>\n  </joint>\n'
    )


def chain(links, length=1.0, mass=1.0):
    """`links` equal round rods in a row along x; their radius is a fortieth of their length."""
    l, m = length / links, mass / links
    r = l / 40
    across = m * (3 * r * r + l * l) / 12
    text = f'<?xml version="1.0"?>\n<robot name="chain{links}">\n  <link name="base"/>\n'
    for i in range(links):
        body = inertial(m, (l / 2, 0, 0), (m * r * r / 2, across, across))
        text += f'  <link name="link{i + 1:03}">\n{body}  </link>\n'
        parent = f"link{i:03}" if i else "base"
        text += joint(f"joint{i + 1:03}", parent, f"link{i + 1:03}", (l if i else 0, 0, 0), (0, 0, 1))
    return text + tip(f"link{links:03}", (l, 0, 0)) + "</robot>\n"


def humanoid():
    """A tree of 29 hinges: homogeneous cylinders of human size, not the data of a product. `tip` is on the right hand."""
    text = ['<?xml version="1.0"?>\n<robot name="humanoid29">\n  <link name="pelvis"/>\n']
    axes = {"x": (1, 0, 0), "y": (0, 1, 0), "z": (0, 0, 1)}

    def limb(parent, start, parts):
        """parts: (name, axis, signed length along z, radius), m; each starts at the end of the one before."""
        at = start
        for name, axis, length, radius in parts:
            l = abs(length)
            m = DENSITY * math.pi * radius**2 * l
            across = m * (3 * radius**2 + l**2) / 12
            body = inertial(m, (0, 0, length / 2), (across, across, m * radius**2 / 2))
            text.append(f'  <link name="{name}">\n{body}  </link>\n')
            text.append(joint(f"{name}_joint", parent, name, at, axes[axis]))
            parent, at = name, (0, 0, length)
        return parent, at

    torso, top = limb("pelvis", (0, 0, 0.05), [
        ("waist_yaw", "z", 0.05, 0.07), ("waist_roll", "x", 0.05, 0.07), ("waist_pitch", "y", 0.4, 0.09),
    ])
    hand = None
    for side, sign in (("left", 1), ("right", -1)):
        limb("pelvis", (0, 0.1 * sign, -0.05), [
            (f"{side}_hip_pitch", "y", -0.05, 0.05), (f"{side}_hip_roll", "x", -0.05, 0.05),
            (f"{side}_hip_yaw", "z", -0.3, 0.05), (f"{side}_knee", "y", -0.35, 0.04),
            (f"{side}_ankle_pitch", "y", -0.03, 0.03), (f"{side}_ankle_roll", "x", -0.05, 0.04),
        ])
        hand = limb(torso, (0, 0.2 * sign, top[2] - 0.05), [
            (f"{side}_shoulder_pitch", "y", -0.05, 0.04), (f"{side}_shoulder_roll", "x", -0.05, 0.04),
            (f"{side}_shoulder_yaw", "z", -0.2, 0.035), (f"{side}_elbow", "y", -0.1, 0.03),
            (f"{side}_wrist_roll", "z", -0.12, 0.03), (f"{side}_wrist_pitch", "y", -0.04, 0.025),
            (f"{side}_wrist_yaw", "x", -0.1, 0.025),
        ])
    return "".join(text) + tip(*hand) + "</robot>\n"


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    kinds = parser.add_subparsers(dest="kind", required=True)
    of_chain = kinds.add_parser("chain")
    of_chain.add_argument("links", type=int)
    of_chain.add_argument("--length", type=float, default=1.0)
    of_chain.add_argument("--mass", type=float, default=1.0)
    kinds.add_parser("humanoid")
    args = parser.parse_args()
    print(chain(args.links, args.length, args.mass) if args.kind == "chain" else humanoid(), end="")
