"""Several machines in one simulation meet, push and tow each other, as closed forms say."""

import math
import pickle

import gymnasium as gym
import numpy as np
import pytest
from recordings import recorded
from rovers import with_fields

from machines import FOUR, RADIUS, machine
from rover_gym import Plane, RoverModel, Simulation
from rover_gym.core import ModelError, OptionError
from rover_gym.show.replay import write_page
from rover_gym.show.replay.rover_scene import bare_scene

GRAVITY = 9.81
#: Height of a cart's chassis over the ground, m.
HEIGHT = 2 * RADIUS
#: Mass of a cart, and what its wheels add to it while they roll, kg.
CART, ROLLING = 48.0, 4 * 2.0 / 2


def cart(tyres: str = "wheel") -> RoverModel:
    """A cart on four wheels of a material, with a chassis that is longer than the wheels reach."""
    shape = {"kind": "box", "size": [1.0, 0.1, 0.4]}
    return with_fields(machine("cart", FOUR), {"trunk": {"shape": shape}}, {"material": tyres})


def body(name: str, mass: float, shape: dict[str, object], *, collides: bool = False) -> RoverModel:
    solid = {"name": name, "mass": mass, "shape": shape, "collides": collides}
    return RoverModel.from_dict({"name": name, "solids": [solid]})


def on_slope(models: dict[str, RoverModel], places: list[float], slope: float = 0.0, **arguments) -> Simulation:
    """The machines behind each other, facing up a slope (rad)."""
    joined = RoverModel.join(models, **arguments.pop("join", {}))
    ground = Plane([-math.sin(slope), math.cos(slope), 0.0], 0.0)
    sim = Simulation(joined, ground, **arguments)
    q = []
    for model, x in zip(models.values(), places, strict=True):
        along, height = x * math.cos(slope), x * math.sin(slope) + HEIGHT / math.cos(slope)
        hanging = np.array([along, height, 0.0, 0.0, 0.0, slope])
        q.append(model.resting_pose(ground, (along, 0.0), 0.0) if model.wheel_names else hanging)
    sim.set_state(joined.close_loops(np.concatenate(q))[0])
    return sim


def test_machines_that_never_meet_move_as_each_alone():
    models = {name: RoverModel.named(name) for name in ("skid-steered", "open-rover")}
    torques = {"skid-steered": np.full(4, 3.0), "open-rover": np.full(6, 0.5)}
    both, ground = RoverModel.join(models), Plane()
    starts = [model.resting_pose(ground, (0.0, 2.0 * i), 0.3 * i) for i, model in enumerate(models.values())]
    sim = Simulation(both)
    sim.set_state(np.concatenate(starts))
    sim.set_wheel_torques(np.concatenate(list(torques.values())))
    assert sim.step(400).is_converged
    for (name, model), start in zip(models.items(), starts, strict=True):
        alone, own = Simulation(model), both.machines[name]
        alone.set_state(start)
        alone.set_wheel_torques(torques[name])
        alone.step(400)
        np.testing.assert_allclose(sim.q[own.coordinates], alone.q, atol=1e-11)
        np.testing.assert_allclose(sim.motor_torques[own.wheels], alone.motor_torques, atol=1e-11)
        np.testing.assert_allclose(sim.wheel_forces[own.wheels], alone.wheel_forces, atol=1e-2)
        assert own.solids == [f"{name}/{solid}" for solid in model.solid_names]
        assert both.joint_names[own.joints] == [f"{name}/{joint}" for joint in model.joint_names]
        assert np.abs(alone.q[:3] - start[:3]).max() > 0.3


