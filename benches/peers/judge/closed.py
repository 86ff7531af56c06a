"""Closed forms of the derivatives that judge.py compares with; check.py compares them with differences of another program."""

import numpy as np


def steered(pieces, force=(0.0, 3.0), radius=0.2):
    """Cost and its derivatives, of a ball that a force of constant pieces drives against an equal one (case ad-steer): mass 1, 1 s.

    Before the strike the path is linear in the forces: in the piece [a, b] a unit of force moves the ball by ((t−a)² − (t−b)²)/2 up to t > b.
    At the strike, n is the direction of the centres, the struck ball takes over the normal component of the velocity. A change
    of the path by δ moves the time of the strike by −n·δ/(n·v); after it the struck ball has no force.
    """
    force, start, other = (np.array(it, float) for it in (force, (-1, -2), (-1, -1)))
    ends = np.arange(pieces + 1) / pieces
    after = lambda t: np.maximum(t - ends, 0.0)
    moved = lambda t: (after(t)[:-1] ** 2 - after(t)[1:] ** 2) / 2  # position by each piece
    speeds = lambda t: after(t)[:-1] - after(t)[1:]  # velocity by each piece
    # Constant force: a parabola along u. The strike is where |other − start − u t²/2| = 2 r.
    line, size = other - start, force @ force
    t = np.sqrt(2 * (line @ force - np.sqrt((line @ force) ** 2 - size * (line @ line - 4 * radius**2))) / size)
    n = (line - force * t * t / 2) / (2 * radius)
    velocity, left = force * t, 1 - t
    normal = n @ velocity
    last = other + left * normal * n
    found = np.zeros((pieces, 2))
    for k in range(2):
        unit = np.eye(2)[k]
        place, rate = np.outer(moved(t), unit), np.outer(speeds(t), unit)
        later = -(place @ n) / normal
        turn = -(place + np.outer(later, velocity)) / (2 * radius)
        change = rate + np.outer(later, force)
        by_normal = turn @ velocity + change @ n
        by_last = -np.outer(later, normal * n) + left * (np.outer(by_normal, n) + normal * turn)
        found[:, k] = 2 * by_last @ last + 0.02 * force[k] / pieces
    return float(last @ last + 0.01 * size), np.ravel(found)
