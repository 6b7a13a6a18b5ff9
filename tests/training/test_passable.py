"""`training/passable.py`: an easy field has a way, and nobody crosses it in a second."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any


def test_who_crossed_a_field_is_told(passable: Callable[..., Any], tmp_path: Path) -> None:
    written = tmp_path / "who.json"
    given = ("--difficulty", 0.25, "--fields", 1, "--tries", 1, "--planned", 1, "--output", written)
    result = passable(*given)
    assert result.exit_code == 0, result.output
    assert "1 of 1" in result.output
    assert json.loads(written.read_text(encoding="utf-8")) == {"0.25": {"3000000": "foresight"}}
    assert "0 of 1" in passable(*given, "--patience", 1).output
    assert set(json.loads(written.read_text(encoding="utf-8"))["0.25"].values()) == {""}
