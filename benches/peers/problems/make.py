"""Writes a set of contact problems as files of FCLIB: robots, stacks of boxes, walls of bricks, spheres, cubes with redundant points.

Every problem is of its number and of the seed alone. The even ones are time steps (gravity, motors), the odd ones impacts. Needs carom,
h5py and example-robot-data.
"""

import argparse
import importlib.metadata
import pathlib

import numpy as np

import carom
import carom.fclib

GRAVITY = np.array([0.0, 0.0, -9.81])

# Number of problems of each kind, in parts of the whole.
KINDS = {"solo12": 3, "talos": 3, "g1": 3, "stack": 3, "wall": 3, "spheres": 3, "cube": 2}

SOLE = [(x, y, 0.0) for x in (-0.1, 0.1) for y in (-0.065, 0.065)]
G1_SOLE = [(-0.05, -0.025, -0.03), (-0.05, 0.025, -0.03), (0.12, -0.03, -0.03), (0.12, 0.03, -0.03)]
ORIGIN = [(0.0, 0.0, 0.0)]

# File, feet, knees, hands: frames with points in their axes.
ROBOTS = {
    "solo12": (
        "solo12.urdf",
        [(f"{leg}_FOOT", ORIGIN) for leg in ("FL", "FR", "HL", "HR")],
        [(f"{leg}_LOWER_LEG", ORIGIN) for leg in ("FL", "FR", "HL", "HR")],
        [],
    ),
    "talos": (
        "talos_reduced.urdf",
        [(f"{side}_sole_link", SOLE) for side in ("left", "right")],
        [(f"leg_{side}_4_link", [(0.06, 0.0, 0.0)]) for side in ("left", "right")],
        [(f"gripper_{side}_fingertip_{k}_link", ORIGIN) for side in ("left", "right") for k in (1, 2, 3)],
    ),
    "g1": (
        "g1_29dof_rev_1_0.urdf",
        [(f"{side}_ankle_roll_link", G1_SOLE) for side in ("left", "right")],
        [(f"{side}_knee_link", [(0.04, 0.0, 0.0)]) for side in ("left", "right")],
        [(f"{side}_rubber_hand", [(0.08, 0.0, 0.0), (0.04, 0.0, -0.02)]) for side in ("left", "right")],
    ),
}


def axes(normal):
    """Two tangents and the normal, as rows."""
    normal = np.asarray(normal, dtype=float) / np.linalg.norm(normal)
    first = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
    first /= np.linalg.norm(first)
    return np.array([first, np.cross(normal, first), normal])


def turned(rng, largest):
    """A rotation by a random angle about a random axis."""
    axis = rng.normal(size=3)
    axis *= rng.uniform(0.0, largest) / np.linalg.norm(axis)
    return rotation(axis)


def rotation(vector):
    angle = np.linalg.norm(vector)
    if angle == 0.0:
        return np.eye(3)
    x, y, z = vector / angle
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


