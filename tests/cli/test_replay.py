"""`rover replay`: VRML97 and glTF are read back and their poses compared with the run's; bad input is one line."""

import io
import re
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pygltflib
import pytest
import trimesh
from commands import error_of, output_of, rover
from pages import held
from scipy.spatial.transform import Rotation

from rover_gym import Plane, RoverModel, SphereField
from rover_gym.core.rotations import axis_angles, continuous, quaternions
from rover_gym.record import RecordingError, RoverRun, Trajectory, read_run
from rover_gym.record.run import moving_mean
from rover_gym.show.figures import draw_run
from rover_gym.show.frames.appearance import rover_parts, sphere_mesh
from rover_gym.show.replay import write_gltf, write_page, write_vrml
from rover_gym.show.replay.rover_scene import WHEEL_NAMES, facts
from rover_gym.show.replay.scenery import ground_tiles, identifiers

SLOPE = Plane((-0.1, 1.0, 0.05), 0.2)
FIELD = SphereField([[1.0, 0.1, -0.5], [2.0, 0.0, 0.7]], [0.2, 0.3], SLOPE)
PILE = SphereField([[0.0, -0.5, 0.0], [1.0, -0.5, 0.0]], [0.5, 0.6])


def turning_run(terrain: Plane | SphereField = FIELD, n: int = 41, title: str = 'a "test" & <more>') -> RoverRun:
    """A rover that turns once about y, through pi exactly, while its wheels turn thrice and it drives a little."""
    model = RoverModel()
    turn = np.linspace(0.0, 1.0, n)
    q = np.zeros((n, model.nq))
    q[:, 0], q[:, 1], q[:, 2] = 3.0 * turn, 0.5 + 0.1 * turn, -turn
    q[:, 4] = 2.0 * np.pi * turn
    q[:, model.wheel_joint_indices] = -6.0 * np.pi * turn[:, None]
    q[:, model.steering_joint_indices] = 0.3 * turn[:, None]
    wheels = {"wheel_forces": np.ones((n, 6, 3)), "wheel_gaps": np.full((n, 6), np.inf)}
    data = {"time": 1.5 + 4.0 * turn, "q": q, **wheels}
    return RoverRun(Trajectory(data, {}, {"title": title}, terrain), model, terrain, (3.0, -1.0))


def matrices(axis: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """Of turns by angles about axes."""
    result: np.ndarray = Rotation.from_rotvec(axis * np.asarray(angle)[..., None]).as_matrix()
    return result


# --- Rotations


@pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-7, 0.5, np.pi - 1e-7, np.pi - 1e-12, np.pi, np.pi + 1e-7, 4.0])
def test_axis_and_angle_are_right_at_any_angle(angle: float) -> None:
    rng = np.random.default_rng(1)
    axes = np.vstack((np.eye(3), -np.eye(3), rng.normal(size=(50, 3))))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    R = matrices(axes, np.full(len(axes), angle))
    q = quaternions(R)
    assert np.linalg.norm(q, axis=1) == pytest.approx(1.0, abs=1e-15)
    turns = axis_angles(q)
    assert np.linalg.norm(turns[:, :3], axis=1) == pytest.approx(1.0, abs=1e-15)
    assert np.abs(matrices(turns[:, :3], turns[:, 3]) - R).max() < 1e-14


def test_neighbouring_quaternions_lie_on_one_side() -> None:
    angle = np.linspace(0.0, 20.0, 100)
    axis = np.tile(np.array([0.6, 0.0, 0.8]), (100, 1))
    q = continuous(quaternions(matrices(axis, angle)))
    assert np.all(np.sum(q[1:] * q[:-1], axis=-1) > 0.99)
    expected = np.column_stack((np.cos(angle / 2), axis * np.sin(angle / 2)[:, None]))
    assert np.abs(q - expected).max() < 1e-14


# --- Scenery


