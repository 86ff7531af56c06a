"""Newton (Warp) on the CPU: its solver XPBD, in single precision. Restitution is an option of that solver."""

from importlib.metadata import version

import newton
import numpy as np
import warp

from adapter import Refused, floats, has_limits, march, parts, restitution_asked, serve

warp.config.quiet = True
warp.set_device("cpu")
STEP = {"default": 1 / 600, "best": 1e-3}
SOURCE = "newton-physics.github.io/newton, SolverXPBD (enable_restitution, iterations)"
ABOUT = {"engine": "newton", "version": version("newton"), "law": "position based dynamics; Newton's e for each contact", "settings": {
    "default": {"method": "XPBD, CPU, step 1/600 s (ten substeps of 1/60 s), all default; restitution is off", "source": SOURCE},
    "best": {"method": "XPBD, CPU, step 1 ms, enable_restitution, 4 iterations, contact gap 0", "source": SOURCE}}}


def model_of(scene, best):
    builder = newton.ModelBuilder(gravity=tuple(scene["gravity"]))
    contact = scene["contact"]
    config = newton.ModelBuilder.ShapeConfig(density=0.0, mu=contact["friction"], restitution=contact["restitution"], gap=0.0 if best else None,
                                             mu_torsional=0.0, mu_rolling=0.0)
    bodies, joints = {None: -1}, []
    for body in scene["bodies"]:
        made = bodies[body["name"]] = builder.add_link(mass=body["mass"], inertia=warp.mat33(np.diag(body["inertia"]).astype(np.float32)),
                                                       com=tuple(body.get("centre", [0, 0, 0])), lock_inertia=True, label=body["name"])
        for shape in body.get("shapes", []):
            at = warp.transform(tuple(map(float, shape.get("at", [0, 0, 0]))), warp.quat_identity())
            if "sphere" in shape:
                builder.add_shape_sphere(made, xform=at, radius=shape["sphere"], cfg=config)
            else:
                x, y, z = shape["box"]
                builder.add_shape_box(made, xform=at, hx=x / 2, hy=y / 2, hz=z / 2, cfg=config)
        if body["joint"] == "free":
            joint = builder.add_joint_free(made)
        else:
            add = {"hinge": builder.add_joint_revolute, "slider": builder.add_joint_prismatic}[body["joint"]]
            lower, upper = body.get("limits", [None, None])
            joint = add(bodies[body["parent"]], made, parent_xform=warp.transform(tuple(map(float, body["at"])), warp.quat_identity()),
                        axis=tuple(map(float, body["axis"])), limit_lower=lower, limit_upper=upper, armature=0.0)
        if body["parent"] is None and joints:
            builder.add_articulation(joints)
            joints = []
        joints.append(joint)
    builder.add_articulation(joints)
    for plane in scene["planes"]:
        normal = np.array(plane["normal"], float)
        builder.add_shape_plane(plane=(*normal, -float(normal @ plane["point"])), width=0.0, length=0.0, cfg=config)
    return builder


def answer(request):
    scene, best = request["scene"], request["settings"] == "best"
    if has_limits(scene) and scene["contact"].get("limit_restitution", 0.0) > 0.0:
        raise Refused("joint limits have no coefficient of restitution")
    if not best and restitution_asked(scene) > 0.0:
        raise Refused("restitution is off by default (documented); see the setting best")
    step = request.get("step") or STEP[request["settings"]]
    builder = model_of(scene, best)
    q, qd = [], []
    for body, own, rate in parts(scene, scene["start"]["q"], scene["start"]["qd"]):
        q, qd = q + list(own), qd + list(rate)
    builder.joint_q, builder.joint_qd = q, qd
    model = builder.finalize(device="cpu")
    solver = newton.solvers.SolverXPBD(model, **(dict(iterations=4, enable_restitution=True) if best else {}))
    now, after, control = model.state(), model.state(), model.control()
    newton.eval_fk(model, model.joint_q, model.joint_qd, now)
    contacts = model.contacts()

    def advance(count):
        nonlocal now, after
        for _ in range(count):
            now.clear_forces()
            model.collide(now, contacts)
            solver.step(now, after, control, contacts, step)
            now, after = after, now

    def state():
        joint_q, joint_qd = warp.zeros_like(model.joint_q), warp.zeros_like(model.joint_qd)
        newton.eval_ik(model, now, joint_q, joint_qd)
        return {"q": floats(joint_q.numpy()), "qd": floats(joint_qd.numpy())}

    return {"states": march(request, step, advance, state), "used": {"step": step}}


serve(ABOUT, answer)