class Bodies:
    """Free bodies and their contacts; a velocity is the linear, then the angular one of each body, in world axes."""

    def __init__(self):
        self.bodies, self.contacts = [], []

    def add(self, mass, gyration, position, turn=np.eye(3)):
        """A body with these principal radii of gyration; its number."""
        inverse = turn @ np.diag(1.0 / (mass * np.asarray(gyration) ** 2)) @ turn.T
        self.bodies.append((mass, np.array(position, dtype=float), turn, inverse))
        return len(self.bodies) - 1

    def box(self, mass, sides, position, turn=np.eye(3)):
        x, y, z = np.square(sides) / 12.0
        return self.add(mass, np.sqrt([y + z, x + z, x + y]), position, turn)

    def touch(self, first, second, point, normal):
        """The normal points from the first to the second; None is the floor."""
        self.contacts.append((first, second, np.asarray(point, dtype=float), axes(normal)))

    def jacobian(self):
        jacobian = np.zeros((3 * len(self.contacts), 6 * len(self.bodies)))
        for k, (first, second, point, rows) in enumerate(self.contacts):
            for body, sign in ((first, -1.0), (second, 1.0)):
                if body is not None:
                    arm = point - self.bodies[body][1]
                    part = np.hstack([rows, np.cross(arm, rows)])
                    jacobian[3 * k : 3 * k + 3, 6 * body : 6 * body + 6] += sign * part
        return jacobian

    def problem(self, velocity, force_per_step):
        """J, M⁻¹ Jᵀ, and the velocities after the forces have acted."""
        jacobian = self.jacobian()
        solved = np.zeros_like(jacobian.T)
        free = velocity.copy()
        for k, (mass, _, _, inverse) in enumerate(self.bodies):
            linear, angular = slice(6 * k, 6 * k + 3), slice(6 * k + 3, 6 * k + 6)
            solved[linear] = jacobian.T[linear] / mass
            solved[angular] = inverse @ jacobian.T[angular]
            free[linear] += force_per_step[linear] / mass
            free[angular] += inverse @ force_per_step[angular]
        return jacobian, solved, free

    def weight(self):
        return np.concatenate([np.concatenate([mass * GRAVITY, np.zeros(3)]) for mass, *_ in self.bodies])


def stack(rng, bodies):
    """Boxes on one another, each a little off the one below."""
    count, height, place = int(rng.integers(1, 25)), 0.0, np.zeros(2)
    below, half = None, np.array([10.0, 10.0])
    for _ in range(count):
        sides = rng.uniform(0.2, 0.6, 3)
        mass = rng.uniform(0.5, 10.0)
        place = place + rng.uniform(-0.15, 0.15, 2) * np.minimum(half, sides[:2])
        turn = rotation([0.0, 0.0, rng.uniform(-0.2, 0.2)])
        box = bodies.box(mass, sides, [*place, height + sides[2] / 2], turn)
        # The face of contact: the corners of the smaller of both faces.
        reach = np.minimum(half, sides[:2] / 2)
        for x in (-1, 1):
            for y in (-1, 1):
                corner = turn @ [x * reach[0], y * reach[1], 0.0]
                bodies.touch(below, box, [place[0] + corner[0], place[1] + corner[1], height], [0, 0, 1])
        below, half, height = box, sides[:2] / 2, height + sides[2]


def wall(rng, bodies):
    """Rows of equal bricks, every second one shifted by half a brick; four contacts on each face that touches."""
    rows, length = int(rng.integers(2, 6)), int(rng.integers(2, 5))
    sides = np.array([0.3, 0.15, 0.1]) * rng.uniform(0.8, 1.2, 3)
    mass = rng.uniform(2.0, 10.0)
    previous = []
    for row in range(rows):
        shift = 0.5 * (row % 2)
        now = []
        for k in range(length - row % 2):
            x = (k + shift) * sides[0]
            brick = bodies.box(mass, sides, [x, 0.0, (row + 0.5) * sides[2]])
            now.append((x, brick))
            faces = [(None, x - sides[0] / 2, x + sides[0] / 2)] if row == 0 else []
            for other, below in previous:
                low, high = max(x, other) - sides[0] / 2, min(x, other) + sides[0] / 2
                if high - low > 1e-9:
                    faces.append((below, low, high))
            for below, low, high in faces:
                for end in (low, high):
                    for y in (-sides[1] / 2, sides[1] / 2):
                        bodies.touch(below, brick, [end, y, row * sides[2]], [0, 0, 1])
        previous = now