@pytest.mark.parametrize("plane", [Plane(), SLOPE, Plane((1.0, 0.2, 0.0), -1.0)])
def test_the_grounds_squares_lie_on_the_plane_and_face_up(plane: Plane) -> None:
    run = turning_run(plane)
    vertices, light, dark = ground_tiles(run)
    assert vertices @ plane.normal + plane.offset == pytest.approx(0.0, abs=1e-12)
    corners = vertices[np.vstack((light, dark))]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert normals == pytest.approx(np.tile(0.25 * plane.normal, (len(normals), 1)), abs=1e-12)
    assert abs(len(light) - len(dark)) <= 2
    # Every place of the path has ground about it.
    for place in run.trajectory["q"][:, :3]:
        foot = place - (place @ plane.normal + plane.offset) * plane.normal
        assert np.linalg.norm(vertices - foot, axis=1).min() < 0.36


def test_the_sphere_is_closed_and_faces_outwards() -> None:
    vertices, triangles = sphere_mesh(20)
    assert np.linalg.norm(vertices, axis=1) == pytest.approx(1.0)
    a, b, c = np.moveaxis(vertices[triangles], 1, 0)
    volume = np.sum(a * np.cross(b, c)) / 6.0
    assert volume == pytest.approx(4.0 / 3.0 * np.pi, rel=0.02)  # of an inscribed polyhedron, and positive
    assert np.all(np.sum((a + b + c) * np.cross(b - a, c - a), axis=1) > 0.0)


# --- VRML97


@dataclass
class Node:
    """A node with its fields as they were written."""

    kind: str
    fields: dict[str, Any] = field(default_factory=dict)


class Vrml:
    """As much of VRML97's grammar as a file without prototypes and scripts has."""

    def __init__(self, text: str) -> None:
        header, _, rest = text.partition("\n")
        assert header == "#VRML V2.0 utf8"
        self._tokens = re.findall(r'"(?:\\.|[^"\\])*"|[\[\]{}]|[^\s,\[\]{}"]+', rest)
        self._at = 0
        self.named: dict[str, Node] = {}
        self.routes: list[tuple[str, str, str, str]] = []
        self.nodes: list[Node] = []
        while self._at < len(self._tokens):
            if self._peek() == "ROUTE":
                _, source, to, target = (self._next() for _ in range(4))
                assert to == "TO"
                self.routes.append((*source.split("."), *target.split(".")))
            else:
                self.nodes.append(self._node())

    def _peek(self) -> str:
        return self._tokens[self._at]

    def _next(self) -> str:
        self._at += 1
        return self._tokens[self._at - 1]

    def _node(self) -> Node:
        if self._peek() == "USE":
            self._next()
            return self.named[self._next()]
        name = None
        if self._peek() == "DEF":
            self._next()
            name = self._next()
            assert name not in self.named
        node = Node(self._next())
        assert self._next() == "{"
        while self._peek() != "}":
            name_of_field = self._next()
            node.fields[name_of_field] = self._value()
        self._next()
        if name is not None:
            self.named[name] = node
        return node

    def _value(self) -> Any:
        head = self._peek()
        if head == "[":
            self._next()
            values: list[Any] = []
            while self._peek() != "]":
                value = self._value()
                values += value if isinstance(value, list) else [value]
            self._next()
            return values
        if head.startswith('"'):
            return re.sub(r"\\(.)", r"\1", self._next()[1:-1])
        if head in ("TRUE", "FALSE"):
            return self._next() == "TRUE"
        if re.match(r"[-+.\d]", head):
            numbers = []
            while re.match(r"[-+.\d]", self._peek()):
                numbers.append(float(self._next()))
            return numbers
        return self._node()

    def follow(self, name: str, event: str) -> str:
        """The node and field that drive an event of a node."""
        (source,) = [f"{a}.{b}" for a, b, c, d in self.routes if (c, d) == (name, event)]
        return source


def key_values(vrml: Vrml, solid: str, event: str, size: int) -> tuple[np.ndarray, np.ndarray]:
    """Fractions and values of the interpolator that is routed to a solid's event."""
    interpolator, out = vrml.follow(solid, event).split(".")
    assert out == "value_changed"
    assert vrml.follow(interpolator, "set_fraction") == "Clock.fraction_changed"
    node = vrml.named[interpolator]
    kind = {3: "PositionInterpolator", 4: "OrientationInterpolator"}[size]
    assert node.kind == kind
    return np.array(node.fields["key"]), np.array(node.fields["keyValue"]).reshape(-1, size)


