"""An adapter to start from: the closed form of a frictionless ball above a floor; it refuses every other scene.

check.py also uses it, with the planted defects of the environment variable DEFECT, to see that the judge notices them.
"""

import math
import os

import derivatives
from adapter import Refused, serve

DEFECT = os.environ.get("DEFECT", "")
STEP = 1e-3
ABOUT = {"engine": "example", "version": "1", "law": "Newton's e", "settings": {
    "default": {"method": "closed form", "source": "example_adapter.py"}, "best": {"method": "closed form", "source": "example_adapter.py"}}}


def fall(height, velocity, gravity, restitution, time):
    """Height and velocity of the lowest point after `time`, through all impacts; at rest once they accumulate."""
    for _ in range(10_000):
        # The next impact: height + velocity t − gravity t²/2 = 0.
        until = (velocity + math.sqrt(velocity**2 + 2 * gravity * height)) / gravity if gravity else -height / velocity if velocity < 0 else math.inf
        if until > time or until < 1e-13:
            break
        time, height, velocity = time - until, 0.0, restitution * (gravity * until - velocity)
    if gravity and height == 0.0 and velocity < 1e-12:
        return 0.0, 0.0
    return height + velocity * time - gravity * time**2 / 2, velocity - gravity * time


def answer(request):
    scene = request["scene"]
    [body, *others], contact = scene["bodies"], scene["contact"]
    plain = not others and len(scene["planes"]) == 1 and scene["planes"][0]["normal"] == [0, 0, 1] and body["joint"] == "free"
    if not plain or contact["friction"] or len(body["shapes"]) != 1 or "sphere" not in body["shapes"][0]:
        raise Refused("one frictionless ball above a floor is all that it knows")
    q, qd, radius = scene["start"]["q"], scene["start"]["qd"], body["shapes"][0]["sphere"]
    restitution = contact["restitution"]
    if DEFECT == "restitution":
        restitution *= 0.99
    if DEFECT == "threshold" and contact["restitution"] and abs(qd[2]) < 0.2 and not scene["gravity"][2]:
        restitution = 0.0
    step = request.get("step") or STEP
    states = []
    for time in request["times"]:
        # The defect of a method with steps: it is late by a step.
        height, velocity = fall(q[2] - radius, qd[2], -scene["gravity"][2], restitution, time + (step if DEFECT == "late" else 0.0))
        states.append({"t": time, "q": [q[0], q[1], height + radius, *q[3:]], "qd": [qd[0], qd[1], velocity, *qd[3:]]})
    return {"states": states, "used": {"step": step} if DEFECT == "late" else {}}


def gradient(request):
    """The derivative of the height after one bounce, from that of the closed form: v = sqrt(2 g h), τ = t − v/g, z = e v τ − g τ²/2."""
    def both(point):
        scene = derivatives.put(request["scene"], request["by"], map(float, point))
        if len(scene["bodies"]) > 1 or not scene["planes"] or "sphere" not in scene["bodies"][0]["shapes"][0]:
            raise Refused("one frictionless ball above a floor is all that it knows")
        g, e, radius = -scene["gravity"][2], scene["contact"]["restitution"], scene["bodies"][0]["shapes"][0]["sphere"]
        v = math.sqrt(2 * g * (scene["start"]["q"][2] - radius))
        tau = request["times"][0] - v / g
        by = {"start.q.2": e * tau * g / v - (e * v - g * tau) / v, "contact.restitution": v * tau}
        slopes = [by[path] for path in request["by"]]
        if DEFECT == "no event":
            slopes = [e * tau * g / v]  # the change of the time of the impact is forgotten
        return radius + e * v * tau - g * tau**2 / 2, slopes

    return derivatives.reply(request, lambda point: both(point)[0], lambda point: both(point)[1], "closed form")


serve(ABOUT, answer, gradient)