def spheres(rng, bodies):
    """A row of touching spheres on the floor, or a pyramid of them; the masses differ up to a hundredfold."""
    radius, ball = 0.05, lambda place: bodies.add(10.0 ** rng.uniform(-1.0, 1.0), [np.sqrt(0.4) * radius] * 3, place)
    if rng.random() < 0.5:
        previous = None
        for k in range(int(rng.integers(1, 26))):
            own = ball([2 * radius * k, 0, radius])
            bodies.touch(None, own, [2 * radius * k, 0, 0], [0, 0, 1])
            if previous is not None:
                bodies.touch(previous, own, [2 * radius * k - radius, 0, radius], [1, 0, 0])
            previous = own
        return
    width, layers = int(rng.integers(2, 5)), {}
    for layer in range(width):
        for x in range(width - layer):
            for y in range(width - layer):
                place = np.array([(2 * x + layer) * radius, (2 * y + layer) * radius, radius + layer * np.sqrt(2) * radius])
                own = layers[layer, x, y] = ball(place), place
                if layer == 0:
                    bodies.touch(None, own[0], place - [0, 0, radius], [0, 0, 1])
                for i in (0, 1):
                    for j in (0, 1):
                        if layer:
                            below, lower = layers[layer - 1, x + i, y + j]
                            bodies.touch(below, own[0], (place + lower) / 2, place - lower)


def cube(rng, bodies):
    """A cube on a face of more points than are needed, at up to two walls."""
    side = rng.uniform(0.2, 1.0)
    own = bodies.box(rng.uniform(0.5, 20.0), [side] * 3, [0, 0, side / 2])
    points = np.linspace(-side / 2, side / 2, int(rng.integers(2, 6)))
    for x in points:
        for y in points:
            bodies.touch(None, own, [x, y, 0], [0, 0, 1])
    for normal in ([1, 0, 0], [0, 1, 0])[: int(rng.integers(0, 3))]:
        for x in points:
            for z in points:
                face = -side / 2 * np.array(normal) + (np.array([0, x, 0]) if normal[0] else np.array([x, 0, 0]))
                bodies.touch(None, own, face + [0, 0, side / 2 + z], normal)