@pytest.mark.parametrize("terrain", [SLOPE, FIELD, PILE])
def test_vrml_has_the_poses_of_the_run(terrain: Plane | SphereField, tmp_path: Path) -> None:
    run = turning_run(terrain)
    vrml = Vrml(write_vrml(run, tmp_path / "deep" / "out.wrl").read_text(encoding="utf-8"))
    clock = vrml.named["Clock"]
    assert clock.kind == "TimeSensor"
    assert clock.fields["cycleInterval"] == [4.0]
    for i, solid in enumerate(run.model.solid_names):
        fractions, places = key_values(vrml, solid, "set_translation", 3)
        assert 1.5 + 4.0 * fractions == pytest.approx(run.time, abs=1e-6)
        assert np.abs(places - run.positions[:, i]).max() < 1e-6
        fractions, turns = key_values(vrml, solid, "set_rotation", 4)
        assert 1.5 + 4.0 * fractions == pytest.approx(run.time, abs=1e-6)
        assert np.linalg.norm(turns[:, :3], axis=1) == pytest.approx(1.0, abs=1e-6)
        assert np.abs(matrices(turns[:, :3], turns[:, 3]) - run.rotations[:, i]).max() < 1e-6
        # Quaternions of neighbouring keys lie on one side, so that any viewer turns the short way between them.
        half = turns[:, 3:] / 2
        q = np.column_stack((np.cos(half), np.sin(half) * turns[:, :3]))
        assert np.sum(q[1:] * q[:-1], axis=1).min() > 0.5
        # Where no clock runs, the solid stands where it starts.
        still = vrml.named[solid].fields
        assert still["translation"] == pytest.approx(run.positions[0, i], abs=1e-6)


def shaped_run() -> RoverRun:
    """The same run of a rover whose first beam is made of turned shapes, a ball among them."""
    description = RoverModel().to_dict()
    beam = description["solids"][1]
    del beam["shape"], beam["collides"]
    beam["shapes"] = [
        {"kind": "box", "size": [0.1, 0.2, 0.9], "rotation": [0.0, 0.4, 0.2]},
        {"kind": "sphere", "radius": 0.1, "position": [0.0, 0.2, 0.1]},
        {"kind": "cylinder", "radius": 0.1, "height": 0.2, "visible": False},
    ]
    return replace(turning_run(), model=RoverModel.from_dict(description))


@pytest.mark.parametrize("run", [turning_run(FIELD), shaped_run()], ids=["plain", "shaped"])
def test_vrml_has_the_ground_the_spheres_and_every_part(run: RoverRun, tmp_path: Path) -> None:
    vrml = Vrml(write_vrml(run, tmp_path / "out.wrl").read_text(encoding="utf-8"))
    ground = vrml.named["Ground"].fields["geometry"].fields
    points = np.array(ground["coord"].fields["point"]).reshape(-1, 3)
    assert points @ SLOPE.normal + SLOPE.offset == pytest.approx(0.0, abs=1e-6)
    corners = np.array(ground["coordIndex"]).reshape(-1, 4)
    assert np.all(corners[:, 3] == -1)
    assert corners[:, :3].max() == len(points) - 1
    assert len(ground["colorIndex"]) == len(corners)
    balls = vrml.named["Spheres"].fields["children"]
    for ball, centre, radius in zip(balls, FIELD.centres, FIELD.radii, strict=True):
        assert ball.fields["translation"] == pytest.approx(centre, abs=1e-6)
        assert ball.fields["children"].fields["geometry"].fields["radius"] == pytest.approx([radius], abs=1e-6)
    parts = rover_parts(run.model)
    for solid in run.model.solid_names:
        drawn = vrml.named[solid].fields.get("children", [])
        wanted = [part for part in parts if part.solid == solid]
        assert len(drawn) == len(wanted)
        for node, part in zip(drawn, wanted, strict=True):
            shape = node.fields["children"].fields["geometry"]
            assert shape.kind == part.kind.capitalize()
            assert node.fields["translation"] == pytest.approx(part.position, abs=1e-6)
            turn = np.array(node.fields["rotation"])
            assert matrices(turn[:3], turn[3]) == pytest.approx(part.rotation, abs=1e-6)
    assert vrml.nodes[0].fields["title"] == run.title


