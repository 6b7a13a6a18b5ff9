"""Starts a rover and RViz: ros2 launch rover_launch.py terrain:=rocks difficulty:=0.5."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, ExecuteProcess
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node


def generate_launch_description() -> LaunchDescription:
    """The node of the rover, and RViz on its time."""
    arguments = {"terrain": "rocks", "difficulty": "0.5", "seed": "0", "model": "rover"}
    options = [part for name in arguments for part in (f"--{name}", LaunchConfiguration(name))]
    sensors = ["--sensor", "imu", "--sensor", "scan", "--sensor", "depth"]
    return LaunchDescription(
        [
            *(DeclareLaunchArgument(name, default_value=value) for name, value in arguments.items()),
            ExecuteProcess(cmd=["rover", "ros", *options, *sensors], output="screen"),
            Node(package="rviz2", executable="rviz2", parameters=[{"use_sim_time": True}]),
        ]
    )
