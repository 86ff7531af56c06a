"""Writes the page and the picture of the judge: page.py judge.json judge_gradients.json judge_accuracy.json page.md OUT.md OUT.svg."""

import json
import math
import os
import sys

import matplotlib

matplotlib.use("svg")
import matplotlib.pyplot as plt

HERE = os.path.dirname(os.path.abspath(__file__))
# Distinguishable without colour vision: lightness falls with the quality.
COLOURS = {"exact": "#2166ac", "within tolerance": "#92c5de", "degrades": "#fee090", "fails": "#d6604d", "refused": "#e0e0e0"}
INK = {"exact": "white", "fails": "white"}


def rounded(figure):
    """Rounded up to one digit, so that a figure is never shown at or below a limit that it exceeds."""
    text = f"{figure:.0e}"
    if float(text) < figure:
        digit, exponent = text.split("e")
        text = f"{float(f'{int(digit) + 1}e{exponent}'):.0e}"
    return text.replace("e-0", "e-").replace("e+0", "e")


def short(verdict):
    figure = verdict.get("figure")
    number = "" if figure is None else rounded(figure)
    return {"exact": "exact", "within tolerance": f"≤ {number}", "degrades": f"*degrades, {number}*",
            "fails": f"**fails**, {number}" if number else "**fails**", "refused": "refused"}[verdict["verdict"]]


def picture(told, path):
    plt.rcParams.update({"svg.fonttype": "none", "svg.hashsalt": "judge", "font.family": "sans-serif", "font.size": 8})
    engines, cases = [about["engine"] for about in told["engines"] if "missing" not in about], told["cases"]
    verdicts = {(it["engine"], it["case"], it["settings"]): it for it in told["verdicts"]}
    figure, axes = plt.subplots(1, 2, figsize=(2.6 + 1.1 * len(engines), 0.27 * len(cases) + 1.6), sharey=True, layout="constrained")
    for axis, settings, title in zip(axes, ("default", "best"), ("default settings", "best documented settings")):
        for row, case in enumerate(cases):
            for column, engine in enumerate(engines):
                verdict = verdicts.get((engine, case["case"], settings))
                if verdict is None:
                    continue
                kind = verdict["verdict"]
                axis.add_patch(plt.Rectangle((column - 0.48, row - 0.46), 0.96, 0.92, color=COLOURS[kind], linewidth=0))
                word = short(verdict).strip("*").replace("**, ", " ").replace("degrades, ", "").replace("fails ", "").replace("≤ ", "")
                if kind == "refused":
                    word = "–"
                axis.text(column, row, word, ha="center", va="center", color=INK.get(kind, "black"), fontsize=6.5)
        axis.set_xlim(-0.5, len(engines) - 0.5)
        axis.set_ylim(len(cases) - 0.5, -0.5)
        axis.set_xticks(range(len(engines)), engines, rotation=40, ha="left")
        axis.xaxis.tick_top()
        axis.set_yticks(range(len(cases)), [case["title"] for case in cases])
        axis.tick_params(length=0)
        axis.set_title(title, fontsize=10)
        for side in axis.spines.values():
            side.set_visible(False)
    patches = [plt.Rectangle((0, 0), 1, 1, color=COLOURS[kind], linewidth=0) for kind in COLOURS]
    names = ["exact (≤ 1e-9)", "within tolerance (≤ 1e-3)", "degrades: a smaller step helps", "fails: it does not help", "refused, or too slow"]
    figure.legend(patches, names, loc="outside lower center", ncols=5, frameon=False)
    figure.savefig(path, metadata={"Date": None, "Creator": None})


