"""Cylinders, capsules, ellipsoids and meshes of robot files collide; so do their models' own shapes."""

import numpy as np
import pytest
from models.robot_files import rover, write
from models.test_writers import assert_same_machine, written_and_read
from rovers import placed

from rover_gym import ModelError, RoverModel, Simulation, SphereField
from rover_gym.core import Plane
from rover_gym.core.polytopes import hull_faces, hull_mesh, hull_properties
from rover_gym.show.frames.appearance import part_mesh, rover_parts

TEXT = """
<mujoco model="stone">
  <asset><mesh name="wedge" vertex="0 0 0  1 0 0  0 1 0  0 0 1"/></asset>
  <worldbody>
    <body name="stone" pos="0 0 1">
      <freejoint/><inertial pos="0 0 0" mass="2" diaginertia="0.1 0.1 0.1"/>
      <geom type="cylinder" size="0.1 0.3" pos="0.1 0 0"/>
      <geom type="capsule" size="0.2 0.4" euler="0 90 0"/>
      <geom type="ellipsoid" size="0.1 0.2 0.3" pos="0 1 0"/>
      <geom type="mesh" mesh="wedge" pos="0 0 2" euler="0 0 90"/>
    </body>
  </worldbody>
</mujoco>
"""


def link_shapes(model, name):
    return next(solid for solid in model.to_dict()["solids"] if solid["name"] == name).get("shapes", [])


def box(low, high):
    """Corners (8, 3) and triangles (12, 3) of a box."""
    corners = np.array([[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])])
    sides = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return corners, np.array([(a, b, c) for p, q, r, s in sides for a, b, c in ((p, q, r), (p, r, s))])


def u_profile():
    """A closed mesh of volume 0.28 whose convex hull has 0.6: a U of two legs on a bar, 0.5 wide."""
    outline = np.array([[0, 0], [1.2, 0], [1.2, 1], [1, 1], [1, 0.2], [0.2, 0.2], [0.2, 1], [0, 1]], dtype=float)
    n = len(outline)
    vertices = np.concatenate([np.column_stack([outline, np.full(n, z)]) for z in (0.0, 0.5)])
    front = [(0, 5, 1), (0, 6, 5), (0, 7, 6), (1, 5, 4), (1, 4, 2), (2, 4, 3)]
    back = [tuple(k + n for k in triangle[::-1]) for triangle in front]
    rim = [(k, (k + 1) % n, k + n) for k in range(n)] + [((k + 1) % n, (k + 1) % n + n, k + n) for k in range(n)]
    return vertices, np.array(front + back + rim)


def chassis_of(tmp_path, vertices, faces, **options):
    """A small rover whose chassis collides as a mesh."""
    trimesh = pytest.importorskip("trimesh")
    trimesh.Trimesh(vertices, faces, process=False).export(tmp_path / "hull.stl")
    text = rover().replace('<box size="1 0.6 0.2"/>', '<mesh filename="hull.stl" scale="1 1 1"/>')
    return RoverModel.from_urdf(write(tmp_path, text), **options)


def test_the_geoms_of_a_body_are_its_shapes(tmp_path):
    pytest.importorskip("mujoco")
    model = RoverModel.from_mjcf(write(tmp_path, TEXT, "stone.xml"), wheels=[])
    shapes = cylinder, capsule, ellipsoid, hull = link_shapes(model, "stone")
    assert [shape["kind"] for shape in shapes] == ["cylinder", "capsule", "ellipsoid", "hull"]
    assert all(shape["collides"] for shape in shapes)
    assert (cylinder["radius"], cylinder["height"]) == (0.1, 0.6)
    assert (capsule["radius"], capsule["height"]) == (0.2, 0.8)
    assert ellipsoid["radii"] == [0.1, 0.3, 0.2]  # our y is the file's z
    volume, _, _ = hull_properties(hull["points"])
    assert volume == pytest.approx(1.0 / 6.0)
    # Turned by 90 degrees about z and raised by 2 in the file: x to y, y to -x.
    corners = np.array(hull["points"]) @ [[1, 0, 0], [0, 0, 1], [0, -1, 0]]
    assert {tuple(np.round(point, 6) + 0.0) for point in corners} == {(0, 0, 2), (0, 1, 2), (-1, 0, 2), (0, 0, 3)}
    assert "its convex hull of 4 vertices, volume +0.0 %" in str(model.import_report)


