"""The configurations of trainings that come with the package, by name."""

from pathlib import Path

from rover_gym.mechanics import OptionError
from rover_gym.validation import refuse

FOLDER = Path(__file__).parents[1] / "data" / "configs"

#: Their names.
SHIPPED_CONFIGURATIONS = tuple(sorted(path.stem for path in FOLDER.glob("*.yaml")))


def find_configuration(config: str) -> Path:
    """The file of a configuration.

    Args:
        config: A name among `SHIPPED_CONFIGURATIONS`, or the path of a YAML file. A file wins over a name.

    Raises:
        OptionError: There is neither.
    """
    path = Path(config)
    try:
        if path.is_file():
            return path
    except (OSError, ValueError):  # a path that cannot be
        pass
    if config not in SHIPPED_CONFIGURATIONS:
        refuse(
            OptionError, "configuration", config, f"must be a YAML file or one of {', '.join(SHIPPED_CONFIGURATIONS)}"
        )
    return FOLDER / f"{config}.yaml"
