"""How the errors of free spheres are taken, and where their tables go."""

from pathlib import Path

import numpy as np
import pytest
import reports
from comparison.spheres.scene import FreeScene, Slab, energy, penetration, velocity_error
from comparison.spheres.tables import tables

A = np.array([[0.7, 0.0, 0.0], [0.2, 0.0, 0.0]])


def scene(slab: Slab | None = None) -> FreeScene:
    centres = np.array([[0.0, 0.15, 0.0], [0.15, 0.15, 0.0]])
    return FreeScene("two", 1.0, 0.0, 0.0, 2.0, 0.1, centres, slab, None)


def test_penetration_is_summed_over_pairs_and_plane() -> None:
    assert penetration(scene().centres, 0.1) == pytest.approx(0.05**2)
    assert penetration(scene().centres - [0.0, 0.07, 0.0], 0.1) == pytest.approx(0.05**2 + 2 * 0.02**2)


def test_energy_is_kinetic_and_potential() -> None:
    velocities = np.array([[3.0, 0.0, 4.0], [0.0, 0.0, 0.0]])
    assert energy(scene(), scene().centres, velocities) == pytest.approx(25.0 + 2.0 * 9.81 * 0.3)


def test_velocity_error_is_the_slabs_and_the_mean_of_the_balls() -> None:
    exact = np.array([A[1], A[1], A[0]]) * 2.0
    assert velocity_error(A, exact, 2.0) == 0.0
    off = exact + np.array([[0.1, 0.0, 0.0], [0.0, 0.0, 0.3], [0.0, 0.2, 0.0]])
    assert velocity_error(A, off, 2.0) == pytest.approx(0.2**2 + (0.1**2 + 0.3**2) / 2.0)


def test_the_slabs_inertia_is_a_boxes() -> None:
    slab = Slab(12.0, np.array([0.5, 1.0, 1.5]), 0.8, np.zeros(3), np.zeros(3))
    np.testing.assert_allclose(slab.inertia, [4.0 + 9.0, 1.0 + 9.0, 1.0 + 4.0])


def test_a_run_without_a_figure_leaves_a_gap_in_the_table() -> None:
    point = {"scene": "666", "engine": "E", "variant": "v"}
    done = point | {"step": 0.01, "penetration": 2e-5, "us_per_step": 480.0}
    meta = {"command": "make chart", "processor": "P", "packages": {}}
    data = {"meta": meta, "points": [done, point | {"step": 0.005, "failure": "no"}]}
    assert "| E, v | 2.0e-05, 480 us | - |" in tables(data)


def test_text_goes_between_its_marks_and_a_page_without_them_is_refused(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    begin, end = "<!-- scene: made by `make it`, not by hand -->", "<!-- end of scene -->"
    page.write_text(f"a\n{begin}\nold\n{end}\nz\n")
    reports.fill(page, "scene", "new")
    filled = f"a\n{begin}\n\nnew\n\n{end}\nz\n"
    assert page.read_text() == filled
    with pytest.raises(ValueError, match="'other' are there 0 times"):
        reports.fill(page, "other", "newer")
    assert page.read_text() == filled
