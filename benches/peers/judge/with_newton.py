"""Newton (Warp) on the CPU: its solver XPBD, in single precision. Restitution is an option of that solver."""

import math
from importlib.metadata import version

import newton
import numpy as np
import warp

from adapter import Refused, floats, has_limits, march, parts, restitution_asked, serve  # first: it makes `common` importable
import derivatives

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


def damping_ratio(restitution):
    """Damping ratio of a spring whose damper acts only in the approach: e = exp(−ζ/sqrt(1 − ζ²) acos ζ), by bisection."""
    low, high = 0.0, 1.0 - 1e-9
    for _ in range(100):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if math.exp(-middle / math.sqrt(1 - middle**2) * math.acos(middle)) > restitution else (low, middle)
    return low


def gradient(request):
    """By Warp's tape (reverse mode) through SolverSemiImplicit, the solver of Newton's examples of differentiation. Its contacts are
    springs with dampers that act in the approach: a half period of 40 steps, the damping that gives e."""
    scene, step = request["scene"], request.get("step") or STEP["best"]
    if any(path.startswith("contact.") for path in request["by"]):
        raise Refused("the contacts of SolverSemiImplicit have no coefficient of restitution")
    builder, contact, hint = model_of(scene, True), scene["contact"], scene["hint"]
    stiffness = hint["mass"] * (math.pi / (40 * step)) ** 2
    builder.shape_material_ke = [stiffness] * builder.shape_count
    builder.shape_material_kd = [2 * damping_ratio(contact["restitution"]) * math.sqrt(stiffness * hint["mass"])] * builder.shape_count
    builder.shape_material_kf = [1e2 * hint["mass"] if contact["friction"] else 0.0] * builder.shape_count
    builder.joint_q, builder.joint_qd = scene["start"]["q"], scene["start"]["qd"]
    model = builder.finalize(device="cpu", requires_grad=True)
    solver, control = newton.solvers.SolverSemiImplicit(model), model.control()
    count = round(request["times"][-1] / step)
    states = [model.state(requires_grad=True) for _ in range(count + 1)]
    pipeline = newton.CollisionPipeline(model, requires_grad=True, rigid_contact_max=8 * len(scene["bodies"]))
    contacts = [pipeline.contacts() for _ in range(count)]
    newton.eval_fk(model, model.joint_q, model.joint_qd, states[0])
    names = [body["name"] for body in scene["bodies"]]
    pieces = derivatives.forces(scene)
    loads = [warp.zeros(model.body_count, dtype=warp.spatial_vector, requires_grad=True) for _ in pieces]

    def put(point):
        here = derivatives.put(scene, request["by"], map(float, point))
        q, qd = states[0].body_q.numpy(), states[0].body_qd.numpy()
        for k, (_, own, rate) in enumerate(parts(here, here["start"]["q"], here["start"]["qd"])):
            q[k], qd[k] = own, rate
        states[0].body_q.assign(q)
        states[0].body_qd.assign(qd)
        u = derivatives.forces(here)
        for load, piece in zip(loads, u):
            whole = np.zeros((model.body_count, 6), np.float32)
            whole[names.index(here["force"]["body"]), :2] = piece
            load.assign(whole)
        return u

    def advance():
        for k in range(count):
            if loads:
                warp.copy(states[k].body_f, loads[k * len(loads) // count])
            else:
                states[k].clear_forces()
            pipeline.collide(states[k], contacts[k])
            solver.step(states[k], states[k + 1], control, contacts[k], step)

    def value(point):
        u = put(point)
        advance()
        return derivatives.value(request, states[-1].body_q.numpy().astype(float).ravel(), u)

    def slope(point):
        u, tape = put(point), warp.Tape()
        with tape:
            advance()
        by_q, by_u = derivatives.slopes(request, states[-1].body_q.numpy().astype(float).ravel(), u)
        seed = warp.array(by_q.reshape(-1, 7).astype(np.float32), dtype=warp.transform)
        tape.backward(grads={states[-1].body_q: seed})
        first = {"q": states[0].body_q.grad.numpy().ravel(), "qd": states[0].body_qd.grad.numpy().ravel()}
        found = [first[path.split(".")[1]][int(path.split(".")[2])] for path in request["by"] if path != "force.pieces"]
        found += list(by_u + np.ravel([load.grad.numpy()[names.index(scene["force"]["body"]), :2] for load in loads])) if loads else []
        tape.zero()
        return found

    return derivatives.reply(request, value, slope, "Warp's tape (reverse mode), SolverSemiImplicit", step=step, precision="single")


serve(ABOUT, answer, gradient)