def test_vrmls_viewpoint_sees_the_rover_upright(tmp_path: Path) -> None:
    run = turning_run()
    vrml = Vrml(write_vrml(run, tmp_path / "out.wrl").read_text(encoding="utf-8"))
    (view,) = [node.fields for node in vrml.nodes if node.kind == "Viewpoint"]
    turn = np.array(view["orientation"])
    R = matrices(turn[:3], turn[3])
    way = run.positions[0, 0] - np.array(view["position"])
    assert -R[:, 2] @ way / np.linalg.norm(way) > 0.99  # the eye looks along its -z
    assert R[1, 1] > 0.7  # and up is up


# --- glTF


def accessor(gltf: pygltflib.GLTF2, index: int) -> np.ndarray:
    """Reads an accessor and checks that it lies within its view, and the view within the buffer."""
    entry = gltf.accessors[index]
    view = gltf.bufferViews[entry.bufferView]
    columns = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}[entry.type]
    dtype = {pygltflib.FLOAT: "<f4", pygltflib.UNSIGNED_INT: "<u4"}[entry.componentType]
    assert view.byteOffset % 4 == 0
    assert entry.count * columns * 4 == view.byteLength
    assert view.byteOffset + view.byteLength <= gltf.buffers[0].byteLength
    blob = gltf.binary_blob()
    values = np.frombuffer(blob, dtype, entry.count * columns, view.byteOffset).reshape(entry.count, columns)
    if entry.min:
        assert values.min(axis=0).tolist() == pytest.approx(entry.min)
        assert values.max(axis=0).tolist() == pytest.approx(entry.max)
    return values


@pytest.mark.parametrize("terrain", [SLOPE, FIELD, PILE])
def test_gltf_has_the_poses_of_the_run(terrain: Plane | SphereField, tmp_path: Path) -> None:
    run = turning_run(terrain)
    gltf = pygltflib.GLTF2.load(write_gltf(run, tmp_path / "deep" / "out.glb"))
    names = [node.name for node in gltf.nodes]
    (motion,) = gltf.animations
    seen = set()
    for channel in motion.channels:
        node, path = channel.target.node, channel.target.path
        seen.add((names[node], path))
        i = run.model.solid_names.index(names[node])
        sampler = motion.samplers[channel.sampler]
        assert sampler.interpolation == "LINEAR"
        assert gltf.accessors[sampler.input].min == [0.0]  # glTF wants the bounds of the time
        assert accessor(gltf, sampler.input)[:, 0] == pytest.approx(run.time - run.time[0], abs=1e-6)
        values = accessor(gltf, sampler.output)
        if path == "translation":
            assert np.abs(values - run.positions[:, i]).max() < 1e-6
            assert gltf.nodes[node].translation == pytest.approx(values[0])
        else:
            assert np.linalg.norm(values, axis=1) == pytest.approx(1.0, abs=1e-6)
            assert np.sum(values[1:] * values[:-1], axis=1).min() > 0.5
            assert np.abs(Rotation.from_quat(values).as_matrix() - run.rotations[:, i]).max() < 1e-6
    assert seen == {(name, path) for name in run.model.solid_names for path in ("translation", "rotation")}


def test_gltf_is_whole(tmp_path: Path) -> None:
    run = turning_run(FIELD)
    path = write_gltf(run, tmp_path / "out.glb")
    content = path.read_bytes()
    assert content[:4] == b"glTF"
    assert int.from_bytes(content[8:12], "little") == len(content)
    gltf = pygltflib.GLTF2.load(path)
    assert sorted(gltf.scenes[0].nodes) == list(range(len(gltf.nodes)))
    for mesh in gltf.meshes:
        for primitive in mesh.primitives:
            points = accessor(gltf, primitive.attributes.POSITION)
            assert len(gltf.accessors[primitive.attributes.POSITION].min) == 3
            corners = accessor(gltf, primitive.indices)
            assert len(corners) % 3 == 0
            assert corners.max() < len(points)
            assert 0 <= primitive.material < len(gltf.materials)
    for animation in gltf.animations:
        targets = [(channel.target.node, channel.target.path) for channel in animation.channels]
        assert len(set(targets)) == len(targets)


