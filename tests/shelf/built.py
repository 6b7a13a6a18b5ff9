"""Scenes built by hand: stacks, mass ratios, wedges, an arch, a wall, a table, spinning bodies, a heap of disks.

The y axis points up. Where nothing can move, or the motion has a closed form, that is said at the scene.
"""

from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from shelf.piles import skew
from shelf.problem import GROUND, Array, Dense, FreeBodies, frames_of

GRAVITY = 9.81
UP = np.array([0.0, 1.0, 0.0])


@dataclass
class Scene:
    """Bodies and contacts, gathered one by one; `problem` is that of one time step.

    Attributes:
        step: h, s.
    """

    step: float = 1e-3
    mass: list[float] = field(default_factory=list)
    inertia: list[Array] = field(default_factory=list)
    place: list[Array] = field(default_factory=list)
    velocity: list[Array] = field(default_factory=list)
    spin: list[Array] = field(default_factory=list)
    force: list[Array] = field(default_factory=list)
    contacts: list[tuple[int, int, Array, Array, float]] = field(default_factory=list)

    def body(
        self,
        mass: float,
        inertia: Array,
        place: Array,
        velocity: Array | None = None,
        spin: Array | None = None,
        force: Array | None = None,
    ) -> int:
        """Adds a body of inertia (3, 3), world axes; returns its number. A force, N, acts beside gravity."""
        self.mass.append(mass)
        self.inertia.append(inertia)
        self.place.append(np.asarray(place, float))
        for values, value in ((self.velocity, velocity), (self.spin, spin), (self.force, force)):
            values.append(np.zeros(3) if value is None else np.asarray(value, float))
        return len(self.mass) - 1

    def touch(self, first: int, second: int, point: Array, normal: Array, mu: float) -> None:
        """Adds a contact; the normal points from the first body, or the ground, to the second."""
        self.contacts.append((first, second, np.asarray(point, float), np.asarray(normal, float), mu))

    def problem(self) -> FreeBodies:
        """The step's problem. Spins make it unsymmetric: M̂ = J + h/2 ([ω] J - [J ω])."""
        h, mass, J = self.step, np.array(self.mass), np.array(self.inertia)
        place, spin = np.array(self.place), np.array(self.spin)
        Jw = np.einsum("nij,nj->ni", J, spin)
        inertia_inverse = np.linalg.inv(J + 0.5 * h * (skew(spin) @ J - skew(Jw)))
        v_free = np.array(self.velocity) + h * (np.array(self.force) / mass[:, None] - GRAVITY * UP)
        spin_free = spin - h * np.einsum("nij,nj->ni", inertia_inverse, np.cross(spin, Jw))
        pairs = np.array([contact[:2] for contact in self.contacts], dtype=np.int64)
        points = np.array([contact[2] for contact in self.contacts])
        frames = frames_of(np.array([contact[3] for contact in self.contacts]))
        levers = np.where(pairs[..., None] == GROUND, 0.0, points[:, None] - place[pairs])
        mu = np.array([contact[4] for contact in self.contacts])
        problem = FreeBodies(mass, inertia_inverse, pairs, frames, levers, np.zeros(3 * len(mu)), mu)
        problem.q[:] = problem.jacobian() @ np.column_stack([v_free, spin_free]).ravel()
        return problem


def box(mass: float, sides: tuple[float, float, float]) -> Array:
    """Inertia (3, 3) of a box."""
    squares = np.square(sides)
    return mass / 12.0 * np.diag(squares.sum() - squares)


SQUARE = [(-0.5, -0.5), (-0.5, 0.5), (0.5, -0.5), (0.5, 0.5)]


def stack(
    masses: list[float], mu: list[float], pull: float = 0.0, spin: Array | None = None, height: float = 1.0
) -> FreeBodies:
    """Boxes of 1 m x `height` x 1 m on one another, four contacts a face; the top one is pulled along x by `pull` N."""
    scene = Scene()
    for level, mass in enumerate(masses):
        on_top = level == len(masses) - 1
        scene.body(
            mass,
            box(mass, (1.0, height, 1.0)),
            (level + 0.5) * height * UP,
            spin=spin,
            force=np.array([pull if on_top else 0.0, 0.0, 0.0]),
        )
        for x, z in SQUARE:
            scene.touch(level - 1 if level else GROUND, level, [x, level * height, z], UP, mu[level])
    return scene.problem()


