"""Solves the problems of a folder by carom and by the solvers of Siconos, and writes what each found and its processor time.

Each solver works in a process of its own, on one thread, which a limit of processor time ends. What it found is judged here, from its
impulses alone and by the same function for all (`measures`). Needs carom, h5py and, under the Python that --siconos names, Siconos.
"""

import argparse
import json
import os
import pathlib
import pickle
import signal
import subprocess
import sys
import time

import numpy as np

# A solution has every measure below this.
SOLVED = 1e-10
# A solver that says it is done and is not, by our measures, gets another try at the next tolerance; the time is that of the last try.
TOLERANCES = (1e-10, 1e-12, 1e-14)
# Runs of one problem: the smallest time counts. Long ones run once.
RUNS, LONG = 5, 0.1

# Solver of Siconos, solver of one contact in it, the most iterations: first-order methods end by the limit of time. Not here: PFP refuses
# dense matrices, NSGSV ends by a segmentation fault with them; SOCLCP and CONVEXQP_PG_CYLINDER solve other problems (without the term of De
# Saxcé, with a given bound of friction).
SICONOS = {
    "NSGS": ("NSGS", None, 10**7),
    "NSGS_PLI": ("NSGS", "ProjectionOnConeWithLocalIteration", 10**7),
    "NSGS_QUARTIC": ("NSGS", "QUARTIC", 10**7),
    "NSN_AC": ("NSN_AC", None, 1000),
    "NSN_FB": ("NSN_FB", None, 1000),
    "NSN_NM": ("NSN_NM", None, 1000),
    "PROX": ("PROX", None, 10**5),
    "ADMM": ("ADMM", None, 10**6),
    "TFP": ("TFP", None, 10**5),
    "ACLMFP": ("ACLMFP", None, 10**5),
    "DSFP": ("DSFP", None, 10**7),
    "EG": ("EG", None, 10**7),
    "FPP": ("FPP", None, 10**7),
    "HP": ("HP", None, 10**7),
    "VI_EG": ("VI_EG", None, 10**7),
    "VI_FPP": ("VI_FPP", None, 10**7),
}


def measures(delassus, q, friction, impulse):
    """How far impulses are from a solution, all 0 for an exact one; rows t1, t2, n; u = W r + q.

    With the velocity scale s = max |q| and h of a contact the mean of W's diagonal in its rows, so that h r is a velocity:

    signorini    max |min(u_n, h r_n)| / s
    dissipation  max h (mu r_n |u_t| + r_t · u_t) / s², the power that the largest friction would take beyond that of r_t
    cone         max h (|r_t| - mu r_n)⁺ / s
    natural_map  max |h r - P(h r - u - mu |u_t| n)| / s, the natural map of De Saxcé's bipotential; P projects on Coulomb's cone
    """
    r = np.reshape(impulse, (-1, 3))
    if not np.isfinite(r).all():
        return dict.fromkeys(("signorini", "dissipation", "cone", "natural_map"), float("inf"))
    with np.errstate(over="ignore", invalid="ignore"):
        return _measures(delassus, q, friction, r)


def _measures(delassus, q, friction, r):
    u = (delassus @ r.ravel() + q).reshape(-1, 3)
    scale = np.abs(q).max()
    h = np.diag(delassus).reshape(-1, 3).mean(axis=1)
    slip, friction_impulse = np.linalg.norm(u[:, :2], axis=1), np.linalg.norm(r[:, :2], axis=1)
    dissipation = friction * r[:, 2] * slip + (r[:, :2] * u[:, :2]).sum(axis=1)
    moved = h[:, None] * r - u
    moved[:, 2] -= friction * slip
    return {
        "signorini": float(np.abs(np.minimum(u[:, 2], h * r[:, 2])).max() / scale),
        "dissipation": float(np.abs(h * dissipation).max() / scale**2),
        "cone": float(np.maximum(h * (friction_impulse - friction * r[:, 2]), 0.0).max() / scale),
        "natural_map": float(np.abs(h[:, None] * r - projected(moved, friction)).max() / scale),
    }


def projected(points, friction):
    """The nearest points of Coulomb's cones."""
    tangent, normal = np.linalg.norm(points[:, :2], axis=1), points[:, 2]
    found = points.copy()
    found[friction * tangent <= -normal] = 0.0
    outside = (friction * tangent > -normal) & (tangent > friction * normal)
    on = (friction * tangent + normal)[outside] / (1.0 + friction[outside] ** 2)
    found[outside, :2] *= (friction[outside] * on / tangent[outside])[:, None]
    found[outside, 2] = on
    return found


# The processes of the solvers.


def worker(which):
    """Answers requests on the standard input: (solver, tolerance, limit, W, q, friction) by (impulse, seconds, seconds with
    the problem's construction, iterations, says solved)."""
    answers = os.fdopen(os.dup(1), "wb")
    # What a solver prints is not an answer.
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    prepare = {"carom": carom_solver, "siconos": siconos_solver}[which]()
    while True:
        try:
            solver, tolerance, limit, *numbers = pickle.load(sys.stdin.buffer)
        except EOFError:
            return
        # As bytes: both sides have NumPy of different versions.
        w, q, friction = (np.frombuffer(it).copy() for it in numbers)
        w = w.reshape(len(q), len(q))
        make, best, whole = prepare(solver, tolerance, w, q, friction), float("inf"), float("inf")
        for _ in range(RUNS):
            # The signal ends the process, inside of C too.
            signal.setitimer(signal.ITIMER_PROF, limit)
            # The clock of the only thread: while the timer runs, that of the process has the resolution of the scheduler.
            first = time.thread_time_ns()
            run = make()
            second = time.thread_time_ns()
            found = run()
            third = time.thread_time_ns()
            signal.setitimer(signal.ITIMER_PROF, 0.0)
            best, whole = min(best, (third - second) * 1e-9), min(whole, (third - first) * 1e-9)
            if best > LONG:
                break
        impulse, iterations, solved = found()
        pickle.dump((np.asarray(impulse, dtype=float).tobytes(), best, whole, iterations, solved), answers, protocol=4)
        answers.flush()


