"""MuJoCo: a spring and damper at each corner, in the direct form of `solref`, or in its default form with the default impedance."""

import math

import mujoco
import numpy as np

import common

STEPS = 16  # between two samples, unless refined


class Engine:
    peer, version = "MuJoCo", mujoco.__version__
    common_settings = {"step": f"1/{STEPS} of the interval of the samples", "cone": "elliptic", "impratio": 10, "integrator": "Euler",
                       "condim": 3}

    def __init__(self, urdf, gravity, spacing, refine):
        spec = mujoco.MjSpec.from_file(urdf)
        spec.worldbody.first_body().add_freejoint()
        for geom in spec.geoms:
            geom.contype, geom.conaffinity = 1, 2  # with the floor only, as in carom
        spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[5, 5, 1], contype=2, conaffinity=1)
        spec.option.gravity = gravity
        spec.option.timestep = spacing / (STEPS * refine)
        spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
        spec.option.impratio = 10.0
        self.model, self.steps = spec.compile(), STEPS * refine
        self.data = mujoco.MjData(self.model)

    def roll(self, q, qd, count):
        mujoco.mj_resetData(self.model, self.data)
        x, y, z, w = q[3:7]
        self.data.qpos[:] = [*q[:3], w, x, y, z, *q[7:]]
        self.data.qvel[:] = [*common.turned([x, y, z, w], qd[:3]), *qd[3:]]
        poses = [list(q)]
        for _ in range(count - 1):
            mujoco.mj_step(self.model, self.data, nstep=self.steps)
            p = self.data.qpos
            poses.append([*p[:3], *p[4:7], p[3], *p[7:]])
        return poses


class Direct(Engine):
    method = "direct solref"
    settings = {**Engine.common_settings, "solref": "-(pi/T)^2, -2 z pi/T: half period T, damping ratio z of a spring that returns e",
                "solimp": "0.99 0.99"}
    parameters = [("e", 0.0, 1.0, [0.1, 0.3, 0.5]), ("friction", 0.0, 1.0, [0.05, 0.15, 0.3]),
                  ("half period, s (log)", math.log10(0.002), math.log10(0.04), [math.log10(0.004), math.log10(0.016)])]

    def tune(self, values):
        e, friction, half_period = values
        frequency = math.pi / half_period
        self.model.geom_solref[:] = [-frequency**2, -2.0 * common.spring_damping(min(max(e, 1e-3), 1.0)) * frequency]
        self.model.geom_solimp[:, :2] = 0.99
        self.model.geom_friction[:] = [friction, 0.0, 0.0]


class Default(Engine):
    method = "default solref"
    settings = {**Engine.common_settings, "solref": "time constant, damping ratio", "solimp": "default"}
    parameters = [("damping ratio", 0.0, 1.5, [0.2, 0.5, 1.0]), ("friction", 0.0, 1.0, [0.05, 0.15, 0.3]),
                  ("time constant, s (log)", math.log10(0.001), math.log10(0.1), [math.log10(0.005), math.log10(0.02)])]

    def tune(self, values):
        ratio, friction, constant = values
        self.model.geom_solref[:] = [max(constant, 2.0 * self.model.opt.timestep), max(ratio, 1e-3)]
        self.model.geom_friction[:] = [friction, 0.0, 0.0]


METHODS = [Direct, Default]
