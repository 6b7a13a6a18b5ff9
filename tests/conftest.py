"""Tiers of the tests, and how long one may take.

`--tier quick` takes the files of `QUICK`, `--tier test` all tests but those marked `nightly`, `--tier all` every test.
In the first two, a test that takes more than `LONG` seconds of processor time is named at the end, and one that takes
more than `TOO_LONG` fails the run, unless it is marked `takes_long`. The same test takes twice as long on some machines
as on others, so what fails is far over what is named.
"""

import os
import sys
from collections.abc import Generator
from pathlib import Path
from typing import Any

import pytest

pytest_plugins = ["scripts_run"]

# Two workers share two cores; libraries that start threads of their own only get in the way.
for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

TESTS = Path(__file__).parent
#: Files of the quick tier.
QUICK = (
    "house/test_circles.py",
    "house/test_package_arrows.py",
    "house/test_tiers.py",
    "api/test_friction_contact.py",
    "api/test_model.py",
    "api/test_simulation.py",
    "envs/test_episode.py",
    "envs/test_reward_terms.py",
)
#: Processor time of one test and the processes that it waits for, s. It depends less on the machine's load than time.
LONG, TOO_LONG = 5.0, 20.0
TIER = pytest.StashKey[str]()
#: PyTorch, and the compiler that its first optimizer imports: each takes a process seconds, and whose test that is
#: depends on chance.
HEAVY = ("torch", "torch._dynamo")
#: Processor time of the fixtures that this test set up and shares with others, s.
SHARED: list[float] = []
#: Tests of this run that took long: name and processor time, s.
FOUND: list[tuple[str, float]] = []


def pytest_addoption(parser: pytest.Parser) -> None:
    """Adds `--tier`."""
    parser.addoption("--tier", choices=["quick", "test", "all"], default="test", help="which tests to run")


def pytest_configure(config: pytest.Config) -> None:
    """Notes the tier."""
    config.stash[TIER] = config.getoption("--tier")


def is_quick(path: Path) -> bool:
    """Whether a file is in the quick tier."""
    place = path.relative_to(TESTS).as_posix()
    return any(place == one or place.startswith(f"{one}/") for one in QUICK)


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leaves out the tests of the slower tiers."""
    tier = config.stash[TIER]
    if tier == "all":
        return
    out = [
        item
        for item in items
        if item.get_closest_marker("nightly")
        or (tier == "quick" and (item.get_closest_marker("takes_long") or not is_quick(item.path)))
    ]
    left_out = set(out)
    items[:] = [item for item in items if item not in left_out]
    config.hook.pytest_deselected(items=out)


@pytest.fixture(scope="session")
def whole(pytestconfig: pytest.Config) -> bool:
    """Whether a test that can be cut short runs whole, as it does with `--tier all`."""
    return pytestconfig.stash[TIER] == "all"


def processor_time() -> float:
    """Of this process and of those that it has waited for, s."""
    return sum(os.times()[:4])


def n_imported() -> int:
    """How many of the heavy modules this process has imported."""
    return sum(name in sys.modules for name in HEAVY)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Generator[None, object, object]:
    """Notes when a test begins."""
    SHARED.clear()
    item.user_properties += [("start", processor_time()), ("imported", n_imported())]
    return (yield)


@pytest.hookimpl(wrapper=True)
def pytest_fixture_setup(fixturedef: pytest.FixtureDef[Any]) -> Generator[None, object, object]:
    """Notes what a fixture took that several tests share: the first of them is not to blame."""
    start = processor_time()
    try:
        return (yield)
    finally:
        if fixturedef.scope != "function":
            SHARED.append(processor_time() - start)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Notes what a test took, with the fixtures that are its own."""
    report = yield
    if report.when == "teardown":
        noted = dict(item.user_properties)
        may_take_long = item.get_closest_marker("takes_long") is not None or noted["imported"] != n_imported()
        report.user_properties = [
            ("processor_time", processor_time() - noted["start"] - sum(SHARED)),
            ("takes_long", may_take_long),
        ]
    return report


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    """Collects the tests that took long; with several workers this runs in the process that gathers them."""
    noted = dict(report.user_properties)
    took = noted.get("processor_time", 0.0)
    if report.when == "teardown" and took > LONG and not noted["takes_long"]:
        FOUND.append((report.nodeid, took))


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Fails the run if a test took too long."""
    took_too_long = session.config.stash[TIER] != "all" and any(took > TOO_LONG for _, took in FOUND)
    if took_too_long and session.exitstatus == pytest.ExitCode.OK:
        session.exitstatus = pytest.ExitCode.TESTS_FAILED


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter, config: pytest.Config) -> None:
    """Names the tests that took long, last those that fail the run."""
    if config.stash[TIER] == "all":
        return
    for limit, verdict in ((LONG, "take long"), (TOO_LONG, "fail the run")):
        found = [f"{name}: {took:.1f} s" for name, took in FOUND if took > limit]
        if found:
            title = f"not marked takes_long, over {limit:g} s of processor time: {verdict}"
            terminalreporter.section(title, red=limit == TOO_LONG)
            terminalreporter.write("\n".join(found) + "\n")
