"""carom.jax and carom.torch: their derivatives are those of carom, differences agree, and batches are loops."""

import importlib

import carom
import numpy as np
import pytest
from conftest import ROOT

LAW = carom.Energetic(0.5, 0.3)
Q, QD = np.array([0.3, 0.6]), np.array([-1.0, 1.2])


def arrays(library):
    """The module of carom, a function that makes arrays of the library, and one that makes NumPy arrays of them."""
    if library == "jax":
        jax = pytest.importorskip("jax")
        jax.config.update("jax_enable_x64", True)
        return importlib.import_module("carom.jax"), jax.numpy.asarray, np.asarray
    torch = pytest.importorskip("torch")
    make = lambda x: torch.tensor(np.asarray(x), dtype=torch.float64, requires_grad=True)  # noqa: E731
    return importlib.import_module("carom.torch"), make, lambda x: x.detach().numpy()


def gradients(library, of, values):
    """The derivatives of a number by arguments, by reverse mode."""
    _, make, plain = arrays(library)
    if library == "jax":
        import jax

        return [np.asarray(x) for x in jax.grad(of, argnums=range(len(values)))(*map(make, values))]
    arguments = [make(x) for x in values]
    of(*arguments).backward()
    return [plain(x.grad) for x in arguments]


both = pytest.mark.parametrize("library", ["jax", "torch"])


@pytest.fixture
def scene():
    return carom.Scene.from_file(ROOT / "scenes/planar2.toml")


@both
def test_derivatives_of_impacts_are_those_of_chains(library, arm):
    strike = arrays(library)[0].impact(arm, "tip", (0, 1, 0), LAW)
    weights = np.array([0.7, -0.4])
    found = gradients(library, lambda *x: (strike(*x) * arrays(library)[1](weights)).sum(), [Q, QD, 0.6, 0.2])
    hit = arm.impact(Q, QD, "tip", (0, 1, 0), LAW, restitution=0.6, friction=0.2, derivatives=True)
    for own, name in zip(found, ["q", "qd", "restitution", "friction"]):
        assert np.abs(own - weights @ hit.derivatives[name]).max() < 1e-14, name


@both
def test_derivatives_of_runs_are_rows_of_sensitivities(library, scene):
    wrt = ["contact.restitution", "robot.mass.link2"]
    scene = scene.with_keys({"robot.mass.link2": 1.5})
    end = arrays(library)[0].run(scene, wrt)
    q, qd = scene.q, scene.qd
    found = gradients(library, lambda *x: end(*x)[1][1], [q, qd, 0.5, 1.5])
    by = scene.with_start(q, qd).with_keys({"contact.restitution": 0.5}).sensitivity(["q", "qd", *wrt]).last_by[3]
    assert np.abs(np.concatenate([np.ravel(x) for x in found]) - by).max() < 1e-13
    assert abs(by[5]) > 1e-3


@both
def test_batches_are_loops(library, arm, scene):
    module, make, plain = arrays(library)
    qd = np.array([[-1.0, 1.2], [-0.5, 1.0], [-2.0, 0.1]])
    strike = module.impact(arm, "tip", (0, 1, 0), LAW)
    end = module.run(scene, ["contact.restitution"])
    q, e = scene.q, 0.5
    many = gradients(library, lambda x: batched(library, strike, Q)(x).sum(), [qd])[0]
    runs = gradients(library, lambda x: batched(library, lambda q, qd: end(q, qd, e)[0], q)(x).sum(), [0.01 * qd])[0]
    for k in range(3):
        assert np.array_equal(many[k], gradients(library, lambda x: strike(make(Q), x).sum(), [qd[k]])[0])
        assert np.array_equal(runs[k], gradients(library, lambda x: end(make(q), x, e)[0].sum(), [0.01 * qd[k]])[0])


def batched(library, function, q):
    """The function of rows of qd."""
    if library == "jax":
        import jax

        return jax.jit(jax.vmap(lambda qd: function(q, qd)))
    return lambda qd: function(np.broadcast_to(q, tuple(qd.shape)).copy(), qd)


