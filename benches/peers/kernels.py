"""The driver of `kernels`: makes cases, builds the peers' programs, checks that they agree, then times them in turn.

    kernels.py prepare FOLDER CAROM ROBOT...      (under the venv's Python)
    kernels.py time FOLDER ROUNDS SECONDS CAROM_BENCH CAROM_BENCH_NATIVE
"""

import json
import os
import random
import statistics
import subprocess
import sys

HERE = os.path.dirname(os.path.abspath(__file__))
# Straight-line code grows with the cube of the joints; beyond this it is no yardstick any more.
GENERATED_UP_TO = 7


def prepare(folder, carom, urdfs):
    import mujoco
    import numpy as np

    import symbolic
    import prepare as scenes

    os.makedirs(folder, exist_ok=True)
    chance = random.Random(20040)
    with open(f"{folder}/cases.txt", "w") as plain, open(f"{folder}/hinges.txt", "w") as full:
        for urdf in urdfs:
            name = os.path.splitext(os.path.basename(urdf))[0]
            inspected = subprocess.run([carom, "inspect", urdf, "--json"], check=True, capture_output=True, text=True).stdout
            order = [it["name"] for it in json.loads(inspected)["joints"] if it["type"] != "fixed"]
            robot, hinges = symbolic.Robot(urdf), scenes.hinges(urdf)
            place = [order.index(it) for it in robot.names]
            n = len(order)
            q, qd, tau = ([chance.uniform(-1, 1) for _ in range(n)] for _ in range(3))
            show = lambda them: " ".join(repr(float(x)) for x in np.ravel(them))
            plain.write(f"{name} {os.path.abspath(urdf)} {n} {show(q)} {show(qd)} {show(tau)}\n")
            full.write(f"{name} {os.path.abspath(urdf)} {n} {place[hinges['tip']['link']]} {show(hinges['tip']['at'])}\n")
            for wanted in range(n):
                it = hinges["links"][place.index(wanted)]
                parent = place[it["parent"]] if it["parent"] >= 0 else -1
                assert parent < wanted, "parents come first in carom's order"
                rest = [it[key] for key in ("turn", "shift", "axis", "mass", "centre", "inertia")] + [q[wanted], qd[wanted], tau[wanted]]
                full.write(f"{order[wanted]} {parent} " + " ".join(show(x) for x in rest) + "\n")
            spec = mujoco.MjSpec.from_file(urdf)
            for geom in list(spec.geoms):
                spec.delete(geom)
            spec.body("tip").add_site(name="tip")
            spec.option.gravity = [0, -9.81, 0]
            # Everything that isn't in the other programs: limits, constraints, damping.
            spec.option.disableflags = mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
            model = spec.compile()
            mujoco.mj_saveModel(model, f"{folder}/{name}.mjb")
            if n <= GENERATED_UP_TO:
                if robot.names != order:
                    raise SystemExit(f"{urdf}: the file's order of joints is not carom's, the generated code would be out of order")
                symbolic.write(urdf, f"{folder}/{name}.c", [0, -9.81, 0])


def build(folder):
    """The peers' programs, each as (label, flags, version, argument list); who can't be built is named with the reason."""
    from importlib.metadata import version

    site = os.path.dirname(os.path.dirname(__import__("mujoco").__file__))
    library = next(it for it in os.listdir(f"{site}/mujoco") if it.startswith("libmujoco.so"))
    include = f"{site}/cmeel.prefix/include"
    made, jobs = [], [
        ("mujoco", "-O3", version("mujoco"), ["gcc", "-O3", f"{HERE}/c/mujoco.c", f"-I{site}/mujoco/include",
         f"{site}/mujoco/{library}", f"-Wl,-rpath,{site}/mujoco", "-lm"], [f"{folder}/hinges.txt", folder]),
    ]
    for flags in (["-O3"], ["-O3", "-march=native"]):
        tail = "-native" if len(flags) > 1 else ""
        jobs.append((f"pinocchio{tail}", " ".join(flags), version("pin"), ["g++", "-std=c++17", "-DNDEBUG", *flags,
                     # Pinocchio's joints are a variant of more kinds than Boost's lists are written out for.
                     "-DBOOST_MPL_CFG_NO_PREPROCESSED_HEADERS", "-DBOOST_MPL_LIMIT_LIST_SIZE=30", "-DBOOST_FUSION_INVOKE_MAX_ARITY=12", f"{HERE}/c/pinocchio.cpp",
                     f"-I{include}", f"-I{include}/eigen3"], [f"{folder}/hinges.txt"]))
    for label, flags, release, command, arguments in jobs:
        program = f"{os.path.abspath(folder)}/{label}"
        source = next(it for it in command if it.endswith((".c", ".cpp")))
        if not os.path.exists(program) or os.path.getmtime(program) < os.path.getmtime(source):
            print(f"building {label}", flush=True)
            done = subprocess.run([*command, "-o", program], capture_output=True, text=True)
            if done.returncode:
                first = next((it for it in done.stderr.splitlines() if "error" in it), done.stderr.strip()[:200])
                print(f"could not build {label}: {first}")
                continue
        made.append((label, flags, release, lambda s, p=program, a=arguments, l=label: [p, *a, s, l]))
    for file in sorted(os.listdir(folder)):
        if file.endswith(".c"):
            robot = file[:-2]
            program = f"{os.path.abspath(folder)}/generated-{robot}"
            subprocess.run(["gcc", "-O3", "-march=native", f'-DROBOT_C="{os.path.abspath(folder)}/{file}"', f"{HERE}/c/generated.c",
                            "-o", program, "-lm"], check=True)
            made.append((f"generated-{robot}", "-O3 -march=native", f"CasADi {version('casadi')}",
                         lambda s, p=program, r=robot: [p, f"{folder}/hinges.txt", s, "generated", r]))
    return made


