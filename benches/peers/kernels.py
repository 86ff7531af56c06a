"""Driver of `kernels`: writes the cases, builds the programs, checks that their results agree, then times them in turn.

    kernels.py prepare FOLDER CAROM ROBOT...      (under the venv's Python)
    kernels.py time FOLDER ROUNDS SECONDS CAROM_BENCH CAROM_BENCH_NATIVE CRATES CRATES_NATIVE
"""

import json
import os
import platform
import random
import statistics
import subprocess
import sys
from importlib.metadata import version

HERE = os.path.dirname(os.path.abspath(__file__))
# Straight-line code grows with the cube of the number of joints; it is compared up to this number.
GENERATED_UP_TO = 7
STATES = 16
BUILDS = {"plain": "without flags for the processor", "native": "`target-cpu=native`, `-march=native`"}
COLUMNS = {
    "carom": "carom",
    "closed-form": "closed form by hand",
    "generated": "CasADi's C",
    "pinocchio": "Pinocchio",
    "mujoco": "MuJoCo",
    "dynibo": "dynibo",
    "featherstone": "featherstone (f32)",
    "rapier": "rapier",
}
KERNELS = {
    "chain": "chain",
    "batch-all": "chain, batch",
    "batch": "jump, batch",
    "mass": "M",
    "inverse": "inverse dynamics",
    "forward": "forward dynamics",
}
# Largest difference of a result, relative to the largest number of its state.
TOLERANCE = {"closed-form": 1e-12, "featherstone": 1e-3}

# A program had the whole core if, before and after it, the throughput of additions was at least this share of the full
# throughput. The full throughput is the 90 % quantile of the measurements, since single values are far too high.
ALONE = 0.85
ALL_BUT = 0.1


def prepare(folder, carom, urdfs):
    import mujoco
    import numpy as np

    import prepare as scenes
    import symbolic

    os.makedirs(folder, exist_ok=True)
    chance = random.Random(20040)
    with open(f"{folder}/cases.txt", "w") as plain, open(f"{folder}/hinges.txt", "w") as full:
        for urdf in urdfs:
            name = os.path.splitext(os.path.basename(urdf))[0]
            inspected = subprocess.run([carom, "inspect", urdf, "--json"], check=True, capture_output=True, text=True).stdout
            order = [it["name"] for it in json.loads(inspected)["joints"] if it["type"] != "fixed"]
            robot, hinges = symbolic.Robot(urdf), scenes.hinges(urdf)
            tip = hinges["places"]["tip"]
            place = [order.index(it) for it in robot.names]
            n = len(order)
            # q, q̇, and q̈ (inverse dynamics) or τ (forward dynamics).
            states = [[[chance.uniform(-1, 1) for _ in range(n)] for _ in range(3)] for _ in range(STATES)]
            show = lambda them: " ".join(repr(float(x)) for x in np.ravel(them))
            plain.write(f"{name} {os.path.abspath(urdf)} {n} {STATES}\n{show(states)}\n")
            full.write(f"{name} {n} {STATES} {place[tip['link']]} {show(tip['shift'])}\n")
            for wanted in range(n):
                it = hinges["links"][place.index(wanted)]
                parent = place[it["parent"]] if it["parent"] >= 0 else -1
                assert parent < wanted, "parents come first in carom's order"
                rest = [it[key] for key in ("turn", "shift", "axis", "mass", "centre", "inertia")]
                full.write(f"{order[wanted]} {parent} " + " ".join(show(x) for x in rest) + "\n")
            full.writelines(show(row) + "\n" for state in states for row in state)
            spec = mujoco.MjSpec.from_file(urdf)
            for geom in list(spec.geoms):
                spec.delete(geom)
            spec.body("tip").add_site(name="tip")
            spec.option.gravity = [0, -9.81, 0]
            # Disables what the other programs do not compute: limits and other constraints.
            spec.option.disableflags = mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
            mujoco.mj_saveModel(spec.compile(), f"{folder}/{name}.mjb")
            if n <= GENERATED_UP_TO:
                if robot.names != order:
                    raise SystemExit(f"{urdf}: the order of the joints in the file differs from that of carom, which the generated code needs")
                symbolic.write(urdf, f"{folder}/{name}.c", [0, -9.81, 0])


