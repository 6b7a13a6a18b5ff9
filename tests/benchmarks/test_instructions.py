"""A step that became dearer is named."""

import json

from comparison import instructions


def test_a_count_beyond_the_tolerance_is_named_and_so_is_one_that_is_new_or_gone() -> None:
    before = {"a": 1000, "b": 1000, "c": 1000}
    assert instructions.changes(before, before) == []
    assert instructions.changes(before, {"a": 1009, "b": 989, "d": 5}) == ["b", "c", "d"]


def test_every_scene_has_its_committed_count() -> None:
    committed = json.loads(instructions.COUNTS.read_text(encoding="utf-8"))
    assert committed["a step"].keys() == instructions.SCENES.keys()