def test_a_collision_cylinder_of_a_link_that_is_no_wheel_collides(tmp_path):
    pytest.importorskip("yourdfpy")
    text = rover().replace('<box size="1 0.6 0.2"/>', '<cylinder radius="0.4" length="0.2"/>')
    (shape,) = link_shapes(RoverModel.from_urdf(write(tmp_path, text)), "chassis")
    assert (shape["kind"], shape["radius"], shape["height"], shape["collides"]) == ("cylinder", 0.4, 0.2, True)


def test_a_concave_mesh_is_divided_and_the_report_states_the_error(tmp_path):
    pytest.importorskip("vhacdx")
    vertices, faces = u_profile()
    model = chassis_of(tmp_path, vertices, faces)
    hulls = link_shapes(model, "chassis")
    volumes = [hull_properties(hull["points"])[0] for hull in hulls]
    assert 3 <= len(hulls) <= 8
    assert sum(volumes) == pytest.approx(0.28, rel=0.03)
    told = f"{len(hulls)} convex parts, volume {100.0 * (sum(volumes) / 0.28 - 1.0):+.1f} %: link[chassis]"
    assert f"a mesh collides as {told}" in str(model.import_report)
    whole = chassis_of(tmp_path, vertices, faces, mesh_parts=1)
    (hull,) = link_shapes(whole, "chassis")
    assert hull_properties(hull["points"])[0] == pytest.approx(0.6)
    assert f"volume {100.0 * (0.6 / 0.28 - 1.0):+.1f} %" in str(whole.import_report)
    none = chassis_of(tmp_path, vertices, faces, mesh_parts=0)
    assert link_shapes(none, "chassis") == []
    assert "left out because of `mesh_parts`" in str(none.import_report)


def test_without_a_library_a_concave_mesh_is_its_hull_and_the_report_says_so(tmp_path, monkeypatch):
    vertices, faces = u_profile()
    monkeypatch.setitem(__import__("sys").modules, "vhacdx", None)
    report = str(chassis_of(tmp_path, vertices, faces).import_report)
    assert "its convex hull of 8 vertices" in report
    assert "it is not divided, since vhacdx is not installed" in report


def test_vertices_are_limited_and_open_and_flat_meshes_are_told(tmp_path):
    trimesh = pytest.importorskip("trimesh")
    ball = trimesh.creation.icosphere(3, radius=0.5)
    for limit in (4, 20, 64):
        model = chassis_of(tmp_path, ball.vertices, ball.faces, mesh_vertices=limit)
        (hull,) = link_shapes(model, "chassis")
        assert len(hull["points"]) == limit
        share = hull_properties(hull["points"])[0] / ball.volume
        assert f"volume {100.0 * (share - 1.0):+.1f} %" in str(model.import_report)
    assert share > 0.9
    corners, sides = box((0, 0, 0), (1, 2, 3))
    assert "it is not closed" in str(chassis_of(tmp_path, corners, sides[:-1]).import_report)
    flat = chassis_of(tmp_path, corners[:4], sides[:2])
    assert "a mesh without volume, although it touches" in str(flat.import_report)
    assert link_shapes(flat, "chassis") == []
    for option in ({"mesh_parts": -1}, {"mesh_parts": 2.0}, {"mesh_vertices": 3}, {"mesh_vertices": 65}):
        with pytest.raises(ModelError, match=next(iter(option))):
            chassis_of(tmp_path, corners, sides, **option)


def test_the_chassis_mesh_of_an_imported_robot_hits_a_rock(tmp_path):
    """A robot came to lie on a boulder as if its chassis were air."""
    pytest.importorskip("vhacdx")
    vertices, faces = u_profile()
    vertices = (vertices - [0.6, 0.0, 0.25]) * [0.8, 0.3, 0.8]
    rock = SphereField([[0.0, 0.0, -0.03]], [0.35], ground=Plane([0.0, 1.0, 0.0], 0.0))
    lowest = {}
    for parts in (0, 8):
        model = chassis_of(tmp_path, vertices, faces, mesh_parts=parts)
        simulation = placed(Simulation(model, rock, time_step=0.005), y=0.9)
        touched = set()
        for _ in range(100):
            report = simulation.step()
            assert report.is_converged
            touched |= set(zip(simulation.contacts.bodies, simulation.contacts.kinds, strict=True))
        assert (("chassis", "collider") in touched) == (parts > 0)
        lowest[parts] = simulation.poses()["chassis"][0][1]
    # The rock's top is 0.35 m over the ground, and the chassis' bottom 0.2 m where it stands on its wheels.
    assert lowest[8] > lowest[0] + 0.05


