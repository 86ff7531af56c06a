"""Siconos: Moreau & Jean's time stepping. Runs under the Python of the system, for which Debian builds the module.

Siconos gets its models as matrices and functions, which this adapter makes of the scene: free bodies that move in the xz plane, with
spheres as shapes (a sliding box is a point mass); chains of hinges as plug-ins in C (symbolic.py and plugin.c of the peers). The
Python with CasADi is in the environment variable PYTHON.
"""

import math
import os
import subprocess
import tempfile

import numpy as np
import siconos.kernel as kernel

from adapter import Refused, floats, march, parts, serve, urdf

PEERS = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
PYTHON = os.environ.get("PYTHON", "python3")
VERSION = subprocess.run(["dpkg-query", "-W", "-f", "${Version}", "python3-siconos"], capture_output=True, text=True).stdout or "unknown"
STEP = {"default": 1e-3, "best": 1e-4}
SOURCE = "nonsmooth.gricad-pages.univ-grenoble-alpes.fr/siconos, User's guide, Time integration of the dynamics (MoreauJeanOSI)"
ABOUT = {"engine": "siconos", "version": VERSION, "law": "Newton's e for each contact, Coulomb (Moreau)", "settings": {
    "default": {"method": "Moreau–Jean, θ = 1/2, step 1 ms, Newton tolerance 1e-10", "source": SOURCE},
    "best": {"method": "the same, step 0.1 ms", "source": SOURCE}}}
FOLDER = tempfile.TemporaryDirectory()


# Gap and slip of a sphere at (A, B) (axes of the body, x and z) of a body with q = (x, z, θ about y), before a plane.
SPHERE = """
#include <math.h>
static double ax(const double *q) { return cos(q[2]) * A + sin(q[2]) * B; }
static double az(const double *q) { return -sin(q[2]) * A + cos(q[2]) * B; }
void gap(unsigned n, double *q, unsigned ny, double *y, unsigned nz, double *z) {
    y[0] = NX * (q[0] + ax(q)) + NZ * (q[1] + az(q)) - OFFSET - RADIUS;
}
/* The contact point is RADIUS below the centre; an arm (x, z) that turns about y has the rate (z, -x). */
void gap_rows(unsigned n, double *q, unsigned ny, double *g, unsigned nz, double *z) {
    double x = ax(q) - RADIUS * NX, h = az(q) - RADIUS * NZ;
    for (unsigned i = 0; i < ROWS; i++) {
        double a = i ? NZ : NX, b = i ? -NX : NZ;
        g[i] = a, g[ROWS + i] = b, g[2 * ROWS + i] = a * h - b * x;
    }
}
void gap_rows_rate(unsigned n, double *q, unsigned nd, double *qd, double *g, unsigned nz, double *z) {
    double x = az(q) * qd[2], h = -ax(q) * qd[2];
    for (unsigned i = 0; i < ROWS; i++) {
        double a = i ? NZ : NX, b = i ? -NX : NZ;
        g[i] = g[ROWS + i] = 0.0, g[2 * ROWS + i] = a * h - b * x;
    }
}
"""


def sphere(plane, at, radius, rows):
    """The relation of SPHERE with these numbers."""
    normal = np.array(plane["normal"], float)
    numbers = {"A": at[0], "B": at[2], "NX": normal[0], "NZ": normal[2], "OFFSET": normal @ plane["point"], "RADIUS": radius, "ROWS": rows}
    return relation_of("".join(f"#define {key} ({value!r})\n" for key, value in ((k, v if k == "ROWS" else float(v)) for k, v in numbers.items())) + SPHERE)


def built(code):
    """The library of a source in C; each source is built once."""
    base = os.path.join(FOLDER.name, f"code{abs(hash(code))}")
    if not os.path.exists(f"{base}Plugin.so"):
        with open(f"{base}.c", "w") as file:
            file.write(code)
        subprocess.run(["gcc", "-O1", "-shared", "-fPIC", "-o", f"{base}Plugin.so", f"{base}.c", "-lm"], check=True)
    return f"{base}Plugin.so"


