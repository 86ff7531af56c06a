"""Shared by the adapters in Python: the loop of the protocol, and the scene as URDF. The protocol is described in protocol.md.

An adapter calls `serve(about, answer)`; `answer(request)` returns {"states": [...], "used": {...}} or raises `Refused`. With
`serve(about, answer, gradient)` it has derivatives, too: `gradient(request)` returns the answer of derivatives.py.
Only the standard library is used here, since Siconos runs under the Python of the system.
"""

import json
import math
import os
import signal
import sys

# common.py and symbolic.py of the peers; last, since above a copy of this file there is any folder.
sys.path.append(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))

BUDGET = 120  # longest processor time for one answer, s


class Refused(Exception):
    """The engine cannot express the scene, or says that it cannot compute it."""


def serve(about, answer, gradient=None):
    """Reads one request for each line of standard input and writes one answer for each line."""
    # Some libraries print to standard output, so the answers go to a copy of it and the rest to standard error.
    out = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)

    def late(*_):
        raise TimeoutError(f"no answer within {BUDGET} s of processor time, of derivatives {4 * BUDGET} s")

    signal.signal(signal.SIGPROF, late)
    for line in sys.stdin:
        request = json.loads(line)
        if "about" in request:
            reply = about
        else:
            signal.setitimer(signal.ITIMER_PROF, BUDGET * (4 if "of" in request else 1))
            try:
                if "of" in request:
                    reply = gradient(request) if gradient else {"refused": about.get("no derivatives", "it has no automatic derivatives")}
                    numbers = reply.get("values", []) + reply.get("gradient", [])
                else:
                    reply = answer(request)
                    numbers = [x for state in reply["states"] for x in state["q"] + state["qd"]]
                if not all(map(math.isfinite, numbers)):
                    reply = {"failed": "the state is no longer finite"}
            except Refused as why:
                reply = {"refused": str(why)}
            except Exception as why:  # an exception of an engine is its answer
                reply = {"failed": f"{type(why).__name__}: {str(why).splitlines()[0] if str(why) else ''}"}
            signal.setitimer(signal.ITIMER_PROF, 0)
            reply["id"] = request["id"]
        out.write(json.dumps(reply) + "\n")
        out.flush()


def floats(*parts):
    return [float(x) for part in parts for x in part]


def march(request, step, advance, state):
    """The states at the ends of the steps nearest to the asked times. `advance(n)` makes n steps."""
    states, made = [], 0
    for time in request["times"]:
        count = round(time / step)
        if count > made:
            advance(count - made)
            made = count
        states.append(dict(state(), t=made * step))
    return states


def sizes(body):
    return (7, 6) if body["joint"] == "free" else (1, 1)


def parts(scene, q, qd):
    """(body, its part of q, its part of qd) for every body."""
    found, i, j = [], 0, 0
    for body in scene["bodies"]:
        n, m = sizes(body)
        found.append((body, q[i:i + n], qd[j:j + m]))
        i, j = i + n, j + m
    return found


def trees(scene):
    """The bodies as lists, one for each tree, parents first."""
    root, found = {}, {}
    for body in scene["bodies"]:
        root[body["name"]] = root.get(body["parent"], body["name"])
        found.setdefault(root[body["name"]], []).append(body)
    return list(found.values())


def vector(values):
    return " ".join(repr(float(x)) for x in values)


def urdf(bodies, shapes=True, world=None):
    """URDF of one tree. A jointed root hangs on the link `world`; a free root is the root link, or, if `world` is given, hangs
    on that link by a joint of type `floating`, so that several trees fit into one file."""
    text, base = [], world or "world"
    if world or bodies[0]["joint"] != "free":
        text.append(f'<link name="{base}"/>')
    for body in bodies:
        inertia = "".join(f' i{a}{a}="{i!r}"' for a, i in zip("xyz", map(float, body["inertia"])))
        text.append(f'<link name="{body["name"]}"><inertial><origin xyz="{vector(body.get("centre", [0, 0, 0]))}"/>'
                    f'<mass value="{float(body["mass"])!r}"/><inertia{inertia} ixy="0" ixz="0" iyz="0"/></inertial>')
        for shape in body.get("shapes", []) if shapes else []:
            kind = f'<sphere radius="{shape["sphere"]!r}"/>' if "sphere" in shape else f'<box size="{vector(shape["box"])}"/>'
            text.append(f'<collision><origin xyz="{vector(shape.get("at", [0, 0, 0]))}"/><geometry>{kind}</geometry></collision>')
        text.append("</link>")
        parent = body["parent"] or base
        if body["joint"] == "free":
            if world:
                text.append(f'<joint name="{body["name"]}_joint" type="floating"><parent link="{parent}"/>'
                            f'<child link="{body["name"]}"/></joint>')
            continue
        kind, limit = {"hinge": "revolute", "slider": "prismatic"}[body["joint"]], body.get("limits", [-1e3, 1e3])
        if body["joint"] == "hinge" and "limits" not in body:
            kind, limit = "continuous", None
        limit = f'<limit lower="{limit[0]!r}" upper="{limit[1]!r}" effort="1e9" velocity="1e9"/>' if limit else ""
        text.append(f'<joint name="{body["name"]}_joint" type="{kind}"><parent link="{parent}"/><child link="{body["name"]}"/>'
                    f'<origin xyz="{vector(body["at"])}"/><axis xyz="{vector(body["axis"])}"/>{limit}</joint>')
    return '<?xml version="1.0"?>\n<robot name="tree">\n' + "\n".join(text) + "\n</robot>\n"


def restitution_asked(scene):
    """Largest coefficient of restitution that the scene needs: 0 if it has none above zero."""
    contact = scene["contact"]
    touches = scene["planes"] or scene["pairs"]
    return max(contact["restitution"] if touches else 0.0, contact.get("limit_restitution", 0.0) if has_limits(scene) else 0.0)


def has_limits(scene):
    return any("limits" in body for body in scene["bodies"])