def table(told, settings, engines=None):
    engines = engines or [about["engine"] for about in told["engines"] if "missing" not in about]
    verdicts = {(it["engine"], it["case"]): it for it in told["verdicts"] if it["settings"] == settings}
    lines = ["| case | " + " | ".join(engines) + " |", "| --- |" + " --- |" * len(engines)]
    for case in told["cases"]:
        cells = [short(verdicts[engine, case["case"]]) if (engine, case["case"]) in verdicts else "" for engine in engines]
        lines.append(f"| {case['case']} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def counts(told):
    """One line for each engine: how often each verdict with the best settings."""
    lines = ["| engine | exact | within tolerance | degrades | fails | refused |", "| --- | --- | --- | --- | --- | --- |"]
    for about in told["engines"]:
        own = [it["verdict"] for it in told["verdicts"] if it["engine"] == about["engine"] and it["settings"] == "best"]
        if own:
            lines.append(f"| {about['engine']} | " + " | ".join(str(own.count(kind)) for kind in COLOURS) + " |")
    return "\n".join(lines)


def refusals(told):
    """The reasons of refusals with the best settings, once for each engine and reason."""
    lines = []
    for about in told["engines"]:
        reasons = {}
        for it in told["verdicts"]:
            if it["engine"] == about["engine"] and it["settings"] == "best" and it["verdict"] == "refused":
                reasons.setdefault(it["reason"].split(": ", 1)[1], []).append(it["case"])
        lines += [f"- {about['engine']}: {reason} ({', '.join(cases)})" for reason, cases in reasons.items()]
    return "\n".join(lines)


def differentiated(told):
    """The engines that have derivatives of some case."""
    return [about["engine"] for about in told["engines"] if any("gradient" in it and it["engine"] == about["engine"] for it in told["verdicts"])]


def measured(told):
    """A line for each engine and case with derivatives: their errors and times."""
    plain = lambda number: f"{number:.3g}".replace("e-0", "e-").replace("e+0", "e")
    lines = ["| case | engine | value | derivative | error | step/8 | own differences | value, s | gradient, values | first, s |",
             "| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |"]
    for it in told["verdicts"]:
        if "gradient" not in it:
            continue
        seconds = it["seconds"]
        slopes = ", ".join(f"{number:.4g}" for number in it["gradient"]) if len(it["gradient"]) <= 4 else f"{len(it['gradient'])} numbers"
        refined = plain(it["refined"]) if "refined" in it else "no answer" if "not refined" in it else ""
        lines.append(f"| {it['case']} | {it['engine']} | {it['value']:.5g} | {slopes} | {plain(it['figure'])} | {refined} | {plain(it['own'])} | "
                     f"{plain(seconds['value'])} | {seconds['gradient'] / seconds['value']:.1f} | {plain(seconds['first gradient'])} |")
    return "\n".join(lines)


def listed(told, level="###"):
    return "\n".join(f"{level} {case['case']}: {case['title']}\n\n{case['asks']} Law: {case['law']}. Source: {case['source']}.\n" for case in told["cases"]).rstrip()


def methods(told):
    """How each engine differentiates, or why it refuses all cases."""
    lines = []
    for about in told["engines"]:
        own = [it for it in told["verdicts"] if it["engine"] == about["engine"]]
        known = next((it for it in own if "method" in it), None)
        found = list(dict.fromkeys(it["method"] for it in own if "method" in it))
        step = f", step {known['used']['step']:g} s" if known and "step" in known["used"] else ""
        refusals = {}
        for it in own:
            if it["verdict"] == "refused":
                refusals.setdefault(it["reason"], []).append(it["case"])
        told_of = [f"{reason} ({'all cases' if len(cases) == len(told['cases']) else ', '.join(cases)})" for reason, cases in refusals.items()]
        failed = [f"{it['case']} fails: {it['reason']}" for it in own if it["verdict"] == "fails" and "reason" in it]
        if own:
            text = "; ".join([" and ".join(found) + step] if found else []) + ("; " if found and told_of + failed else "") + "; ".join(
                [f"refused: {it}" for it in told_of] + failed)
            lines.append(f"| {about['engine']} {about['version']} | {text} |")
    return "| engine | derivatives |\n| --- | --- |\n" + "\n".join(lines)


PROGRAMS = {"drake-cenic": "CENIC", "drake": "RK3", "carom": "carom"}


def obtained(accuracy):
    """Error obtained for an accuracy asked, and the processor time of the cheapest run below an error: a line for each scene."""
    asked = {"drake-cenic": (1e-3, 1e-6), "drake": (1e-3, 1e-6), "carom": (1e-6, 1e-10)}
    plain = lambda number: f"{number:.1e}".replace("e-0", "e-").replace("e+0", "e")
    run = {(row["scene"], row["engine"], round(math.log10(row["asked"]))): row for row in accuracy["runs"]}
    heads = [f"{PROGRAMS[engine]}, {one:.0e}".replace("e-0", "e-") for engine, both in asked.items() for one in both]
    lines = ["| scene | " + " | ".join(heads) + " |", "| --- |" + " --- |" * len(heads)]
    for about in accuracy["scenes"]:
        rows = [run[about["scene"], engine, round(math.log10(one))] for engine, both in asked.items() for one in both]
        lines.append(f"| {about['title']} | " + " | ".join(plain(row["own"]) if "own" in row else "failed" for row in rows) + " |")
    return "\n".join(lines)


def times_to(accuracy, limits=(1e-3, 1e-6)):
    """The processor time of the cheapest run of each program whose error is below a limit."""
    heads = [f"{name}, ≤ {limit:.0e}".replace("e-0", "e-") for limit in limits for name in PROGRAMS.values()]
    lines = ["| scene | " + " | ".join(heads) + " |", "| --- |" + " --- |" * len(heads)]
    for about in accuracy["scenes"]:
        cells = []
        for limit in limits:
            for engine in PROGRAMS:
                found = [row["seconds"] for row in accuracy["runs"] if (row["scene"], row["engine"]) == (about["scene"], engine) and row.get("own", math.inf) <= limit]
                # The start of the program, which is subtracted from carom's times, varies by some 0.1 ms.
                cells.append("none" if not found else "< 0.1" if min(found) < 1e-4 else f"{float(f'{1e3 * min(found):.2g}'):g}")
        lines.append(f"| {about['title']} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def page(told, derived, accuracy, template, path):
    machine = told["machine"]
    engines = [about for about in told["engines"] if "missing" not in about]
    with open(os.path.join(os.path.dirname(template), "protocol.md")) as file:
        # What adapters are asked and answer: its rules and the format of cases stand elsewhere on the page.
        protocol = file.read()
    protocol = protocol[protocol.index("**First line"):protocol.index("\n\n## Verdicts")]
    with open(template) as file:
        text = file.read()
    settings = "\n".join(
        f"| {about['engine']} {about['version']} | {about['law']} | {about['settings']['default']['method']} | "
        f"{about['settings']['best']['method']} | {about['settings']['best']['source']} |" for about in engines)
    settings = "| engine | contact law | default | best | source of the settings |\n| --- | --- | --- | --- | --- |\n" + settings
    missing = "".join(f"\n- not run: {about['engine']}: {about['missing']}" for about in told["engines"] if "missing" in about)
    text = text.format(
        protocol=protocol, obtained=obtained(accuracy), times=times_to(accuracy), engines=len(engines), cases=len(told["cases"]), refine=told["refine"], best=table(told, "best"), default=table(told, "default"),
        counts=counts(told), refusals=refusals(told), list=listed(told),
        derivatives=table(derived, "best", differentiated(derived)), measured=measured(derived), methods=methods(derived), derived=listed(derived, "####"), settings=settings + ("\n" + missing if missing else ""),
        machine=f"{machine['cpu']}, {machine['cores']} cores, {machine['system']}. No case uses random numbers. "
                "Times do not enter the verdicts, except that an engine has two minutes of processor time and twenty minutes in all for an answer.")
    with open(path, "w") as file:
        file.write(text)


if __name__ == "__main__":
    source, gradients, accuracies, template, out, drawing = sys.argv[1:]
    with open(source) as file:
        told = json.load(file)
    with open(gradients) as file:
        derived = json.load(file)
    with open(accuracies) as file:
        accuracy = json.load(file)
    picture(told, drawing)
    page(told, derived, accuracy, template, out)
