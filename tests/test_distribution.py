"""The distribution: its name wherever somebody is told to install it, and a wheel that works."""

import os
import re
import subprocess
import sys
import tomllib
import zipfile
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

import pytest

from workbench.environment import DISTRIBUTION, VERSION, pip_install, version_of

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
TEXTS = {".py", ".md", ".toml", ".yml", ".yaml", ".txt", ".cfg", ".sh", ".html", ".css", ""}
NOT_OURS = re.compile(
    r"pip3? install (?:[^\s,;:`]+ )*?['\"]?workbench(?![\w/-])"  # pip install workbench
    r"|(?<![\w-])workbench\[(?:course|dask|bench|test|thorough|dev)\]"  # workbench[course]
    r"|(?<!_)version\(['\"]workbench['\"]\)"  # importlib.metadata's
)


def texts() -> list[Path]:
    """All that is written by hand, wherever it stands in the tree."""
    folders = (
        "workbench",
        "lectures",
        "examples",
        "howto",
        "builder",
        "benchmarks",
        "tests",
        ".ci",
    )
    inside = [path for folder in folders for path in (ROOT / folder).rglob("*")]
    return [
        path
        for path in (*ROOT.iterdir(), *inside)
        if path.is_file() and path.suffix in TEXTS and path.name != ".git"
    ]


def test_texts_name_our_own_distribution() -> None:
    wrong = [
        f"{path.relative_to(ROOT)}: {found[0]}"
        for path in texts()
        if path != Path(__file__)
        for found in NOT_OURS.finditer(path.read_text(encoding="utf-8", errors="replace"))
    ]
    assert not wrong
    assert len(texts()) > 500  # the tree was found


def test_extras_named_in_code_exist() -> None:
    assert PROJECT["name"] == DISTRIBUTION
    extras = PROJECT["optional-dependencies"]
    for needed in [one for several in extras.values() for one in several]:
        name, _, extra = needed.rstrip("]").partition("[")
        if extra:
            assert (name, extra in extras) == (DISTRIBUTION, True), needed
    for path in (ROOT / "workbench").rglob("*.py"):
        for extra in re.findall(r"pip_install\(\"(\w+)\"\)", path.read_text()):
            assert extra in extras, path
    assert pip_install("course").count("[course]") == 2


def test_version_of_metadata_is_that_of_code() -> None:
    assert version_of(DISTRIBUTION) == VERSION
    assert version_of("nothing-of-that-name") is None
    assert f"\nversion: {VERSION}\n" in (ROOT / "CITATION.cff").read_text()
    try:
        assert distribution(DISTRIBUTION).version == VERSION
    except PackageNotFoundError:
        pytest.skip("a checkout that is not installed has no metadata to compare with")


def test_python_m_workbench_runs_from_a_checkout(tmp_path: Path) -> None:
    done = typed("--version", paths=(ROOT,), cwd=tmp_path)
    assert done.stdout == f"smpl-workbench {VERSION}\n"
    shown = typed("lecture", "show", "2", paths=(ROOT,), cwd=tmp_path)
    assert str(ROOT / "lectures" / "lec02_rotations" / "lecture.py") in shown.stdout


@pytest.mark.thorough
def test_wheel_has_its_lectures_and_works(tmp_path: Path) -> None:
    """Built, unpacked and used, from a folder that is no checkout."""
    pytest.importorskip("hatchling", reason="hatchling is needed: pip install '.[thorough]'")
    build = "import sys; from hatchling.build import build_wheel; build_wheel(sys.argv[1])"
    subprocess.run([sys.executable, "-c", build, str(tmp_path)], cwd=ROOT, check=True)
    (wheel,) = tmp_path.glob("*.whl")
    assert wheel.name.startswith(f"smpl_workbench-{VERSION}-")
    place = tmp_path / "site-packages"
    with zipfile.ZipFile(wheel) as packed:
        packed.extractall(place)
    assert {path.name for path in place.iterdir()} == {
        "workbench",
        f"smpl_workbench-{VERSION}.dist-info",
    }
    for name in ("AUTHORS.md", "outline.py", "lec02_rotations/checks.py", "material/tubes.py"):
        assert (place / "workbench" / "lectures" / name).is_file(), name
    shown = typed("lecture", "show", "2", paths=(place,), cwd=tmp_path)
    assert str(place / "workbench" / "lectures" / "lec02_rotations" / "lecture.py") in shown.stdout
    typed("lecture", "start", "2", "mine", paths=(place,), cwd=tmp_path)
    mine = tmp_path / "mine" / "lec02_rotations.py"
    mine.write_text(mine.read_text().replace('raise Unsolved("shorter")', "return w"))
    done = typed("lecture", "check", "2", "mine", paths=(place,), cwd=tmp_path, code=1)
    assert "2.4 shorter" in done.stdout
    assert "not attempted" in done.stdout


def typed(
    *arguments: str, paths: tuple[Path, ...], cwd: Path, code: int = 0
) -> subprocess.CompletedProcess[str]:
    """`python -m workbench`, with these folders before all that is installed."""
    paths_of = os.pathsep.join(map(str, paths))
    done = subprocess.run(
        [sys.executable, "-m", "workbench", *arguments],
        env=os.environ | {"PYTHONPATH": paths_of, "COLUMNS": "200"},
        cwd=cwd,
        capture_output=True,
        text=True,
        timeout=240,
        check=False,
    )
    assert done.returncode == code, done.stderr + done.stdout
    return done
