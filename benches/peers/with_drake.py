"""The scenes in Drake: its discrete solvers and its continuous plant, with compliant contacts (Hunt & Crossley)."""

import itertools
import logging
import math
from importlib.metadata import version

import numpy as np
from pydrake.geometry import (
    AddContactMaterial, Box, CollisionFilterDeclaration, Cylinder, GeometrySet, HalfSpace, ProximityProperties, Role, Sphere)
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.math import SpatialVelocity
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, CoulombFriction, DiscreteContactApproximation
from pydrake.multibody.tree import PdControllerGains
from pydrake.common.eigen_geometry import Quaternion
from pydrake.systems.analysis import ResetIntegratorFromFlags, Simulator
from pydrake.systems.controllers import PidController
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource, Saturation

import common

VERSION = version("drake")
logging.getLogger("drake").setLevel(logging.ERROR)


# Radius of the balls at the corners of a box, m.
CORNER = 1e-9


def contact_steps(dt):
    """Number of steps in a contact: with more steps the error of the rebound falls and the contact lasts longer."""
    return max(40.0, 1.0 / math.sqrt(dt))


def material(scene, stiffness):
    properties = ProximityProperties()
    friction = CoulombFriction(scene["friction"], scene["friction"])
    if stiffness is None:
        AddContactMaterial(friction=friction, properties=properties)
    else:
        # The stiffnesses of a pair act in series, and each dissipation is weighted by the other stiffness: with equal materials
        # the stiffness must be doubled, the dissipation not.
        AddContactMaterial(point_stiffness=2 * stiffness, friction=friction, properties=properties,
                           dissipation=common.hunt_crossley(scene["restitution"], scene["approach"]))
    return properties


def bodies(scene):
    """The shapes that can touch, with link, pose and name: a pair has only one contact point, so each corner of a box is a ball."""
    for number, it in enumerate(scene["shapes"]):
        pose, size = RigidTransform(RotationMatrix(np.array(it["turn"])), it["at"]), it["size"]
        if it["kind"] == "box":
            for k, corner in enumerate(itertools.product((-1, 1), repeat=3)):
                yield it["link"], pose @ RigidTransform(np.array(corner) * size / 2), Sphere(CORNER), f"shape{number}_{k}"
        else:
            yield it["link"], pose, Sphere(*size) if it["kind"] == "sphere" else Cylinder(*size), f"shape{number}"