class Program:
    """A program to be timed: the lines it prints name the peer (its column) and the kernel."""

    def __init__(self, build, command, robots=None):
        self.build, self.command, self.robots = build, command, robots

    def lines(self, robot, seconds):
        """(peer, kernel, nanoseconds, numbers) of each line."""
        done = subprocess.run(self.command(robot, str(seconds)), capture_output=True, text=True)
        if done.returncode:
            raise SystemExit(f"{self.command(robot, seconds)} ended with status {done.returncode}: {done.stderr.strip()[:500]}")
        for line in done.stdout.splitlines():
            peer, kernel, nanoseconds, *numbers = line.split()
            yield peer, kernel, float(nanoseconds), [float(x) for x in numbers]


def compiled(folder):
    """Builds the C and C++ programs, two at a time; returns them, and those that cannot be built with the reason."""
    site = os.path.dirname(os.path.dirname(__import__("mujoco").__file__))
    library = next(it for it in os.listdir(f"{site}/mujoco") if it.startswith("libmujoco.so"))
    include = f"{site}/cmeel.prefix/include"
    hinges, folder = f"{folder}/hinges.txt", os.path.abspath(folder)
    # The library of the wheel is compiled already, so there is one build of it.
    jobs = [("mujoco", None, ["gcc", "-O3", f"{HERE}/c/mujoco.c", f"-I{site}/mujoco/include", f"{site}/mujoco/{library}",
                              f"-Wl,-rpath,{site}/mujoco", "-lm"], None,
             lambda p: lambda robot, s: [p, hinges, robot, s, "mujoco", folder])]
    for build, flags in (("plain", ["-O3"]), ("native", ["-O3", "-march=native"])):
        jobs.append((f"pinocchio-{build}", build, ["g++", "-std=c++17", "-DNDEBUG", *flags,
                     # The variant of joint types is longer than the default limit of the lists of Boost.
                     "-DBOOST_MPL_CFG_NO_PREPROCESSED_HEADERS", "-DBOOST_MPL_LIMIT_LIST_SIZE=30", "-DBOOST_FUSION_INVOKE_MAX_ARITY=12",
                     f"{HERE}/c/pinocchio.cpp", f"-I{include}", f"-I{include}/eigen3"], None,
                     lambda p: lambda robot, s: [p, hinges, robot, s, "pinocchio"]))
        for file in sorted(it for it in os.listdir(folder) if it.endswith(".c")):
            jobs.append((f"generated-{build}-{file[:-2]}", build, ["gcc", *flags, f'-DROBOT_C="{folder}/{file}"',
                         f"{HERE}/c/generated.c", "-lm"], file[:-2],
                         lambda p: lambda robot, s: [p, hinges, robot, s, "generated"]))
    programs, missing, running = [], [], []

    def finish():
        label, process = running.pop(0)
        _, errors = process.communicate()
        if process.returncode:
            first = next((it for it in errors.splitlines() if "error" in it), errors.strip()[:200])
            missing.append(f"{label}: could not be built: {first}")

    for label, build, command, robot, arguments in jobs:
        program = f"{folder}/{label}"
        sources = [f"{HERE}/c/common.h", *(it for it in command if it.endswith((".c", ".cpp"))), *([f"{folder}/{robot}.c"] if robot else [])]
        if not os.path.exists(program) or os.path.getmtime(program) < max(map(os.path.getmtime, sources)):
            if len(running) > 1:
                finish()
            print(f"building {label}", flush=True)
            running.append((label, subprocess.Popen([*command, "-o", program], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)))
        programs.append((label, Program(build, arguments(program), robot and {robot})))
    while running:
        finish()
    broken = {it.split(":")[0] for it in missing}
    return [program for label, program in programs if label not in broken], missing


def gauge(folder):
    """A function that measures how many additions the core makes in the time of a dependent one (c/core.c)."""
    subprocess.run(["gcc", "-O2", f"{HERE}/c/core.c", "-o", f"{folder}/core"], check=True)
    return lambda: float(subprocess.run([f"{folder}/core"], check=True, capture_output=True, text=True).stdout)


def whole(core):
    """The throughput of the whole core."""
    return sorted(core)[int((1 - ALL_BUT) * len(core))]


