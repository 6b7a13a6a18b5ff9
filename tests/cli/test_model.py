"""`rover model list|import|show|check`."""

import re
from functools import partial
from pathlib import Path

import commands
import pytest
from models.robot_files import rover as robot_text, write

from rover_gym import RoverModel

rover = partial(commands.rover, "model")


@pytest.mark.parametrize("name", RoverModel.names())
def test_every_model_of_the_gallery_is_shown_and_checked(name: str) -> None:
    shown = rover("show", name)
    assert shown.exit_code == 0, shown.output
    for solid in RoverModel.named(name).solid_names:
        assert solid in shown.output
    checked = rover("check", name)
    assert checked.exit_code == 0, checked.output
    for what in ("load", "wheelbase", "clearance", "turning centre", "step that it can climb at friction 0.7"):
        assert what in checked.output


def test_the_gallery_is_listed() -> None:
    shown = rover("list")
    assert shown.exit_code == 0, shown.output
    assert [line.split()[0] for line in shown.stdout.splitlines()[3:] if line.strip()] == list(RoverModel.names())


@pytest.mark.takes_long("imports and draws; the only test of the picture")
def test_an_import_writes_the_model_and_its_picture(tmp_path: Path) -> None:
    pytest.importorskip("yourdfpy")
    pytest.importorskip("matplotlib")
    file = write(tmp_path, robot_text())
    output = tmp_path / "models" / "small.toml"
    result = rover("import", file, "--output", output)
    assert result.exit_code == 0, result.output
    for what in ("chassis", "steers left_wheel", "assumed: ", "not simulated: ", "follows left_rocker by -1"):
        assert what in result.output
    assert RoverModel.from_file(output) == RoverModel.from_urdf(file)
    assert output.with_suffix(".png").read_bytes().startswith(b"\x89PNG")
    given = rover("import", file, "--output", output, "--wheel", "left_wheel=0.3", "--wheel", "right_drive=0.25")
    assert given.exit_code == 0, given.output
    assert RoverModel.from_file(output).wheel_radii.tolist() == [0.3, 0.25]
    bare = rover("import", file, "--output", output, "--wheel", "none", "--steering", "none", "--fixed-base")
    assert bare.exit_code == 0, bare.output
    assert RoverModel.from_file(output).wheel_names == []
    thin = rover("import", file, "--output", output, "--wheel-width", "0")
    assert thin.exit_code == 0, thin.output
    assert "width" not in RoverModel.from_file(output).to_dict()["wheels"][0]
    wrong = rover("import", file, "--output", output, "--wheel", "mast_tail")
    assert wrong.exit_code == 2
    assert wrong.stderr.startswith("error: --wheel: there is no such link")
    shown = rover("show", output, "--picture", tmp_path / "small.svg")
    assert shown.exit_code == 0, shown.output
    assert (tmp_path / "small.svg").stat().st_size > 1000


def test_a_robot_without_wheels_is_warned_of(tmp_path: Path) -> None:
    """A robot was imported with 0 wheels, exit status 0 and no warning."""
    pytest.importorskip("yourdfpy")
    text = (
        robot_text()
        .replace("_wheel", "_part")
        .replace("cylinder", "box")
        .replace('radius="0.2" length="0.1"', 'size="1 1 1"')
    )
    file, output = write(tmp_path, text), tmp_path / "rover.toml"
    reason = "warning: .*no wheel was found \\(left_part has no cylinder or sphere about its axis; right_part"
    for arguments in (("import", str(file), "--output", str(output)), ("check", str(file)), ("show", str(file))):
        result = rover(*arguments)
        assert re.search(reason, result.stderr), result.output
    silent = rover("import", file, "--output", output, "--wheel", "none")
    assert "warning" not in silent.stderr


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["show", "opportunity"], "mars-rover"),
        (["show", "nothing.toml"], "nothing.toml"),
        (["show", "rover", "--picture", "rover.gif"], "png"),
        (["check", "rover", "--friction", "0"], "friction"),
        (["import", "rover"], "only URDF and MJCF"),
        (["import", "nothing.urdf", "--wheel", "a=b"], "must be NAME=NUMBER"),
        (["import", "nothing.urdf", "--wheel", "a=1", "--wheel", "b"], "all names or all"),
        (["import", "nothing.urdf"], "nothing.urdf"),
        (["import", "nothing.urdf", "--package-path", "nowhere"], "--package-path"),
    ],
)
def test_bad_input_is_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: list[str], expected: str
) -> None:
    monkeypatch.chdir(tmp_path)
    result = rover(*arguments)
    assert result.exit_code == 2
    assert expected in result.stderr
    assert len(result.stderr.strip().splitlines()) == 1
    assert not list(tmp_path.iterdir())


def test_a_model_without_wheels_stands_on_nothing(tmp_path: Path) -> None:
    ball = {"name": "arm", "joint": "fixed", "position": [0, 0, 0], "mass": 1.0}
    arm = {"name": "arm", "solids": [ball | {"shape": {"kind": "sphere", "radius": 0.1}}]}
    RoverModel.from_dict(arm).to_file(tmp_path / "arm.toml")
    assert rover("show", tmp_path / "arm.toml").exit_code == 0
    result = rover("check", tmp_path / "arm.toml")
    assert result.exit_code == 2
    assert "wheels" in result.stderr


def test_a_refused_import_recommends_options_of_the_command(tmp_path: Path) -> None:
    pytest.importorskip("yourdfpy")
    pytest.importorskip("matplotlib")
    rough = robot_text().replace(
        "</robot>", '<gazebo><joint name="loop"><parent>a</parent><child>b</child></joint></gazebo></robot>'
    )
    path, out = write(tmp_path, rough), tmp_path / "out.toml"
    result = rover("import", path, "--output", out)
    assert result.exit_code == 2
    assert '--ignore "closed loops" leaves it out' in result.stderr
    told = rover("import", path, "--output", out, "--ignore", "closed loops")
    assert told.exit_code == 0, told.output
    assert "this loop stays open" in told.stderr + told.stdout
