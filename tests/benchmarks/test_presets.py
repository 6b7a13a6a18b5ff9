"""The ensembles and the table of the named accuracies."""

import numpy as np
import pytest
from comparison import presets
from comparison.ensembles import Ensemble, drive, ensembles, load


def rows(fast: float, balanced: float, reference: float) -> list[dict[str, object]]:
    medians = {"fast": fast, "balanced": balanced, "reference": reference}
    return [{"accuracy": name, "median": median} for name, median in medians.items()]


def test_order_is_of_the_medians_and_rounding_does_not_count() -> None:
    assert presets.is_ordered(rows(3e-3, 1e-3, 1e-4))
    assert not presets.is_ordered(rows(1e-3, 3e-3, 1e-4))
    assert presets.is_ordered(rows(1e-12, 1e-19, 1e-17))


@pytest.mark.parametrize("ensemble", ensembles(), ids=lambda ensemble: ensemble.name)
def test_every_member_has_a_reference_of_its_length_and_no_two_are_alike(ensemble: Ensemble) -> None:
    starts = {(*scene.q, *scene.spheres[:2].ravel(), scene.phases, scene.normal) for scene in ensemble.members}
    assert len(starts) == len(ensemble.members)
    if ensemble.has_reference:
        references = load()[ensemble.name]
        assert len(references) == len(ensemble.members)
        for scene, reference in zip(ensemble.members, references, strict=True):
            assert reference["path"].shape == (round(scene.duration / 0.1) + 1, 3)
            np.testing.assert_allclose(reference["path"][0], scene.q[:3], atol=1e-7)


def test_balanced_is_nearer_than_fast_before_drives_over_rocks_part() -> None:
    (rocks,) = (e for e in ensembles() if e.name == "rocks")
    references = load()["rocks"]
    found: dict[str, list[float]] = {}
    for name in ("fast", "balanced"):
        options = presets.options_of(name)
        step = options.pop("time_step")
        for scene, reference in zip(rocks.members, references, strict=True):
            path, _ = drive(scene, step, **options)
            found.setdefault(name, []).append(rocks.errors(path, reference["path"])["first 3 s"])
    assert np.median(found["balanced"]) < 0.5 * np.median(found["fast"])