def agree(programs, robots):
    """Stops if the results of a program differ from those of carom. Returns the largest difference of each peer, and the kernels
    that are left out because single precision is not sufficient."""
    worst, left_out = {}, []
    for robot in robots:
        ours = {}
        for program in programs:
            if program.robots and robot not in program.robots:
                continue
            for peer, kernel, _, numbers in program.lines(robot, 0):
                if kernel not in ours:
                    ours[kernel] = numbers
                # Relative to each state, so that states of small numbers count as much as others.
                reference = ours[kernel]
                size = len(reference) // (1 if kernel.startswith("batch") else STATES)
                parts = [(reference[i : i + size], numbers[i : i + size]) for i in range(0, len(reference), size)]
                if len(numbers) != len(reference):
                    raise SystemExit(f"{peer} gives {len(numbers)} numbers for {kernel} of {robot}: {len(reference)} are expected")
                off = max(max(abs(a - b) for a, b in zip(x, y)) / max(map(abs, x)) for x, y in parts)
                # The error of a solve with M grows with its condition number, which for a chain grows as the fourth power of n.
                limit = TOLERANCE.get(peer, 1e-8 if robot == "chain100" else 1e-10)
                if off < limit:
                    worst[peer] = max(worst.get(peer, 0), off)
                elif peer == "featherstone":
                    left_out.append((peer, kernel, robot, off))
                else:
                    raise SystemExit(f"{peer} ({program.build}) differs on {kernel} of {robot} by {off:.1e} of the largest number: nothing is timed")
    return worst, left_out


def shown(nanoseconds):
    digits = 1 if nanoseconds < 100 else 0
    return f"{nanoseconds:.{digits}f} ns" if nanoseconds < 9999.5 else f"{nanoseconds / 1000:.1f} µs"


class Samples:
    """The times of one kernel; `alone`: those measured with the whole core."""

    ENOUGH = 3

    def __init__(self):
        self.every, self.alone = [], []

    def add(self, nanoseconds, alone):
        self.every.append(nanoseconds)
        if alone:
            self.alone.append(nanoseconds)

    def few(self):
        return len(self.alone) < self.ENOUGH

    def median(self):
        return statistics.median(self.every if self.few() else self.alone)

    def ratio(self, ours):
        """The ratio to our time, both from samples of the same kind."""
        if self.few() or ours.few():
            return statistics.median(self.every) / statistics.median(ours.every)
        return self.median() / ours.median()


def tables(samples, kernels, robots):
    """The tables of times and ratios as Markdown."""
    for build, how in BUILDS.items():
        peers = [it for it in COLUMNS if any(key[0] in (build, None) and key[3] == it for key in samples)]
        yield f"\nBuilt {how}:\n"
        yield "| kernel | robot | " + " | ".join(COLUMNS[it] for it in peers) + " |"
        yield "| --- | --- |" + " --- |" * len(peers)
        for kernel, name in KERNELS.items():
            for robot in robots:
                ours = samples.get((build, kernel, robot, "carom"))
                if not ours:
                    continue
                cells = [shown(ours.median())]
                for peer in peers[1:]:
                    them = samples.get((build, kernel, robot, peer)) or samples.get((None, kernel, robot, peer))
                    cells.append(f"{shown(them.median())} ({them.ratio(ours):.2f})" if them else "–")
                yield f"| {name} | {robot} | " + " | ".join(cells) + " |"
    yield "\n| checked strike in space, and with all its derivatives | " + " | ".join(BUILDS.values()) + " |\n| --- | --- | --- |"
    for robot in robots:
        cells = []
        for build in BUILDS:
            strike, both = (samples.get((build, it, robot, "carom")) for it in ("strike", "derivative"))
            if both:
                cells.append(f"{shown(strike.median())}, {shown(both.median())} ({both.ratio(strike):.2f})")
        if cells:
            yield f"| {robot} | " + " | ".join(cells) + " |"


def first_line(*command):
    done = subprocess.run(command, capture_output=True, text=True)
    return done.stdout.splitlines()[0] if done.returncode == 0 and done.stdout else "unknown"


