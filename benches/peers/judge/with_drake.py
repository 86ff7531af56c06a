"""Drake: compliant contacts (Hunt & Crossley); `default` is discrete, `best` continuous with error control, or discrete with --discrete."""

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
from pydrake.multibody.math import SpatialVelocity
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, CoulombFriction, DiscreteContactApproximation
from pydrake.systems.analysis import ResetIntegratorFromFlags, Simulator, Simulator_
from pydrake.systems.framework import DiagramBuilder

from adapter import Refused, floats, has_limits, march, parts, restitution_asked, serve, trees, urdf  # first: it makes `common` importable
import common
import derivatives

logging.getLogger("drake").setLevel(logging.ERROR)
DISCRETE = "--discrete" in sys.argv
STEP = {"default": 1e-3, "best": 1e-4}
SOURCE = "drake.mit.edu, MultibodyPlant, Contact modeling; drake.mit.edu/doxygen_cxx/group__compliant__contact.html"
ABOUT = {"engine": "drake-discrete" if DISCRETE else "drake", "version": version("drake"), "law": "Hunt & Crossley, regularised Coulomb", "settings": {
    "default": {"method": "discrete, step 1 ms, kLagged (default), default stiffness and dissipation; restitution is not expressible", "source": SOURCE},
    "best": {"method": "discrete, step 0.1 ms, kLagged, stiffness for a contact of 100 steps, dissipation that gives e at the case's speed, boxes as spheres at their corners" if DISCRETE else
             "continuous, RK3 with accuracy 1e-9, stiffness for a contact of 0.1 ms, dissipation that gives e at the case's speed, boxes as spheres at their corners", "source": SOURCE}}}
HALF_PERIOD = 1e-4  # of the contact in the continuous plant, s


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


def answer(request):
    scene, best = request["scene"], request["settings"] == "best"
    if has_limits(scene) and scene["contact"].get("limit_restitution", 0.0) > 0.0:
        raise Refused("joint limits have no coefficient of restitution")
    if not best and restitution_asked(scene) > 0.0:
        raise Refused("it has no coefficient of restitution by default (dissipation instead); see the setting best")
    continuous = best and not DISCRETE
    if continuous and has_limits(scene):
        raise Refused("joint limits are ignored by the continuous plant (documented)")
    step = request.get("step") or STEP[request["settings"]]
    # Refinement of the continuous plant is a stiffer, shorter contact.
    half_period = None if not best else HALF_PERIOD * step / STEP["best"] if continuous else max(100.0, 1 / math.sqrt(step)) * step
    diagram, plant = plant_of(scene, 0.0 if continuous else step, half_period)
    simulator = Simulator(diagram)
    if continuous:
        ResetIntegratorFromFlags(simulator, "runge_kutta3", 1e-3)
        integrator = simulator.get_mutable_integrator()
        # A longer step that meets a contact is rejected by the error control.
        integrator.set_maximum_step_size(2e-3)
        integrator.set_target_accuracy(1e-9)
    context = plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    bodies = {body["name"]: plant.GetBodyByName(body["name"]) for body in scene["bodies"]}
    joints = {name: plant.GetJointByName(f"{name}_joint") for name, body in zip(bodies, scene["bodies"]) if body["joint"] != "free"}
    for body, own, rate in parts(scene, scene["start"]["q"], scene["start"]["qd"]):
        name = body["name"]
        if body["joint"] == "free":
            x, y, z, w = own[3:]
            plant.SetFloatingBaseBodyPoseInWorldFrame(context, bodies[name], RigidTransform(Quaternion(np.array([w, x, y, z]) / np.linalg.norm(own[3:])), own[:3]))
            velocity = SpatialVelocity(np.array(rate[3:], float), np.array(rate[:3], float))
            plant.SetFreeBodySpatialVelocity(context=context, body=bodies[name], V_JpJc=velocity)
        elif body["joint"] == "hinge":
            joints[name].set_angle(context, own[0])
            joints[name].set_angular_rate(context, rate[0])
        else:
            joints[name].set_translation(context, own[0])
            joints[name].set_translation_rate(context, rate[0])
    simulator.Initialize()
    made = 0

    def advance(count):
        nonlocal made
        made += count
        # An update takes place at the start of a step: half a step before the end, so that a rounded time makes no step more or less.
        simulator.AdvanceTo(made * step if continuous else (made - 0.5) * step)

    def state():
        q, qd = [], []
        for body in scene["bodies"]:
            name = body["name"]
            if body["joint"] == "free":
                pose, velocity = bodies[name].EvalPoseInWorld(context), bodies[name].EvalSpatialVelocityInWorld(context)
                w, x, y, z = pose.rotation().ToQuaternion().wxyz()
                q += [*pose.translation(), x, y, z, w]
                qd += [*velocity.translational(), *velocity.rotational()]
            else:
                q.append(joints[name].GetOnePosition(context))
                qd.append(joints[name].GetOneVelocity(context))
        return {"q": floats(q), "qd": floats(qd)}

    return {"states": march(request, step, advance, state), "used": {"step": step} | ({"half period of contact": half_period} if best else {})}


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


serve(ABOUT, answer, gradient)
