"""Steps after which an episode is truncated, by environment."""

#: Control periods of `Rover-v0`: 60 s at the default control frequency of 20 Hz.
MAX_EPISODE_STEPS = 1200

#: Control periods of a course of waypoints.
MAX_COURSE_STEPS = 2 * MAX_EPISODE_STEPS

#: Control periods of `RoverTrap-v0`: 30 s.
MAX_TRAP_STEPS = MAX_EPISODE_STEPS // 2

#: Control periods that a command of `RoverCommand-v0` is held: 0.3 s.
REPEAT = 6

#: Commands, as long as `Rover-v0`.
MAX_COMMANDS = MAX_EPISODE_STEPS // REPEAT

#: Arcs of 0.2 s each, as long as `Rover-v0`.
MAX_ARCS = MAX_EPISODE_STEPS // 4
