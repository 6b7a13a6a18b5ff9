"""Two families of piles, simulated until they have as many contacts as asked.

- Stones: random convex polyhedra dropped on each other into a bin. Contacts by separating axes and clipped faces, so
  that a face on a face has up to eight of them.
- Logs: capsules in a skip that tips, so that the whole pile turns. Near parallel ones touch at two ends.

The motion is Moreau–Jean's at the level of velocities, with a Baumgarte push against the drift; the recorded problem
is without that push. The gyroscopic couple is implicit, to which W owes its asymmetry:

    M̂_spin = J + h/2 ([ω] J - [J ω]),   J ω̇ = -ω × J ω.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations

import numpy as np

import rover_gym
from shelf.problem import GROUND, Array, FreeBodies, Indices, block_rows, frames_of

GRAVITY = 9.81
MARGIN = 1e-3  # contacts closer than this are active, m


@dataclass
class Contacts:
    """Contacts found: the normal points from body 1 to body 2."""

    pairs: Indices  # (n, 2)
    points: Array  # (n, 3)
    normals: Array  # (n, 3)
    gaps: Array  # (n,)


def gather(found: list[tuple[int, int, Array, Array, Array]]) -> Contacts:
    """One table of groups (body 1, body 2, points (k, 3), normals (k, 3), gaps (k,))."""
    return Contacts(
        np.repeat([(a, b) for a, b, *_ in found], [len(gaps) for *_, gaps in found], axis=0).astype(np.int64),
        np.concatenate([points for _, _, points, _, _ in found]),
        np.concatenate([normals for _, _, _, normals, _ in found]),
        np.concatenate([gaps for *_, gaps in found]),
    )


def skew(vectors: Array) -> Array:
    """[a] with [a] b = a × b, (..., 3, 3)."""
    x, y, z = np.moveaxis(vectors, -1, 0)
    zero = np.zeros_like(x)
    return np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=-1).reshape(*vectors.shape[:-1], 3, 3)


def turn(rotation_vectors: Array) -> Array:
    """Rotation matrices (n, 3, 3) of rotation vectors (n, 3), rad (Rodrigues)."""
    angle = np.linalg.norm(rotation_vectors, axis=1)[:, None, None]
    K = skew(rotation_vectors / np.maximum(angle[:, 0], 1e-300))
    return np.eye(3) + np.sin(angle) * K + (1.0 - np.cos(angle)) * K @ K


class Polyhedron:
    """A convex polyhedron {x: normals x <= offsets} about its mass centre, of density 2500 kg/m³."""

    def __init__(self, normals: Array, offsets: Array) -> None:
        corners = []
        for three in combinations(range(len(normals)), 3):
            if abs(np.linalg.det(normals[list(three)])) > 1e-6:
                corner = np.linalg.solve(normals[list(three)], offsets[list(three)])
                if (normals @ corner <= offsets + 1e-12).all():
                    corners.append(corner)
        vertices = np.unique(np.round(corners, 12), axis=0)
        on = np.abs(vertices @ normals.T - offsets) < 1e-9
        kept = on.sum(axis=0) >= 3
        self.normals, on = normals[kept], on[:, kept]
        self.faces = [self._in_order(vertices, np.flatnonzero(on[:, f]), n) for f, n in enumerate(self.normals)]
        self.edges = np.array(
            sorted({(min(e), max(e)) for f in self.faces for e in zip(f, np.roll(f, -1), strict=True)})
        )
        # Tetrahedra from an inner point to the faces' triangles.
        inner = vertices.mean(axis=0)
        triangles = np.array(
            [[f[0], f[i], f[i + 1]] for f in self.faces for i in range(1, len(f) - 1)],
        )
        a, b, c = np.moveaxis(vertices[triangles] - inner, 1, 0)
        volume = np.einsum("ni,ni->n", a, np.cross(b, c)) / 6.0
        first = (a + b + c) / 4.0
        second = sum(np.einsum("n,ni,nj->ij", volume, x, x) for x in (a, b, c, a + b + c)) / 20.0
        centre = volume @ first / volume.sum()
        density = 2500.0
        self.mass = density * volume.sum()
        spread = density * second - self.mass * np.outer(centre, centre)
        self.inertia = np.trace(spread) * np.eye(3) - spread
        self.vertices = vertices - inner - centre
        self.radius = np.linalg.norm(self.vertices, axis=1).max()

    @staticmethod
    def _in_order(vertices: Array, face: Indices, normal: Array) -> Indices:
        """The face's vertices, anticlockwise seen from outside."""
        arms = vertices[face] - vertices[face].mean(axis=0)
        u = arms[0] / np.linalg.norm(arms[0])
        return face[np.argsort(np.arctan2(arms @ np.cross(normal, u), arms @ u))]

    @classmethod
    def random(cls, rng: np.random.Generator) -> "Polyhedron":
        """A stone of some 0.2 m: a box of which three corners or edges are cut off."""
        cuts = rng.normal(size=(3, 3))
        cuts /= np.linalg.norm(cuts, axis=1, keepdims=True)
        half = rng.uniform(0.05, 0.12, size=3)
        normals = np.vstack([np.eye(3), -np.eye(3), cuts])
        return cls(normals, np.concatenate([half, half, rng.uniform(0.8, 0.95, size=3) * (np.abs(cuts) @ half)]))