def relation_of(code):
    return kernel.LagrangianScleronomousR(*(f"{built(code)[:-3]}:{name}" for name in ("gap", "gap_rows", "gap_rows_rate")))


class FreeBodies:
    """Bodies that move in the xz plane, q = (x, z, θ) each; with friction and without spheres, a point mass in space."""

    def __init__(self, scene):
        self.scene, self.links = scene, []
        self.point = any("box" in shape for body in scene["bodies"] for shape in body["shapes"])
        if self.point and scene["start"]["q"][3:6] != [0, 0, 0]:
            raise Refused("its Debian module has no collision detection: a box that turns is not in this adapter")
        gravity, start = np.array(scene["gravity"], float), {}
        axes = [0, 1, 2] if self.point else [0, 2]
        self.systems = {}
        for body, q, qd in parts(scene, scene["start"]["q"], scene["start"]["qd"]):
            inertia = [] if self.point else [body["inertia"][1]]
            first = [q[k] for k in axes] + ([] if self.point else [2 * math.atan2(q[4], q[6])])
            speed = [qd[k] for k in axes] + ([] if self.point else [qd[4]])
            start[body["name"]] = np.array(first)
            mass = np.diag([body["mass"]] * len(axes) + inertia)
            self.systems[body["name"]] = system = kernel.LagrangianLinearTIDS(first, speed, mass)
            system.setFExtPtr(np.array([*(body["mass"] * gravity[axes]), *([] if self.point else [0.0])]))
            for plane in scene["planes"]:
                self.touch(body, plane, system, 3 if self.point else 2 if scene["contact"]["friction"] else 1)
        for a, b in scene["pairs"]:
            # Both spheres move along the line of their centres.
            [one, other] = [next(body for body in scene["bodies"] if body["name"] == name) for name in (a, b)]
            line = start[b] - start[a]
            line = line[:2] / np.linalg.norm(line[:2])
            gap = -one["shapes"][0]["sphere"] - other["shapes"][0]["sphere"]
            self.links.append((kernel.LagrangianLinearTIR([[*-line, 0.0, *line, 0.0]], [gap]), [self.systems[a], self.systems[b]], 1))

    def touch(self, body, plane, system, rows):
        if self.point:
            normal = np.array(plane["normal"], float)
            [half] = [shape["box"][2] / 2 for shape in body["shapes"]]
            relation = kernel.LagrangianLinearTIR([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]], [-normal @ plane["point"] - half, 0.0, 0.0])
            self.links.append((relation, [system], rows))
            return
        for shape in body["shapes"]:
            at = shape.get("at", [0, 0, 0])
            self.links.append((sphere(plane, at, shape["sphere"], rows), [system], rows))

    def state(self):
        q, qd = [], []
        for body in self.scene["bodies"]:
            at, speed = self.systems[body["name"]].q(), self.systems[body["name"]].velocity()
            if self.point:
                q += [*at, 0, 0, 0, 1]
                qd += [*speed, 0, 0, 0]
            else:
                q += [at[0], 0, at[1], 0, math.sin(at[2] / 2), 0, math.cos(at[2] / 2)]
                qd += [speed[0], 0, speed[1], 0, speed[2], 0]
        return {"q": floats(q), "qd": floats(qd)}


