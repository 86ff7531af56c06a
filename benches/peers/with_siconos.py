"""The scenes in Siconos: Moreau & Jean's time stepping and its event-driven scheme. Runs under the Python of the system.

The dynamics of chains and the corners of a box are plug-ins in C, built by plugins.py. `run` passes their folder in SICONOS_PLUGINS.
"""

import math
import os
import sys
import ctypes

import numpy as np
import siconos.kernel as kernel

import common
import plugins

VERSION = os.environ.get("SICONOS_VERSION", "unknown")  # the module has no version; `run` gets it from the package manager
PLUGINS = os.environ["SICONOS_PLUGINS"]


class Run:
    def __init__(self, scene, dt, events):
        self.scene, self.dt, self.events, self.floating = scene, dt, events, scene["floating"]
        self.library = None if self.floating and not scene["box"] else ctypes.CDLL(self.plugin())
        self.steps = round(scene["duration"] / dt)

    def plugin(self):
        return os.path.join(os.path.abspath(PLUGINS), self.scene["name"] + "Plugin.so")

    def box(self):
        """A box that moves in the plane of x and z, q = (x, z, angle about y), and its four corners above the floor."""
        scene, mass, inertia = self.scene, self.scene["body"]["mass"], self.scene["body"]["inertia"][1]
        q, qd, gravity = scene["q"], scene["qd"], scene["gravity"]
        start = [q[0], q[2], 2.0 * math.atan2(q[4], q[6])]
        velocity = common.turned(q[3:], qd[:3])
        self.system = kernel.LagrangianLinearTIDS(start, [velocity[0], velocity[2], qd[4]], np.diag([mass, mass, inertia]))
        self.system.setFExtPtr(np.array([mass * gravity[0], mass * gravity[2], 0.0]))
        names = lambda k: [f"{self.plugin()[:-3]}:{name}{k}" for name in ("gap", "rows", "rate")]
        return [kernel.LagrangianScleronomousR(*names(k)) for k in range(4)]

    def reset(self):
        scene, contact = self.scene, bool(self.scene["surfaces"])
        relations = []
        if scene["box"]:
            relations = self.box()
        elif self.floating:
            # The ball falls without rotating: three translations are sufficient.
            mass = scene["body"]["mass"]
            self.system = kernel.LagrangianLinearTIDS(scene["q"][:3], scene["qd"][:3], mass * np.eye(3))
            self.system.setFExtPtr(mass * np.array(scene["gravity"]))
            normal = np.array(scene["plane"]["normal"])
            offset = -normal @ scene["plane"]["point"] - scene["tip_radius"]
            relations = [kernel.LagrangianLinearTIR([list(normal)], [offset])]
        else:
            self.system = kernel.LagrangianDS(scene["q"], scene["qd"])
            self.system.setComputeMassFunction(self.plugin(), "mass_matrix")
            self.system.setComputeFGyrFunction(self.plugin(), "bias_force")
            names = [f"{self.plugin()[:-3]}:{name}" for name in ("gap", "gap_rows", "gap_rows_rate")]
            relations = [kernel.LagrangianScleronomousR(*names)] if contact else []
        nsds = kernel.NonSmoothDynamicalSystem(0.0, 2.0 * scene["duration"])
        nsds.insertDynamicalSystem(self.system)
        self.interactions, friction = [], scene["friction"]
        for relation in relations:
            law = (kernel.NewtonImpactFrictionNSL(scene["restitution"], 0.0, friction, 2) if friction
                   else kernel.NewtonImpactNSL(scene["restitution"]))
            self.interactions.append(kernel.Interaction(law, relation))
            nsds.link(self.interactions[-1], self.system)
        discretisation = kernel.TimeDiscretisation(0.0, self.dt)
        if self.events:
            self.simulation = kernel.EventDriven(nsds, discretisation)
            integrator = kernel.LsodarOSI()
            self.simulation.insertIntegrator(integrator)
            self.simulation.insertNonSmoothProblem(kernel.LCP(), kernel.SICONOS_OSNSP_ED_IMPACT)
            self.simulation.insertNonSmoothProblem(kernel.LCP(), kernel.SICONOS_OSNSP_ED_SMOOTH_ACC)
            self.keep = integrator
        else:
            problem = kernel.FrictionContact(2) if friction else kernel.LCP()
            integrator = kernel.MoreauJeanOSI(0.5)
            self.simulation = kernel.TimeStepping(nsds, discretisation, integrator, problem)
            self.simulation.setNewtonTolerance(1e-10)
            self.simulation.setNewtonMaxIteration(50)
            self.keep = integrator, problem
        self.nsds, self.relations, self.impact, self.touching = nsds, relations, None, False
        self.simulation.initialize()
        self.made, self.pushed = 0, 0.0

    def step(self, count):
        if not self.events:
            for _ in range(count):
                self.simulation.computeOneStep()
                # Read before the next step begins, which overwrites it.
                self.pushed = sum(it.lambda_(1)[0] for it in self.interactions)
                self.simulation.nextStep()
            return
        self.made += count
        until, self.touching = (self.made - 1e-6) * self.dt, False
        while self.simulation.startingTime() < until:
            self.simulation.advanceToEvent()
            before = np.array(self.system.velocity())
            self.simulation.processEvents()
            if np.abs(np.array(self.system.velocity()) - before).max() > 1e-12:
                self.touching = True
                if self.impact is None:
                    self.impact = dict(self.state(), time=self.simulation.startingTime())

    def force(self):
        if self.events:
            return 1.0 if self.touching else 0.0
        return self.pushed

    def state(self):
        q, qd = np.array(self.system.q()), np.array(self.system.velocity())
        if self.scene["box"]:
            turn = [0, math.sin(q[2] / 2), 0, math.cos(q[2] / 2)]
            return common.free_body(self.scene, [q[0], 0, q[1]], turn, [qd[0], 0, qd[1]], [0, qd[2], 0])
        if self.floating:
            return common.free_body(self.scene, q, [0, 0, 0, 1], qd, [0, 0, 0])
        n = len(q)
        state = {"q": q, "qd": qd, "kinetic_energy": 0.5 * qd @ (self.evaluated("mass", q, n, n) @ qd)}
        if self.scene["surfaces"]:
            state["tip_velocity"] = self.evaluated("jacobian", q, 3, n) @ qd
        return state

    def evaluated(self, name, q, rows, columns):
        """The value of a function of the plug-in at q, the same function that Siconos calls."""
        double, pointer = ctypes.c_double, ctypes.POINTER(ctypes.c_double)
        out, at = (double * (rows * columns))(), (double * len(q))(*q)
        inputs, outputs = (pointer * 8)(at), (pointer * 8)(out)
        getattr(self.library, name)(inputs, outputs, (ctypes.c_longlong * 1024)(), (double * 65536)(), 0)
        return np.array(out).reshape(columns, rows).T


def main():
    args = common.arguments(__doc__)
    for scene in common.scenes(args.scenes):
        if args.only and scene["name"] not in args.only:
            continue
        # README.md has the reasons.
        if len(scene["surfaces"]) > 1 or len(scene["shapes"]) > 1 or scene["box"] and not plugins.planar(scene):
            print(f"siconos: {scene['name']} is not in this program", file=sys.stderr)
            continue
        law = ("newton, coulomb (Moreau)" if scene["friction"] else "newton") if scene["surfaces"] else None
        for dt in common.STEPS:
            common.measure("siconos", VERSION, scene, "Moreau-Jean", law, {"theta": 0.5, "newton tolerance": 1e-10}, dt,
                           lambda h: Run(scene, h, False), args)
        if scene["friction"]:
            continue  # its event-driven scheme has no friction
        for dt in common.STEPS[:3]:
            common.measure("siconos", VERSION, scene, "event-driven", law, {"integrator": "LSODAR, default tolerances"}, dt,
                           lambda h: Run(scene, h, True), args)


if __name__ == "__main__":
    main()