@dataclass
class Placed:
    """A polyhedron in the world."""

    shape: Polyhedron
    vertices: Array
    normals: Array

    def extent(self) -> tuple[Array, Array]:
        """Starts (k, 3) and directions (k, 3) of the edges."""
        start, end = self.vertices[self.shape.edges[:, 0]], self.vertices[self.shape.edges[:, 1]]
        return start, end - start


def polyhedra_in_contact(a: Placed, b: Placed) -> tuple[Array, Array, Array] | None:
    """Points, normals from a to b and gaps: separating axes, then clipped faces or two edges."""
    best, kind = -np.inf, ""
    of_a = (a.normals @ b.vertices.T).min(axis=1) - (a.normals @ a.vertices.T).max(axis=1)
    of_b = (b.normals @ a.vertices.T).min(axis=1) - (b.normals @ b.vertices.T).max(axis=1)
    if max(of_a.max(), of_b.max()) > MARGIN:
        return None
    kind, best = ("a", of_a.max()) if of_a.max() >= of_b.max() else ("b", of_b.max())
    (start_a, along_a), (start_b, along_b) = a.extent(), b.extent()
    axes = np.cross(along_a[:, None], along_b[None])
    length = np.linalg.norm(axes, axis=2, keepdims=True)
    axes = axes / np.maximum(length, 1e-12)
    between = start_b[None] - start_a[:, None]
    separation = np.einsum("ijk,ijk->ij", axes, between)
    # Both senses: the edges must be what supports the two bodies along the axis.
    for sense in (1.0, -1.0):
        directed = sense * axes
        gap = (directed @ b.vertices.T).min(axis=2) - (directed @ a.vertices.T).max(axis=2)
        real = (np.abs(gap - sense * separation) < 1e-9) & (length[..., 0] > 1e-8)
        gap = np.where(real, gap, -np.inf)
        i, j = np.unravel_index(gap.argmax(), gap.shape)
        if gap[i, j] > MARGIN:
            return None
        if gap[i, j] > best + 1e-4:  # a face is preferred where both are as deep
            best, kind, normal, pair = gap[i, j], "edges", directed[i, j], (i, j)
    if kind == "edges":
        i, j = pair
        system = np.column_stack([along_a[i], -along_b[j], normal])
        s, t, _ = np.linalg.solve(system, start_b[j] - start_a[i])
        point = 0.5 * (start_a[i] + s * along_a[i] + start_b[j] + t * along_b[j])
        return point[None], normal[None], np.array([best])
    if kind == "a":
        points, gaps = clipped(a, int(of_a.argmax()), b)
        normal = a.normals[of_a.argmax()]
    else:
        points, gaps = clipped(b, int(of_b.argmax()), a)
        normal = -b.normals[of_b.argmax()]
    return (points, np.tile(normal, (len(points), 1)), gaps) if len(points) else None


def clipped(reference: Placed, face: int, other: Placed) -> tuple[Array, Array]:
    """Points (k, 3) and gaps (k,) of the other body's facing face, clipped by the sides of the reference face."""
    normal = reference.normals[face]
    corners = reference.vertices[reference.shape.faces[face]]
    polygon = other.vertices[other.shape.faces[int((other.normals @ normal).argmin())]]
    for start, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        inward = np.cross(normal, end - start)
        inside = (polygon - start) @ inward
        kept = []
        for k, (here, depth) in enumerate(zip(polygon, inside, strict=True)):
            before, depth_before = polygon[k - 1], inside[k - 1]
            if depth * depth_before < 0.0:
                kept.append(before + (here - before) * depth_before / (depth_before - depth))
            if depth >= 0.0:
                kept.append(here)
        polygon = np.array(kept).reshape(-1, 3)
    gaps = (polygon - corners[0]) @ normal
    close = gaps < MARGIN
    return (polygon - 0.5 * gaps[:, None] * normal)[close], gaps[close]