def dragged(ratio: float) -> FreeBodies:
    """A light cube under a heavy one that is pulled.

    mu is 0.3 on the ground and 0.5 between them. Both accelerate with (0.5 - 0.3) g / 2: the lower four contacts slide
    at 9.81e-4 m/s after 1 ms, the upper ones hold.
    """
    return stack([1.0, ratio], [0.3, 0.5], pull=0.4 * GRAVITY * (1.0 + ratio))


def column(n: int) -> FreeBodies:
    """Spheres on one another, one contact each: rest."""
    scene = Scene()
    for level in range(n):
        scene.body(1.0, 0.1 * np.eye(3), (level + 0.5) * UP)
        scene.touch(level - 1 if level else GROUND, level, level * UP, UP, 0.5)
    return scene.problem()


def wedge(mu: float) -> FreeBodies:
    """A prism driven at 1 m/s into a groove whose sides stand 20 degrees off the vertical: it stops."""
    scene = Scene()
    scene.body(5.0, box(5.0, (0.3, 0.5, 0.4)), 0.1 * UP, velocity=-1.0 * UP)
    a = np.radians(20.0)
    for side in (-1.0, 1.0):
        for y in (-0.2, 0.2):
            for z in (-0.2, 0.2):
                point = [side * (0.15 + np.tan(a) * y), y, z]
                scene.touch(GROUND, 0, point, [-side * np.cos(a), np.sin(a), 0.0], mu)
    return scene.problem()


def arch(n: int, thickness: float, mu: float = 0.7) -> FreeBodies:
    """A half-circle of n wedge stones, mean radius 1 m, four contacts a joint, on two springers.

    A thickness of some 0.11 m is the least that stands (Heyman); thinner, it falls as a mechanism of hinges.
    """
    scene, width = Scene(), 0.4
    joints = np.linspace(0.0, np.pi, n + 1)
    for start, end in pairwise(joints):
        middle = 0.5 * (start + end)
        outward = np.array([np.cos(middle), np.sin(middle), 0.0])
        mass = 2500.0 * thickness * width * (end - start)
        along = np.array([[outward[0], -outward[1], 0.0], [outward[1], outward[0], 0.0], [0.0, 0.0, 1.0]])
        scene.body(mass, along @ box(mass, (thickness, end - start, width)) @ along.T, outward)
    for j, angle in enumerate(joints):
        outward = np.array([np.cos(angle), np.sin(angle), 0.0])
        normal = np.array([-outward[1], outward[0], 0.0])
        first, second = j - 1, j
        if j == n:  # the last joint stands on the ground
            first, second, normal = GROUND, n - 1, -normal
        for r, z in SQUARE:
            scene.touch(first, second, (1.0 + thickness * r) * outward + [0.0, 0.0, width * z], normal, mu)
    return scene.problem()


def row_of_spheres(masses: list[float], speed: float, mu: float = 0.5) -> FreeBodies:
    """Spheres of 0.1 m radius in a row on the floor, each touching the next; the first is struck along the row."""
    scene, radius = Scene(), 0.1
    along = np.array([1.0, 0.0, 0.0])
    for k, mass in enumerate(masses):
        inertia = 0.4 * mass * radius**2 * np.eye(3)
        velocity = speed * along if k == 0 else None
        scene.body(mass, inertia, 2.0 * radius * k * along + radius * UP, velocity=velocity)
        scene.touch(GROUND, k, 2.0 * radius * k * along, UP, mu)
    for k in range(len(masses) - 1):
        scene.touch(k, k + 1, (2.0 * k + 1.0) * radius * along + radius * UP, along, mu)
    return scene.problem()


def stacks_sliding(boxes: int, mu: float = 0.5) -> FreeBodies:
    """Two stacks of cubes of 1 m, side by side and touching; they slide along the floor towards each other at 1 m/s."""
    scene = Scene()
    for side in (-1.0, 1.0):
        for level in range(boxes):
            centre = [0.5 * side, level + 0.5, 0.0]
            k = scene.body(1.0, box(1.0, (1.0, 1.0, 1.0)), np.array(centre), velocity=np.array([-side, 0.0, 0.2]))
            for x, z in SQUARE:
                scene.touch(k - 1 if level else GROUND, k, [0.5 * side + x, level, z], UP, mu)
    for level in range(boxes):
        for y, z in SQUARE:
            scene.touch(level, boxes + level, [0.0, level + 0.5 + y, z], np.array([1.0, 0.0, 0.0]), mu)
    return scene.problem()


