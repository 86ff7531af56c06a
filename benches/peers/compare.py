"""Prints the difference of every line of peers.jsonl from carom: compare.py CAROM PEERS.jsonl SCENE.toml...

The differences are those of the joint velocities and of the kinetic energy right after the first impact, and of the joint
velocities at the end; each relative to the largest number of its kind in the result of carom, if that is not zero.
"""

import json
import os
import subprocess
import sys


def off(found, wanted):
    if found is None or len(found) != len(wanted):
        return None
    # At rest the difference itself.
    return max(abs(a - b) for a, b in zip(found, wanted)) / (max(map(abs, wanted)) or 1.0)


def show(value, width=10):
    return f"{value:{width}.1e}" if value is not None else "–".rjust(width)


def main(carom, lines, scenes):
    with open(lines) as file:
        lines = [json.loads(line) for line in file]
    print(f"{'scene':9} {'peer':10} {'method':34} {'parameter':9} {'value':>8} {'time, s':>10} {'qd⁺':>10} {'T⁺':>10} {'qd end':>10}  e obtained")
    for path in scenes:
        name = os.path.splitext(os.path.basename(path))[0]
        answer = json.loads(subprocess.run([carom, "simulate", path, "--json"], check=True, capture_output=True, text=True).stdout)
        impact = next((event for event in answer["events"] if event["kind"] == "impact"), None)
        for line in lines:
            if line["scene"] != name:
                continue
            head = f"{name:9} {line['peer']:10} {line['method'][:34]:34} {line['knob']:9} {line['value']:8.1e}"
            result = line["result"]
            if not result:
                print(head, " failed:", line.get("failure"))
                continue
            after, rebound, jump, energy = result.get("after_impact"), "", None, None
            if impact and after:
                jump = off(after["qd"], impact["qd_plus"])
                energy = off([after["kinetic_energy"]], [impact["impact"]["energy_after"]])
                minus, normal = impact["impact"]["u_minus"], impact["impact"]["impulse"]
                axis = max(range(3), key=lambda k: abs(normal[k]))
                rebound = f"{-after['tip_velocity'][axis] / minus[axis]:10.6f}"
            end = off(result["final"]["qd"], answer["final"]["qd"])
            print(head, show(line["wall_time_s"]), show(jump), show(energy), show(end), rebound)


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], sys.argv[3:])
