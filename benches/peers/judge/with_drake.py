"""Drake: compliant contacts (Hunt & Crossley); `default` is discrete, `best` continuous with error control. With --discrete both are
discrete, with --cenic both are continuous, integrated by CENIC."""

import itertools
import logging
import math
import sys
from importlib.metadata import version

import numpy as np
from pydrake.autodiffutils import AutoDiffXd, ExtractGradient, InitializeAutoDiff
from pydrake.common.eigen_geometry import Quaternion
from pydrake.geometry import (
    AddContactMaterial, Box, CollisionFilterDeclaration, GeometrySet, HalfSpace, ProximityProperties, Sphere)
from pydrake.math import RigidTransform
from pydrake.multibody.cenic import CenicIntegrator  # noqa: F401: without it the integrator has no Python class
from pydrake.multibody.contact_solvers import IcfSolverParameters
from pydrake.multibody.math import SpatialVelocity
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, CoulombFriction, DiscreteContactApproximation
from pydrake.systems.analysis import ResetIntegratorFromFlags, Simulator, Simulator_
from pydrake.systems.framework import DiagramBuilder

from adapter import Refused, floats, has_limits, march, parts, restitution_asked, serve, trees, urdf  # first: it makes `common` importable
import common
import derivatives

logging.getLogger("drake").setLevel(logging.ERROR)
DISCRETE, CENIC = "--discrete" in sys.argv, "--cenic" in sys.argv
STEP = {"default": 1e-3, "best": 1e-4}
SOURCE = "drake.mit.edu, MultibodyPlant, Contact modeling; drake.mit.edu/doxygen_cxx/group__compliant__contact.html"
CHOSEN = "dissipation that gives e at the case's speed, boxes as spheres at their corners"
METHODS = {
    "drake": ("discrete, step 1 ms, kLagged (default)", f"continuous, RK3 with accuracy 1e-9, stiffness for a contact of 0.1 ms, {CHOSEN}"),
    "drake-discrete": ("discrete, step 1 ms, kLagged (default)", f"discrete, step 0.1 ms, kLagged, stiffness for a contact of 100 steps, {CHOSEN}"),
    "drake-cenic": ("continuous, CENIC with accuracy 1e-3 (its default), steps to 0.1 s (default)",
                    f"continuous, CENIC with accuracy 1e-11, steps to 2 µs, stiffness for a contact of 0.1 ms, {CHOSEN}")}
NAME = "drake-discrete" if DISCRETE else "drake-cenic" if CENIC else "drake"
SOURCE += "; drake.mit.edu/doxygen_cxx/classdrake_1_1multibody_1_1_cenic_integrator.html" if CENIC else ""
ABOUT = {"engine": NAME, "version": version("drake"), "law": "Hunt & Crossley, regularised Coulomb", "settings": {
    "default": {"method": f"{METHODS[NAME][0]}, default stiffness and dissipation; restitution is not expressible", "source": SOURCE},
    "best": {"method": METHODS[NAME][1], "source": SOURCE}}}
if CENIC:
    ABOUT["no derivatives"] = "CENIC solves its steps in double precision only (its source: 'ICF solver only supports T = double')"
HALF_PERIOD = 1e-4  # of the contact in the continuous plant, s
# CENIC: accuracy and longest step. Its contacts in a step are those that overlap at the start of the step, so that the first contact is
# found late by up to half a step: with 1/50 of the contact's duration the energy is wrong by (π/100)² or less.
CENIC_CONTROL = {"default": (1e-3, 0.1), "best": (1e-11, 2e-6)}


def material(scene, half_period):
    properties, contact = ProximityProperties(), scene["contact"]
    friction = CoulombFriction(contact["friction"], contact["friction"])
    if half_period is None:
        AddContactMaterial(friction=friction, properties=properties)
        return properties
    # The stiffnesses of a pair act in series, and each dissipation is weighted by the other stiffness: with equal materials
    # the stiffness must be doubled, the dissipation not. At e = 0 the dissipation is large, but finite.
    speed, mass = scene["hint"]["speed"], scene["hint"]["mass"]
    AddContactMaterial(point_stiffness=2 * mass * (math.pi / half_period) ** 2, friction=friction, properties=properties,
                       dissipation=common.hunt_crossley(max(contact["restitution"], 0.01), speed))
    return properties


def shapes_of(shape, best):
    """(shape, position). Point contact gives a box one contact point with a half-space, so `best` has spheres of 1 mm at its corners."""
    at = np.array(shape.get("at", [0, 0, 0]), float)
    if "sphere" in shape:
        return [(Sphere(shape["sphere"]), at)]
    if not best:
        return [(Box(*shape["box"]), at)]
    half = np.array(shape["box"]) / 2 - 1e-3
    return [(Sphere(1e-3), at + half * np.array(corner)) for corner in itertools.product((-1, 1), repeat=3)]