def test_another_reader_finds_the_rover_in_the_gltf(tmp_path: Path) -> None:
    run = turning_run(FIELD)
    scene = trimesh.load_scene(io.BytesIO(write_gltf(run, tmp_path / "out.glb").read_bytes()), file_type="glb")
    for i, solid in enumerate(run.model.solid_names):
        transform, _ = scene.graph.get(solid)
        assert transform[:3, 3] == pytest.approx(run.positions[0, i], abs=1e-6)
        assert transform[:3, :3] == pytest.approx(run.rotations[0, i], abs=1e-6)
    for i in range(2):
        transform, _ = scene.graph.get(f"sphere_{i}")
        assert transform[:3, 3] == pytest.approx(FIELD.centres[i], abs=1e-6)
        assert np.diag(transform)[:3] == pytest.approx(FIELD.radii[i], abs=1e-6)


# --- The page, as far as no browser is needed


def test_the_page_holds_the_curves_of_the_run(tmp_path: Path) -> None:
    run = turning_run()
    page = write_page(run, tmp_path / "deep" / "out.html")
    data = held(page).head["curves"]
    assert data["title"] == run.title
    assert data["time"] == pytest.approx(run.time - run.time[0])
    names = [WHEEL_NAMES[name] for name in run.model.wheel_names]
    loads, gaps = data["charts"][:2]
    assert all([curve["name"] for curve in chart["series"]] == names for chart in (loads, gaps))
    assert (loads["unit"], gaps["unit"]) == ("N", "mm")
    assert loads["values"] == [[1.0] * run.n_frames] * 6
    assert gaps["values"] == [[None] * run.n_frames] * 6  # infinite ones, which JSON does not know
    assert "<title>a &quot;test&quot; &amp; &lt;more&gt;</title>" in page.read_text(encoding="utf-8")


def test_a_page_of_a_thousand_frames_stays_small(tmp_path: Path) -> None:
    run = turning_run(FIELD, n=1000)
    assert write_page(run, tmp_path / "out.html").stat().st_size < 1_500_000


def test_the_page_holds_the_poses_of_every_sample(tmp_path: Path) -> None:
    """To 0.06 mm, over several pieces."""
    run = turning_run(n=61)
    page = held(write_page(run, tmp_path / "out.html"))
    assert len(page.pieces) == 3
    assert np.abs(page.values("places") - run.positions).max() < 2.0**-14
    turns = page.values("turns")[..., [3, 0, 1, 2]]
    assert np.linalg.norm(turns, axis=-1) == pytest.approx(1.0, abs=1e-3)
    assert np.abs(np.sum(turns * quaternions(run.rotations), axis=-1)) == pytest.approx(1.0, abs=1e-3)
    assert page.head["plane"]["normal"] == pytest.approx(SLOPE.normal.tolist())
    rocks = page.arrays["rocks"].reshape(-1, 4)
    assert rocks == pytest.approx(np.column_stack((FIELD.centres, FIELD.radii)), abs=1e-6)


def test_forces_point_away_from_the_ground_and_stand_under_the_wheels(tmp_path: Path) -> None:
    """A force along the normal of a slope: in the world frame, in mean shares of the weight."""
    run = turning_run(SLOPE)
    run.trajectory.data["wheel_forces"] = np.tile([200.0, 0.0, 0.0], (run.n_frames, 6, 1))
    forces = held(write_page(run, tmp_path / "out.html")).values("forces")
    share = run.model.mass * 9.81 / 6.0
    np.testing.assert_allclose(forces[..., 3:] - 200.0 / share * SLOPE.normal, 0.0, atol=1e-3)
    wheels = [run.model.solid_names.index(wheel["solid"]) for wheel in run.model.to_dict()["wheels"]]
    below = run.positions[:, wheels] - forces[..., :3]
    assert np.linalg.norm(below, axis=-1) == pytest.approx(np.tile(run.model.wheel_radii, (run.n_frames, 1)), abs=1e-3)
    assert (below @ SLOPE.normal > 0.0).all()


