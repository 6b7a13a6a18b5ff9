"""Colours and visual meshes of robot files, as frames, films and pages draw them."""

import numpy as np
import pytest
from models.robot_files import rover, write
from models.test_wheel_groups import four, round_shape
from rovers import with_fields

from rover_gym import ModelError, RoverModel, Simulation
from rover_gym.envs.sensors import LaserScanner, Mount
from rover_gym.envs.sensors.sensor import Moment
from rover_gym.models.drawings import MOST_OF_ONE, simplified
from rover_gym.models.meshes import Mesh
from rover_gym.show.frames.appearance import TYRE_COLOUR, part_mesh, rover_parts
from rover_gym.show.replay.scenery import coloured_meshes

pytest.importorskip("yourdfpy")

RED = '<material name="red"><color rgba="1 0 0 1"/></material>'


def drawn_on_base(text, drawn):
    return text.replace('<link name="base">', f'<link name="base">{drawn}')


def visual(geometry, material=""):
    return f'<visual><origin xyz="0 0 0.1"/><geometry>{geometry}</geometry>{material}</visual>'


def parts_of(model, solid):
    return [part for part in rover_parts(model) if part.solid == solid]


@pytest.mark.parametrize("material", [
    '<material name=""><color rgba="0.2 0.4 0.6 1"/></material>',
    '<material name="blue"/>',
])  # fmt: skip
def test_a_shape_has_the_colour_of_its_material(tmp_path, material):
    text = drawn_on_base(four(), visual('<box size="0.3 0.2 0.1"/>', material))
    named = '<material name="blue"><color rgba="0.2 0.4 0.6 1"/></material>'
    model = RoverModel.from_urdf(write(tmp_path, text.replace("</robot>", named + "</robot>")))
    assert [part.colour for part in parts_of(model, "base")] == [(0.2, 0.4, 0.6)]
    assert RoverModel.from_text(model.to_text()) == model


def test_gazebos_colours_are_known_by_name(tmp_path):
    extra = '<gazebo reference="base"><material>Gazebo/Orange</material></gazebo></robot>'
    text = drawn_on_base(four(), visual('<sphere radius="0.1"/>')).replace("</robot>", extra)
    assert parts_of(RoverModel.from_urdf(write(tmp_path, text)), "base")[0].colour == (1.0, 0.51, 0.04)


def test_a_visual_mesh_is_drawn_where_the_file_puts_it_in_its_colour(tmp_path):
    """Only boxes, cylinders and spheres appeared: most robots were their wheels."""
    trimesh = pytest.importorskip("trimesh")
    trimesh.creation.box((0.4, 0.2, 0.1)).export(tmp_path / "hull.stl")
    text = drawn_on_base(four(), visual('<mesh filename="hull.stl"/>', RED))
    model = RoverModel.from_urdf(write(tmp_path, text))
    (part,) = parts_of(model, "base")
    assert (part.kind, part.colour) == ("mesh", (1.0, 0.0, 0.0))
    vertices, triangles = part_mesh(part)
    assert len(triangles) == 12
    box = [(-0.2, 0.05, -0.1), (0.2, 0.15, 0.1)]
    np.testing.assert_allclose([vertices.min(axis=0), vertices.max(axis=0)], box, atol=1e-5)
    ((colour, points, _),) = coloured_meshes((part,))
    assert colour == (1.0, 0.0, 0.0)
    assert len(points) == 36
    assert not [entry for entry in model.import_report.left_out if "drawn" in entry]
    (tmp_path / "hull.stl").unlink()
    listed = RoverModel.from_urdf(tmp_path / "robot.urdf").import_report.left_out
    assert any("what is drawn is the mesh" in entry and "hull.stl" in entry for entry in listed)


@pytest.mark.parametrize(("radius", "is_the_files"), [(0.102, True), (0.06, False), (0.15, False)])
def test_a_wheel_is_drawn_once(tmp_path, radius, is_the_files):
    """The file's wheel and the model's were drawn one inside the other."""
    text = four().replace('<link name="fl_wheel">', '<link name="fl_wheel">' + round_shape(radius, role="visual"))
    model = RoverModel.from_urdf(write(tmp_path, text))
    parts = parts_of(model, "fl_wheel")
    colours = {part.colour for part in parts}
    assert (TYRE_COLOUR in colours) is not is_the_files
    largest = max(float(np.linalg.norm(part_mesh(part)[0] @ part.rotation.T, axis=1).max()) for part in parts)
    assert largest == pytest.approx(np.hypot(0.102, 0.02) if is_the_files else 0.107, rel=0.1)
    assert any("the wheel is of another radius" in entry for entry in model.import_report.left_out) is not is_the_files
    assert TYRE_COLOUR in {part.colour for part in parts_of(model, "fr_wheel")}