def test_a_rover_pushes_one_that_stands_on_ice():
    models = {"tug": cart(), "sledge": cart("skate")}
    laws = {("skate", "ground"): (0.0, 0.0), ("body", "body"): (0.0, 0.0)}
    sim = on_slope(models, [0.0, 1.0 + 1e-9], materials=laws)
    torque = 4.0
    sim.set_wheel_torques([torque] * 4 + [0.0] * 4)
    assert sim.step(100).is_converged
    # The sledge's wheels do not turn.
    acceleration = 4 * torque / RADIUS / (2 * CART + ROLLING)
    assert sim.v[[0, 10]] == pytest.approx(acceleration * 0.5, rel=1e-9)
    contacts = sim.contacts
    push = [k for k, other in enumerate(contacts.others) if other is not None]
    assert {*(contacts.bodies[k] for k in push), *(contacts.others[k] for k in push)} == {"tug/trunk", "sledge/trunk"}
    assert sum(contacts.impulses[push, 0]) / 0.005 == pytest.approx(CART * acceleration, rel=1e-9)


def short(name: str) -> RoverModel:
    """A cart whose wheels reach beyond its chassis."""
    return machine(name, FOUR)


def meeting_wheels(friction: float) -> Simulation:
    """Two carts without weight: the front wheels of the first, which spin, meet the back wheels of the other."""
    pair = RoverModel.join({"a": short("a"), "b": short("b")})
    sim = Simulation(pair, gravity=(0, 0, 0), friction=friction)
    q, v, first, second = np.zeros(pair.nv), np.zeros(pair.nv), *(pair.machines[name].coordinates for name in "ab")
    q[first.start + 1] = q[second.start + 1] = 5.0
    q[second.start] = 0.6 + 2 * RADIUS + 2e-3
    v[first.start] = 1.0
    v[[first.start + 6, first.start + 7]] = -4.0
    sim.set_state(q, v)
    return sim