def one_round(programs, seconds):
    for label, flags, release, command in programs:
        done = subprocess.run(command(str(seconds)), capture_output=True, text=True)
        if done.returncode:
            print(f"{label} ended with status {done.returncode}: {done.stderr.strip()[:200]}")
        for line in done.stdout.splitlines():
            name, kernel, robot, nanoseconds, *numbers = line.split()
            yield (kernel, robot, name), float(nanoseconds), [float(x) for x in numbers], flags, release


def time(folder, rounds, seconds, carom, native):
    programs = [
        ("carom", "release", "this tree", lambda s: [carom, f"{folder}/cases.txt", s, "carom"]),
        ("carom-native", "release, target-cpu=native", "this tree", lambda s: [native, f"{folder}/cases.txt", s, "carom-native"]),
        *build(folder),
    ]
    answers, worst = {}, 0.0
    for (kernel, robot, name), _, numbers, _, _ in one_round(programs, 0.0):
        if name == "carom":
            answers[kernel, robot] = numbers
        elif numbers:
            ours = answers[kernel, robot]
            off = max(abs(a - b) for a, b in zip(ours, numbers)) / max(map(abs, ours))
            worst = max(worst, off)
            # Solving with M costs its condition number, which in a chain grows with the fourth power of the links.
            limit = 1e-8 if robot == "chain100" else 1e-10
            if len(ours) != len(numbers) or not off < limit:
                raise SystemExit(f"{name} disagrees on {kernel} of {robot} by {off:.1e} of the largest: nothing is timed")
    print(f"all agree within {worst:.1e} of the largest number of each answer")
    samples, about = {}, {}
    for k in range(rounds):
        for key, nanoseconds, _, flags, release in one_round(programs, seconds):
            samples.setdefault(key, []).append(nanoseconds)
            about[key] = flags, release
    with open(f"{folder}/../kernels.jsonl", "w") as file:
        for (kernel, robot, name), them in samples.items():
            flags, release = about[kernel, robot, name]
            file.write(json.dumps({"kernel": kernel, "robot": robot, "peer": name, "version": release, "flags": flags,
                                   "median_ns": statistics.median(them), "repeats": len(them), "least_ns": min(them)}) + "\n")
    names = list(dict.fromkeys(name for _, _, name in samples))
    print("\nMedian ns, and in brackets the median over the rounds of the ratio to carom (above 1: carom is faster).\n")
    print("| kernel | robot | " + " | ".join(names) + " |\n| --- | --- |" + " --- |" * len(names))
    for kernel, robot in dict.fromkeys((kernel, robot) for kernel, robot, _ in samples):
        cells = []
        for name in names:
            them, ours = samples.get((kernel, robot, name)), samples[kernel, robot, "carom"]
            # A round's samples were taken one after the other: what slows the machine slows both.
            cells.append("–" if not them else f"{statistics.median(them):.0f} ({statistics.median(a / b for a, b in zip(them, ours)):.2f})")
        print(f"| {kernel} | {robot} | " + " | ".join(cells) + " |")


if __name__ == "__main__":
    if sys.argv[1] == "prepare":
        prepare(sys.argv[2], sys.argv[3], sys.argv[4:])
    else:
        time(sys.argv[2], int(sys.argv[3]), float(sys.argv[4]), *sys.argv[5:7])