def plant_of(scene, step, half_period):
    builder = DiagramBuilder()
    plant, graph = AddMultibodyPlantSceneGraph(builder, step)
    for k, tree in enumerate(trees(scene)):
        # A jointed root hangs on a link `world`, which is Drake's world.
        Parser(plant, f"tree{k}").AddModelsFromString(urdf(tree, shapes=False), "urdf")
    plant.mutable_gravity_field().set_gravity_vector(scene["gravity"])
    planes, shapes = [], {}
    for k, plane in enumerate(scene["planes"]):
        pose = HalfSpace.MakePose(np.array(plane["normal"], float), np.array(plane["point"], float))
        planes.append(plant.RegisterCollisionGeometry(plant.world_body(), pose, HalfSpace(), f"plane{k}", material(scene, half_period)))
    for body in scene["bodies"]:
        made = [it for shape in body.get("shapes", []) for it in shapes_of(shape, half_period is not None)]
        shapes[body["name"]] = [
            plant.RegisterCollisionGeometry(plant.GetBodyByName(body["name"]), RigidTransform(at), shape, f"{body['name']}{k}", material(scene, half_period))
            for k, (shape, at) in enumerate(made)]
    pairs = {frozenset(pair) for pair in scene["pairs"]}
    for a in shapes:
        for b in shapes:
            if a < b and frozenset((a, b)) not in pairs and shapes[a] and shapes[b]:
                rule = CollisionFilterDeclaration().ExcludeBetween(GeometrySet(shapes[a]), GeometrySet(shapes[b]))
                graph.collision_filter_manager().Apply(rule)
    if half_period is not None and step:
        plant.set_discrete_contact_approximation(DiscreteContactApproximation.kLagged)
    plant.Finalize()
    if half_period is not None and scene["contact"]["friction"]:
        plant.set_stiction_tolerance(1e-4 * max(scene["hint"]["speed"], 0.1))
    return builder.Build(), plant


def put(scene, plant, context):
    """Sets the start of the scene."""
    for body, own, rate in parts(scene, scene["start"]["q"], scene["start"]["qd"]):
        if body["joint"] == "free":
            x, y, z, w = own[3:]
            here = plant.GetBodyByName(body["name"])
            plant.SetFloatingBaseBodyPoseInWorldFrame(context, here, RigidTransform(Quaternion(np.array([w, x, y, z]) / np.linalg.norm(own[3:])), own[:3]))
            velocity = SpatialVelocity(np.array(rate[3:], float), np.array(rate[:3], float))
            plant.SetFreeBodySpatialVelocity(context=context, body=here, V_JpJc=velocity)
            continue
        joint = plant.GetJointByName(f"{body['name']}_joint")
        if body["joint"] == "hinge":
            joint.set_angle(context, own[0])
            joint.set_angular_rate(context, rate[0])
        else:
            joint.set_translation(context, own[0])
            joint.set_translation_rate(context, rate[0])


def state(scene, plant, context):
    q, qd = [], []
    for body in scene["bodies"]:
        if body["joint"] == "free":
            here = plant.GetBodyByName(body["name"])
            pose, velocity = here.EvalPoseInWorld(context), here.EvalSpatialVelocityInWorld(context)
            w, x, y, z = pose.rotation().ToQuaternion().wxyz()
            q += [*pose.translation(), x, y, z, w]
            qd += [*velocity.translational(), *velocity.rotational()]
        else:
            joint = plant.GetJointByName(f"{body['name']}_joint")
            q.append(joint.GetOnePosition(context))
            qd.append(joint.GetOneVelocity(context))
    return {"q": floats(q), "qd": floats(qd)}