class Hinges:
    """One chain of hinges that hangs on the world; its last shape is a sphere before the only plane."""

    def __init__(self, scene):
        self.scene, bodies = scene, scene["bodies"]
        last = bodies[-1]
        shape = last.get("shapes", [{"sphere": 0.0, "at": [0, 0, 0]}])[0]
        tip = (f'<link name="tip"/><joint name="probe" type="fixed"><parent link="{last["name"]}"/><child link="tip"/>'
               f'<origin xyz="{" ".join(map(str, shape["at"]))}"/></joint></robot>')
        plane = scene["planes"][0] if scene["planes"] else {"point": [0, 0, 0], "normal": [0, 0, 1]}
        rows = 2 if scene["contact"]["friction"] else 1
        plugin = self.plugin(urdf(bodies, shapes=False).replace("</robot>", tip), plane, shape["sphere"], rows)
        self.system = kernel.LagrangianDS(scene["start"]["q"], scene["start"]["qd"])
        self.system.setComputeMassFunction(plugin, "mass_matrix")
        self.system.setComputeFGyrFunction(plugin, "bias_force")
        self.systems, self.links = {"chain": self.system}, []
        if scene["planes"]:
            names = [f"{plugin[:-3]}:{name}" for name in ("gap", "gap_rows", "gap_rows_rate")]
            self.links.append((kernel.LagrangianScleronomousR(*names), [self.system], rows))
        for k, body in enumerate(bodies):
            for sign, limit in zip((1.0, -1.0), body.get("limits", [])):
                row = [0.0] * len(bodies)
                row[k] = sign
                self.links.append((kernel.LagrangianLinearTIR([row], [-sign * limit]), [self.system], 1))

    def plugin(self, robot, plane, radius, rows):
        numbers = lambda v: "{" + ", ".join(repr(float(x)) for x in v) + "}"
        head = (f"static const double POINT[3] = {numbers(plane['point'])}, NORMAL[3] = {numbers(plane['normal'])}, "
                f"TANGENT[3] = {numbers(np.cross([0, 0, 1.0], plane['normal']))};\n"
                f"static const double RADIUS = {radius!r};\nenum {{ ROWS = {rows} }};\n#include \"{PEERS}/plugin.c\"\n")
        base = os.path.join(FOLDER.name, f"chain{abs(hash(robot))}")
        if not os.path.exists(f"{base}.robot.c"):
            with open(f"{base}.urdf", "w") as file:
                file.write(robot)
            gravity = map(str, self.scene["gravity"])
            subprocess.run([PYTHON, os.path.join(PEERS, "symbolic.py"), f"{base}.urdf", f"{base}.robot.c", "--gravity", *gravity], check=True)
        return built(f'#include "{base}.robot.c"\n{head}')

    def state(self):
        return {"q": floats(self.system.q()), "qd": floats(self.system.velocity())}


def answer(request):
    scene, step = request["scene"], request.get("step") or STEP[request["settings"]]
    joints = {body["joint"] for body in scene["bodies"]}
    if joints not in ({"free"}, {"hinge"}):
        raise Refused("chains beside free bodies are not in this adapter")
    world = FreeBodies(scene) if joints == {"free"} else Hinges(scene)
    contact = scene["contact"]
    restitution = contact.get("limit_restitution", contact["restitution"]) if not scene["planes"] else contact["restitution"]
    nsds = kernel.NonSmoothDynamicalSystem(0.0, 2.0 * request["times"][-1])
    for system in world.systems.values():
        nsds.insertDynamicalSystem(system)
    keep = []
    for relation, systems, rows in world.links:
        law = kernel.NewtonImpactNSL(restitution) if rows == 1 else kernel.NewtonImpactFrictionNSL(restitution, 0.0, contact["friction"], rows)
        keep.append((law, relation, kernel.Interaction(law, relation)))
        nsds.link(keep[-1][2], *systems)
    rows = max(rows for _, _, rows in world.links)
    problem = kernel.LCP() if rows == 1 else kernel.FrictionContact(rows)
    integrator = kernel.MoreauJeanOSI(0.5)
    discretisation = kernel.TimeDiscretisation(0.0, step)
    simulation = kernel.TimeStepping(nsds, discretisation, integrator, problem)
    if rows > 1:
        problem.numericsSolverOptions().dparam[0] = 1e-12
    simulation.setNewtonTolerance(1e-10)
    simulation.setNewtonMaxIteration(50)
    simulation.initialize()

    def advance(count):
        for _ in range(count):
            simulation.computeOneStep()
            simulation.nextStep()

    return {"states": march(request, step, advance, world.state), "used": {"step": step}}


serve(ABOUT, answer)