@pytest.mark.parametrize("friction", [0.0, 0.4])
def test_a_wheel_that_is_met_feels_the_force_of_the_one_that_meets_it(friction):
    sim = meeting_wheels(friction)
    before = sim.momentum()
    for _ in range(10):
        sim.step()
        if len(sim.contacts):
            break
    np.testing.assert_allclose(sim.momentum()[0], before[0], atol=0.01)
    np.testing.assert_allclose(sim.momentum()[1], before[1], atol=0.01)  # to the order of the step
    others = [other for other in sim.contacts.others if other is not None]
    assert len(others) == 2
    forces = sim.wheel_forces
    names = sim.model.wheel_names
    hit = [names.index(name) for name in ("a/FL", "a/FR", "b/BL", "b/BR")]
    front, back = forces[hit[:2]], forces[hit[2:]]
    assert (front[:, 0] > 100.0).all()
    # Opposite normals and axles that agree: forces along the normal and the rolling direction are the same.
    np.testing.assert_allclose(back[:, :2], front[:, :2], rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(back[:, 2], -front[:, 2], rtol=0.0, atol=1e-9)
    assert (np.abs(front[:, 1]) > 1.0).all() == (friction > 0.0)
    assert not forces[[k for k in range(8) if k not in hit]].any()
    assert back[:, 0].sum() * 0.005 == pytest.approx(sim.contacts.impulses[:, 0].sum())


def test_a_chassis_that_is_met_by_a_chassis_counts_as_pressed_on_both_sides():
    sim = on_slope({"tug": cart(), "sledge": cart("skate")}, [0.0, 1.0 + 1e-9], materials={("skate", "ground"): (0, 0)})
    sim.set_wheel_torques([4.0] * 4 + [0.0] * 4)
    sim.step(20)
    push = [k for k, other in enumerate(sim.contacts.others) if other is not None]
    assert sim.trunk_force == pytest.approx(2.0 * sim.contacts.impulses[push, 0].sum() / 0.005)


@pytest.mark.parametrize("time_step", [5e-3, 0.02])
def test_rovers_that_meet_head_on_at_three_metres_a_second_do_not_pass(time_step):
    model = RoverModel.named("rover")
    pair = RoverModel.join({"a": model, "b": model})
    rolling = -3.0 / np.asarray(model.wheel_radii)
    for late in np.linspace(0.0, 1.0, 5):
        sim = Simulation(pair, time_step=time_step)
        v = np.zeros(pair.nv)
        for own, speed in zip(pair.machines.values(), (3.0, -3.0), strict=True):
            v[own.coordinates.start] = speed
            v[own.coordinates.start + np.asarray(model.wheel_joint_indices)] = rolling
        starts = [model.resting_pose(Plane(), place, turn) for place, turn in (((0, 0), 0), ((3, 0.1), math.pi))]
        starts[1][0] += late * 6.0 * time_step
        sim.set_state(np.concatenate(starts), v)
        before = sim.energy()
        sim.step(round(0.8 / time_step))
        assert sim.q[pair.machines["b"].coordinates.start] - sim.q[0] > 1.2, "a body's length"
        after = sim.energy()
        assert after.kinetic + after.potential < before.kinetic + before.potential


def test_parts_meet_while_they_move_by_less_than_a_third_of_their_thickness_in_a_step():
    plate = body("plate", 50.0, {"kind": "box", "size": [0.03, 1.0, 1.0]}, collides=True)
    ball = body("ball", 0.5, {"kind": "sphere", "radius": 0.05}, collides=True)
    pair, h = RoverModel.join({"ball": ball, "plate": plate}), 0.02
    speed = 0.98 * 0.13 / 3 / h
    for late in np.linspace(0.0, 1.0, 20):
        sim = Simulation(pair, time_step=h, gravity=(0, 0, 0))
        q, v = np.zeros(12), np.zeros(12)
        q[0], v[0] = -1.0 - late * speed * h, speed
        sim.set_state(q, v)
        sim.step(50)
        assert sim.q[0] < sim.q[6]


@pytest.mark.parametrize("hitch", ["ball joint", "bar"])
def test_a_rover_tows_one_without_power_up_a_slope(hitch):
    slope, torque, long = 0.1, 6.0, 0.6
    if hitch == "bar":
        bar = body("rod", 1.0, {"kind": "box", "size": [long, 0.03, 0.03]})
        models, places = {"tug": cart(), "load": cart(), "bar": bar}, [0.0, -1.6, -0.8]
        ends = [("tug", [-0.5, 0.0, 0.0], [long / 2, 0.0, 0.0]), ("load", [0.5, 0.0, 0.0], [-long / 2, 0.0, 0.0])]
        loops = [
            {"name": f"{name} pin", "kind": "connect", "solid": f"{name}/trunk", "other": "bar/rod"}
            | {"position": own, "other_position": other}
            for name, own, other in ends
        ]
        names, mass = ("tug pin", "load pin"), 1.0
    else:
        models, places = {"tug": cart(), "load": cart()}, [0.0, -1.2]
        pin = {"name": "pin", "kind": "connect", "solid": "tug/trunk", "position": [-0.6, 0.0, 0.0]}
        loops = [pin | {"other": "load/trunk", "other_position": [0.6, 0.0, 0.0]}]
        names, mass = ("pin", "pin"), 0.0
    sim = on_slope(models, places, slope, join={"loops": loops}, friction=0.9)
    sim.set_wheel_torques([torque] * 4 + [0.0] * 4)
    assert sim.step(100).is_converged
    up = np.array([math.cos(slope), math.sin(slope), 0.0])
    pull = 4 * torque / RADIUS
    acceleration = (pull - (2 * CART + mass) * GRAVITY * math.sin(slope)) / (2 * (CART + ROLLING) + mass)
    machines = sim.model.machines
    for name in ("tug", "load"):
        velocity = sim.v[machines[name].coordinates][:3]
        np.testing.assert_allclose(velocity, acceleration * 0.5 * up, atol=1e-6)
    forces = sim.loop_forces
    on_load = CART * GRAVITY * math.sin(slope) + (CART + ROLLING) * acceleration
    on_tug = on_load + mass * (GRAVITY * math.sin(slope) + acceleration)
    assert forces[names[0]] @ up == pytest.approx(-on_tug, rel=1e-6)
    assert abs(forces[names[1]] @ up) == pytest.approx(on_load if hitch == "bar" else on_tug, rel=1e-6)


def test_a_run_of_several_machines_is_recorded_and_drawn(tmp_path):
    sim = on_slope({"tug": cart(), "load": cart()}, [0.0, -1.3])
    sim.set_wheel_torques([8.0, -8.0, 8.0, -8.0, 2.0, 2.0, 2.0, 2.0])
    run = recorded(sim, tmp_path / "meet.h5", 20, 5)
    assert run.model == sim.model
    last = sim.poses()
    for solid, place in zip(run.model.solid_names, run.positions[-1], strict=True):
        np.testing.assert_allclose(place, last[solid][0], atol=1e-12)
    scene, _ = bare_scene(run)
    assert scene.frames == len(run.model.solid_names) == 10
    assert [wheel["name"] for wheel in scene.facts["wheels"]] == run.model.wheel_names
    assert write_page(run, tmp_path / "meet.html").stat().st_size > 10_000


def test_a_joined_model_survives_files_pickles_and_another_join():
    skid = RoverModel.named("skid-steered").to_dict() | {"self_contact": True}
    pair = RoverModel.join({"a": RoverModel.from_dict(skid), "b": cart()}, name="pair")
    for copy in (RoverModel.from_text(pair.to_text()), pickle.loads(pickle.dumps(pair))):  # noqa: S301 - written here
        assert copy == pair
    fleet = RoverModel.join({"first": pair, "last": cart()})
    assert list(fleet.machines) == ["first/a", "first/b", "last"]
    assert [own["self_contact"] for own in fleet.to_dict()["machines"] if "self_contact" in own] == [True]
    assert list(cart().machines) == ["cart"]
    assert fleet.machines["first/b"].wheels == slice(4, 8, 1)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda own: own["machines"][1].update(name="a"), r"machines\[1\].name: the name .a. is used twice"),
        (lambda own: own["machines"][1].update(first="b/wheel_FL"), r"machines\[1\].first: .b/wheel_FL. must be"),
        (lambda own: own["machines"][0].update(first="b/trunk"), r"machines\[0\].first"),
        (lambda own: own["machines"].reverse(), r"machines\[0\].first"),
        (
            lambda own: own["wheels"].reverse(),
            r"wheels\[4\].solid: the wheels of the machine .a. must be listed together",
        ),
        (lambda own: own.update(self_contact=True), "self_contact: a model with machines"),
    ],
)
def test_wrong_machines_are_refused(change, message):
    description = RoverModel.join({"a": cart(), "b": cart()}).to_dict()
    change(description)
    with pytest.raises(ModelError, match=message):
        RoverModel.from_dict(description)