class Stones:
    """Polyhedra of a pile."""

    def __init__(self, n: int, rng: np.random.Generator) -> None:
        self.shapes = [Polyhedron.random(rng) for _ in range(n)]
        self.mass = np.array([s.mass for s in self.shapes])
        self.inertia = np.array([s.inertia for s in self.shapes])
        self.radius = np.array([s.radius for s in self.shapes])

    def contacts(self, x: Array, R: Array, walls: tuple[Array, Array]) -> Contacts:
        """All contacts of bodies at x (n, 3), turned by R (n, 3, 3), among themselves and with walls n . x >= d."""
        placed = [Placed(s, s.vertices @ R[i].T + x[i], s.normals @ R[i].T) for i, s in enumerate(self.shapes)]
        found = []
        for i, j in near(x, self.radius):
            if (hit := polyhedra_in_contact(placed[i], placed[j])) is not None:
                found.append((i, j, *hit))
        for normal, offset in zip(*walls, strict=True):
            for i, body in enumerate(placed):
                gaps = body.vertices @ normal - offset
                close = gaps < MARGIN
                if close.any():
                    points = body.vertices[close] - 0.5 * gaps[close, None] * normal
                    found.append((GROUND, i, points, np.tile(normal, (close.sum(), 1)), gaps[close]))
        return gather(found)


class Logs:
    """Capsules of a pile: solid cylinders with half-spheres as ends."""

    def __init__(self, n: int, rng: np.random.Generator) -> None:
        self.half = rng.uniform(0.06, 0.12, size=n)  # of the segment
        self.thickness = rng.uniform(0.03, 0.06, size=n)  # radius
        r, length = self.thickness, 2.0 * self.half
        cylinder, ends = 700.0 * np.pi * r**2 * length, 700.0 * 4.0 / 3.0 * np.pi * r**3
        self.mass = cylinder + ends
        along = cylinder * r**2 / 2.0 + ends * 0.4 * r**2
        # The half-spheres' centres of mass lie 3/8 r outside the ends of the segment.
        across = cylinder * (r**2 / 4.0 + length**2 / 12.0) + ends * (0.4 * r**2 + self.half**2 + 0.75 * self.half * r)
        self.inertia = np.stack([along, across, across], axis=1)[:, None] * np.eye(3)
        self.radius = self.half + r

    def contacts(self, x: Array, R: Array, walls: tuple[Array, Array]) -> Contacts:
        """All contacts of bodies at x (n, 3), turned by R (n, 3, 3), among themselves and with walls n . x >= d."""
        arms = self.half[:, None] * R[:, :, 0]
        found = []
        for i, j in near(x, self.radius):
            on_i, on_j = closest(x[i], arms[i], x[j], arms[j])
            between = on_j - on_i
            distance = np.linalg.norm(between, axis=1)
            gaps = distance - self.thickness[i] - self.thickness[j]
            if (close := gaps < MARGIN).any():
                normals = between[close] / distance[close, None]
                points = on_i[close] + (self.thickness[i] + 0.5 * gaps[close, None]) * normals
                found.append((i, j, points, normals, gaps[close]))
        ends = np.stack([x - arms, x + arms], axis=1)
        for normal, offset in zip(*walls, strict=True):
            gaps = ends @ normal - offset - self.thickness[:, None]
            for i in np.flatnonzero((gaps < MARGIN).any(axis=1)):
                close = gaps[i] < MARGIN
                points = ends[i][close] - (self.thickness[i] + 0.5 * gaps[i][close, None]) * normal
                found.append((GROUND, int(i), points, np.tile(normal, (close.sum(), 1)), gaps[i][close]))
        return gather(found)


def closest(x: Array, a: Array, y: Array, b: Array) -> tuple[Array, Array]:
    """Points (k, 3) on the segments x ± a and y ± b where they are closest; near parallel ones also at their ends."""
    aa, bb, ab, r = a @ a, b @ b, a @ b, x - y
    across = aa * bb - ab * ab
    if across < 1e-2 * aa * bb:  # some 6 degrees: each end against the other segment, if it lies beside it
        t = np.array([(r + s * a) @ b / bb for s in (-1.0, 1.0)])
        s = np.array([(t * b - r) @ a / aa for t in (-1.0, 1.0)])
        s, t = np.concatenate([[-1.0, 1.0], s]), np.concatenate([t, [-1.0, 1.0]])
        beside = (np.abs(s) <= 1.0) & (np.abs(t) <= 1.0)
        if beside.any():
            return x + s[beside, None] * a, y + t[beside, None] * b
    s = np.clip((ab * (r @ b) - bb * (r @ a)) / max(across, 1e-12 * aa * bb), -1.0, 1.0)
    t = np.clip(((r + s * a) @ b) / bb, -1.0, 1.0)
    s = np.clip(((t * b - r) @ a) / aa, -1.0, 1.0)
    return (x + s * a)[None], (y + t * b)[None]


def near(x: Array, radius: Array) -> Iterator[tuple[int, int]]:
    """Pairs of bodies whose bounding spheres meet."""
    distance = np.linalg.norm(x[:, None] - x[None], axis=2)
    for i, j in np.argwhere(np.triu(distance < radius[:, None] + radius[None] + MARGIN, 1)):
        yield int(i), int(j)