def wall(courses: int, bricks: int, mu: float = 0.6, top: float = 1.0) -> FreeBodies:
    """A wall in running bond, bricks of 0.2 m x 0.1 m x 0.1 m; a brick in its middle is hit at 2 m/s along z.

    The bricks of the highest course are `top` times heavier than the others.
    """
    scene = Scene()
    centres = [0.2 * i + 0.1 * (course % 2) for course in range(courses) for i in range(bricks)]
    for k, x in enumerate(centres):
        hit = k == (courses // 2) * bricks + bricks // 2
        mass = 4.0 * (top if k >= (courses - 1) * bricks else 1.0)
        scene.body(
            mass,
            box(mass, (0.2, 0.1, 0.1)),
            [x, 0.1 * (k // bricks) + 0.05, 0.0],
            velocity=np.array([0.0, 0.0, 2.0 if hit else 0.0]),
        )
    for k, x in enumerate(centres):
        course = k // bricks
        below = [GROUND] if course == 0 else range((course - 1) * bricks, course * bricks)
        for other in below:
            start, end = x - 0.1, x + 0.1
            if other != GROUND:
                start, end = max(start, centres[other] - 0.1), min(end, centres[other] + 0.1)
            if end - start > 1e-6:
                for corner in (start, end):
                    for z in (-0.05, 0.05):
                        scene.touch(other, k, [corner, 0.1 * course, z], UP, mu)
    return scene.problem()


def table(legs: int) -> FreeBodies:
    """A table on a circle of legs, pushed and turned: it slides; W has rank 6."""
    scene = Scene()
    scene.body(
        6.0, np.diag([2.0, 1.25, 2.0]), 0.8 * UP, velocity=np.array([0.02, 0.0, 0.01]), spin=np.array([0.0, 0.03, 0.0])
    )
    for angle in 2.0 * np.pi * np.arange(legs) / legs:
        scene.touch(GROUND, 0, [np.cos(angle), 0.0, np.sin(angle)], UP, 0.5)
    return scene.problem()


def caged(contacts: int, seed: int) -> FreeBodies:
    """A flat stone that spins at 40 rad/s, caught by walls on all sides; W is unsymmetric by a tenth."""
    rng = np.random.default_rng(seed)
    scene = Scene(step=5e-3)
    scene.body(2.0, box(2.0, (0.3, 0.1, 0.5)), np.zeros(3), velocity=[0.5, -1.0, 0.2], spin=[25.0, 5.0, 30.0])
    for _ in range(contacts):
        outward = rng.normal(size=3)
        outward /= np.linalg.norm(outward)
        normal = -outward + 0.3 * rng.normal(size=3)
        scene.touch(GROUND, 0, outward * [0.15, 0.05, 0.25], normal / np.linalg.norm(normal), rng.uniform(0.1, 1.0))
    return scene.problem()


def heap_of_disks(rows: int, mu: float = 0.5) -> Dense:
    """A free-standing triangle of rigid disks after a step of gravity from rest, in the plane."""
    h, r = 1e-3, 0.5
    place, index = [], {}
    for row in range(rows):
        for i in range(rows - row):
            index[row, i] = len(place)
            place.append(np.array([2.0 * r * i + r * row, r + np.sqrt(3.0) * r * row]))
    found = [(GROUND, index[0, i], np.array([0.0, 1.0])) for i in range(rows)]
    for (row, i), body in index.items():
        if row:
            found += [
                (below, body, (place[body] - place[below]) / (2.0 * r))
                for below in (index[row - 1, i], index[row - 1, i + 1])
            ]
    jacobian = np.zeros((len(found), 2, len(place), 3))
    for k, (first, second, normal) in enumerate(found):
        tangent = np.array([normal[1], -normal[0]])
        for body, sign in ((first, -1.0), (second, 1.0)):
            if body != GROUND:
                jacobian[k, 0, body, :2] = sign * normal
                jacobian[k, 1, body, :2] = sign * tangent
                # spin x lever: the levers are r normal for the first and -r normal for the second
                jacobian[k, 1, body, 2] = r
    J = jacobian.reshape(2 * len(found), -1)
    inverse = np.tile([1.0, 1.0, 2.0 / r**2], len(place))
    q = J @ np.tile([0.0, -GRAVITY * h, 0.0], len(place))
    return Dense(J * inverse @ J.T, q, np.full(len(found), mu), 2)