# --- Names and titles of a file that means harm

SCRIPTS = ('" } ] DEF Evil Script { url "javascript:alert(1)" }', "</script><img src=x onerror=alert(1)>")
UNKIND = (*SCRIPTS, "a b", "a_b", "Clock", "ü", "")


def renamed_run(title: str) -> RoverRun:
    """A run whose solids, wheels and title are what no format must read as its own."""
    plain = RoverModel().to_dict()
    old = [solid["name"] for solid in plain["solids"]]
    names = dict(zip(old, (*UNKIND, *(f"{UNKIND[0]}{i}" for i in range(len(old)))), strict=False))

    def rename(value: Any) -> Any:
        if isinstance(value, dict):
            return {key: rename(entry) for key, entry in value.items()}
        if isinstance(value, list):
            return [rename(entry) for entry in value]
        return names.get(value, value) if isinstance(value, str) else value

    return replace(turning_run(title=title), model=RoverModel.from_dict(rename(plain)))


def test_names_and_titles_reach_vrml_escaped(tmp_path: Path) -> None:
    """A solid's name was written unescaped and could add nodes and scripts."""
    run = renamed_run('a "} Script { url "x\n')
    text = write_vrml(run, tmp_path / "out.wrl").read_text(encoding="utf-8")
    assert "Evil Script" not in text
    assert "javascript" not in text.replace("javascript_alert", "")
    vrml = Vrml(text)
    moved = {"Transform", "PositionInterpolator", "OrientationInterpolator", "TimeSensor"}
    kinds = moved | {"Shape", "Group", "Appearance"}
    assert {node.kind for node in vrml.named.values()} <= kinds
    assert vrml.named["Clock"].kind == "TimeSensor"
    assert sum(node.kind == "PositionInterpolator" for node in vrml.named.values()) == len(run.model.solid_names)
    assert 'title "a \\"} Script { url \\"x"' in text


def test_names_and_titles_reach_the_page_as_text_only(tmp_path: Path) -> None:
    run = renamed_run("</title></script><script>alert(1)</script>")
    page = write_page(run, tmp_path / "out.html")
    text = page.read_text(encoding="utf-8")
    assert "<script>alert(1)" not in text
    assert "onerror=alert" not in text
    assert held(page).head["curves"]["title"] == run.title


def test_names_and_titles_reach_gltf_as_text(tmp_path: Path) -> None:
    run = renamed_run('"}], "x": [{"')
    gltf = pygltflib.GLTF2().load_binary(str(write_gltf(run, tmp_path / "out.glb")))
    assert [node.name or "" for node in gltf.nodes[: len(UNKIND)]] == list(UNKIND)
    assert gltf.animations[0].name == run.title


def test_names_become_identifiers_that_are_their_own() -> None:
    names = identifiers(["trunk", "a b", "a_b", "a b_place", "1", "", "Clock", "x" * 500], {"Clock"}, ("_place",))
    assert names["trunk"] == "trunk"
    forms = [name + ending for name in names.values() for ending in ("", "_place")]
    assert len(set(forms)) == len(forms)
    assert all(re.fullmatch(r"[A-Za-z]\w{0,79}", name, flags=re.ASCII) for name in names.values())
    assert "Clock" not in names.values()


def test_a_run_over_thousands_of_kilometres_has_a_ground_of_few_squares() -> None:
    """The ground was drawn in squares of half a metre, which exhausted the memory."""
    run = turning_run(Plane())
    run.trajectory["q"][-1, :3] = 5e8
    tiles = ground_tiles(run)
    assert len(tiles[0]) < 4 * 50_000
    assert np.isfinite(tiles[0]).all()


