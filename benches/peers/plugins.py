"""Writes and builds the plug-ins for Siconos: plugins.py SCENES.json FOLDER."""

import json
import os
import subprocess
import sys

import numpy as np

import symbolic


def main(scenes, folder):
    os.makedirs(folder, exist_ok=True)
    with open(scenes) as file:
        scenes = json.load(file)
    here = os.path.dirname(os.path.abspath(__file__))
    for scene in scenes:
        if scene["floating"]:
            continue
        base = os.path.join(folder, scene["name"])
        symbolic.write(scene["urdf"], base + ".robot.c", scene["gravity"])
        point, normal = (np.array(scene.get("plane", {}).get(key, [0, 0, 1.0])) for key in ("point", "normal"))
        tangent = np.cross([0, 0, 1.0], normal)
        numbers = lambda v: "{" + ", ".join(repr(float(x)) for x in v) + "}"
        with open(base + ".c", "w") as file:
            file.write(f'#include "{os.path.abspath(base)}.robot.c"\n'
                       f"static const double POINT[3] = {numbers(point)}, NORMAL[3] = {numbers(normal)}, TANGENT[3] = {numbers(tangent)};\n"
                       f"static const double RADIUS = {scene['tip_radius']!r};\nenum {{ ROWS = {2 if scene['friction'] else 1} }};\n"
                       f'#include "{here}/plugin.c"\n')
        subprocess.run(["gcc", "-O3", "-march=native", "-shared", "-fPIC", "-o", f"{base}Plugin.so", f"{base}.c", "-lm"], check=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
