"""The command carom-references: reference scenes of rigid impacts, and a judge of engines.

    carom-references judge --adapter "python3 my_adapter.py" [--case NAME...] [--settings default|best] [--out FILE.json]
    carom-references list                    the cases: number, name, title, runs
    carom-references requests [CASE...]      the requests of the protocol, a line each, for trying an adapter by hand
    carom-references solution CASE           the expected values as numbers with bounds
    carom-references certify [CASE...]       the solutions against second methods (extra `certify`)
    carom-references solve [CASE...] [--out FOLDER]   writes the solutions (extra `certify`)
    carom-references check                   the judge against exact programs with planted defects (extra `certify`)
    carom-references copy FILE...            copies adapters, and the modules that they import, into this directory
"""

import ast
import json
import os
import shutil
import sys

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, HERE)  # the modules are scripts, too: they import each other by their plain names


def listed(_):
    import judge
    for case in judge.cases(None):
        print(f"{case['number']:2} {case['case']:21} {case['title']} ({len(case['runs'])} runs)")


def requests(names):
    import judge
    for case in judge.cases(names):
        for run in case["runs"]:
            request = {"id": f"{case['case']}/{run['run']}", "settings": "best", "scene": judge.scene_of(case, run), "times": run["times"]}
            print(json.dumps(request | ({"step": run["step"]} if "step" in run else {})))


def solution(names):
    for name in names:
        with open(os.path.join(HERE, "solutions", f"{name}.json")) as file:
            print(file.read(), end="")


def imported(name):
    """A file of the package and all files of it that this one imports."""
    found, left = [], [name]
    while left:
        name = left.pop()
        if name in found:
            continue
        found.append(name)
        with open(os.path.join(HERE, name)) as file:
            tree = ast.parse(file.read())
        for node in ast.walk(tree):
            modules = [it.name for it in node.names] if isinstance(node, ast.Import) else []
            modules += [node.module] if isinstance(node, ast.ImportFrom) else []
            left += [f"{module}.py" for module in modules if os.path.exists(os.path.join(HERE, f"{module}.py"))]
    return found


def copy(names):
    for name in dict.fromkeys(file for name in names for file in imported(name)):
        if os.path.exists(name):
            print(f"kept: {name} is there")
        else:
            shutil.copyfile(os.path.join(HERE, name), name)
            print(f"copied: {name}")


def passed(module):
    """A command that is the `main` of a module, with the words that follow as its arguments."""
    def command(words):
        sys.argv = [f"carom-references {module}", *words]
        return __import__(module).main()
    return command


COMMANDS = {"judge": passed("judge"), "list": listed, "requests": requests, "solution": solution, "certify": passed("certify"),
            "solve": passed("solve"), "check": passed("check"), "copy": copy}


def main():
    words = sys.argv[1:]
    if not words or words[0] not in COMMANDS:
        print(__doc__)
        sys.exit(0 if words and words[0] in ("-h", "--help") else 2)
    try:
        sys.exit(COMMANDS[words[0]](words[1:]))
    except ImportError as why:
        if why.name in ("mpmath", "scipy"):
            sys.exit(f"{words[0]} needs {why.name}: pip install 'carom-references[certify]'")
        raise
    except FileNotFoundError as why:
        sys.exit(f"not found: {os.path.basename(why.filename)}")