@pytest.mark.parametrize(
    ("models", "loops", "message"),
    [
        ([cart()], [], "models: must be models by name"),
        ({"a": "crat"}, [], r"models\[a\]: .*crat"),
        ({"a": 3}, [], r"models\[a\]: must be a RoverModel"),
        ({}, [], "solids: a model needs at least one solid"),
        ({"a": cart()}, [{"name": "pin"}], "missing field `kind`"),
        ({"a": cart()}, 3, "loops: must be a list of dictionaries"),
        (
            {"a": cart(), "b": cart()},
            [{"name": "pin", "kind": "connect", "solid": "a/trunk", "other": "b/trunk"}],
            r"loops\[0\].other_position: is missing",
        ),
    ],
)
def test_wrong_joins_are_refused(models, loops, message):
    with pytest.raises(ModelError, match=message):
        RoverModel.join(models, loops=loops)


@pytest.mark.parametrize(
    ("model", "message"),
    [
        (RoverModel.join({"a": cart(), "b": cart()}), "machines: places one machine, the model has 2"),
        (body("stone", 1.0, {"kind": "sphere", "radius": 0.1}), "wheels: a model without wheels cannot stand"),
    ],
)
def test_only_one_machine_with_wheels_is_placed(model, message):
    with pytest.raises(ModelError, match=message):
        model.resting_pose(Plane(), (0.0, 0.0), 0.0)


def test_an_environment_has_one_machine():
    with pytest.raises(OptionError, match=r"model: must be one machine, got \['a', 'b'\]"):
        gym.make("Rover-v0", model=RoverModel.join({"a": cart(), "b": cart()}))