@both
def test_a_floating_base_has_the_derivatives_along_displacements(library):
    scene = carom.Scene.from_file(ROOT / "scenes/ball.toml")
    chain = scene.chain
    q, qd = scene.q, scene.qd
    end = arrays(library)[0].run(scene)
    weights = np.linspace(-1, 1, chain.nq)
    make = arrays(library)[1]
    by_q, by_qd = gradients(library, lambda q, qd: (end(q, qd)[0] * make(weights)).sum(), [q, qd])
    h = 1e-5
    for j, unit in enumerate(np.eye(chain.nv)):
        at = lambda q, qd: weights @ scene.with_start(q, qd).simulate().last[1]  # noqa: E731
        moved = (at(chain.integrate(q, unit, h), qd) - at(chain.integrate(q, unit, -h), qd)) / (2 * h)
        assert abs(moved - by_q @ chain.q_rate(q, unit)) < 1e-6 * max(1, abs(moved)), j
        faster = (at(q, qd + h * unit) - at(q, qd - h * unit)) / (2 * h)
        assert abs(faster - by_qd[j]) < 1e-6 * max(1, abs(faster)), j


@both
def test_where_there_is_no_derivative_the_reason_is_told(library, scene):
    module, make, _ = arrays(library)
    end = module.run(scene.with_keys({"run.method": "steps", "run.contact_step": 1e-3}))
    q, qd = scene.q, scene.qd
    with pytest.raises(Exception, match="no derivative after t = .* s: .*steps"):
        gradients(library, lambda q, qd: end(q, qd)[0].sum(), [q, qd])
    with pytest.raises(TypeError, match="1 numbers are given for 0 keys: none"):
        end(make(q), make(qd), 1.0)


@both
def test_numbers_that_a_run_cannot_be_a_function_of_are_refused(library, scene):
    module, _, _ = arrays(library)
    for wrt, kind, told in [
        ("contact.restitution", TypeError, "give a list of paths"),
        (["contact.restitution", "contact.restitution"], ValueError, "twice"),
        (["robot.q[0]"], ValueError, "the start is given by the arguments q and qd"),
    ]:
        with pytest.raises(kind, match=told):
            module.run(scene, wrt)
    with pytest.raises(TypeError, match="law is a list of 2: give one law"):
        module.impact(scene.chain, "tip", [-1, 0, 0], [carom.Newton(0.5), carom.Poisson(0.5)])


def test_jax_checks_gradients_by_differences(arm, scene):
    module, make, _ = arrays("jax")
    from jax.test_util import check_grads

    strike = module.impact(arm, "tip", (0, 1, 0), LAW)
    check_grads(strike, [make(Q), make(QD), make(0.6), make(0.2)], order=1, rtol=1e-6, atol=1e-6)
    q, qd = scene.q, scene.qd
    end = module.run(scene, ["contact.restitution"])
    check_grads(end, [make(q), make(qd), make(0.5)], order=1, rtol=1e-4, atol=1e-4, eps=1e-6)


def test_torch_checks_gradients_by_differences(arm, scene):
    module, make, _ = arrays("torch")
    import torch

    strike = module.impact(arm, "tip", (0, 1, 0), LAW)
    assert torch.autograd.gradcheck(strike, [make(Q), make(QD), make(0.6), make(0.2)])
    q, qd = scene.q, scene.qd
    end = module.run(scene, ["contact.restitution"])
    assert torch.autograd.gradcheck(end, [make(q), make(qd), make(0.5)], rtol=1e-4, atol=1e-4)


def test_jax_with_32_bits_is_refused(arm):
    module, _, _ = arrays("jax")
    import jax

    jax.config.update("jax_enable_x64", False)
    try:
        with pytest.raises(TypeError, match="jax_enable_x64"):
            module.impact(arm, "tip", (0, 1, 0), LAW)(Q, QD)
    finally:
        jax.config.update("jax_enable_x64", True)
