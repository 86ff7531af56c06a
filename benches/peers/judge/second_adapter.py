"""The second methods of certify.py as an adapter: an exact program, from which check.py makes wrong ones by the planted defects of the
environment variable DEFECT. Needs mpmath and scipy.
"""

import os

import numpy as np

import certify
import second
from adapter import Refused, serve

DEFECT = os.environ.get("DEFECT", "")
ABOUT = {"engine": "second", "version": "1", "law": "Darboux and Keller, Stronge's end", "settings": {
    key: {"method": "maximal coordinates, DOP853", "source": "second.py"} for key in ("default", "best")}}


def smooth(H, u, mu, e, law):
    """No friction inside impacts."""
    return np.array([0, 0, -(1 + e) * u[2] / H[2, 2]])


def frozen(H, u, mu, e, law, exact=second.impulse):
    """Where the end slips before the impact, friction keeps that direction through all of it."""
    slip = np.hypot(u[0], u[1])
    if slip < 1e-9:
        return exact(H, u, mu, e, law)
    push = np.array([*(-mu * u[:2] / slip), 1])
    return -(1 + e) * u[2] / (H[2] @ push) * push


second.impulse = {"smooth": smooth, "frozen": frozen}.get(DEFECT, second.impulse)


def answer(request):
    scene, case = request["scene"], {"case": request["id"].split("/")[0]}
    if case["case"] in certify.WITHOUT:
        raise Refused(certify.WITHOUT[case["case"]])
    contact = scene["contact"]
    if DEFECT == "restitution":
        for key in ("restitution", "limit_restitution"):
            if key in contact:
                contact[key] += 0.01 if contact[key] < 0.5 else -0.01
    if DEFECT == "friction":
        contact["friction"] *= 0.98
    if DEFECT == "inertia":
        for body in scene["bodies"]:
            body["inertia"][1] *= 1.01
    return {"states": certify.method(case)[1](scene, request["times"], "energetic"), "used": {}}


serve(ABOUT, answer)
