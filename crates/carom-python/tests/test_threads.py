"""The GIL is released, threads may share a chain, and nothing leaks."""

import gc
import threading
import time

import numpy as np
import pytest

import carom
from conftest import ROOT, states


def share_of_the_longest_pause(work):
    """The longest time in which another thread cannot run Python code while `work` runs, as a share of its duration."""
    done, lasted = threading.Event(), 0.0

    def run():
        nonlocal lasted
        start = time.perf_counter()
        work()
        lasted = time.perf_counter() - start
        done.set()

    # The clock runs before the thread does, which may hold the GIL from its first line on.
    longest, last = 0.0, time.perf_counter()
    worker = threading.Thread(target=run)
    worker.start()
    while not done.is_set():
        now = time.perf_counter()
        longest, last = max(longest, now - last), now
    worker.join()
    return longest / lasted


def test_other_threads_run_during_batches_and_simulations(arm7, rng):
    # With the GIL held the pause is the whole call. Released, it is the switching interval of 5 ms, or as long as the system
    # runs something else; that may be long, so that one of several tries decides.
    q, qd = states(arm7, rng, 200_000)
    law, frame = carom.Energetic(0.5, 0.3), arm7.frames[-1]
    scene = carom.Scene.from_file(ROOT / "scenes/box.toml").with_duration(0.6)
    for work in (
        lambda: arm7.impact(q, qd, frame=frame, normal=(0, 0, 1), law=law),
        lambda: arm7.inverse_dynamics(q, qd, qd),
        lambda: scene.simulate(),
    ):
        assert any(share_of_the_longest_pause(work) < 0.5 for _ in range(5))


def test_threads_share_a_chain(arm7, rng):
    q, qd = states(arm7, rng, 500)
    law, frame = carom.Energetic(0.5, 0.3), arm7.frames[-1]
    expected = arm7.impact(q, qd, frame=frame, normal=(0, 0, 1), law=law).qd_plus
    found = {}

    def run(name):
        single = [arm7.impact(q[k], qd[k], frame=frame, normal=(0, 0, 1), law=law).qd_plus for k in range(500)]
        batch = arm7.impact(q, qd, frame=frame, normal=(0, 0, 1), law=law).qd_plus
        found[name] = np.array_equal(single, expected) and np.array_equal(batch, expected) and arm7.mass_matrix(q).shape == (500, 7, 7)

    threads = [threading.Thread(target=run, args=(k,)) for k in range(4)]
    [thread.start() for thread in threads]
    [thread.join() for thread in threads]
    assert found == dict.fromkeys(range(4), True)


def resident():
    """Memory of this process, bytes."""
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * 4096


@pytest.mark.parametrize("kind", ["impact", "dynamics", "law in Python", "error", "batch"])
def test_a_million_calls_leak_nothing(kind, arm, rng):
    q, qd = np.array([0.7854, -1.5708]), np.array([-0.15, 0.6])
    law, own = carom.Energetic(0.35, 0.2), lambda H, u: (0, 0, -u[2] / H[2, 2])
    many_q, many_qd = states(arm, rng, 1000)

    def once():
        if kind == "impact":
            hit = arm.impact(q, qd, frame="tip", normal=(-1, 0, 0), law=law)
            hit.qd_plus, hit.impulse, hit.flags
        elif kind == "dynamics":
            arm.mass_matrix(q)
        elif kind == "law in Python":
            arm.impact(q, qd, frame="tip", normal=(-1, 0, 0), law=own)
        elif kind == "error":
            try:
                arm.mass_matrix(qd[:1])
            except carom.StateError:
                pass
        else:
            arm.impact(many_q, many_qd, frame="tip", normal=(-1, 0, 0), law=law, derivatives=True).mode

    # In all a million calls: of a batch, states.
    calls = {"impact": 500_000, "dynamics": 300_000, "law in Python": 100_000, "error": 100_000, "batch": 1000}[kind]
    for _ in range(max(100, calls // 20)):
        once()
    gc.collect()
    before = resident()
    for _ in range(calls):
        once()
    gc.collect()
    # One word for each call would be 0.8 MB at the fewest calls; a single result of a batch is 0.4 MB.
    assert resident() - before < 4e6 if kind == "batch" else resident() - before < max(0.5e6, 4 * calls)
