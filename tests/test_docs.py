"""The documents: their code prints what they say, and what they name exists."""

import re
import shlex
from functools import cache, reduce
from pathlib import Path

import pytest

import workbench as wb
from workbench.cli.new import write_scaffold
from workbench.experiments import find

ROOT = Path(__file__).parents[1]
HOWTO = sorted((ROOT / "howto").glob("*.md"))
README, ARCHITECTURE = ROOT / "README.md", ROOT / "ARCHITECTURE.md"
PAGES = [README, ARCHITECTURE, ROOT / "CONTRIBUTING.md", *HOWTO]  # with names that must exist
MORE = [ROOT / name for name in ("CHANGELOG.md", "COMMANDS.md", "examples/README.md")]
LARGEST = {
    README: 11,
    ARCHITECTURE: 15,
    ROOT / "CONTRIBUTING.md": 5,
    ROOT / "CHANGELOG.md": 8,
}  # kB

BLOCK = re.compile(r"```python\n(.*?)```(?:\n\n```\n(.*?)```)?", re.S)
ROUNDING = re.compile(r"the next \d(\.\d+)?e-\d\d")  # noise, of which only the size is compared
TYPED = re.compile(r"^(workbench [a-z].*)$|`(workbench [a-z][^`]*)`", re.M)
QUOTED = re.compile(r"`([^`\n]+)`|^  +(\S.*\.(?:py|html).*)$", re.M)  # also lines of call paths
FILE = re.compile(r"[\w./-]*(?:\.(?:py|md|html)\b|\w/(?![\w.*<]))")
MADE = re.compile(r"runs/|<\w+>|lecNN")  # by users, or in place of a name
PACKAGES = "|".join(path.parent.name for path in ROOT.glob("workbench/*/__init__.py"))
NAME = re.compile(rf"\bwb\.([\w.]*\w)|`(?:workbench\.)?((?:{PACKAGES})\.(?!py\b|json\b)[\w.]*\w)`")

each_page = pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)


@pytest.mark.parametrize(
    "page", [pytest.param(README, marks=pytest.mark.browser), *HOWTO], ids=lambda page: page.stem
)
def test_code_prints_what_the_page_says(page: Path, capsys: pytest.CaptureFixture[str]) -> None:
    names: dict[str, object] = {"__name__": page.stem}
    blocks = BLOCK.findall(page.read_text(encoding="utf-8"))
    assert any(shown for _, shown in blocks)
    for code, shown in blocks:
        exec(compile(code, page.name, "exec", dont_inherit=True), names)
        printed = ROUNDING.sub("the next ~0", capsys.readouterr().out)
        assert printed == ROUNDING.sub("the next ~0", shown)


@pytest.mark.parametrize("page", [*PAGES, *MORE], ids=lambda page: page.stem)
def test_links_lead_somewhere(page: Path) -> None:
    targets = re.findall(r"\]\(([^)#:]+)\)", page.read_text(encoding="utf-8"))
    assert [one for one in targets if not (page.parent / one).exists()] == []


@cache
def all_paths() -> str:
    """Every file of the checkout, a line each, with a slash before it."""
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
    found = [*ROOT.iterdir(), *(path for name in folders for path in (ROOT / name).rglob("*"))]
    return "\n".join(f"/{path.relative_to(ROOT).as_posix()}\n" for path in found)


@each_page
def test_files_that_are_named_exist(page: Path) -> None:
    text = re.sub(r"\]\([^)]*\)", "", page.read_text(encoding="utf-8"))  # links: see above
    quoted = (one or other for one, other in QUOTED.findall(text))
    named = {file for text in quoted if not MADE.search(text) for file in FILE.findall(text)}
    if page != ARCHITECTURE:
        named = {file for file in named if "/" in file}  # the others are files of users
    missing = {
        file for file in named if f"/{file}{'' if file[-1] == '/' else chr(10)}" not in all_paths()
    }
    assert not missing


@each_page
def test_names_of_the_library_exist(page: Path) -> None:
    for one, other in NAME.findall(page.read_text(encoding="utf-8")):
        reduce(getattr, (one or other).split("."), wb)


@pytest.mark.parametrize("page", [*PAGES, *MORE[::2]], ids=lambda page: page.stem)
def test_commands_that_are_named_exist(page: Path) -> None:
    options = options_of_commands()
    for line, quoted in TYPED.findall(page.read_text(encoding="utf-8")):
        words = shlex.split(line or quoted, comments=True)[1:]
        verb = " ".join(words[: 2 if words[0] in ("lecture", "body") else 1])
        assert verb in options, line or quoted
        assert {word for word in words if word.startswith("--")} <= options[verb], line or quoted


@cache
def options_of_commands() -> dict[str, set[str]]:
    from builder.commands import commands

    return {
        name: {option for parameter in command.params for option in parameter.opts}
        for name, command in commands()
    }


def test_commands_are_those_of_the_command_line() -> None:
    from builder.commands import FILE, text

    assert FILE.read_text(encoding="utf-8") == text(), "run `python -m builder.commands`"


@pytest.mark.parametrize("page", [*PAGES, *MORE[:1]], ids=lambda page: page.stem)
def test_documents_stay_short(page: Path) -> None:
    assert page.stat().st_size <= 1024 * LARGEST.get(page, 5)


def test_every_example_is_listed() -> None:
    listed = re.findall(r"\((\w+\.py)\)", MORE[2].read_text(encoding="utf-8"))
    assert sorted(listed) == sorted(path.name for path in ROOT.glob("examples/[0-9]*.py"))


@pytest.mark.parametrize("kind", ["problem", "residual", "solver", "experiment"])
def test_files_to_begin_with_converge_without_warnings(kind: str, tmp_path: Path) -> None:
    setup = find(str(write_scaffold(kind, "mine", tmp_path))).setup()
    solution = wb.solve(setup.problem, setup.start)
    assert solution.status is wb.Status.CONVERGED
    values = setup.start | solution.values
    assert not wb.diagnose(setup.problem, values, priors=setup.priors).warnings