# A function that makes a problem from arrays, which returns one that solves it, which returns one that reads the result.


def carom_solver():
    import carom

    def prepare(solver, tolerance, w, q, friction):
        def make():
            problem = carom.ContactProblem(w, q, friction=friction)

            def run():
                hit = problem.solve(tolerance=tolerance)
                return lambda: (hit.impulse, hit.iterations, hit.solved)

            return run

        return make

    return prepare


def siconos_solver():
    import siconos.numerics as numerics

    numerics.numerics_set_verbose(0)
    constant = lambda name: getattr(numerics, f"SICONOS_FRICTION_3D_{name}")  # noqa: E731

    def prepare(solver, tolerance, w, q, friction):
        name, inner, iterations = SICONOS[solver]
        # Siconos has the normal first.
        order = (3 * np.arange(len(friction))[:, None] + [2, 0, 1]).ravel()
        w, q = np.asfortranarray(w[np.ix_(order, order)]), q[order]

        def make():
            problem = numerics.FrictionContactProblem(3, len(friction), w, q, friction)
            options = numerics.SolverOptions(constant(name))
            options.iparam[numerics.SICONOS_IPARAM_MAX_ITER] = iterations
            options.dparam[numerics.SICONOS_DPARAM_TOL] = tolerance
            if inner is not None:
                numerics.solver_options_update_internal(options, 0, constant(f"ONECONTACT_{inner}"))
            if name == "DSFP":
                # Its default, 1, is not for every W.
                options.dparam[numerics.SICONOS_FRICTION_3D_NSN_RHO] = 1.0 / np.linalg.norm(w, 2)
            impulse, velocity = np.zeros(len(q)), np.zeros(len(q))

            def run():
                failed = numerics.fc3d_driver(problem, impulse, velocity, options)

                def found():
                    own = np.empty(len(q))
                    own[order] = impulse
                    return own, int(options.iparam[numerics.SICONOS_IPARAM_ITER_DONE]), failed == 0

                return found

            return run

        return make

    return prepare


class Process:
    """The process of a solver, started again after it has ended."""

    def __init__(self, python, which):
        self.command = [python, __file__, "--worker", which]
        self.process = None

    def solve(self, *request):
        """The answer, or how the process ended."""
        if self.process is None:
            single = {name: "1" for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "RAYON_NUM_THREADS")}
            self.process = subprocess.Popen(
                self.command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, env={**os.environ, **single}
            )
        try:
            pickle.dump(request, self.process.stdin, protocol=4)
            self.process.stdin.flush()
            return pickle.load(self.process.stdout)
        except (EOFError, BrokenPipeError, pickle.UnpicklingError):
            ended = self.process.wait()
            self.process = None
            return "limit of time" if ended == -signal.SIGPROF else f"ended by signal {-ended}" if ended < 0 else f"ended with {ended}"


def solve(process, solver, limit, w, q, friction):
    """The record of one problem."""
    for tolerance in TOLERANCES:
        answer = process.solve(solver, tolerance, limit, *(it.tobytes() for it in (w, q, friction)))
        if isinstance(answer, str):
            return {"outcome": answer, "tolerance": tolerance}
        impulse, seconds, whole, iterations, says = answer
        found = measures(w, q, friction, np.frombuffer(impulse))
        # Not by their maximum: a solver that diverges may leave numbers whose measures are NaN.
        solved = all(value <= SOLVED for value in found.values())
        if solved or not says:
            break
    outcome = "solved" if solved else "says solved" if says else "gives up"
    return {"outcome": outcome, "tolerance": tolerance, "seconds": seconds, "with_setup": whole, "iterations": iterations, **found}


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=pathlib.Path, nargs="?", help="problems")
    parser.add_argument("results", type=pathlib.Path, nargs="?", help="a JSON object a line; what it has is not solved again")
    parser.add_argument("--solver", action="append", help="carom or one of Siconos (" + ", ".join(SICONOS) + "); all by default")
    parser.add_argument("--every", type=int, default=1, help="take every Nth problem; odd, since the even ones are time steps")
    parser.add_argument("--limit", type=float, default=10.0, help="limit of processor time for a problem, s")
    parser.add_argument("--siconos", default="python3", help="the Python that has Siconos")
    parser.add_argument("--worker", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.worker:
        return worker(given.worker)
    if given.results is None:
        parser.error("give the folder of the problems and the file of the results")
    import carom.fclib

    done = set()
    if given.results.exists():
        done = {(it["problem"], it["solver"]) for it in map(json.loads, given.results.read_text().splitlines())}
    solvers = given.solver or ["carom", *SICONOS]
    processes = {name: Process(sys.executable, "carom") if name == "carom" else Process(given.siconos, "siconos") for name in solvers}
    with given.results.open("a") as results:
        for path in sorted(given.folder.glob("*.hdf5"))[:: given.every]:
            missing = [name for name in solvers if (path.stem, name) not in done]
            if not missing:
                continue
            problem = carom.fclib.read(path)
            w, q, friction = (np.array(it) for it in (problem.delassus, problem.u_free, problem.friction))
            for name in missing:
                record = solve(processes[name], name, given.limit, w, q, friction)
                head = {"problem": path.stem, "contacts": len(friction), "solver": name, "limit": given.limit}
                results.write(json.dumps({**head, **record}) + "\n")
                results.flush()


if __name__ == "__main__":
    main()
