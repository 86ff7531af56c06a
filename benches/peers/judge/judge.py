"""Judges engines: sends the cases to adapters, evaluates the invariants and writes verdicts. See README.md.

    judge.py [--gradients] [--engine NAME...] [--case NAME...] [--settings default|best] [--adapter "COMMAND"] [--out FILE.json]
"""

import argparse
import copy
import json
import math
import os
import queue
import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor

import numpy as np

import closed
import derivatives
from mechanics import Moment

HERE = os.path.dirname(os.path.abspath(__file__))
EXACT, TOLERANCE = 1e-9, 1e-3
REFINE = 8  # a step so many times smaller must at least halve an error beyond the tolerance, or the verdict is `fails`
PATIENCE = 1200  # an adapter that does not answer for so long is ended, s
SETTINGS = ("default", "best")
# Programs for GPUs take milliseconds for a step on the CPU: there they are judged by cases that simulate at most so long in all, s.
SLOW, SHORT = ("newton", "mujoco-warp"), 2.0


def adapters():
    """The command of each engine. Environment: PYTHON (with the engines of the Python registry), RAPIER (program)."""
    python = os.environ.get("PYTHON", sys.executable)
    here = lambda name: os.path.join(HERE, name)
    found = {name: [python, here(f"with_{name.split('-')[-1].removeprefix('py')}.py")] for name in
             ("carom", "mujoco", "drake", "pybullet", "dart", "pinocchio", "mjx", "mujoco-warp", "newton")}
    found["drake-discrete"] = [*found["drake"], "--discrete"]
    found["drake-cenic"] = [*found["drake"], "--cenic"]
    found["siconos"] = ["/usr/bin/python3", here("with_siconos.py")]
    found["rapier"] = [os.environ.get("RAPIER", "target/peers/rapier/release/judge")]
    return found


ORDER = ("carom", "siconos", "pinocchio", "drake", "drake-discrete", "drake-cenic", "mujoco", "mjx", "mujoco-warp", "newton", "pybullet",
         "dart", "rapier")


