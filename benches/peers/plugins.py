"""Writes and builds the plug-ins for Siconos: plugins.py SCENES.json FOLDER."""

import itertools
import json
import os
import subprocess
import sys

import numpy as np


def planar(scene):
    """Whether a free body moves in the plane of x and z."""
    q, qd, normal = scene["q"], scene["qd"], scene["plane"]["normal"]
    return not any((q[1], q[3], q[5], qd[1], qd[3], qd[5], normal[1], scene["gravity"][1]))


def main(scenes, folder):
    os.makedirs(folder, exist_ok=True)
    with open(scenes) as file:
        scenes = json.load(file)
    here = os.path.dirname(os.path.abspath(__file__))
    for scene in scenes:
        base = os.path.join(folder, scene["name"])
        point, normal = (np.array(scene.get("plane", {}).get(key, [0, 0, 1.0])) for key in ("point", "normal"))
        numbers = lambda v: "{" + ", ".join(repr(float(x)) for x in v) + "}"
        text = f"static const double POINT[3] = {numbers(point)}, NORMAL[3] = {numbers(normal)};\n"
        if scene["box"] and planar(scene):
            x, _, z = np.array(scene["box"]) / 2
            text += f'#include "{here}/corner.c"\n'
            text += "".join(f"CORNER({k}, {float(a)!r}, {float(b)!r})\n" for k, (a, b) in enumerate(itertools.product((-x, x), (-z, z))))
        elif not scene["floating"] and len(scene["shapes"]) <= 1:
            import symbolic

            symbolic.write(scene["urdf"], base + ".robot.c", scene["gravity"])
            text = (f'#include "{os.path.abspath(base)}.robot.c"\n{text}'
                    f"static const double TANGENT[3] = {numbers(np.cross([0, 0, 1.0], normal))};\n"
                    f"static const double RADIUS = {scene['tip_radius']!r};\nenum {{ ROWS = {2 if scene['friction'] else 1} }};\n"
                    f'#include "{here}/plugin.c"\n')
        else:
            continue
        with open(base + ".c", "w") as file:
            file.write(text)
        subprocess.run(["gcc", "-O3", "-march=native", "-shared", "-fPIC", "-o", f"{base}Plugin.so", f"{base}.c", "-lm"], check=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