def test_a_fine_mesh_is_simplified_to_its_share_of_triangles():
    trimesh = pytest.importorskip("trimesh")
    ball = trimesh.creation.icosphere(subdivisions=5, radius=0.5)
    made = simplified(Mesh(np.asarray(ball.vertices), np.asarray(ball.faces)), MOST_OF_ONE)
    assert 300 < len(made.faces) <= MOST_OF_ONE
    assert made.faces.max() == len(made.vertices) - 1
    reach = np.linalg.norm(made.vertices, axis=1)
    assert reach.min() > 0.45
    assert reach.max() <= 0.5 + 1e-9


@pytest.mark.parametrize(("changes", "field"), [
    ({"faces": [[0, 1, 3]]}, r"solids\[0\]\.drawings\[0\]\.faces: there is no vertex 3, only 3"),
    ({"vertices": [[0.0, 0.0, float("inf")]] * 3}, r"solids\[0\]\.drawings\[0\]\.vertices"),
    ({"colour": [0.0, 0.0, 2.0]}, r"solids\[0\]\.drawings\[0\]\.colour: must be from 0 to 1"),
    ({"faces": [[0, 1, 2]] * 200_001}, "at most 200000 triangles"),
])  # fmt: skip
def test_a_drawing_that_is_none_is_refused(changes, field):
    source = RoverModel.named("open-rover").to_dict()
    drawing = {"vertices": [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], "faces": [[0, 1, 2]]}
    source["solids"][0]["drawings"] = [drawing]
    assert RoverModel.from_dict(source).to_dict() == source
    source["solids"][0]["drawings"] = [drawing | changes]
    with pytest.raises(ModelError, match=field):
        RoverModel.from_dict(source)


def test_drawings_change_nothing_that_moves():
    plain = RoverModel.named("open-rover")
    drawing = {"vertices": [[0.0, 0.0, 0.0], [5.0, 0.0, 0.0], [0.0, 5.0, 0.0]], "faces": [[0, 1, 2]]}
    drawn = with_fields(plain, {plain.solid_names[0]: {"drawings": [drawing]}})
    q = np.linspace(-0.2, 0.2, plain.nq)
    np.testing.assert_array_equal(drawn.mass_matrix(q), plain.mass_matrix(q))
    assert drawn != plain


def test_a_frame_of_a_urdf_carries_sensors_in_its_direction(tmp_path):
    """A sensor could name solids only: `camera_link`, which has no mass, was unknown."""
    extra = '<link name="camera_link"/><joint name="c" type="fixed"><parent link="chassis"/><child link="camera_link"/>'
    extra += '<origin xyz="0.4 0.1 0.3" rpy="0 0 1.5707963267948966"/></joint>'
    model = RoverModel.from_urdf(write(tmp_path, rover(extra=extra)))
    mount = Mount(solid="camera_link", position=(0.05, 0.0, 0.0))
    assert mount.solid_of(model) == "chassis"
    place, rotation = mount.pose_on(model)
    # The frame looks to the left, -z, and the sensor stands 5 cm ahead of it.
    np.testing.assert_allclose(place, (0.4, 0.3, -0.15), atol=1e-15)
    np.testing.assert_allclose(rotation[:, 0], (0.0, 0.0, -1.0), atol=1e-15)
    np.testing.assert_allclose(rotation[:, 1], (0.0, 1.0, 0.0), atol=1e-15)
    sim = Simulation(model)
    origin, turn = sim.poses()["chassis"]
    np.testing.assert_allclose(Moment(sim, 0.0).frame(mount)[0], origin + turn @ place)
    LaserScanner(mount=mount).check(model)
    model.to_urdf(tmp_path / "again.urdf")
    again = mount.pose_on(RoverModel.from_urdf(tmp_path / "again.urdf"))
    np.testing.assert_allclose(again[1], rotation, atol=1e-15)
    with pytest.raises(ValueError, match=r"mount\.solid: unknown; known are .*camera_link"):
        LaserScanner(mount=Mount(solid="camera")).check(model)
