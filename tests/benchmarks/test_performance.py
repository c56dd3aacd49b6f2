"""The benchmarks run at tiny sizes and agree; how fast they are is not asked here."""

import shutil
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path

import pytest

from benchmarks import __main__ as command
from benchmarks import candidates, measuring, page, performance
from benchmarks.candidates import NUMPY, Candidate
from benchmarks.problems import Case, case_of, random_body

pytestmark = pytest.mark.thorough


def test_pages_are_those_of_the_kept_numbers(tmp_path: Path) -> None:
    here = tmp_path / "benchmarks"
    here.mkdir()
    shutil.copytree(measuring.RESULTS, here / "results")
    for name in command.PAGES:
        shutil.copy(measuring.HERE / name, here)
    command.write_pages(here)
    for name in command.PAGES:
        assert (here / name).read_text("utf-8") == (measuring.HERE / name).read_text("utf-8"), name


def test_readme_claims_the_speed_that_is_stored() -> None:
    readme = (measuring.HERE.parent / "README.md").read_text("utf-8")
    stored = measuring.kept("performance")
    assert stored is not None
    ratios = {one.name: one.measured for one in page.targets(stored["found"])}
    assert "a tenth of the time that JAX needs" in readme
    assert 9 <= ratios["workbench: JAX / Jacobian"] <= 11
    assert "less than a fortieth with a C compiler" in readme
    assert ratios["workbench, compiled: JAX / Jacobian"] > 40


@pytest.mark.filterwarnings("default")  # peers have warnings of their own
@pytest.mark.parametrize("part", performance.PARTS)
def test_parts_agree_and_write_their_tables(part: str) -> None:
    """Each compares what its candidates compute before it times them."""
    found = performance.measured(True, (part,))
    text = performance.tables(found)
    assert text.startswith(f"## {performance.PARTS[part].heading}\n\n| ")
    assert NUMPY in text or part in ("vertices", "videos")
    page.targets(found)  # can be judged


@pytest.mark.filterwarnings("default")  # they have warnings of their own
@pytest.mark.parametrize(
    ("make", "packages"),
    [
        (candidates.by_differences, []),
        (candidates.in_jax, ["jax"]),
        (candidates.in_torch, ["torch", "smplx"]),
    ],
)
def test_peers_agree_with_the_workbench(
    make: Callable[[Case], Candidate], packages: list[str]
) -> None:
    if any(find_spec(package) is None for package in packages):
        pytest.skip(f"{' and '.join(packages)} needed: pip install '.[bench]'")
    case = case_of("40", random_body(40))
    x, y = case.people(2)
    candidates.check(make(case.seeing(x)), case.seeing(x), y)
