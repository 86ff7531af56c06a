"""MJX (JAX) on the CPU: the model of with_mujoco.py, in single precision (its contacts mix integer types in double precision)."""

import os

os.environ.setdefault("JAX_PLATFORMS", "cpu")
from importlib.metadata import version

import jax
import jax.numpy as jnp
import mujoco
from mujoco import mjx

import derivatives
import with_mujoco
from adapter import march, serve

STEP = {"default": 2e-3, "best": 5e-4}
SOURCE = "mujoco.readthedocs.io/en/stable/mjx.html"
ABOUT = {"engine": "mjx", "version": version("mujoco-mjx"), "law": with_mujoco.ABOUT["law"], "settings": {
    "default": {"method": "JAX on the CPU in single precision, step 2 ms, as MuJoCo's default", "source": SOURCE},
    "best": {"method": "the same, step 0.5 ms, as MuJoCo's best with Euler and solimp 0.99", "source": SOURCE}}}


@jax.jit
def steps(model, data, count):
    return jax.lax.fori_loop(0, count, lambda _, it: mjx.step(model, it), data)


def answer(request):
    with_mujoco.refuse_what_is_missing(request)
    scene, step = request["scene"], request.get("step") or STEP[request["settings"]]
    spec = with_mujoco.spec_of(scene, request["settings"], step, impedance=0.99)  # closer to 1 it is lost in single precision
    spec.option.integrator, spec.option.tolerance = mujoco.mjtIntegrator.mjINT_EULER, 1e-8
    if not scene["contact"]["friction"]:
        spec.option.cone = mujoco.mjtCone.mjCONE_PYRAMIDAL  # the elliptic cone refuses frictionless contacts
    model = spec.compile()
    data = mujoco.MjData(model)
    with_mujoco.start(scene, data)
    there = mjx.put_model(model)
    now = mjx.put_data(model, data)

    def advance(count):
        nonlocal now
        now = steps(there, now, count)

    return {"states": march(request, step, advance, lambda: with_mujoco.state(scene, now.qpos, now.qvel)), "used": {"step": step}}


def gradient(request):
    """By JAX in double precision, with the step and the impedance of MuJoCo's best settings. Forward mode goes through the solver's
    loop; where there are more than 20 numbers, reverse mode, for which the solver makes one iteration, without a loop."""
    jax.config.update("jax_enable_x64", True)
    scene, step = request["scene"], request.get("step") or with_mujoco.STEP["best"]
    if any(path.startswith("contact.") for path in request["by"]):
        raise with_mujoco.Refused("it has no coefficient of restitution")
    reverse = len(request["at"][0]) > 20
    spec = with_mujoco.spec_of(scene, "best", step)
    spec.option.integrator, spec.option.tolerance = mujoco.mjtIntegrator.mjINT_EULER, 1e-12
    spec.option.cone = mujoco.mjtCone.mjCONE_PYRAMIDAL  # the derivatives of the elliptic cone are not finite
    if reverse:
        spec.option.iterations, spec.option.ls_iterations = 1, 4
    model = spec.compile()
    data = mujoco.MjData(model)
    with_mujoco.start(scene, data)
    there, begin = mjx.put_model(model), mjx.put_data(model, data)
    pieces = len(derivatives.forces(scene)) or 1
    steered = [body["name"] for body in scene["bodies"]].index(scene["force"]["body"]) if "force" in scene else None
    count = round(request["times"][-1] / step / pieces)
    # A step mixes the lengths of integers in double precision; a loop needs the same types before and after.
    alike = lambda now: jax.tree.map(lambda new, old: new.astype(old.dtype), mjx.step(there, now), now)
    chosen = [path.split(".") for path in request["by"] if path != "force.pieces"]

    def final(point):
        now, u = begin, jnp.zeros((0, 2))
        for (_, kind, place), number in zip(chosen, point):
            # Positions and velocities of free bodies are in world axes in MuJoCo, too.
            if kind == "q":
                now = now.replace(qpos=now.qpos.at[int(place)].set(number))
            else:
                now = now.replace(qvel=now.qvel.at[int(place)].set(number))
        if steered is None:
            now = jax.lax.scan(lambda it, _: (alike(it), None), now, length=count)[0]
        else:
            u = point.reshape(-1, 2)
            one = lambda it, _: (alike(it), None)
            # The steps within a piece are computed again on the way back, so that not all are kept.
            piece = jax.checkpoint(lambda it, force: (jax.lax.scan(one, it.replace(
                qfrc_applied=jax.lax.dynamic_update_slice(it.qfrc_applied, force, (6 * steered,))), length=count)[0], None))
            now = jax.lax.scan(piece, now, u)[0]
        return derivatives.value(request, now.qpos, u)

    value = jax.jit(final)
    slope = jax.jit(jax.grad(final) if reverse else jax.jacfwd(final))
    waited = lambda function: lambda point: jax.block_until_ready(function(point))
    return derivatives.reply(request, waited(value), waited(slope), f"JAX, {'reverse' if reverse else 'forward'} mode, double precision", step=step)


serve(ABOUT, answer, gradient)
