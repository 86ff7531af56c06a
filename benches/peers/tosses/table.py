"""Merges the rows of the engines with those of carom: table.py compare.json tosses.jsonl [FOLDER]

Prints, as Markdown, a table for each part of each set of tosses with carom's laws and the engines, and what is ahead of what by
more than two standard errors. With FOLDER the tables are written to FOLDER/SET.md.
"""

import json
import os
import statistics
import sys

import numpy as np

from measure import PARTS, estimate, without_refused


def short(x):
    """As `carom compare` prints numbers."""
    return "0" if abs(x) < 5e-6 else f"{x:.3f}" if abs(x) >= 1 else f"{x:.4f}" if abs(x) >= 0.01 else f"{x:.5f}"


def spread(values):
    return "{} ± {}".format(*map(short, values))


def digits(x):
    return f"{x:.3g}" if abs(x) >= 100 or 0 < abs(x) < 0.01 else f"{x:.3f}"


def fitted(parameters):
    sign = {"restitution": "e", "friction": "μ", "tangential_restitution": "e_t"}

    def one(name, values):
        low, high = digits(min(values)), digits(max(values))
        return f"{sign.get(name, name)} {low if low == high else f'{low} … {high}'}"

    return ", ".join(one(name, values) for name, values in parameters.items())


def carom_name(row):
    several = row.get("several")
    effects = "".join(f" + {effect}" for effect in row.get("effects", []))
    return f"carom: {row['law']}" + (f", {several}" if several and several != "moreau" else "") + effects


def rows_of(comparison, lines):
    """Name, parameters, errors and number of refused roll-outs of carom's laws and of the engines."""
    rows = [(carom_name(row), fitted({it["name"]: it["values"] for it in row["coefficients"]}), np.array(row["errors"]), row["refused"], True)
            for row in comparison["rows"]]
    for line in lines:
        if line["set"] != comparison["set"]:
            continue
        if line["numbers"] != comparison["numbers"]:
            raise SystemExit(f"{line['set']}: {line['peer']} was judged by other tosses than carom: run both on the same data and seed")
        errors, refused = without_refused(line["errors"][comparison["what"]])
        rows.append((f"{line['peer']} {line['version']}, {line['method']}", fitted(line["parameters"]), errors, refused, False))
    return sorted(rows, key=lambda row: row[2].mean())


def table(comparison, lines):
    rows = rows_of(comparison, lines)
    best = next(row for row in rows if row[4])
    whole = comparison["what"].startswith("whole")
    head = ["law or engine", "parameters", "mean", "median"] + ["share below 0.5"] * whole + ["difference to carom's best", "refused"]
    page = [f"## {comparison['what']}", "", "| " + " | ".join(head) + " |", "|" + " --- |" * len(head)]
    told = []
    for name, parameters, errors, refused, own in rows:
        difference = estimate(errors - best[2])
        cells = [name, parameters, spread(estimate(errors)), short(statistics.median(errors))]
        cells += [f"{np.mean(errors < 0.5):.3f}"] * whole + ["–" if errors is best[2] else spread(difference), str(refused)]
        page.append("| " + " | ".join(cells) + " |")
        if not own:
            ahead, by = ("behind" if difference[0] > 0 else "ahead of", abs(difference[0]))
            clear = "more" if by > 2.0 * difference[1] else "less"
            told.append(f"{name} is {ahead} {best[0]} by {spread((by, difference[1]))}, {clear} than two standard errors.")
    return "\n".join([*page, "", *[f"- {line}" for line in told], ""])


def main():
    with open(sys.argv[1]) as file:
        comparisons = json.load(file)["comparisons"]
    with open(sys.argv[2]) as file:
        lines = [json.loads(line) for line in file]
    # A repeated line replaces the earlier one.
    lines = list({(line["set"], line["peer"], line["method"]): line for line in lines}.values())
    parts = [name for name, _, _ in PARTS]
    for name in dict.fromkeys(line["set"] for line in lines):
        page = f"# {name}\n\n" + "\n".join(table(one, lines) for one in comparisons if one["set"] == name and one["what"] in parts)
        print(page)
        if len(sys.argv) > 3:
            os.makedirs(sys.argv[3], exist_ok=True)
            with open(os.path.join(sys.argv[3], f"{name}.md"), "w") as file:
                file.write(page)


if __name__ == "__main__":
    main()