def test_a_title_with_dollars_is_no_formula(tmp_path: Path) -> None:
    """The run also has infinite gaps and a weightless rover; both must give finite axes."""
    run = turning_run(title=r"$\frac{")
    gravity = {"solver": {"gravity": [0.0, 0.0, 0.0]}}
    weightless = replace(run.trajectory, attributes={**run.trajectory.attributes, **gravity})
    assert len(draw_run(replace(run, trajectory=weightless), tmp_path)) >= 2


def test_a_page_of_a_run_without_its_forces_names_them(tmp_path: Path) -> None:
    run = turning_run()
    del run.trajectory.data["wheel_forces"]
    with pytest.raises(RecordingError, match="there is no such data set"):
        write_page(run, tmp_path / "out.html")


# --- The command


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    folder = tmp_path_factory.mktemp("drive")
    assert rover("drive", "--time-limit", "1", "--output", folder).exit_code == 0
    return folder / "episode-0.h5"


def test_all_formats_are_written_and_named(recording: Path, tmp_path: Path) -> None:
    targets = [tmp_path / name for name in ("a.html", "a.wrl", "a.glb")]
    given = ("--html", targets[0], "--vrml", targets[1], "--gltf", targets[2])
    output = output_of("replay", recording, *given, "--fps", "10")
    for target in targets:
        assert f"{target}" in output.replace("\n", "")
    assert held(targets[0]).head["time"] == pytest.approx(np.linspace(0.0, 1.0, 11))
    vrml = Vrml(targets[1].read_text(encoding="utf-8"))
    assert len(vrml.named["trunk_place"].fields["key"]) == 11
    assert read_run(recording).goal is not None
    assert "goal" in [node.name for node in pygltflib.GLTF2.load(targets[2]).nodes]


@pytest.mark.parametrize(
    ("arguments", "culprit"),
    [
        (["--vrml", "out.wrl", "--fps", "0"], "fps"),
        (["--vrml", "out.wrl", "--fps", "nan"], "fps"),
        (["--vrml", "taken/below/out.wrl"], "taken"),
    ],
)
def test_bad_input_is_one_line_that_names_the_culprit(
    arguments: list[str], culprit: str, recording: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "taken").write_text("a file, not a folder", encoding="utf-8")
    assert culprit in error_of("replay", recording, *arguments)
    assert [path.name for path in tmp_path.iterdir()] == ["taken"]


def test_what_is_no_run_is_refused_in_one_line(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("no run", encoding="utf-8")
    for name, message in (("notes.txt", "is not a rover-gym trajectory"), ("nowhere.h5", "nowhere.h5")):
        assert message in error_of("replay", tmp_path / name, "--vrml", tmp_path / "out.wrl")


def test_a_missing_package_is_named_with_its_extra(
    recording: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pygltflib", None)
    error = error_of("replay", recording, "--vrml", tmp_path / "out.wrl", "--gltf", tmp_path / "out")
    assert error == "error: pygltflib is not installed: pip install 'rover-gym[replay]'\n"
    assert list(tmp_path.iterdir()) == []


# --- What the panel says of a run


def test_the_panel_says_scene_seed_difficulty_and_outcome(tmp_path: Path) -> None:
    drive = ["drive", "--difficulty", "0.5", "--slope", "3", "--seed", "4", "--time-limit", "0.2"]
    assert rover(*drive, "--output", tmp_path).exit_code == 0
    told = ["scene: rocks", "slope: 3.0 degrees", "seed: 4", "difficulty: 0.5", "outcome: ran out of time"]
    assert facts(read_run(tmp_path / "episode-4.h5")) == told
    assert facts(turning_run()) == []


def test_loads_are_smoothed_and_what_is_unknown_is_left_out() -> None:
    time = np.arange(0.0, 1.0, 0.05)
    values = np.ones((len(time), 2))
    values[10, 0], values[5, 1] = 11.0, np.nan
    smooth = moving_mean(time, values, 0.2)
    assert smooth[10, 0] == pytest.approx(3.0)  # five samples within 0.2 s
    assert smooth[3, 0] == pytest.approx(1.0)
    assert np.allclose(smooth[:, 1], 1.0)
    assert np.isnan(moving_mean(time, np.full((len(time), 1), np.nan), 0.2)).all()