def foot(rounds, seconds, load, core, samples, worst, missing, versions):
    cpu = next((it.split(":")[1].strip() for it in open("/proc/cpuinfo") if it.startswith("model name")), platform.processor())
    yield f"\nMedians over {rounds} rounds of {seconds} s each; in brackets their ratio to the time of carom in the same build (above 1: carom is faster).\n"
    yield f"- Machine: {cpu}, {os.cpu_count()} cores, {platform.system()} {platform.release()}; load before and after {load[0]:.1f}, {load[1]:.1f}."
    every, alone = sum(len(it.every) for it in samples.values()), sum(len(it.alone) for it in samples.values())
    yield (f"- Independent additions of the core in the time of a dependent one, measured before and after each program: 90 % quantile "
           f"{whole(core):.1f}, median {statistics.median(core):.1f}. Samples with at least {ALONE} of the quantile before and after had the "
           f"whole core: {alone} of {every}. Only these count, except in the {sum(it.few() for it in samples.values())} of {len(samples)} "
           f"cells with fewer than {Samples.ENOUGH} of them, where all samples count.")
    yield f"- carom: commit {first_line('git', 'describe', '--always', '--dirty')}, {first_line('rustc', '--version')}, release profile."
    yield f"- C and C++: {first_line('gcc', '--version')}, `-O3`. " + ", ".join(f"{COLUMNS[peer]} {what}" for peer, what in versions.items()) + "."
    answers = ", ".join(f"{COLUMNS[it]} {off:.0e}" for it, off in worst.items() if it != "carom")
    yield f"- Largest differences from carom, relative to the largest number of a state: {answers}."
    if "dynibo" in worst:
        yield "- dynibo has gravity of 9.80665 m/s² along −z only: its fixed base is rotated, and time is scaled to 9.81 m/s², outside the measured time."
    yield from (f"- Left out: {it}." for it in missing)


def time(folder, rounds, seconds, carom, carom_native, crates, crates_native):
    programs = [
        Program(build, lambda robot, s, p=path: [p, f"{folder}/cases.txt", robot, s, "carom"])
        for build, path in (("plain", carom), ("native", carom_native))
    ]
    c_programs, missing = compiled(folder)
    programs += c_programs
    for build, path in (("plain", crates), ("native", crates_native)):
        if os.path.exists(path):
            programs.append(Program(build, lambda robot, s, p=path: [p, f"{folder}/hinges.txt", f"{folder}/cases.txt", robot, s]))
        else:
            missing.append(f"dynibo, featherstone and rapier ({build}): could not be built")
    with open(f"{folder}/cases.txt") as file:
        robots = [line.split()[0] for line in list(file)[::2]]
    worst, wrong = agree(programs, robots)
    missing += [f"{COLUMNS[peer]}, {kernel} of {robot}: differs by {off:.0e}" for peer, kernel, robot, off in dict.fromkeys(wrong)]
    wrong = {it[:3] for it in wrong}
    taken, load, core, filled = [], [os.getloadavg()[0]], [], gauge(folder)
    for turn in range(rounds):
        print(f"round {turn + 1} of {rounds}", file=sys.stderr, flush=True)
        for robot in robots:
            # Each round begins with the next program.
            for program in programs[turn % len(programs) :] + programs[: turn % len(programs)]:
                if program.robots and robot not in program.robots:
                    continue
                core.append(filled())
                for peer, kernel, nanoseconds, _ in program.lines(robot, seconds):
                    if (peer, kernel, robot) not in wrong:
                        taken.append(((program.build, kernel, robot, peer), nanoseconds, len(core)))
    core.append(filled())
    load.append(os.getloadavg()[0])
    samples = {}
    full = whole(core)
    for key, nanoseconds, after in taken:
        alone = min(core[after - 1], core[after]) >= ALONE * full
        samples.setdefault(key, Samples()).add(nanoseconds, alone)
    versions = {"mujoco": f"{version('mujoco')} (the wheel's library)", "pinocchio": f"{version('pin')} (headers)",
                "generated": f"{version('casadi')} (by gcc)", "dynibo": "0.5.2", "featherstone": "0.1.0", "rapier": "0.36.1, f64"}
    with open(f"{folder}/../kernels.jsonl", "w") as file:
        for (build, kernel, robot, peer), them in samples.items():
            file.write(json.dumps({"kernel": kernel, "robot": robot, "peer": peer, "version": versions.get(peer, "this commit"), "build": build,
                                   "median_ns": them.median(), "least_ns": min(them.every), "alone": len(them.alone), "repeats": len(them.every)}) + "\n")
    text = "\n".join([*tables(samples, KERNELS, robots), *foot(rounds, seconds, load, core, samples, worst, missing, versions)]) + "\n"
    with open(f"{folder}/../kernels.md", "w") as file:
        file.write(text)
    print(text, end="")


if __name__ == "__main__":
    if sys.argv[1] == "prepare":
        prepare(sys.argv[2], sys.argv[3], sys.argv[4:])
    else:
        time(sys.argv[2], int(sys.argv[3]), float(sys.argv[4]), *sys.argv[5:9])
