"""Impacts and runs as functions of NumPy arrays with their derivatives, for carom.jax and carom.torch."""

import concurrent.futures
import os
import re

import numpy as np

from . import _errors


class _Function:
    """A function of arrays and its derivatives.

    ``inputs`` are the numbers of axes of the arguments, ``sizes`` the lengths of the results, all without the leading axes of batches.
    """

    def __init__(self, inputs, sizes):
        self.inputs, self.sizes = inputs, sizes

    def __call__(self, arguments, derivatives):
        """The results, and for each of them its derivatives by each argument, an axis more than the result; None without derivatives."""
        arguments = [np.asarray(it, dtype=float) for it in arguments]
        lead = np.broadcast_shapes(*(it.shape[: it.ndim - axes] for it, axes in zip(arguments, self.inputs)))
        own = [it.shape[it.ndim - axes :] for it, axes in zip(arguments, self.inputs)]
        flat = [np.broadcast_to(it, lead + end).reshape((-1,) + end) for it, end in zip(arguments, own)]
        values, by = self.batch(flat, derivatives)
        values = [np.ascontiguousarray(it.reshape(lead + it.shape[1:])) for it in values]
        if by is not None:
            by = [[np.ascontiguousarray(it.reshape(lead + it.shape[1:])) for it in row] for row in by]
        return values, by


class Impact(_Function):
    """The velocities after an impact, by q, qd and coefficients."""

    def __init__(self, chain, frame, normal, law, point, joints, coefficients):
        super().__init__([1, 1] + [0] * len(coefficients), [chain.nv])
        self.chain, self.coefficients = chain, coefficients
        self.given = {"frame": frame, "normal": normal, "law": law, "point": point, "joints": joints}

    def batch(self, arguments, derivatives):
        q, qd, *numbers = arguments
        hits = self.chain.impact(q, qd, **self.given, **dict(zip(self.coefficients, numbers)), derivatives=derivatives)
        if not derivatives:
            return [hits.qd_plus], None
        by = hits.derivatives
        of_coefficients = [by[name][..., None] for name in self.coefficients]
        return [hits.qd_plus], [[by["q"] @ np.linalg.pinv(_tangent(self.chain, q)), by["qd"], *of_coefficients]]


class Run(_Function):
    """The state at the end of a run, by that at its start and by numbers of keys."""

    def __init__(self, scene, keys):
        if isinstance(keys, str):
            raise TypeError(f"wrt is the text '{keys}': give a list of paths, [\"{keys}\"]")
        keys = list(keys)
        for key in keys:
            if keys.count(key) > 1:
                raise ValueError(f"wrt has {key} twice: name each number once")
            if re.fullmatch(r"robot(\[\d+\])?\.(q|qd|tip_velocity)\b.*", key):
                raise ValueError(f"wrt has {key}: the start is given by the arguments q and qd")
        super().__init__([1, 1] + [0] * len(keys), [scene.chain.nq, scene.chain.nv])
        self.scene, self.keys = scene, keys

    def batch(self, arguments, derivatives):
        with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
            runs = list(pool.map(lambda row: self._one(row, derivatives), zip(*arguments)))
        values = [np.stack([run[0][k] for run in runs]) for k in range(2)]
        if not derivatives:
            return values, None
        q, last = arguments[0], values[0]
        nv = self.scene.chain.nv
        by = np.stack([run[1] for run in runs])
        ends, starts = _tangent(self.scene.chain, last), np.linalg.pinv(_tangent(self.scene.chain, q))
        columns = [by[..., :nv] @ starts, by[..., nv : 2 * nv]] + [by[..., 2 * nv + k, None] for k in range(len(self.keys))]
        return values, [[ends @ it[:, :nv] for it in columns], [it[:, nv:] for it in columns]]

    def check(self, numbers):
        if len(numbers) != len(self.keys):
            raise TypeError(f"{len(numbers)} numbers are given for {len(self.keys)} keys: {', '.join(self.keys) or 'none'}")

    def _one(self, row, derivatives):
        q, qd, *numbers = row
        scene = self.scene.with_start(q, qd)
        if self.keys:
            scene = scene.with_keys({key: float(number) for key, number in zip(self.keys, numbers)})
        found = scene.sensitivity(["q", "qd", *self.keys]) if derivatives else scene.simulate()
        if derivatives and found.broken is not None:
            time, reason = found.broken["time"], found.broken["reason"]
            raise _errors.SimulationError(f"the run has no derivative after t = {time} s: {reason}")
        if len(found.last[1]) != len(q):
            raise _errors.SimulationError("the plan leaves out joints: keep all of them by [run] model = \"full\"")
        return found.last[1:], found.last_by if derivatives else None


def _tangent(chain, q):
    """The rates of q at unit velocities, (B, nq, nv)."""
    unit = np.eye(chain.nv)
    return np.stack([chain.q_rate(q, np.broadcast_to(it, (len(q), chain.nv))) for it in unit], axis=-1)


def check_law(law):
    """Refuses lists of laws, of which `carom.Chain.impact` would make as many impacts."""
    if isinstance(law, (list, tuple)):
        raise TypeError(f"law is a {type(law).__name__} of {len(law)}: give one law, and make a function for each")


def function_of_impact(chain, frame, normal, law, point, joints, given):
    """The Impact of the coefficients that are given, and their values."""
    given = {name: value for name, value in given.items() if value is not None}
    return Impact(chain, frame, normal, law, point, joints, list(given)), list(given.values())
