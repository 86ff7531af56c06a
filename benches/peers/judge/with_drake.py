"""Drake: compliant contacts (Hunt & Crossley), discrete (default, and `best` with --discrete) or continuous with error control."""

import logging
import math
import sys
from importlib.metadata import version

import numpy as np
from pydrake.common.eigen_geometry import Quaternion
from pydrake.geometry import (
    AddContactMaterial, Box, CollisionFilterDeclaration, GeometrySet, HalfSpace, ProximityProperties, Sphere)
from pydrake.math import RigidTransform
from pydrake.multibody.math import SpatialVelocity
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, CoulombFriction, DiscreteContactApproximation
from pydrake.systems.analysis import ResetIntegratorFromFlags, Simulator
from pydrake.systems.framework import DiagramBuilder

from adapter import Refused, floats, has_limits, march, parts, restitution_asked, serve, trees, urdf  # first: it makes `common` importable
import common

logging.getLogger("drake").setLevel(logging.ERROR)
DISCRETE = "--discrete" in sys.argv
STEP = {"default": 1e-3, "best": 1e-4}
SOURCE = "drake.mit.edu, MultibodyPlant, Contact modeling; drake.mit.edu/doxygen_cxx/group__compliant__contact.html"
ABOUT = {"engine": "drake-discrete" if DISCRETE else "drake", "version": version("drake"), "law": "Hunt & Crossley, regularised Coulomb", "settings": {
    "default": {"method": "discrete, step 1 ms, kLagged (default), default stiffness and dissipation; restitution is not expressible", "source": SOURCE},
    "best": {"method": "discrete, step 0.1 ms, kLagged, stiffness for a contact of 100 steps, dissipation that gives e at the case's speed" if DISCRETE else
             "continuous, RK3 with accuracy 1e-9, stiffness for a contact of 0.1 ms, dissipation that gives e at the case's speed", "source": SOURCE}}}
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


def shape_of(shape):
    return Sphere(shape["sphere"]) if "sphere" in shape else Box(*shape["box"])


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
        shapes[body["name"]] = [
            plant.RegisterCollisionGeometry(plant.GetBodyByName(body["name"]), RigidTransform(np.array(shape.get("at", [0.0, 0, 0]), float)),
                                            shape_of(shape), f"{body['name']}{k}", material(scene, half_period))
            for k, shape in enumerate(body.get("shapes", []))]
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
        # Limits the step, which could otherwise skip a whole contact.
        integrator.set_maximum_step_size(half_period / 2)
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
        simulator.AdvanceTo((made + 1e-6) * step if not continuous else made * step)

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


serve(ABOUT, answer)
