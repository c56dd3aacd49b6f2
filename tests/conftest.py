"""How tests are divided among tiers and processes, what they cost, and what they forget."""

import ctypes
import gc
import os
import re
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

# A process for each core is enough: their linear algebra needs no further threads.
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
# Compiled libraries are kept with the checkout, not in the user's own cache.
os.environ.setdefault("WORKBENCH_CACHE", str(Path(__file__).parents[1] / ".pytest_cache/compiled"))

import pytest

TOGETHER = {  # files of tests that share what takes long, and a name for them
    "test_repository.py": "repository",
    "test_site.py": "site",
    "test_no_hang.py": "no hang",
    "test_studies.py": "studies",
    "test_gauges_of_training.py": "gauges of training",
}
LECTURES = ("test_every_lecture.py", "test_prose.py")  # a group for each lecture
SLOW = 2.0  # CPU seconds, of a default test that is named at the end
BEGAN = pytest.StashKey[float]()


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Do not import files of which no test is asked for.

    With `-m browser`, they import libraries that an environment like a browser's does not have; in
    the default run, files that are thorough as a whole only take time.
    """
    inside = collection_path.is_dir()
    if not (inside or collection_path.suffix == ".py"):
        return None
    if config.option.markexpr == "browser":
        files = collection_path.rglob("test_*.py") if inside else [collection_path]
        return not any("mark.browser" in file.read_text(encoding="utf-8") for file in files) or None
    if config.option.markexpr == "not thorough" and not inside:
        text = collection_path.read_text(encoding="utf-8")
        return bool(re.search(r"^pytestmark = pytest\.mark\.thorough$", text, re.MULTILINE)) or None
    return None


class Results:
    """What became of each test, written as it ends, and the CPU seconds that it took."""

    def __init__(self, file: Path) -> None:
        self.file = file.open("w", encoding="utf-8", buffering=1)  # line by line: runs are killed
        self.seconds: dict[str, float] = {}
        self.outcomes: dict[str, str] = {}

    def pytest_runtest_logreport(self, report: Any) -> None:
        name = report.nodeid
        if report.when == "call" or not report.passed:
            self.outcomes[name] = report.outcome
        if hasattr(report, "cpu"):
            self.seconds[name] = report.cpu
            self.file.write(f"{self.outcomes.get(name, '')}\t{report.cpu:.2f}\t{name}\n")

    def pytest_terminal_summary(self, terminalreporter: Any) -> None:
        self.file.close()
        slow = {name: s for name, s in self.seconds.items() if s > SLOW}
        default = terminalreporter.config.option.markexpr == "not thorough"
        for name in sorted(slow, key=slow.__getitem__, reverse=True) if default else ():
            terminalreporter.write_line(f"{slow[name]:6.1f} s of CPU: {name}")
        terminalreporter.write_line(f"tests took {sum(self.seconds.values()):.0f} s of CPU")


@pytest.hookimpl(tryfirst=True)
def pytest_configure(config: pytest.Config) -> None:
    """Groups are kept together by pytest-xdist, and mean nothing without it."""
    config.addinivalue_line("markers", "xdist_group(name): tests that run in one process")
    if getattr(config.option, "dist", "no") == "load":
        config.option.dist = "loadgroup"
    if hasattr(config, "workerinput"):
        config.option.loadgroup = True  # which workers do not hear of
    else:
        folder = config.rootpath / ".pytest_cache"
        folder.mkdir(exist_ok=True)
        config.pluginmanager.register(Results(folder / "results.tsv"))


@pytest.hookimpl(tryfirst=True)  # before pytest-xdist reads the groups
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Keep tests that share what takes long in one process, where it is done once.

    Tests of one lecture follow each other, so that no more than one run of a lecture is kept.
    """
    for item in items:
        if item.path.name in TOGETHER:
            item.add_marker(pytest.mark.xdist_group(TOGETHER[item.path.name]))
    places = [i for i, one in enumerate(items) if one.path.name in LECTURES]
    taught = sorted((items[i] for i in places), key=lecture_number)  # others keep their order
    for i, one in zip(places, taught, strict=True):
        items[i] = one
        one.add_marker(pytest.mark.xdist_group(f"lecture {lecture_number(one)}"))


def lecture_number(item: pytest.Item) -> int:
    """Of the lecture that a test is about; 0 for one that is about none."""
    params = getattr(getattr(item, "callspec", None), "params", {})
    number = getattr(params.get("lecture"), "number", params.get("number", 0))
    return int(number)


def cpu_seconds() -> float:
    """Of this process and of its children that have ended."""
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Iterator[None]:
    item.stash[BEGAN] = cpu_seconds()
    return (yield)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item, call: pytest.CallInfo[None]) -> Iterator[Any]:
    report = yield
    if report.when == "teardown":
        report.cpu = cpu_seconds() - item.stash[BEGAN]
    return report


@pytest.fixture(autouse=True, scope="module")
def nothing_is_kept_for_other_files(request: pytest.FixtureRequest) -> Iterator[None]:
    """After a file of tests, what its cached functions hold is freed and given to the system.

    All files of a run are imported at its start and stay, and so would what their caches hold.
    """
    yield
    for value in vars(request.module).values():
        own = getattr(value, "__module__", None) == request.module.__name__
        if own and hasattr(value, "cache_clear"):
            value.cache_clear()
    gc.collect()
    with suppress(AttributeError, OSError, TypeError):  # only glibc has this
        ctypes.CDLL(None).malloc_trim(0)
