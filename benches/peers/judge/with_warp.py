"""MuJoCo Warp on the CPU: the model of with_mujoco.py, in single precision."""

import os

os.environ.setdefault("MJWARP_DEVICE", "cpu")
from importlib.metadata import version

import mujoco
import mujoco_warp
import warp

import with_mujoco
from adapter import march, serve

warp.config.quiet = True
warp.set_device("cpu")
STEP = {"default": 2e-3, "best": 1e-3}
SOURCE = "mujoco.readthedocs.io/en/stable/mjwarp"
ABOUT = {"engine": "mujoco-warp", "version": version("mujoco-warp"), "law": with_mujoco.ABOUT["law"],
         "no derivatives": "its kernels are compiled without a backward pass (enable_backward is False)", "settings": {
    "default": {"method": "CPU, step 2 ms, as MuJoCo's default", "source": SOURCE},
    "best": {"method": "CPU, step 1 ms (single precision loses the contact at smaller ones), otherwise as MuJoCo's best with Euler and solimp 0.99", "source": SOURCE}}}


def answer(request):
    with_mujoco.refuse_what_is_missing(request)
    scene, step = request["scene"], request.get("step") or STEP[request["settings"]]
    spec = with_mujoco.spec_of(scene, request["settings"], step, impedance=0.99)  # closer to 1 it is lost in single precision
    spec.option.integrator, spec.option.tolerance = mujoco.mjtIntegrator.mjINT_EULER, 1e-8
    spec.option.iterations, spec.option.ls_iterations = 10, 10  # the CPU executes all of them in every step
    model = spec.compile()
    data = mujoco.MjData(model)
    with_mujoco.start(scene, data)
    mujoco.mj_forward(model, data)
    there, state = mujoco_warp.put_model(model), mujoco_warp.put_data(model, data, nconmax=64, njmax=256)

    def advance(count):
        for _ in range(count):
            mujoco_warp.step(there, state)

    now = lambda: with_mujoco.state(scene, state.qpos.numpy()[0], state.qvel.numpy()[0])
    return {"states": march(request, step, advance, now), "used": {"step": step}}


serve(ABOUT, answer)