SHAPES = [
    {"kind": "cylinder", "radius": 0.1, "height": 0.3, "position": [0.1, 0.2, 0.3], "collides": True},
    {"kind": "capsule", "radius": 0.05, "height": 0.4, "rotation": [0.1, 0.2, 0.3], "collides": True},
    {"kind": "ellipsoid", "radii": [0.1, 0.2, 0.3], "position": [0.0, 0.5, 0.0], "rotation": [0.5, 0.0, 0.0], "collides": True},
    {"kind": "hull", "points": [[0, 0, 0], [1, 0, 0], [0, 0.5, 0], [0, 0, 0.7], [1, 0.4, 0.6]], "rotation": [0.0, 0.3, 0.0],
     "position": [0.0, 0.0, 0.2], "collides": True},
]  # fmt: skip


def stone(shapes):
    return RoverModel.from_dict({"name": "stone", "solids": [{"name": "stone", "mass": 3.0, "shapes": shapes}]})


def test_shapes_come_back_from_mjcf_and_what_urdf_lacks_is_refused_by_name(tmp_path):
    pytest.importorskip("mujoco")
    pytest.importorskip("yourdfpy")
    model = stone(SHAPES)
    back = written_and_read(model, tmp_path, "mjcf", wheels=[])
    assert_same_machine(model, back)
    found = link_shapes(back, "stone")
    assert [shape["kind"] for shape in found] == [shape["kind"] for shape in SHAPES]
    assert found[2]["radii"] == pytest.approx(SHAPES[2]["radii"])
    assert found[1]["height"] == pytest.approx(0.4)
    assert hull_properties(found[3]["points"])[0] == pytest.approx(hull_properties(SHAPES[3]["points"])[0])
    for kind in ("ellipsoid", "hull"):
        one = stone([shape for shape in SHAPES if shape["kind"] == kind])
        with pytest.raises(ModelError, match=rf'solids\[0\]\.shapes.*URDF has no {kind}s.*ignore=\["{kind}s"\]'):
            one.to_urdf(tmp_path / "x.urdf")
    model.to_urdf(tmp_path / "x.urdf", ignore=["ellipsoids", "hulls"])
    back = RoverModel.from_urdf(tmp_path / "x.urdf", wheels=[])
    assert_same_machine(model, back)
    kinds = [shape["kind"] for shape in link_shapes(back, "stone") if shape.get("collides")]
    assert kinds == ["cylinder", "cylinder", "sphere", "sphere"]


def test_a_model_of_each_shape_has_the_bodys_inertia_and_is_drawn():
    """The core's inertia of a hull and the writers' agree; a drawn vertex is on the shape."""
    for shape in SHAPES:
        model = stone([shape])
        for part in rover_parts(model):
            vertices, triangles = part_mesh(part)
            assert len(triangles)
            assert triangles.max() < len(vertices)
            if part.kind == "ellipsoid":
                np.testing.assert_allclose(np.linalg.norm(vertices / part.size, axis=1), 1.0)
            if part.kind == "hull":
                a, b, c = (vertices[triangles[:, k]] for k in range(3))
                volume = np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6.0
                assert volume == pytest.approx(hull_properties(shape["points"])[0])
    kinds = [part.kind for part in rover_parts(stone(SHAPES))]
    assert kinds == ["cylinder", "cylinder", "sphere", "sphere", "ellipsoid", "hull"]


def test_hulls_are_those_of_scipy():
    spatial = pytest.importorskip("scipy.spatial")
    rng = np.random.default_rng(3)
    for n in (4, 9, 30):
        points = rng.normal(size=(n, 3))
        hull = spatial.ConvexHull(points)
        assert hull_properties(points)[0] == pytest.approx(hull.volume)
        assert len(hull_mesh(points)[1]) == len(hull.simplices)
    corners, _ = box((0, 0, 0), (1, 2, 3))
    inside = np.concatenate([corners, [[0.5, 1.0, 1.5], [1.0, 1.0, 1.0], [1.0, 1.0, 0.0]]])
    assert sorted(len(face) for face in hull_faces(inside)) == [4] * 6
    volume, centre, inertia = hull_properties(inside)
    assert volume == pytest.approx(6.0)
    np.testing.assert_allclose(centre, [0.5, 1.0, 1.5])
    np.testing.assert_allclose(inertia, np.diag([13.0, 10.0, 5.0]) / 12.0, atol=1e-12)
