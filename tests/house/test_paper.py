"""Each number of the paper stands on the manual's page that it names, and has a command that exists."""

import re
from pathlib import Path

import pytest
from house.test_makefile import phony_targets
from typer.testing import CliRunner

from rover_gym.cli import app

ROOT = Path(__file__).parents[2]
PAPER = re.sub(r"<!--.*?-->", "", (ROOT / "paper" / "paper.md").read_text(encoding="utf-8"), flags=re.DOTALL)
ROWS = re.findall(r"^\| (.+?) \| .+? \| `(.+?)` \| `(.+?)` \|$", PAPER, flags=re.MULTILINE)
BODY = PAPER.partition("# Reproducing the numbers")[0]


def has_number(text: str, number: str) -> bool:
    """Whether a number stands alone in a text: `4.0` is no part of `14.0` or `4.01`."""
    return re.search(rf"(?<![\d.]){re.escape(number)}(?![\d]|\.\d)", text) is not None


@pytest.mark.parametrize(("numbers", "command", "page"), ROWS)
def test_a_number_is_in_the_text_and_on_its_page_and_its_command_exists(numbers: str, command: str, page: str) -> None:
    text = (ROOT / page).read_text(encoding="utf-8")
    for number in numbers.split(", "):
        assert has_number(BODY, number), f"{number} is not in the paper"
        assert has_number(text, number), f"{number} is not in {page}"
    match command.split():
        case ["make", target]:
            assert target in phony_targets()
        case ["rover", name]:
            assert CliRunner().invoke(app, [name, "--help"]).exit_code == 0
        case ["python", "-m", module]:
            assert (ROOT / "benchmarks" / f"{module.replace('.', '/')}.py").is_file()
        case other:
            pytest.fail(f"what is {other}?")


def test_the_table_has_every_measured_number_of_the_results() -> None:
    results = BODY.partition("\n# Results\n")[2].replace("\\", "")
    decimals = set(re.findall(r"(?<![\d.])\d+\.\d+(?:e-\d+)?%?", results))
    named = {number for numbers, _, _ in ROWS for number in numbers.split(", ")}
    of_the_text = {"1.5", "0.64"}  # a spread, and the literature's
    assert len(ROWS) > 5
    assert decimals - of_the_text <= named


def test_every_citation_has_its_entry_and_every_entry_is_cited() -> None:
    cited = set(re.findall(r"@([a-z]\w+)", PAPER))
    bibliography = (ROOT / "paper" / "paper.bib").read_text(encoding="utf-8")
    entries = set(re.findall(r"^@\w+\{(\w+),$", bibliography, flags=re.MULTILINE))
    assert cited == entries
