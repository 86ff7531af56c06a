"""Shared by the adapters that have derivatives: the point at which a request asks, the number that is differentiated, and times.

A request for derivatives has, beside `scene`, `times` (one) and perhaps `step`: `of`, a formula of the final q (flat, as in `start`) and
of u (the forces of the pieces, two numbers each); `by`, paths of numbers of the scene; `at`, points, each with a value for every number;
`repeats`. The answer has the value of `of` at every point, and the derivatives by all numbers at the first one.
"""

import copy
import statistics
import time

import numpy as np

LONG = 30  # calls are not repeated beyond this time in all, s


def numbers(scene, path):
    """The numbers at a path such as `start.q.2`, or all numbers of the list there."""
    for key in path.split("."):
        scene = scene[int(key)] if isinstance(scene, list) else scene[key]
    return np.ravel(np.array(scene, float))


def point_of(scene, paths):
    return np.concatenate([numbers(scene, path) for path in paths])


def put(scene, paths, values):
    """A copy of the scene with other numbers, of any type, at the paths."""
    scene, values = copy.deepcopy(scene), list(values)
    for path in paths:
        *way, last = path.split(".")
        at = scene
        for key in way:
            at = at[int(key)] if isinstance(at, list) else at[key]
        last = int(last) if isinstance(at, list) else last
        if isinstance(at[last], list):  # pieces of two numbers each
            count = len(at[last])
            at[last] = [[values.pop(0), values.pop(0)] for _ in range(count)]
        else:
            at[last] = values.pop(0)
    return scene


def forces(scene):
    """The pieces of the force on a body, a row each; without a force no rows."""
    return np.array(scene["force"]["pieces"]) if "force" in scene else np.zeros((0, 2))


def value(request, q, u):
    """The number that is differentiated, of arrays of any type."""
    return eval(request["of"], {"q": q, "u": u})


def slopes(request, q, u):
    """Derivatives of the formula itself by q and by u, by complex steps: for engines that don't evaluate the formula themselves."""
    both, h, found = np.concatenate([q, np.ravel(u)]), 1e-30, []
    for k in range(len(both)):
        moved = both.astype(complex)
        moved[k] += 1j * h
        found.append(np.imag(value(request, moved[:len(q)], moved[len(q):].reshape(np.shape(u)))) / h)
    return np.array(found[:len(q)]), np.array(found[len(q):])


def timed(function, repeats):
    """What a function returns, the time of its first call, and the median of further calls, s; of one where they take long."""
    spent = []
    while len(spent) < 1 + repeats and (len(spent) < 2 or sum(spent) < LONG):
        begin = time.perf_counter()
        found = function()
        spent.append(time.perf_counter() - begin)
    return found, spent[0], statistics.median(spent[1:])


def reply(request, values, gradient, method, **used):
    """The answer from functions: `values(point)` and `gradient(point)`; the latter is called at the first point."""
    first = np.array(request["at"][0])
    last, begun, usual = timed(lambda: values(first), request["repeats"])
    found = {"values": [float(last)] + [float(values(np.array(point))) for point in request["at"][1:]]}
    slope, prepared, spent = timed(lambda: gradient(first), request["repeats"])
    # The first call compiles; without compilation it takes as long as the others.
    return found | {"gradient": [float(x) for x in np.ravel(slope)], "method": method, "used": used,
                    "seconds": {"value": usual, "gradient": spent, "first value": begun, "first gradient": prepared}}
