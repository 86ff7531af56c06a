"""Tables and performance profiles (Dolan & Moré 2002) of results: profile.py RESULTS.jsonl OUT.md OUT.svg. Needs matplotlib."""

import argparse
import json
import pathlib

import matplotlib
import numpy as np

matplotlib.use("svg")
import matplotlib.pyplot as plt  # noqa: E402

CLASSES = (("1 to 50 contacts", 0, 50), ("more than 50 contacts", 50, 10**9))
MEASURES = ("signorini", "dissipation", "cone", "natural_map")


def grid(records):
    """Names of the solvers and of the problems, contacts, and times: inf where a problem is not solved."""
    solvers = list(dict.fromkeys(it["solver"] for it in records))
    # Problems that every solver has been given.
    given = {}
    for it in records:
        given.setdefault(it["problem"], {})[it["solver"]] = it
    given = {name: own for name, own in given.items() if len(own) == len(solvers)}
    times = np.full((len(given), len(solvers)), np.inf)
    for i, own in enumerate(given.values()):
        for k, solver in enumerate(solvers):
            if own[solver]["outcome"] == "solved":
                times[i, k] = own[solver]["seconds"]
    contacts = np.array([next(iter(own.values()))["contacts"] for own in given.values()])
    return solvers, given, contacts, times


def share(part, whole):
    return f"{100 * part / whole:.1f} %" if whole else "–"


def median(values):
    return f"{1e6 * np.median(values):.0f}" if len(values) else "–"


def tables(solvers, given, contacts, times):
    """Markdown: how many problems each solver solves, on how many it is the fastest, and its times."""
    lines = []
    for title, least, most in CLASSES:
        own = times[(contacts > least) & (contacts <= most)]
        if not len(own):
            continue
        best = own.min(axis=1)
        solvable = np.isfinite(best)
        mine = own[:, solvers.index("carom")] if "carom" in solvers else None
        lines += [
            f"{title}: {len(own)} problems, {solvable.sum()} solved by at least one solver",
            "",
            "| solver | solved | fastest | within a factor 2 | faster than carom | median of its times, µs | median ratio to the fastest |",
            "| --- | --- | --- | --- | --- | --- | --- |",
        ]
        order = np.argsort([-np.isfinite(own[:, k]).sum() for k in range(len(solvers))], kind="stable")
        for k in order:
            column, solved = own[:, k], np.isfinite(own[:, k])
            ratio = column[solved] / best[solved]
            fastest, near = (ratio == 1.0).sum(), (ratio <= 2.0).sum()
            cells = [share(solved.sum(), len(own)), share(fastest, solvable.sum()), share(near, solvable.sum())]
            cells.append(share((column < mine).sum(), len(own)) if solvers[k] != "carom" and "carom" in solvers else "–")
            middle = f"{np.median(ratio):.2f}" if len(ratio) else "–"
            lines.append(f"| {solvers[k]} | " + " | ".join(cells) + f" | {median(column[solved])} | {middle} |")
        lines.append("")
    lines += ["| solver | " + " | ".join(f"largest {it}" for it in MEASURES) + " | not solved |", "| --- | --- | --- | --- | --- | --- |"]
    for solver in solvers:
        own = [it[solver] for it in given.values()]
        solved = [it for it in own if it["outcome"] == "solved"]
        largest = [f"{max((it[name] for it in solved), default=np.nan):.1e}" for name in MEASURES]
        other = {}
        for it in own:
            if it["outcome"] != "solved":
                other[it["outcome"]] = other.get(it["outcome"], 0) + 1
        lines.append(f"| {solver} | " + " | ".join(largest) + " | " + ", ".join(f"{k}: {v}" for k, v in other.items()) + " |")
    nobody = [name for name, row in zip(given, times) if not np.isfinite(row).any()]
    lines += ["", "Solved by no solver: " + (", ".join(nobody) or "none")]
    if "carom" in solvers:
        own = times[:, solvers.index("carom")]
        missed = [name for name, mine, row in zip(given, own, times) if not np.isfinite(mine) and np.isfinite(row).any()]
        lines += ["", "Solved by another solver and not by carom: " + (", ".join(missed) or "none")]
    return "\n".join(lines) + "\n"


def picture(solvers, contacts, times, path):
    """The share of the problems that a solver solves within a factor of the fastest one's time."""
    plt.rcParams.update({"svg.fonttype": "none", "svg.hashsalt": "problems", "font.family": "sans-serif", "font.size": 9})
    figure, axes = plt.subplots(1, 2, figsize=(10.0, 4.4), sharey=True, layout="constrained")
    ranks = sorted((name for name in solvers if name != "carom"), key=lambda name: -np.isfinite(times[:, solvers.index(name)]).sum())
    colours = {name: plt.get_cmap("tab20")(k % 20) for k, name in enumerate(ranks)}
    for axis, (title, least, most) in zip(axes, CLASSES):
        own = times[(contacts > least) & (contacts <= most)]
        own = own[np.isfinite(own.min(axis=1))]
        axis.set_title(f"{title} ({len(own)} problems)", fontsize=10)
        axis.set_xscale("log")
        axis.set_xlim(1.0, 1000.0)
        axis.set_ylim(0.0, 1.02)
        axis.set_xlabel("factor of the fastest solver's processor time")
        axis.grid(alpha=0.3, linewidth=0.5)
        if not len(own):
            continue
        ratios = own / own.min(axis=1, keepdims=True)
        # carom first, and above the others.
        for name in ["carom"] * ("carom" in solvers) + ranks:
            column = np.sort(ratios[:, solvers.index(name)])
            column = column[np.isfinite(column)]
            x, y = np.concatenate([[1.0], column, [1000.0]]), np.arange(len(column) + 2) / len(own)
            y[-1] = len(column) / len(own)
            style = {"color": "black", "linewidth": 2.2, "zorder": 3} if name == "carom" else {"color": colours[name], "linewidth": 1.1}
            axis.step(x, y, where="post", label=name, **style)
    axes[0].set_ylabel("share of the problems solved to 1e-10")
    handles, names = axes[0].get_legend_handles_labels()
    figure.legend(handles, names, loc="outside right center", frameon=False)
    figure.savefig(path, metadata={"Date": None, "Creator": None})


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("results", type=pathlib.Path)
    parser.add_argument("table", type=pathlib.Path)
    parser.add_argument("picture", type=pathlib.Path)
    given = parser.parse_args()
    found = grid([json.loads(line) for line in given.results.read_text().splitlines()])
    given.table.write_text(tables(*found))
    picture(found[0], found[2], found[3], given.picture)


if __name__ == "__main__":
    main()