def free_bodies(kind, rng, impact):
    bodies = Bodies()
    {"stack": stack, "wall": wall, "spheres": spheres, "cube": cube}[kind](rng, bodies)
    size = 6 * len(bodies.bodies)
    velocity, force = np.zeros(size), np.zeros(size)
    if impact:
        # All fall with one velocity, or every body has its own.
        common = np.concatenate([rng.normal(size=2), [-rng.uniform(0.5, 3.0)], np.zeros(3)])
        velocity = np.tile(common, size // 6)
        if rng.random() < 0.5:
            velocity += rng.normal(size=size) * np.tile([0.5] * 3 + [1.0] * 3, size // 6)
    else:
        step = 10.0 ** rng.uniform(-4.0, -2.0)
        force = step * bodies.weight()
        if rng.random() < 0.5:
            # Forces on the bodies up to their weight, and a push of one body.
            force += rng.uniform(0, 0.5) * np.abs(force).max() * rng.normal(size=size) * np.tile([1.0] * 3 + [0.05] * 3, size // 6)
        if rng.random() < 0.5:
            # Sliding over the floor.
            velocity += np.tile([*(10.0 ** rng.uniform(-4, 0) * rng.normal(size=2)), 0, 0, 0, 0], size // 6)
    return *bodies.problem(velocity, force), velocity


_CHAINS = {}


def chain_of(kind):
    if kind not in _CHAINS:
        files = [file.locate() for file in importlib.metadata.files("example-robot-data") if file.name == ROBOTS[kind][0]]
        _CHAINS[kind] = carom.Chain.from_urdf(files[0], floating=True, meshes=False)
    return _CHAINS[kind]


def robot(kind, rng, impact):
    """A pose within half of the joints' ranges about zero, on the feet, on knees too, or with hands at walls."""
    chain, (_, feet, knees, hands) = chain_of(kind), ROBOTS[kind]
    q = chain.neutral()
    around = np.zeros(chain.nv)
    lower, upper = np.maximum(chain.lower, -3.0), np.minimum(chain.upper, 3.0)
    around[6:] = np.clip(rng.uniform(-0.8, 0.8, chain.nv - 6), 0.5 * lower[6:], 0.5 * upper[6:])
    around[3:6] = rng.normal(size=3) * (1.0 if impact and rng.random() < 0.3 else 0.15)
    q = chain.integrate(q, around)
    floor = [0.0, 0.0, 1.0]
    some = rng.integers(1, len(feet) + 1)
    places = [(frame, point, floor) for k in rng.permutation(len(feet))[:some] for frame, points in [feet[k]] for point in points]
    if rng.random() < 0.4:
        places += [(frame, point, floor) for frame, points in knees for point in points if rng.random() < 0.7]
    if hands and rng.random() < 0.4:
        turn = rotation([0.0, 0.0, rng.uniform(-np.pi, np.pi)])
        places += [(frame, point, turn @ [-1.0, 0.0, 0.0]) for frame, points in hands for point in points if rng.random() < 0.7]
    jacobian = np.vstack([axes(normal) @ chain.jacobian(q, frame, point) for frame, point, normal in places])
    mass = chain.mass_matrix(q)
    solved = np.linalg.solve(mass, jacobian.T)
    if impact:
        velocity = rng.normal(size=chain.nv) * 0.5
        velocity[:3] = chain_axes(chain, q).T @ [*rng.normal(size=2), -rng.uniform(0.5, 3.0)]
        return jacobian, solved, velocity, velocity
    step = 10.0 ** rng.uniform(-4.0, -2.0)
    velocity = np.zeros(chain.nv)
    if rng.random() < 0.5:
        # Moving with the contacts at rest.
        velocity = rng.normal(size=chain.nv) * 0.5
        velocity -= solved @ np.linalg.lstsq(jacobian @ solved, jacobian @ velocity, rcond=1e-10)[0]
    bias = chain.bias(q, velocity)
    torque = np.zeros(chain.nv)
    torque[6:] = rng.uniform(0.0, 1.2) * bias[6:] + 0.1 * np.abs(bias[6:]).max() * rng.normal(size=chain.nv - 6)
    return jacobian, solved, velocity + step * np.linalg.solve(mass, torque - bias), velocity


def chain_axes(chain, q):
    """The rotation of the floating base."""
    return chain.pose(q, chain.frames[0])[:3, :3]


def problem(seed, number):
    """The problem of this number, as (name, carom.ContactProblem, description)."""
    kinds = [kind for kind, share in KINDS.items() for _ in range(share)]
    kind, impact = kinds[number // 2 % len(kinds)], number % 2 == 1
    rng = np.random.default_rng([seed, number])
    while True:
        make = robot if kind in ROBOTS else free_bodies
        jacobian, solved, free, before = make(kind, rng, impact)
        u_free, u_minus = jacobian @ free, jacobian @ before
        contacts = len(u_free) // 3
        # Without an approach all impulses are zero.
        if contacts <= 100 and (u_free[2::3] < -1e-9).any():
            break
    delassus = jacobian @ solved
    friction = rng.uniform(0.1, 1.0, contacts) if rng.random() < 0.5 else np.full(contacts, rng.uniform(0.1, 1.0))
    restitution = rng.uniform(0.1, 0.9) if impact and rng.random() < 0.5 else 0.0
    own = carom.ContactProblem(
        (delassus + delassus.T) / 2, u_free, friction=friction, restitution=restitution, u_minus=u_minus
    )
    rank = np.linalg.matrix_rank(own.delassus, tol=1e-10 * np.abs(own.delassus).max(), hermitian=True)
    what = f"impact with restitution {restitution:.3g}" if impact else "time step"
    return (
        f"{number:04d}-{kind}-{'impact' if impact else 'step'}-{contacts:03d}.hdf5",
        own,
        f"{kind}, {what}, {contacts} contacts, rank of W {rank} of {3 * contacts}; seed {seed}, number {number}",
    )


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--count", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    given.folder.mkdir(parents=True, exist_ok=True)
    for number in range(given.count):
        name, own, description = problem(given.seed, number)
        title = "Contact problem of the set of carom"
        carom.fclib.write(given.folder / name, own, title=title, description=description)


if __name__ == "__main__":
    main()