@dataclass(frozen=True)
class Scene:
    """How a pile is made.

    Attributes:
        bodies: "stones" or "logs".
        n_bodies: How many are dropped.
        n_contacts: The first step with as many is recorded.
        mu: Friction coefficient everywhere.
        step: Time step, s.
        tipping: Spin of the bin about its edge x = y = 0, rad/s, from the moment when half of the contacts are there.
        disorder: Spread of the first orientations, rad; stones that fall flat come to lie on their faces.
        seed: Of shapes, places and spins.
    """

    bodies: str
    n_bodies: int
    n_contacts: int
    mu: float = 1.0
    step: float = 5e-3
    tipping: float = 0.0
    disorder: float = 1.0
    seed: int = 1


def pile(scene: Scene, patience: int = 600) -> FreeBodies:
    """Drops the bodies and returns the problem of the first step with the contacts asked for.

    Raises:
        RuntimeError: The pile never has as many contacts.
    """
    rng = np.random.default_rng(scene.seed)
    bodies = {"stones": Stones, "logs": Logs}[scene.bodies](scene.n_bodies, rng)
    n, h = scene.n_bodies, scene.step
    side = max(2, round((0.6 * n) ** (1 / 3)))
    width = 0.27 * side
    layer = np.arange(n) // side**2
    x = np.column_stack([np.arange(n) % side, layer, np.arange(n) // side % side]) * 0.27 + 0.14
    x[:, [0, 2]] += rng.uniform(-0.01, 0.01, size=(n, 2))
    R = turn(scene.disorder * rng.normal(size=(n, 3)))
    v, spin = np.zeros((n, 3)), rng.normal(size=(n, 3))
    v[:, 1] = -1.0
    normals = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, -1.0]])
    offsets = np.array([0.0, 0.0, -width, 0.0, -width])
    tipped, tipping = 0.0, False
    for _ in range(patience):
        J = R @ bodies.inertia @ R.transpose(0, 2, 1)
        Jw = np.einsum("nij,nj->ni", J, spin)
        implicit = J + 0.5 * h * (skew(spin) @ J - skew(Jw))
        inertia_inverse = np.linalg.inv(implicit)
        v_free = v - h * GRAVITY * np.array([0.0, 1.0, 0.0])
        spin_free = spin - h * np.einsum("nij,nj->ni", inertia_inverse, np.cross(spin, Jw))
        about_z = turn(np.array([[0.0, 0.0, tipped]]))[0]
        found = bodies.contacts(x, R, (normals @ about_z.T, offsets))
        wall_spin = np.array([0.0, 0.0, -scene.tipping if tipping else 0.0])
        tipped += h * wall_spin[2]
        problem = stated(bodies.mass, inertia_inverse, found, x, (v_free, spin_free), wall_spin, scene.mu)
        if len(found.gaps) >= scene.n_contacts:
            return problem
        tipping = tipping or (scene.tipping != 0.0 and 2 * len(found.gaps) >= scene.n_contacts)
        pushed = problem.q.copy()
        pushed[::3] -= np.minimum(0.2 * np.maximum(-found.gaps - 0.5 * MARGIN, 0.0) / h, 1.0)
        answer = rover_gym.solve_friction_contact(
            block_rows(problem.delassus()), pushed, problem.mu, 1e-4, solver="nsgs", max_iterations=80
        )
        velocities = np.column_stack([v_free, spin_free]).ravel()
        velocities += problem.apply_inverse_mass(problem.jacobian().T @ answer.impulses.ravel())
        v, spin = np.split(velocities.reshape(n, 6), 2, axis=1)
        x = x + h * v
        R = turn(h * spin) @ R
    raise RuntimeError(f"{scene}: only {len(found.gaps)} contacts")


def stated(
    mass: Array,
    inertia_inverse: Array,
    found: Contacts,
    x: Array,
    free: tuple[Array, Array],
    wall_spin: Array,
    mu: float,
) -> FreeBodies:
    """The step's problem: contacts found at x, free velocities and spins, and walls that turn about the origin."""
    frames = frames_of(found.normals)
    # On the ground's side the lever is not used.
    levers = found.points[:, None] - np.where(found.pairs[..., None] == GROUND, 0.0, x[found.pairs])
    problem = FreeBodies(
        mass, inertia_inverse, found.pairs, frames, levers, np.zeros(3 * len(frames)), np.full(len(frames), mu)
    )
    q = (problem.jacobian() @ np.column_stack(free).ravel()).reshape(-1, 3)
    on_wall = found.pairs[:, 0] == GROUND
    q[on_wall] -= np.einsum("nij,nj->ni", frames[on_wall], np.cross(wall_spin, found.points[on_wall]))
    problem.q[:] = q.ravel()
    return problem
