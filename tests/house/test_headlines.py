"""The numbers that README, results and paper quote are those of the files that commands write."""

import re

import pytest
from comparison.headlines import PAGES, ROOT, VALUE, cell, data, filled, value
from comparison.tables import cost_of, curve


@pytest.mark.parametrize("name", PAGES)
def test_a_page_quotes_what_the_commands_wrote(name: str) -> None:
    """README and paper said 0.27 ms for 1 cm and 61 ms for Drake beside a file that gave 0.17 and 21."""
    text = (ROOT / name).read_text(encoding="utf-8")
    assert filled(text) == text, "python -m comparison.headlines"


def test_the_headline_of_readme_and_paper_has_its_keys() -> None:
    """Every number of milliseconds or centimetres that compares engines there is marked, so that it is compared."""
    for name, first in (("README.md", "The figure shows"), ("paper/paper.md", "shows one drive on flat ground")):
        text = (ROOT / name).read_text(encoding="utf-8")
        passage = text[text.index(first) :].split("\n\n")[0].split("These are times")[0]
        plain = re.sub(r"<!--.*?-->", "", VALUE.sub("", passage), flags=re.DOTALL)
        assert re.findall(r"\d[\d.]*", plain) == ["1"], name
        assert len(VALUE.findall(passage)) == 3


def test_a_changed_number_is_found() -> None:
    key = "cost flat_drive 10mm rover-gym, linearised"
    right = f"needs {value(key)}<!-- {key} --> ms"
    assert filled(f"needs 0.27<!-- {key} --> ms") == right != f"needs 0.27<!-- {key} --> ms"
    assert filled(right) == right


def test_a_cost_is_read_off_at_or_below_the_error_and_straight_in_the_logarithms_between() -> None:
    assert cost_of([(1.0, 0.1), (4.0, 0.001)], 0.01) == pytest.approx(2.0)
    assert cost_of([(1.0, 0.1), (4.0, 0.001)], 0.1) == 1.0
    assert cost_of([(1.0, 0.1), (4.0, 0.001)], 0.2) == 1.0
    assert cost_of([(1.0, 0.1), (4.0, 0.001)], 1e-4) is None
    points = curve(data("chart.json"), "flat_drive", "rover-gym, linearised")
    costs = [cost for cost, error in points if error <= 0.01]
    assert min(costs) * 0.5 < float(value("cost flat_drive 10mm rover-gym, linearised")) <= min(costs)


@pytest.mark.parametrize(
    "key", ["cost flat_drive 10mm ODE, 1", "cost flat_drive 1mm MuJoCo, defaults", "cell sand; x; y"]
)
def test_a_number_that_no_file_has_is_refused(key: str) -> None:
    with pytest.raises(LookupError):
        value(key)
    assert cell("sand", "smooth / all", "pull, N")
