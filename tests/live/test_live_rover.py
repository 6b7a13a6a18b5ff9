"""The rover of a live drive: what changes under it, what is refused, and the past, which returns bit for bit."""

import math

import numpy as np
import pytest

from rover_gym import HeightField, Plane
from rover_gym.core import OptionError, TerrainError
from rover_gym.ground.terrain_parts import spheres_of
from rover_gym.show.live import LiveChoices, LiveRover, LiveScene
from rover_gym.show.live.live_state import Past


def driven(rover: LiveRover, periods: int, forward: float = 1.0, turn: float = 0.0) -> LiveRover:
    for _ in range(periods):
        rover.step(forward, turn)
    return rover


def heading(rover: LiveRover) -> float:
    return float(rover.env.simulation.q[4])


def speed(rover: LiveRover) -> float:
    v = rover.env.simulation.v
    return float(np.hypot(v[0], v[2]))


def test_by_hand_it_goes_ahead_turns_and_stops() -> None:
    rover = LiveRover()
    first = heading(rover)
    driven(rover, 40, 1.0)
    assert speed(rover) == pytest.approx(1.2, abs=0.1)
    assert heading(rover) == pytest.approx(first, abs=0.02)
    driven(rover, 40, 1.0, 1.0)
    assert heading(rover) > first + 0.3
    driven(rover, 60, 0.0)
    assert speed(rover) < 0.02


def test_friction_and_gravity_change_under_the_moving_rover() -> None:
    rover = driven(LiveRover(), 20)
    before = rover.env.simulation.q, rover.time
    rover.change("friction", 0.05)
    rover.change("gravity", 3.7)
    assert np.array_equal(rover.env.simulation.q, before[0])
    assert rover.time == before[1]
    assert rover.env.simulation.friction == 0.05
    assert rover.env.simulation.gravity == pytest.approx([0.0, -3.7, 0.0])
    driven(rover, 10)
    assert rover.info["domain"]["friction"] == 0.05
    weight = rover.env.model.mass * 3.7
    assert rover.env.simulation.wheel_forces[:, 0].sum() == pytest.approx(weight, rel=0.1)


def test_ice_lets_the_wheels_slip() -> None:
    slips = []
    for friction in (0.7, 0.02):
        rover = LiveRover(LiveScene(friction=friction))
        driven(rover, 6)
        slips.append(rover.info["slip_ratio"])
    assert slips[1] > slips[0] + 0.3


@pytest.mark.parametrize("driver", ["pd", "scan", "foresight", "anywhere", "guided"])
def test_a_policy_takes_over_a_rover_that_moves(driver: str) -> None:
    rover = driven(LiveRover(LiveScene(ground="rocks", difficulty=0.3)), 20)
    before = rover.env.simulation.q, rover.time, rover.info["distance_to_goal"]
    rover.change("driver", driver)
    assert np.array_equal(rover.env.simulation.q, before[0])
    assert rover.time == before[1]
    driven(rover, 60, 0.0)
    assert rover.info["distance_to_goal"] < before[2] - 0.5
    rover.change("driver", "hand")
    driven(rover, 40, 0.0)
    assert speed(rover) < 0.05


def test_the_goal_sends_it_back_to_the_start() -> None:
    rover = LiveRover(LiveScene(driver="pd", goal_distance=2.0))
    start, goal = rover.env.start.position, rover.env.goal
    for _ in range(200):
        rover.step()
        if rover.goals_reached == 1:
            break
    assert rover.env.goal == start
    for _ in range(600):
        rover.step()
        if rover.goals_reached == 2:
            break
    assert rover.goals_reached == 2
    assert rover.env.goal == goal
    assert rover.ended == ""


def test_among_rocks_the_goal_sends_it_back_too_and_the_rocks_may_be_left() -> None:
    """Where start and goal lay apart, the drive ended at its goal: the rover had left the field about the start."""
    rover = LiveRover(LiveScene(ground="rocks", driver="scan", goal_distance=8.0))
    energy = [0.0]
    while rover.goals_reached < 2:
        rover.step()
        energy.append(rover.info["energy"])
        assert rover.ended == ""
        assert rover.time < 40.0
    assert np.abs(np.diff(energy)).max() < 0.1 * energy[-1]  # it is counted on
    rover.change("driver", "hand")
    far = LiveRover(LiveScene(ground="rocks", goal_distance=2.0))
    for _ in range(300):
        far.step(1.0)
    assert far.ended == ""
    assert np.hypot(*far.env.simulation.q[[0, 2]]) > 8.0
    assert far.env.goal == LiveRover(LiveScene(ground="rocks", goal_distance=2.0)).env.goal


def test_a_rock_lies_in_the_way_and_the_rover_meets_it() -> None:
    rover = driven(LiveRover(), 20)
    way = rover.env.simulation.v[[0, 2]]
    place = rover.env.simulation.q[[0, 2]]
    rover.throw_rock(0.5)
    centres, radii = spheres_of(rover.env.simulation.terrain)
    assert radii.tolist() == [0.5]
    ahead = (centres[0, [0, 2]] - place) @ way / np.hypot(*way)
    assert ahead == pytest.approx(rover.env.model.clear_radius + 0.3 + 0.5)
    driven(rover, 60)
    gone = (rover.env.simulation.q[[0, 2]] - place) @ way / np.hypot(*way)
    assert gone < ahead  # driving on for three seconds would have taken it 3.5 m
    rover.throw_rock(0.1)
    assert len(rover.rocks) == 2


def test_the_planner_is_told_of_a_rock() -> None:
    rover = LiveRover(LiveScene(driver="scan"))
    driven(rover, 10)
    rover.throw_rock(0.3)
    driven(rover, 120)
    assert rover.info["distance_to_goal"] < 4.5


