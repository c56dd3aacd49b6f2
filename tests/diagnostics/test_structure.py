"""What a pattern allows, against matchings and alternating paths found by other means."""

import casadi as cs
import numpy as np
import pytest
from scipy.sparse import csc_array, csr_array
from scipy.sparse.csgraph import maximum_bipartite_matching

from tests.tiers import few
from workbench import Block, Problem, Residual, diagnose
from workbench.blocks import Layout
from workbench.diagnostics.structure import Structure, decomposed
from workbench.diagnostics.words import named_groups, named_rows


def reached(pattern: np.ndarray, partner: dict[int, int], start: set[int]) -> tuple[set, set]:
    """Rows and columns on paths from `start` (columns), edge and matched edge taking turns.

    `partner` maps rows to the columns that they are matched with.
    """
    columns, rows, todo = set(start), set(), list(start)
    while todo:
        for row in np.flatnonzero(pattern[:, todo.pop()]).tolist():
            rows.add(row)
            if row in partner and partner[row] not in columns:
                columns.add(partner[row])
                todo.append(partner[row])
    return rows, columns


def sets(structure: Structure, part: str) -> tuple[set[int], set[int]]:
    found = getattr(structure, part)
    return set(found.rows.tolist()), set(found.columns.tolist())


@pytest.mark.parametrize("batch", few(range(6), 1))
def test_the_parts_are_those_of_alternating_paths(batch: int) -> None:
    for case in range(50):
        rng = np.random.default_rng([batch, case])
        m, n = (int(k) for k in rng.integers(1, 25, size=2))
        pattern = rng.random((m, n)) < rng.choice([0.03, 0.08, 0.15, 0.4])
        structure = decomposed(csc_array(pattern))

        matched = maximum_bipartite_matching(csr_array(pattern), perm_type="column")
        of_row = {i: int(j) for i, j in enumerate(matched) if j >= 0}
        of_column = {j: i for i, j in of_row.items()}
        assert structure.rank == len(of_row), (batch, case)

        under = reached(pattern, of_row, set(range(n)) - set(of_column))
        assert sets(structure, "under") == under, (batch, case)
        columns, rows = reached(pattern.T, of_column, set(range(m)) - set(of_row))
        assert sets(structure, "over") == (rows, columns), (batch, case)
        rest = set(range(m)) - under[0] - rows, set(range(n)) - under[1] - columns
        assert sets(structure, "square") == rest, (batch, case)
        assert len(rest[0]) == len(rest[1])

        assert structure.unread.tolist() == np.flatnonzero(~pattern.any(axis=0)).tolist()
        assert structure.idle.tolist() == np.flatnonzero(~pattern.any(axis=1)).tolist()


def test_too_few_rows_for_some_unknowns_are_named() -> None:
    """Three unknowns in two rows, beside two that are well read."""
    a, b = Block("a", (3,)), Block("b", (2,), "1", ("left", "right"))
    known = cs.vertcat(b.symbol, b.symbol[0] + b.symbol[1])
    few = cs.vertcat(a.symbol[0] * a.symbol[1], a.symbol[1] + a.symbol[2])
    problem = Problem((Residual("few", few, 1.0), Residual("known", known, 1.0)), ("a", "b"))
    found = diagnose(problem, {"a": np.ones(3), "b": np.ones(2)})
    structure = found.structure
    assert (found.rank, found.structural_rank) == (4, 4)
    assert sets(structure, "under") == ({0, 1}, {0, 1, 2})
    assert sets(structure, "over") == ({2, 3, 4}, {3, 4})
    assert "2 rows cannot determine 3 unknowns: all of a" in found.warnings[0].text
    assert "over-determined 3 x 2, square 0 x 0, under-determined 2 x 3" in found.report()
    assert found.data()["structure"]["under_determined"] == {
        "rows": 2,
        "of": "2 of few",
        "unknowns": ["a[0]", "a[1]", "a[2]"],
    }
    assert [v.name for v in found.identifiability.verdicts] == ["STRUCTURAL"] * 3 + [
        "IDENTIFIED",
        "IDENTIFIED",
    ]


def test_a_residual_that_reads_nothing_free_is_named() -> None:
    a, b = Block("a", (2,)), Block("b", (2,))
    problem = Problem((Residual("of a", a.symbol, 1.0), Residual("of b", b.symbol, 1.0)), ("a",))
    found = diagnose(problem, {"a": np.zeros(2), "b": np.ones(2)})
    assert found.structure.idle.tolist() == [2, 3]
    (warning,) = found.warnings
    assert warning.text == "the residual of b depends on no free block, so it is constant"


def test_entries_are_named_in_few_words() -> None:
    pose = Block("pose", (3, 3), "rad", ("hip", "knee", "foot"))
    layout = Layout((Block("scale", ()), pose, Block("betas", (4,))))
    assert named_groups(layout, np.array([0])) == "scale"
    assert named_groups(layout, np.arange(1, 10)) == "all of pose"
    assert named_groups(layout, np.array([1, 2, 3, 6, 11])) == (
        "pose[hip, x y z], pose[knee, z], betas[1]"
    )


def test_rows_are_named_by_their_residuals() -> None:
    rows = {"a": slice(0, 4), "b": slice(4, 6), "c": slice(6, 9)}
    assert named_rows(rows, np.array([0, 3, 7])) == "2 of a, 1 of c"
