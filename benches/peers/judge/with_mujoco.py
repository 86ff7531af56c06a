"""MuJoCo. It has no coefficient of restitution: the setting `best` gets one from the damping of its contact springs."""

import math

import mujoco
import numpy as np

from adapter import Refused, floats, march, parts, restitution_asked, serve  # first: it makes `common` importable
import common

STEP = {"default": 2e-3, "best": 1e-4}
ABOUT = {"engine": "mujoco", "version": mujoco.__version__, "law": "linear spring and damper in acceleration space",
         "no derivatives": "it has differences (mjd_transitionFD), no automatic derivatives", "settings": {
    "default": {"method": "step 2 ms, Euler, pyramidal cone; restitution is not expressible",
                "source": "mujoco.readthedocs.io/en/stable/XMLreference.html#option"},
    "best": {"method": "step 0.1 ms, RK4, direct solref (−k, −c) with a half period of 40 steps and the damping ratio of e, solimp 0.9999, "
                       "elliptic cone, Newton tolerance 1e-15, solreffriction 50 steps",
             "source": "mujoco.readthedocs.io/en/stable/modeling.html#solver-parameters"}}}


def spec_of(scene, settings, step, impedance=0.9999):
    solimp = [impedance, impedance, 1e-3, 0.5, 2]
    best, contact = settings == "best", scene["contact"]
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    spec.option.timestep, spec.option.gravity = step, scene["gravity"]
    if best:
        spec.option.cone, spec.option.tolerance = mujoco.mjtCone.mjCONE_ELLIPTIC, 1e-15
        spec.option.iterations, spec.option.integrator = 200, mujoco.mjtIntegrator.mjINT_RK4
    bodies, geoms = {None: spec.worldbody}, {}
    for body in scene["bodies"]:
        at = body.get("at", [0, 0, 0])
        made = bodies[body["parent"]].add_body(name=body["name"], pos=at)
        made.mass, made.ipos, made.inertia, made.explicitinertial = body["mass"], body.get("centre", [0, 0, 0]), body["inertia"], True
        if body["joint"] == "free":
            made.add_freejoint()
        else:
            kind = {"hinge": mujoco.mjtJoint.mjJNT_HINGE, "slider": mujoco.mjtJoint.mjJNT_SLIDE}[body["joint"]]
            joint = made.add_joint(type=kind, axis=body["axis"])
            if "limits" in body:
                joint.limited, joint.range = mujoco.mjtLimited.mjLIMITED_TRUE, body["limits"]
                if best:
                    joint.solref_limit, joint.solimp_limit = solref(contact.get("limit_restitution", 0.0), step), solimp
        geoms[body["name"]] = []
        for k, shape in enumerate(body.get("shapes", [])):
            name, place = f"{body['name']}{k}", shape.get("at", [0, 0, 0])
            if "sphere" in shape:
                made.add_geom(name=name, type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[shape["sphere"], 0, 0], pos=place, contype=0, conaffinity=0)
            else:
                made.add_geom(name=name, type=mujoco.mjtGeom.mjGEOM_BOX, size=[x / 2 for x in shape["box"]], pos=place, contype=0, conaffinity=0)
            geoms[body["name"]].append(name)
        bodies[body["name"]] = made
    for k, plane in enumerate(scene["planes"]):
        turn = np.zeros(4)
        mujoco.mju_quatZ2Vec(turn, np.array(plane["normal"], float))
        spec.worldbody.add_geom(name=f"plane{k}", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[1, 1, 1], pos=plane["point"], quat=turn,
                                contype=0, conaffinity=0)
    touching = [(f"plane{k}", name) for k in range(len(scene["planes"])) for names in geoms.values() for name in names]
    touching += [(a, b) for one, other in scene["pairs"] for a in geoms[one] for b in geoms[other]]
    mu = contact["friction"]
    for a, b in touching:
        pair = spec.add_pair(geomname1=a, geomname2=b, condim=3 if mu else 1, friction=[mu, mu, 0, 0, 0])
        if best:
            pair.solref, pair.solimp = solref(contact["restitution"], step), solimp
            pair.solreffriction = [50 * step, 1]
    return spec


def contact_steps(step):
    """Half period of a contact's spring in steps. More steps at a smaller step, so that the rebound and the duration converge."""
    return max(10.0, 40.0 * math.sqrt(1e-4 / step))


def solref(restitution, step):
    """Direct format (−stiffness, −damping); at e = 0 the default's critical damping, with the shortest documented time, 2 steps."""
    if restitution == 0.0:
        return [2 * step, 1]
    ratio, frequency = common.spring_damping(restitution), math.pi / (contact_steps(step) * step)
    return [-frequency**2, -2.0 * ratio * frequency]


def start(scene, data):
    """Writes the start into MuJoCo's q and q̇: quaternions begin with w, the angular velocity is in the body's axes."""
    q, qd = [], []
    for body, own, rate in parts(scene, scene["start"]["q"], scene["start"]["qd"]):
        if body["joint"] == "free":
            x, y, z, w = own[3:]
            q += [*own[:3], w, x, y, z]
            qd += [*rate[:3], *common.turned(own[3:], rate[3:], back=True)]
        else:
            q, qd = q + list(own), qd + list(rate)
    data.qpos[:], data.qvel[:] = q, qd



def state(scene, qpos, qvel):
    q, qd = [], []
    for body, own, rate in parts(scene, list(qpos), list(qvel)):
        if body["joint"] == "free":
            w, x, y, z = own[3:]
            q += [*own[:3], x, y, z, w]
            qd += [*rate[:3], *common.turned([x, y, z, w], rate[3:])]
        else:
            q, qd = q + own, qd + rate
    return {"q": floats(q), "qd": floats(qd)}


def refuse_what_is_missing(request):
    if request["settings"] == "default" and restitution_asked(request["scene"]) > 0.0:
        raise Refused("it has no coefficient of restitution (documented); see the setting best")


def answer(request):
    refuse_what_is_missing(request)
    scene, step = request["scene"], request.get("step") or STEP[request["settings"]]
    model = spec_of(scene, request["settings"], step).compile()
    data = mujoco.MjData(model)
    start(scene, data)
    advance = lambda count: mujoco.mj_step(model, data, nstep=count)
    return {"states": march(request, step, advance, lambda: state(scene, data.qpos, data.qvel)), "used": {"step": step}}


if __name__ == "__main__":
    serve(ABOUT, answer)