def test_the_past_returns_bit_for_bit_with_its_friction_and_its_driver() -> None:
    rover, past = LiveRover(LiveScene(ground="rocks")), Past()
    path = []
    for period in range(60):
        if period == 20:
            rover.change("friction", 0.3)
        if period == 30:
            rover.throw_rock(0.2)
        if period == 40:
            rover.change("driver", "scan")
        past.keep(rover)
        path.append(rover.env.simulation.q)
        rover.step(1.0, 0.2)
    assert past.reach(rover.time) == pytest.approx(3.0)
    past.rewind(rover, 0.7)  # to 2.25 s, with the planner
    assert rover.time == pytest.approx(2.25)
    assert rover.scene.driver == "scan"
    for q in path[45:]:
        assert np.array_equal(rover.env.simulation.q, q)
        rover.step()
    past.rewind(rover, 1.8)  # to 1 s, by hand, with the new friction and without the rock
    assert rover.time == pytest.approx(1.0)
    assert (rover.scene.driver, rover.scene.friction, len(rover.rocks)) == ("hand", 0.3, 0)
    for q in path[20:30]:
        assert np.array_equal(rover.env.simulation.q, q)
        rover.step(1.0, 0.2)
    past.rewind(rover, 100.0)
    assert rover.time == 0.0
    assert rover.scene.friction == 0.7


@pytest.mark.parametrize(
    ("name", "value", "error", "message"),
    [
        ("friction", -1.0, OptionError, "friction: must be at least 0"),
        ("friction", "ice", OptionError, "friction: must be a number"),
        ("gravity", float("nan"), OptionError, "gravity: must be finite"),
        ("gravity", 1e9, OptionError, "gravity: must be at most 30"),
        ("ground", "/etc/passwd", OptionError, "ground: must be one of plane, rocks, hills"),
        ("model", ["rover"], OptionError, "model: must be one of rover"),
        ("driver", "planner", OptionError, "driver: must be one of hand, pd"),
        ("seed", 1.5, OptionError, "seed: must be a whole number"),
        ("__class__", 1, OptionError, "name: must be one of ground"),
    ],
)
def test_what_cannot_be_is_refused_and_nothing_changes(
    name: str, value: object, error: type[Exception], message: str
) -> None:
    rover = driven(LiveRover(), 5)
    before = rover.scene, rover.env, rover.env.simulation.q
    with pytest.raises(error, match=message):
        rover.change(name, value)
    assert rover.scene is before[0]
    assert rover.env is before[1]
    assert np.array_equal(rover.env.simulation.q, before[2])


@pytest.mark.parametrize("radius", [0.0, 2.0, float("inf")])
def test_a_rock_out_of_range_is_refused(radius: float) -> None:
    rover = LiveRover()
    with pytest.raises(OptionError, match="radius"):
        rover.throw_rock(radius)
    assert len(rover.rocks) == 0


def test_a_rock_beyond_the_map_is_refused() -> None:
    small = HeightField(np.zeros((7, 7)), spacing=0.5, origin=(-1.5, -1.5))
    choices = LiveChoices(grounds={"map": small})
    rover = LiveRover(LiveScene(ground="map", goal_distance=1.0), choices)
    with pytest.raises(TerrainError, match="no known ground"):
        rover.throw_rock(0.6)


def test_a_rover_that_has_rolled_over_stays_until_it_goes_back() -> None:
    rover, past = LiveRover(), Past()
    past.keep(rover)
    q = rover.env.simulation.q
    q[3], q[1] = 1.4, 2.0
    rover.env.simulation.set_state(q)
    rover.step()
    assert rover.ended == "roll_over"
    time = rover.time
    rover.step(1.0)
    assert rover.time == time
    past.rewind(rover, 60.0)
    assert rover.ended == ""
    driven(rover, 20)
    assert speed(rover) > 0.5


def hold(rover: LiveRover, speed: float) -> float:
    """Holds the wheels at a speed for a control period, m/s, and returns the work of their drives, J."""
    radii = rover.env.model.wheel_radii
    rover.follow(lambda simulation: simulation.set_wheel_speeds(speed / radii))
    simulation = rover.env.simulation
    return float(simulation.reading((0.0, 0.0), None)[simulation.reading_layout(0)["work"]][0])


def test_commands_of_the_simulation_count_as_energy_and_reach_the_goal() -> None:
    rover = LiveRover(LiveScene(goal_distance=2.0), LiveChoices(arguments={"goal_bearing_deg": 0.0}))
    start, work = rover.env.start.position, 0.0
    while not rover.goals_reached:
        work += hold(rover, 1.0)
        assert rover.time < 3.0
    assert rover.info["energy"] == pytest.approx(work)
    assert rover.env.goal == start
    driven(rover, 1, 0.0)
    assert rover.info["energy"] > work
    assert rover.ended == ""


def test_commands_of_the_simulation_end_the_drive_where_the_rover_rolls_over() -> None:
    hill = {"hill": Plane.tilted(math.radians(8.0), 0.0)}
    rover = LiveRover(LiveScene(ground="hill"), LiveChoices(hill, arguments={"max_tilt_deg": 5.0}))
    hold(rover, 0.0)
    assert rover.ended == "roll_over"
    time = rover.time
    hold(rover, 0.0)
    assert rover.time == time


def test_a_policy_goes_on_where_commands_have_left_the_rover() -> None:
    rover = LiveRover(LiveScene(driver="pd"))
    for _ in range(40):
        hold(rover, -0.5)
    before = rover.info["distance_to_goal"]
    driven(rover, 60)
    assert rover.info["distance_to_goal"] < before - 0.5
