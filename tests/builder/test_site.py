"""The full site: every public name has a page and an example, and no link is dead."""

import ast
import importlib.util
import re
from pathlib import Path

import pytest

import workbench as wb
from builder import lite
from builder.site import pages as site_pages
from builder.site import write_site
from builder.site.__main__ import main
from builder.site.pages import ExampleRun, rendered
from builder.site.reference import annotated, inventory
from tests.site.links import pages_of, troubles
from tests.site.test_course_site import not_run
from workbench.course import notebooks
from workbench.course.outline import lecture
from workbench.course.site import SITE_TOOLS

ROOT = Path(wb.__file__).parents[1]
SHOWN = sorted(p for p in (ROOT / "examples" / "reference").glob("*.py") if p.stem != "__init__")
PRINTED = "printed when the site was built"


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A site whose lectures and examples were not run."""
    for name in SITE_TOOLS:
        if importlib.util.find_spec(name) is None:
            pytest.skip(f"{name} is not installed")
    figure = tmp_path_factory.mktemp("figures") / "balance.png"
    figure.write_bytes((ROOT / "examples" / "balance.png").read_bytes())
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(notebooks, "run_cells", not_run)
        patch.setattr(site_pages, "run_example", lambda script: stand_in(script, figure))
        out = tmp_path_factory.mktemp("site") / "out"
        assert write_site(out) == out / "index.html"
    return out


def stand_in(script: Path, figure: Path) -> ExampleRun:
    figures = (figure,) if script.stem[:1].isdigit() else ()
    return ExampleRun(script.stem, script.read_text(encoding="utf-8"), PRINTED, figures)


@pytest.mark.thorough
def test_site_has_all_pages_and_no_dead_link(site: Path) -> None:
    """One test, so that the site is written once, and not by every process of a test run."""
    every_public_name_has_a_page_with_an_example(site)
    no_link_is_dead_and_nothing_is_fetched(site)
    all_parts_are_there(site)
    names_are_links_and_types_are_short(site)


def every_public_name_has_a_page_with_an_example(site: Path) -> None:
    entries = {entry.name: entry for entry in inventory() if entry.public}
    assert entries.keys() == set(wb.__all__)
    for name, entry in entries.items():
        page = site / "reference" / entry.package / f"{name}.html"
        assert PRINTED in page.read_text(encoding="utf-8"), f"{name} has no example"


def no_link_is_dead_and_nothing_is_fetched(site: Path) -> None:
    assert troubles(site) == []
    for path in site.rglob("*.css"):
        fetched = re.findall(r"url\(\s*['\"]?(https?:[^)]*)", path.read_text(encoding="utf-8"))
        assert not fetched, path


def all_parts_are_there(site: Path) -> None:
    pages = {path.relative_to(site).as_posix() for path in pages_of(site)}
    documents = {"COMMANDS", "ARCHITECTURE", "CHANGELOG", "CONTRIBUTING", "benchmarks/README"}
    assert {f"{name}.html" for name in documents} | {"index.html"} <= pages
    for script in (ROOT / "examples").glob("[0-9]*.py"):
        assert f"examples/{script.stem}.html" in pages
    assert "lectures/lec02_rotations.html" in pages
    licences = {path.name for path in (site / "licences").iterdir()}
    assert {"Sphinx-LICENSE.txt", "Pygments-LICENSE.txt", "MathJax.txt"} <= licences
    assert (site / "LICENSE").is_file()


def names_are_links_and_types_are_short(site: Path) -> None:
    solve = (site / "reference" / "solvers" / "solve.html").read_text(encoding="utf-8")
    assert '<a href="../problem/Problem.html">Problem</a>' in solve
    assert "numpy.ndarray" not in solve


@pytest.mark.thorough
@pytest.mark.parametrize("script", SHOWN, ids=lambda path: path.stem)
def test_example_of_the_reference_runs(script: Path, capsys: pytest.CaptureFixture[str]) -> None:
    source = script.read_text(encoding="utf-8")
    exec(compile(source, str(script), "exec"), {"__name__": "__main__"})
    assert capsys.readouterr().out.strip()
    example = ExampleRun(script.stem, source, "", ())
    assert example.names, "the docstring begins with the names that it shows: `solve, Status: ...`"
    assert set(example.names) <= set(wb.__all__)
    assert len(example.code.splitlines()) <= 40


INNER = {  # classes in annotations of public ones that users have no reason to name
    "kept by an object for its computations, whose results are properties of the object": {
        "BodyNumbers",
        "Kinematics",
        "TriangleNumbers",
        "Stitching",
        "Rounding",
        "LinearizedConstraints",
        "SingleFrames",
        "FrameRows",
        "Elimination",
        "SparseJacobian",
    },
    "an intermediate result: `Comparison` has what is made of it": {
        "Design",
        "Description",
    },
    "given by a method of a public class: `Start.mirror`": {"Mirror"},
    "a part of `Trained`, read as its `poses`, `regressor` and `shapes`": {
        "PoseModel",
        "JointRegressor",
        "ShapeModel",
    },
    "a protocol, satisfied by what comes with Python or the workbench, such as `map`": {
        "Report",
    },
}


@pytest.mark.thorough
def test_classes_in_public_annotations_are_public() -> None:
    """Classes in their annotations are `wb.Name`, or `wb.package.Name` of its `__all__`."""
    entries = inventory()
    hidden = {(e.module, e.name) for e in entries if e.exported == e.module and not e.public}
    found = {
        name: entry.name
        for entry in entries
        if entry.public
        for module, name, node in annotated(entry)
        if isinstance(node, ast.ClassDef) and (module, name) in hidden
    }
    excused = set().union(*INNER.values())
    missing = {name: used for name, used in found.items() if name not in excused}
    assert not missing, (
        f"export these from `workbench` or their packages, for who uses them: {missing}"
    )
    assert excused <= found.keys(), f"no exceptions any more: {excused - found.keys()}"


def linked(name: str) -> str | None:
    return f"{name}.html" if name in ("Problem", "UnknownName") else None


DOCSTRINGS = {
    "B_P(theta) = sum of f_n P_n, *not* <b>.": (
        "<p>B_P(theta) = sum of f_n P_n, *not* &lt;b&gt;.</p>"
    ),
    "Raises UnknownName, or `other`.": (
        '<p>Raises <a href="UnknownName.html">UnknownName</a>, or <code>other</code>.</p>'
    ),
    "As\n\n    x = $y$ `z`\n      + 1\n\nand": (
        "<p>As</p>\n<pre>x = $y$ `z`\n  + 1</pre>\n<p>and</p>"
    ),
    "Two:\n- one\n  more\n- `two`": (
        "<p>Two:</p>\n<ul><li>one more</li><li><code>two</code></li></ul>"
    ),
    "A batch.\n\nAttributes:\n    subject: (c,) the\n        number.\n    v: (N, 3) m.": (
        '<p>A batch.</p>\n<p class="part">Attributes</p>\n<dl class="fields">'
        "<dt><code>subject</code></dt><dd>(c,) the number.</dd>"
        "<dt><code>v</code></dt><dd>(N, 3) m.</dd></dl>"
    ),
    "One ` backtick ``` of many.": "<p>One ` backtick ``` of many.</p>",
}


def test_docstrings_are_rendered_whatever_is_in_them() -> None:
    for docstring, html in DOCSTRINGS.items():
        assert rendered(docstring, linked) == html


def test_other_people_s_folders_are_not_replaced(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "thesis.tex").write_text("years of work")
    assert main([str(tmp_path)]) == 2
    said = capsys.readouterr().err
    assert "no site of ours" in said or "pip install" in said  # where the tools are missing
    assert (tmp_path / "thesis.tex").read_text() == "years of work"


# The course for JupyterLite.


@pytest.mark.thorough
def test_notebook_installs_what_a_browser_needs() -> None:
    made = lite.for_browsers(lecture(2))
    code = [cell["source"] for cell in made["cells"] if cell["cell_type"] == "code"]
    compile(code[0], "cell", "exec", flags=0x2000)  # with await at its top
    assert "piplite.install('smpl-workbench', deps=False)" in code[0]
    assert "'casadi'" in code[0]
    assert all("piplite" not in cell for cell in code[1:])


def test_missing_tools_of_lite_are_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    out, wheel = tmp_path / "out", tmp_path / "one.whl"
    assert lite.main([str(out), "--wheel", str(wheel)]) == 2
    assert "is no wheel; build one with: pip wheel" in capsys.readouterr().err
    wheel.touch()
    monkeypatch.setattr(lite, "NEEDED", ("jupyterlite_of_nobody",))
    assert lite.main([str(out), "--wheel", str(wheel)]) == 2
    assert "pip install jupyterlite-of-nobody" in capsys.readouterr().err
    assert not out.exists()