def answer(request):
    scene, best = request["scene"], request["settings"] == "best"
    if has_limits(scene) and scene["contact"].get("limit_restitution", 0.0) > 0.0:
        raise Refused("joint limits have no coefficient of restitution")
    if not best and restitution_asked(scene) > 0.0:
        raise Refused("it has no coefficient of restitution by default (dissipation instead); see the setting best")
    continuous = CENIC or best and not DISCRETE
    if continuous and has_limits(scene) and not CENIC:
        raise Refused("joint limits are ignored by the continuous plant (documented)")
    step = request.get("step") or STEP[request["settings"]]
    # Refinement of the continuous plant is a stiffer, shorter contact.
    half_period = None if not best else HALF_PERIOD if CENIC else HALF_PERIOD * step / STEP["best"] if continuous else max(100.0, 1 / math.sqrt(step)) * step
    diagram, plant = plant_of(scene, 0.0 if continuous else step, half_period)
    simulator = Simulator(diagram)
    used = {"step": step} | ({"half period of contact": half_period} if best else {})
    if CENIC:
        # Refinement is a tighter accuracy: of a method of first order with a local error of second order, errors fall with its root.
        accuracy, longest = CENIC_CONTROL[request["settings"]]
        used |= {"accuracy": accuracy * step / STEP[request["settings"]], "longest step": longest}
        integrator = ResetIntegratorFromFlags(simulator, "cenic", used["longest step"])
        integrator.set_target_accuracy(used["accuracy"])
        # Its solver stops at a thousandth of the accuracy, but by default not below 1e-8.
        integrator.SetSolverParameters(IcfSolverParameters(min_tolerance=1e-15))
    elif continuous:
        ResetIntegratorFromFlags(simulator, "runge_kutta3", 1e-3)
        integrator = simulator.get_mutable_integrator()
        # A longer step that meets a contact is rejected by the error control.
        integrator.set_maximum_step_size(2e-3)
        integrator.set_target_accuracy(1e-9)
    context = plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    put(scene, plant, context)
    simulator.Initialize()
    made = 0

    def advance(count):
        nonlocal made
        made += count
        # An update takes place at the start of a step: half a step before the end, so that a rounded time makes no step more or less.
        simulator.AdvanceTo(made * step if continuous else (made - 0.5) * step)

    return {"states": march(request, step, advance, lambda: state(scene, plant, context)), "used": used}


def gradient(request):
    """By AutoDiffXd, the scalar type that carries derivatives through the discrete plant, with the settings `best`."""
    scene, step = request["scene"], request.get("step") or STEP["best"]
    if not DISCRETE:
        raise Refused("the continuous plant with AutoDiffXd ends with an error where the dissipation of a contact is set from Python "
                      "('hunt_crossley_dissipation' exists, but is of a different type: requested AutoDiffXd)")
    if any(path.startswith("contact.") for path in request["by"]):
        raise Refused("it has no coefficient of restitution")
    diagram, plant = plant_of(scene, step, max(100.0, 1 / math.sqrt(step)) * step)
    derived = diagram.ToAutoDiffXd()
    both = {float: (diagram, plant), AutoDiffXd: (derived, derived.GetSubsystemByName(plant.get_name()))}
    pieces = len(derivatives.forces(scene)) or 1
    count = round(request["times"][-1] / step / pieces)
    order = [plant.GetBodyByName(body["name"]) for body in scene["bodies"]]

    def final(point, scalar):
        system, own = both[scalar]
        made = lambda values: [x if isinstance(x, scalar) else scalar(x) for x in values]
        here = derivatives.put(scene, request["by"], point)
        q, v = (np.array(made([0.0] * n)) for n in (plant.num_positions(), plant.num_velocities()))
        for body, (_, place, rate) in zip(order, parts(here, here["start"]["q"], here["start"]["qd"])):
            # Drake: w x y z, position; angular velocity, velocity, in world axes.
            i, j = body.floating_positions_start(), body.floating_velocities_start_in_v()
            q[i:i + 7] = made([place[6], *place[3:6], *place[:3]])
            v[j:j + 6] = made([*rate[3:], *rate[:3]])
        simulator = Simulator_[scalar](system)
        context = own.GetMyMutableContextFromRoot(simulator.get_mutable_context())
        own.SetPositions(context, q)
        own.SetVelocities(context, v)
        u = derivatives.forces(here)
        for k in range(pieces):
            if len(u):
                load = np.array(made([0.0] * len(v)))
                j = plant.GetBodyByName(here["force"]["body"]).floating_velocities_start_in_v() + 3
                load[j:j + 2] = made(u[k])
                own.get_applied_generalized_force_input_port().FixValue(context, load)
            simulator.AdvanceTo(((k + 1) * count - 0.5) * step)
        moved, last = own.GetPositions(context), []
        for body in order:
            i = body.floating_positions_start()
            last += [*moved[i + 4:i + 7], *moved[i + 1:i + 4], moved[i]]
        return derivatives.value(request, np.array(last), u)

    value = lambda point: final(point, float)
    slope = lambda point: ExtractGradient(np.array([[final(InitializeAutoDiff(point).ravel(), AutoDiffXd)]]))
    return derivatives.reply(request, value, slope, "AutoDiffXd (forward mode)", step=step)


if __name__ == "__main__":
    serve(ABOUT, answer, None if CENIC else gradient)