class Adapter:
    """A program that answers a line for each line. It is started again if it ends or does not answer."""

    def __init__(self, command):
        self.command, self.process = command, None

    def ask(self, request):
        if self.process is None or self.process.poll() is not None:
            self.process = subprocess.Popen(self.command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
            self.lines = queue.Queue()
            threading.Thread(target=self.read, args=(self.process, self.lines), daemon=True).start()
        try:
            self.process.stdin.write(json.dumps(request) + "\n")
            self.process.stdin.flush()
            line = self.lines.get(timeout=PATIENCE)
        except BrokenPipeError:
            line = ""
        except queue.Empty:
            line = None
        if line:
            return json.loads(line)
        self.close()
        return {"failed": f"no answer within {PATIENCE} s" if line is None else f"the program ended with status {self.process.returncode}"}

    @staticmethod
    def read(process, lines):
        for line in process.stdout:
            if line.startswith("{"):  # the rest is what a library prints
                lines.put(line)
        process.wait()
        lines.put("")

    def close(self):
        if self.process is not None:
            self.process.kill()
            self.process.wait()


def chain(spec):
    """The shorthand {"links": N, "length": m, "mass": kg}: equal rods in a row along x, hinged about z, pinned at the origin;
    a sphere of `radius` at the end."""
    n = spec["links"]
    length, mass = spec["length"] / n, spec["mass"] / n
    bodies = []
    for k in range(n):
        bodies.append({"name": f"link{k + 1}", "parent": f"link{k}" if k else None, "joint": "hinge",
                       "at": [length if k else 0, 0, 0], "axis": [0, 0, 1], "mass": mass, "centre": [length / 2, 0, 0],
                       "inertia": [1e-6, mass * length**2 / 12, mass * length**2 / 12]})
    bodies[-1]["shapes"] = [{"sphere": spec["radius"], "at": [length, 0, 0]}]
    return bodies


def scene_of(case, run):
    """The scene of a run: that of the case with the run's changes; keys are paths such as `contact.restitution` or `bodies.0.mass`."""
    scene = copy.deepcopy(case["scene"])
    for path, value in run.get("change", {}).items():
        *way, last = path.split(".")
        at = scene
        for key in way:
            at = at[int(key)] if isinstance(at, list) else at[key]
        at[int(last) if isinstance(at, list) else last] = value
    if "chain" in scene:
        scene["bodies"] = chain(scene.pop("chain"))
        n = len(scene["bodies"])
        scene["start"] = {key: (values + [0.0] * n)[:n] for key, values in scene["start"].items()}
    if "force" in scene:
        scene["force"]["pieces"] = [scene["force"]["each"]] * scene["force"]["pieces"]
    scene.setdefault("planes", [])
    scene.setdefault("pairs", [])
    return scene


def bounce(h, e, g, t):
    """Height of the lowest point of a ball dropped from h, at time t: parabolas, each e² as high as the one before."""
    speed, left = math.sqrt(2 * g * h), t - math.sqrt(2 * h / g)
    if left < 0:
        return h - g * t * t / 2
    for _ in range(10_000):
        speed *= e
        flight = 2 * speed / g
        if flight < 1e-12:
            return 0.0
        if left < flight:
            return speed * left - g * left**2 / 2
        left -= flight
    return 0.0


MATHS = {name: getattr(math, name) for name in ("sqrt", "sin", "cos", "asin", "pi", "hypot", "log")} | {
    "abs": abs, "max": max, "min": min, "sum": sum, "range": range, "norm": np.linalg.norm, "array": np.array, "bounce": bounce} | {
    name: getattr(closed, name) for name in ("steered", "jacobi", "quarter", "near", "planar_impact")}


class Seen:
    """What an engine answered to one run, under the names that measures use. Index k is the k-th asked time; 0 is the start."""

    def __init__(self, scene, states):
        moments = [Moment(scene, state["q"], state["qd"]) for state in [scene["start"], *states]]
        self.names = {"t": [0.0, *(state["t"] for state in states)], "m": [body["mass"] for body in scene["bodies"]],
                      "g": float(np.linalg.norm(scene["gravity"])), "e": scene["contact"]["restitution"], "mu": scene["contact"]["friction"]}
        for key in ("q", "qd", "T", "V", "P", "L"):
            self.names[key] = [getattr(moment, key) for moment in moments]
        self.names["point"] = lambda k, body, at: moments[k].point(body, at)
        self.names["axis"] = lambda k, body, axis: moments[k].axis(body, axis)

    def __getattr__(self, name):
        return self.names[name]


def evaluate(expected, names):
    """One expectation: its measured and expected value, and the error as a share of `scale`."""
    names = dict(MATHS, **names)
    for name, formula in expected.get("let", {}).items():
        names[name] = eval(str(formula), names)
    got = eval(expected["measure"], names)
    kind = next(key for key in ("value", "at_most", "at_least") if key in expected)
    value, scale = (eval(str(formula), names) for formula in (expected[kind], expected.get("scale", 1)))
    difference = np.max(np.abs(np.asarray(got) - value)) if kind == "value" else max(0.0, got - value if kind == "at_most" else value - got)
    plain = lambda x: np.asarray(x, float).tolist()
    return {"name": expected["name"], "got": plain(got), kind: plain(value), "error": float(difference / scale)}


def figure_of(case, runs, answers):
    """All expectations of the runs that are there, as rows, and the largest error."""
    rows, seen = [], {}
    for run, answer in zip(runs, answers):
        seen[run["run"]] = Seen(scene_of(case, run), answer["states"])
        names = dict(seen[run["run"]].names, **run.get("with", {}))
        for expected in case.get("expect", []) + run.get("expect", []):
            rows.append(dict(evaluate(expected, names), run=run["run"]))
    for expected in case.get("across", []):
        rows.append(dict(evaluate(expected, {"of": lambda name: seen[name]}), run="all"))
    return rows, max((row["error"] for row in rows), default=None)


def judge(case, adapter, settings):
    """The verdict on one case with one setting."""
    def ask(run, step=None):
        request = {"id": f"{case['case']}/{run['run']}", "settings": settings, "scene": scene_of(case, run), "times": run["times"]}
        step = step or run.get("step")
        return adapter.ask(request | ({"step": step} if step else {}))

    found = {"case": case["case"], "settings": settings}
    runs, answers, refused = [], [], []
    for run in case["runs"]:
        answer = ask(run)
        if "no answer within" in answer.get("failed", ""):
            refused.append(f"{run['run']}: {answer['failed']}")  # too slow to tell is no error of the engine
        elif "failed" in answer:
            return found | {"verdict": "fails", "figure": None, "reason": f"{run['run']}: {answer['failed']}"}
        elif "refused" in answer:
            refused.append(f"{run['run']}: {answer['refused']}")
        else:
            runs.append(run)
            answers.append(answer)
    if refused:
        # What it answered is told beside the refusal.
        rows, figure = figure_of({key: case[key] for key in case if key != "across"}, runs, answers)
        return found | {"verdict": "refused", "figure": figure, "answered": len(runs), "runs": len(case["runs"]), "reason": refused[0], "rows": rows}
    rows, figure = figure_of(case, runs, answers)
    found |= {"figure": figure, "used": answers[-1].get("used", {}), "rows": rows}
    if not math.isfinite(figure):
        return found | {"verdict": "fails", "figure": None, "reason": "a measure is not finite"}
    if figure <= TOLERANCE:
        return found | {"verdict": graded(figure, None)}
    # Beyond the tolerance: does a smaller step help?
    steps = [answer.get("used", {}).get("step") for answer in answers]
    if None in steps:
        return found | {"verdict": "fails", "reason": "the method has no step to refine"}
    if any("step" in run for run in case["runs"]):
        least = case["runs"][int(np.argmin(steps))]["run"]
        refined = max(row["error"] for row in rows if row["run"] == least)
    else:
        finer = [ask(run, step / REFINE) for run, step in zip(case["runs"], steps)]
        silent = next((answer for answer in finer if "states" not in answer), None)
        if silent is not None:
            why = silent.get("failed", silent.get("refused"))
            # Too slow to tell is not an error of the engine.
            return found | {"verdict": "degrades" if "no answer within" in why else "fails", "reason": f"with a step {REFINE} times smaller: {why}"}
        refined = figure_of(case, case["runs"], finer)[1]
    return found | {"verdict": graded(figure, refined), "refined": refined}


def graded(figure, refined):
    """The verdict from the error, and from that with a smaller step: None if there is no step, nan if it took too long."""
    if figure <= TOLERANCE:
        return "exact" if figure <= EXACT else "within tolerance"
    return "degrades" if refined is not None and not refined > figure / 2 else "fails"


def gradients(case, adapter):
    """The verdict on the derivatives of one case, with the best settings; beside them the engine's own differences and times.

    The error is that against the closed form, as a share of the largest derivative, or without one against the engine's own
    differences: `far`, over the case's `width` with a smaller step, where it has a step. `own` is the error against differences at the
    same step over a distance so short that the discretisation does not jump in it: are the derivatives those of the engine's program?
    """
    scene = scene_of(case, {})
    start = derivatives.point_of(scene, case["by"])
    probes = case.get("probe", range(len(start)))

    def ask(width, step=None, repeats=3):
        moved = [start + sign * width * np.eye(len(start))[k] for k in probes for sign in (1, -1)]
        request = {"id": case["case"], "settings": "best", "scene": scene, "times": [case["time"]], "of": case["of"], "by": case["by"],
                   "at": [list(point) for point in [start, *moved]], "repeats": repeats}
        answer = adapter.ask(request | ({"step": step} if step else {}))
        if "values" in answer:
            values = np.array(answer["values"][1:])
            answer["differences"] = ((values[::2] - values[1::2]) / (2 * width)).tolist()
        return answer

    def error(got, expected):
        return float(np.max(np.abs(np.array(got) - expected)) / np.max(np.abs(expected)))

    found = {"case": case["case"], "settings": "best"}
    names = dict(MATHS)
    for name, formula in case.get("let", {}).items():
        names[name] = eval(formula, names)
    answer = ask(1e-6)
    if "values" not in answer:
        reason = answer.get("refused", answer.get("failed", "its adapter has no derivatives"))
        kind = "fails" if "failed" in answer and "no answer within" not in reason else "refused"
        return found | {"verdict": kind, "figure": None, "reason": reason}
    if answer["used"].get("precision") == "single":
        answer |= {"differences": ask(1e-4, repeats=1)["differences"]}  # less is lost in rounding
    own = error(np.array(answer["gradient"])[list(probes)], answer["differences"])
    step = answer["used"].get("step")
    finer = ask(case["width"], step / REFINE, repeats=1) if step else answer
    far = finer.get("differences")
    expected = np.array(eval(case["derivative"], names)) if "derivative" in case else None if far is None else np.array(far)
    found |= {key: answer[key] for key in ("method", "used", "seconds")}
    found |= {"value": answer["values"][0], "gradient": answer["gradient"], "differences": answer["differences"], "own": own, "far": far}
    if "value" in case:
        found["value error"] = abs(answer["values"][0] - eval(case["value"], names))
    if expected is None:
        return found | {"verdict": "refused", "figure": None, "reason": f"with a step {REFINE} times smaller: {finer.get('failed', finer.get('refused'))}"}
    figure, refined = error(answer["gradient"], expected), None
    if step:
        refined = error(finer["gradient"], expected) if "gradient" in finer else math.nan
        if math.isfinite(refined):
            found["refined"] = refined
        else:
            found["not refined"] = finer.get("failed", finer.get("refused"))
    return found | {"verdict": graded(figure, refined), "figure": figure, "expected": expected.tolist()}


def cases(only, gradients=False):
    found = []
    for name in sorted(os.listdir(os.path.join(HERE, "cases"))):
        if name.endswith(".json"):
            with open(os.path.join(HERE, "cases", name)) as file:
                found += [case for case in json.load(file) if ("of" in case) == gradients]
    names = [case["case"] for case in found]
    for name in only or []:
        if name not in names:
            sys.exit(f"no case {name!r}; the cases are {', '.join(names)}")
    return sorted((case for case in found if not only or case["case"] in only), key=lambda case: case["number"])


def judged(engine, command, chosen, settings, shown, one=judge):
    """All verdicts on one engine, or the reason why its adapter does not start; progress on standard error unless all is `shown` later."""
    adapter = Adapter(command)
    try:
        about = adapter.ask({"about": True, "id": "about"})
        if "engine" not in about:
            return {"engine": engine, "missing": about.get("failed", "no answer to about")}, []
        about = dict(about, engine=engine)
        about.pop("id", None)
        found = []
        for case in chosen:
            if engine in SLOW and sum(run["times"][-1] for run in case.get("runs", [])) > SHORT:
                continue
            for setting in settings:
                verdict = dict(one(case, adapter, setting), engine=engine)
                found.append(verdict)
                if not shown:
                    print(told(verdict), file=sys.stderr, flush=True)
        return about, found
    except FileNotFoundError as why:
        return {"engine": engine, "missing": str(why)}, []
    finally:
        adapter.close()


def worst(rows):
    """Of each run the expectation with the largest error."""
    found = {}
    for row in rows:
        if row["run"] not in found or row["error"] > found[row["run"]]["error"]:
            found[row["run"]] = row
    return list(found.values())


def told(verdict):
    figure = "" if verdict.get("figure") is None else f" {verdict['figure']:.2g}"
    refined = f" (step/{REFINE}: {verdict['refined']:.2g})" if "refined" in verdict else ""
    reason = f": {verdict['reason']}" if "reason" in verdict else ""
    return f"{verdict['engine']:10} {verdict['case']:16} {verdict['settings']:8} {verdict['verdict']}{figure}{refined}{reason}"


def lines(whole):
    """JSON with one engine, case and verdict on each line."""
    text = lambda value: "[\n" + ",\n".join(json.dumps(it, ensure_ascii=False) for it in value) + "\n]" if isinstance(value, list) else json.dumps(value)
    return "{" + ",\n".join(f"{json.dumps(key)}: {text(value)}" for key, value in whole.items()) + "}\n"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--engine", nargs="+", choices=ORDER, help="engines to judge [default: all]")
    parser.add_argument("--case", nargs="+", help="cases to judge [default: all]")
    parser.add_argument("--settings", choices=SETTINGS, help="one setting only")
    parser.add_argument("--gradients", action="store_true", help="judge the engines' own derivatives instead, with the best settings")
    parser.add_argument("--adapter", help="command of an adapter that is not listed here, judged alone")
    parser.add_argument("--out", help="file for the answers and verdicts, JSON")
    parser.add_argument("--jobs", type=int, default=2, help="engines judged at the same time")
    args = parser.parse_args()
    chosen, settings = cases(args.case, args.gradients), [args.settings] if args.settings else SETTINGS
    one = judge
    if args.gradients:
        settings, one = ["best"], lambda case, adapter, _: gradients(case, adapter)
    commands = adapters()
    engines = {"adapter": args.adapter.split()} if args.adapter else {name: commands[name] for name in args.engine or ORDER}
    with ThreadPoolExecutor(args.jobs) as pool:
        results = list(pool.map(lambda item: judged(*item, chosen, settings, bool(args.case and not args.out), one), engines.items()))
    for about, found in results:
        if "missing" in about:
            print(f"could not run: {about['engine']}: {about['missing']}", file=sys.stderr)
        if args.case and not args.out:
            for verdict in found:
                print(told(verdict))
                for key in ("value", "value error", "gradient", "expected", "differences", "own", "far", "seconds", "method", "used"):
                    if key in verdict and args.gradients:
                        print(f"  {key}: {verdict[key]}")
                for row in verdict.get("rows", []):
                    expected = next(f"{word} {row[key]}" for key, word in
                                    (("value", "expected"), ("at_most", "at most"), ("at_least", "at least")) if key in row)
                    print(f"  {row['run']}, {row['name']}: {row['got']}, {expected}, error {row['error']:.3g}")
    if args.out:
        write(args.out, chosen, results)


def write(path, chosen, results):
    """Writes the file; what it already holds about other engines and cases stays."""
    import common
    told = {"engines": [], "cases": [], "verdicts": []}
    if os.path.exists(path):
        with open(path) as file:
            told = json.load(file)
    engines = {about["engine"]: about for about in told["engines"]} | {about["engine"]: about for about, _ in results}
    verdicts = {(it["engine"], it["case"], it["settings"]): it for it in told["verdicts"]}
    verdicts |= {(it["engine"], it["case"], it["settings"]): it for _, found in results for it in found}
    listed = {case["case"]: case for case in told["cases"]} | {
        case["case"]: {key: case[key] for key in ("case", "number", "title", "asks", "law", "source")} for case in chosen}
    place = lambda name: ORDER.index(name) if name in ORDER else len(ORDER)
    whole = {
        "machine": common.machine(), "exact": EXACT, "tolerance": TOLERANCE, "refine": REFINE,
        "engines": sorted(engines.values(), key=lambda about: place(about["engine"])),
        "cases": sorted(listed.values(), key=lambda case: case["number"]),
        "verdicts": [dict(verdicts[key], **({"rows": worst(verdicts[key]["rows"])} if "rows" in verdicts[key] else {})) for key in sorted(verdicts, key=lambda key: (listed[key[1]]["number"], place(key[0]), key[2] == "best"))]}
    with open(path + ".part", "w") as file:
        file.write(lines(whole))
    os.replace(path + ".part", path)


if __name__ == "__main__":
    main()
