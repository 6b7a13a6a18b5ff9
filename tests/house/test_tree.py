"""The tree contains no machine paths, no registry addresses and no large files."""

import re
import runpy
import subprocess
import tomllib
from pathlib import Path

import rover_gym

ROOT = Path(__file__).parents[2]
LARGEST = 1_500_000  # bytes

# Written in pieces, so that this file does not match itself.
MACHINE_PATHS = re.compile(r"(?<![\w.])/(?:wo" r"rk|ro" r"ot|ho" r"me|fa" r"rm)/|/tm" r"p/")
REGISTRIES = re.compile(r"pypi\.or" r"g|pythonhost" r"ed|crates\.i" r"o|registry\.np" r"mjs|debian\.o" r"rg")


def tracked_files() -> list[Path]:
    listing = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, check=True, capture_output=True, text=True)  # noqa: S607
    return [ROOT / name for name in listing.stdout.split("\0") if name]


def test_no_file_names_a_place_of_one_machine_or_a_registry() -> None:
    found = []
    for path in tracked_files():
        if path.name == "Cargo.lock" or path.suffix == ".png":  # cargo's own identifier of its registry; no text
            continue
        text = path.read_text(encoding="utf-8", errors="replace")  # pictures are not text
        for number, line in enumerate(text.splitlines(), 1):
            if MACHINE_PATHS.search(line) or REGISTRIES.search(line):
                found.append(f"{path.relative_to(ROOT)}:{number}: {line.strip()[:80]}")
    assert not found


def test_no_file_is_large() -> None:
    assert not [path for path in tracked_files() if path.stat().st_size > LARGEST]


def test_every_golden_file_has_its_provenance() -> None:
    folder = ROOT / "tests" / "golden"
    readme = (folder / "README.md").read_text(encoding="utf-8")
    assert not [path.name for path in folder.glob("*.json") if f"`{path.name}`" not in readme]


def test_the_packages_copy_of_the_golden_curves_is_current() -> None:
    for name in ("pack_section_6_1.py", "pack_chapter_3.py"):
        packer = runpy.run_path(str(ROOT / "tests" / "golden" / name))
        assert packer["PACKED"].read_text(encoding="utf-8") == packer["pack"]()


def test_there_is_one_version() -> None:
    workspace = tomllib.loads((ROOT / "Cargo.toml").read_text(encoding="utf-8"))
    version = workspace["workspace"]["package"]["version"]
    assert rover_gym.__version__ == version
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert f"\nversion: {version}\n" in citation
    (released,) = re.findall(r"^date-released: (\S+)$", citation, flags=re.MULTILINE)
    assert f'\n  version: "{version}"\n' in (ROOT / "packaging" / "conda" / "recipe.yaml").read_text(encoding="utf-8")
    changelog = re.findall(r"^## (.*)$", (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"), flags=re.MULTILINE)
    assert changelog[:2] == ["[Unreleased]", f"[{version}] - {released}"]


def test_pins_hold_versions_and_nothing_else() -> None:
    pin = re.compile(r"[a-z0-9._-]+==[0-9][\w.]*( ; [^@/]+)?")
    for path in (ROOT / "requirements").glob("*.txt"):
        lines = [line for line in path.read_text(encoding="utf-8").splitlines() if not line.startswith("#")]
        assert lines
        assert not [line for line in lines if not pin.fullmatch(line)], path.name


def test_a_processor_gets_none_of_what_only_a_graphics_card_needs() -> None:
    """The environment of `make test` held a gigabyte of a compiler for graphics cards."""
    requirements = ROOT / "requirements"
    text = (requirements / "without" / "processor.txt").read_text(encoding="utf-8")
    left_out = {line for line in text.splitlines() if not line.startswith("#")}
    assert "triton" in left_out
    for name in ("test", "rllib"):
        lines = (requirements / f"{name}.txt").read_text(encoding="utf-8").splitlines()
        pinned = {line.partition("==")[0] for line in lines}
        assert "torch" in pinned
        assert not pinned & left_out
