"""MJX (JAX) on the CPU: the model of with_mujoco.py, in single precision (its contacts mix integer types in double precision)."""

import os

os.environ.setdefault("JAX_PLATFORMS", "cpu")
from importlib.metadata import version

import jax
import mujoco
from mujoco import mjx

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


serve(ABOUT, answer)
