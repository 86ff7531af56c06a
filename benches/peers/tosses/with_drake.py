"""Drake: point contact with Hunt & Crossley's dissipation at the corners of the boxes, in its discrete solvers."""

import itertools
import logging
from importlib.metadata import version

import numpy as np
from pydrake.common.eigen_geometry import Quaternion
from pydrake.geometry import AddContactMaterial, Box, CollisionFilterDeclaration, GeometrySet, HalfSpace, ProximityProperties, Role, Sphere
from pydrake.math import RigidTransform
from pydrake.multibody.math import SpatialVelocity
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, CoulombFriction, DiscreteContactApproximation
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

import common

logging.getLogger("drake").setLevel(logging.ERROR)
STEPS = 16  # between two samples, unless refined
SPEED = 1.5  # of the approach at which the dissipation returns e, m/s: typical of the tosses
RADIUS = 1e-6  # of the balls at the corners, m


class Engine:
    peer, version = "Drake", version("drake")
    parameters = [("e", 0.02, 0.98, [0.1, 0.3, 0.5]), ("friction", 0.0, 1.0, [0.05, 0.15, 0.3]), ("stiffness, N/m (log)", 3.0, 6.0, [4.0, 5.0])]

    def __init__(self, urdf, gravity, spacing, refine):
        self.urdf, self.gravity, self.spacing, self.dt, self.values = urdf, gravity, spacing, spacing / (STEPS * refine), None

    def tune(self, values):
        if values == self.values:
            return
        self.values = values
        e, friction, stiffness = values
        material = ProximityProperties()
        # The stiffnesses of a pair act in series, and each dissipation is weighted by the other stiffness.
        AddContactMaterial(point_stiffness=2.0 * stiffness, dissipation=common.hunt_crossley(e, SPEED),
                           friction=CoulombFriction(friction, friction), properties=material)
        builder = DiagramBuilder()
        plant, graph = AddMultibodyPlantSceneGraph(builder, self.dt)
        Parser(plant).AddModels(self.urdf)
        plant.mutable_gravity_field().set_gravity_vector(self.gravity)
        inspector = graph.model_inspector()
        of_file = inspector.GetAllGeometryIds(Role.kProximity)
        corners = []
        for shape in of_file:
            box, pose = inspector.GetShape(shape), inspector.GetPoseInFrame(shape)
            body = plant.GetBodyFromFrameId(inspector.GetFrameId(shape))
            if not isinstance(box, Box):
                raise ValueError("every collision shape must be a box")
            for k, signs in enumerate(itertools.product((-0.5, 0.5), repeat=3)):
                # The half-space touches a box at one point only: balls at the corners touch at all.
                corner = RigidTransform(pose.multiply(np.array(signs) * box.size()))
                name = f"{body.name()}_{k}"
                corners.append(plant.RegisterCollisionGeometry(body, corner, Sphere(RADIUS), name, material))
        floor = plant.RegisterCollisionGeometry(plant.world_body(), RigidTransform(), HalfSpace(), "floor", material)
        rule = CollisionFilterDeclaration().ExcludeWithin(GeometrySet([*of_file, *corners]))
        rule = rule.ExcludeBetween(GeometrySet(of_file), GeometrySet([floor]))
        graph.collision_filter_manager().Apply(rule)
        plant.set_discrete_contact_approximation(self.approximation)
        plant.Finalize()
        (root,) = plant.GetFloatingBaseBodies()
        self.plant, self.root = plant, plant.get_body(root)
        self.joints = [plant.get_joint(k) for k in plant.GetJointIndices() if plant.get_joint(k).num_velocities() == 1]
        self.simulator = Simulator(builder.Build())

    def roll(self, q, qd, count):
        plant, root = self.plant, self.simulator.get_mutable_context()
        root.SetTime(0.0)
        plant.SetDefaultState(plant.GetMyContextFromRoot(root), plant.GetMyMutableContextFromRoot(root).get_mutable_state())
        context = plant.GetMyMutableContextFromRoot(root)
        x, y, z, w = np.array(q[3:7]) / np.linalg.norm(q[3:7])
        plant.SetFloatingBaseBodyPoseInWorldFrame(context, self.root, RigidTransform(Quaternion(w, x, y, z), q[:3]))
        velocity = SpatialVelocity(np.array(common.turned([x, y, z, w], qd[3:6])), np.array(common.turned([x, y, z, w], qd[:3])))
        plant.SetFreeBodySpatialVelocity(context=context, body=self.root, V_JpJc=velocity)
        for joint, angle, rate in zip(self.joints, q[7:], qd[6:]):
            joint.set_angle(context, angle)
            joint.set_angular_rate(context, rate)
        self.simulator.Initialize()
        poses = [list(q)]
        for k in range(1, count):
            # An update takes place at the start of a step: half a step before the sample, so that a rounded time makes no step more or less.
            self.simulator.AdvanceTo(k * self.spacing - 0.5 * self.dt)
            pose = self.root.EvalPoseInWorld(context)
            w, x, y, z = pose.rotation().ToQuaternion().wxyz()
            poses.append([*pose.translation(), x, y, z, w, *(joint.get_angle(context) for joint in self.joints)])
        return poses


def settings(approximation):
    return {"step": f"1/{STEPS} of the interval of the samples", "approximation": approximation, "points": "balls of 1e-6 m at the corners",
            "dissipation": f"returns e at {SPEED} m/s"}


class Lagged(Engine):
    method, settings, approximation = "kLagged", settings("kLagged"), DiscreteContactApproximation.kLagged


class Sap(Engine):
    method, settings, approximation = "kSap", settings("kSap"), DiscreteContactApproximation.kSap


class Tamsi(Engine):
    method, settings, approximation = "kTamsi", settings("kTamsi"), DiscreteContactApproximation.kTamsi


METHODS = [Lagged, Sap, Tamsi]