class Run:
    def __init__(self, scene, dt, discrete=True, approximation=None, stiffness=None):
        builder = DiagramBuilder()
        plant, graph = AddMultibodyPlantSceneGraph(builder, dt if discrete else 0.0)
        self.scene, self.dt, self.plant, self.discrete = scene, dt, plant, discrete
        Parser(plant).AddModels(scene["urdf"])
        if not scene["floating"]:
            plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("base"))
        plant.mutable_gravity_field().set_gravity_vector(scene["gravity"])
        self.tip = plant.GetBodyByName(scene["tip"])
        # The shapes of the file cannot touch; those that are added can.
        of_file = graph.model_inspector().GetAllGeometryIds(Role.kProximity)
        ours = []
        for k, shape in enumerate(scene["surfaces"]):
            if k == 0:
                for link, pose, ours_too, name in bodies(scene):
                    body = plant.GetBodyByName(link)
                    plant.RegisterCollisionGeometry(body, pose, ours_too, name, material(scene, stiffness))
            if k == 0 and ("halfspace" in shape or len(scene["shapes"]) == 1):
                plane = scene["plane"]
                pose, shape = HalfSpace.MakePose(np.array(plane["normal"]), np.array(plane["point"])), HalfSpace()
            else:
                pose, shape = RigidTransform(np.array(shape["box"]["centre"])), Box(*shape["box"]["size"])
            ours.append(plant.RegisterCollisionGeometry(plant.world_body(), pose, shape, f"surface{k}", material(scene, stiffness)))
        if of_file:
            files, touched = GeometrySet(of_file), GeometrySet(ours)
            rule = CollisionFilterDeclaration().ExcludeWithin(files).ExcludeBetween(files, touched)
            graph.collision_filter_manager().Apply(rule)
        if approximation is not None:
            plant.set_discrete_contact_approximation(approximation)
        # In its discrete solvers except kTamsi, Drake's own drives are implicit.
        implicit = discrete and approximation != DiscreteContactApproximation.kTamsi
        drive = scene.get("drive")
        if drive:
            for name, effort in zip(scene["joints"], drive["effort"]):
                actuator = plant.AddJointActuator(name, plant.GetJointByName(name), effort)
                if implicit:
                    actuator.set_controller_gains(PdControllerGains(p=drive["kp"], d=drive["kd"]))
        plant.Finalize()
        if drive:
            self.drive(builder, implicit)
        if stiffness is not None and scene["friction"]:
            plant.set_stiction_tolerance(1e-3 * scene["approach"])
        self.diagram = builder.Build()
        self.simulator = Simulator(self.diagram)
        if not discrete:
            ResetIntegratorFromFlags(self.simulator, "runge_kutta3", scene["duration"] / 10)
            integrator = self.simulator.get_mutable_integrator()
            # Limits the step, which could otherwise skip a whole contact.
            integrator.set_maximum_step_size(10 * dt)
            integrator.set_target_accuracy(1e-9)

    def drive(self, builder, implicit):
        plant, drive = self.plant, self.scene["drive"]
        count = len(drive["target"])
        target = builder.AddSystem(ConstantVectorSource(np.concatenate([drive["target"], np.zeros(count)])))
        if implicit:
            port = plant.get_desired_state_input_port(plant.GetModelInstanceByName(plant.GetModelInstanceName(self.tip.model_instance())))
            builder.Connect(target.get_output_port(), port)
            return
        joints = [plant.GetJointByName(name) for name in self.scene["joints"]]
        select = np.zeros((2 * count, plant.num_positions() + plant.num_velocities()))
        for k, joint in enumerate(joints):
            select[k, joint.position_start()] = 1
            select[count + k, plant.num_positions() + joint.velocity_start()] = 1
        gains = [np.full(count, it) for it in (drive["kp"], 0.0, drive["kd"])]
        control = builder.AddSystem(PidController(select, np.eye(count), *gains))
        limit = builder.AddSystem(Saturation(-np.array(drive["effort"]), np.array(drive["effort"])))
        builder.Connect(plant.get_state_output_port(), control.get_input_port_estimated_state())
        builder.Connect(target.get_output_port(), control.get_input_port_desired_state())
        builder.Connect(control.get_output_port_control(), limit.get_input_port())
        builder.Connect(limit.get_output_port(), plant.get_actuation_input_port())

    def reset(self):
        context = self.diagram.CreateDefaultContext()
        self.context = self.plant.GetMyMutableContextFromRoot(context)
        q, qd = self.scene["q"], self.scene["qd"]
        if self.scene["floating"]:
            x, y, z, w = turn = q[3:7]
            pose = RigidTransform(Quaternion(w, x, y, z), q[:3])
            self.plant.SetFloatingBaseBodyPoseInWorldFrame(self.context, self.tip, pose)
            velocity = SpatialVelocity(np.array(common.turned(turn, qd[3:6])), np.array(common.turned(turn, qd[:3])))
            self.plant.SetFreeBodySpatialVelocity(context=self.context, body=self.tip, V_JpJc=velocity)
            q, qd = q[7:], qd[6:]
        for name, angle, rate in zip(self.scene["joints"], q, qd):
            joint = self.plant.GetJointByName(name)
            joint.set_angle(self.context, angle)
            joint.set_angular_rate(self.context, rate)
        self.simulator.reset_context(context)
        self.simulator.Initialize()
        self.steps = 0

    def step(self, count):
        self.steps += count
        # An update takes place at the start of a step: half a step before the end, so that a rounded time makes no step more or less.
        self.simulator.AdvanceTo((self.steps - 0.5 if self.discrete else self.steps) * self.dt)

    def force(self):
        results = self.plant.get_contact_results_output_port().Eval(self.context)
        pairs = range(results.num_point_pair_contacts())
        return sum(np.linalg.norm(results.point_pair_contact_info(k).contact_force()) for k in pairs)

    def state(self):
        plant, context = self.plant, self.context
        velocity = self.tip.EvalSpatialVelocityInWorld(context)
        if self.scene["floating"]:
            pose = self.tip.EvalPoseInWorld(context)
            w, x, y, z = pose.rotation().ToQuaternion().wxyz()
            base = pose.translation(), [x, y, z, w], velocity.translational(), velocity.rotational()
            if "chain" not in self.scene:
                return common.free_body(self.scene, *base)
        joints = [plant.GetJointByName(name) for name in self.scene["joints"]]
        q, qd = [it.get_angle(context) for it in joints], [it.get_angular_rate(context) for it in joints]
        if self.scene["floating"]:
            return common.based(*base, q, qd)
        return {
            "q": q, "qd": qd, "tip_velocity": velocity.translational(),
            "kinetic_energy": plant.CalcKineticEnergy(context), "potential_energy": plant.CalcPotentialEnergy(context),
        }


def main():
    args = common.arguments(__doc__)
    for scene in common.scenes(args.scenes):
        if args.only and scene["name"] not in args.only:
            continue
        law = "Hunt & Crossley" if scene["surfaces"] else None
        for dt in common.STEPS:
            common.measure("drake", VERSION, scene, "default", law, {"plant": "discrete"}, dt, lambda h: Run(scene, h), args)
            if not scene["surfaces"]:
                continue
            for name in ("kLagged", "kTamsi"):
                settings = {"plant": f"discrete, {name}", "stiffness": f"half period {contact_steps(dt):.0f} dt",
                            "dissipation": "exact for e at the approach speed"}
                stiff = lambda h: scene["effective_mass"] * (math.pi / (contact_steps(h) * h)) ** 2
                common.measure("drake", VERSION, scene, f"discrete {name}, tuned", law, settings, dt,
                               lambda h, n=name: Run(scene, h, True, getattr(DiscreteContactApproximation, n), stiff(h)), args)
        if not scene["surfaces"]:
            for accuracy in (1e-3, 1e-5, 1e-7, 1e-9, 1e-11):
                def continuous(value):
                    run = Run(scene, scene["duration"] / 100, discrete=False)
                    integrator = run.simulator.get_mutable_integrator()
                    integrator.set_maximum_step_size(scene["duration"])
                    integrator.set_target_accuracy(value)
                    return run
                common.measure("drake", VERSION, scene, "continuous RK3", law, {"plant": "continuous"}, accuracy, continuous,
                               args, knob="accuracy")
            continue
        for half_period in (1e-2, 1e-3, 1e-4, 1e-5):
            stiffness = scene["effective_mass"] * (math.pi / half_period) ** 2
            settings = {"plant": "continuous", "integrator": "runge_kutta3", "accuracy": 1e-9,
                        "dissipation": "exact for e at the approach speed"}
            common.measure("drake", VERSION, scene, "continuous RK3, tuned", law, settings, stiffness,
                           lambda k, h=half_period: Run(scene, h / 20, False, None, k), args, knob="stiffness")


if __name__ == "__main__":
    main()
