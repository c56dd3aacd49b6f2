"""What IDAES's DiagnosticsToolbox lists about the same Jacobians; ours must not miss any of it.

IDAES takes square models of equations, and its own derivatives need a compiled library; so each
case goes to it as the linear equations J x = J x0, with our Jacobian handed over.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from scipy.sparse import coo_array, coo_matrix

from tests.diagnostics.cases import CASES, naive_rodrigues
from workbench import Diagnosis, diagnose
from workbench.diagnostics.conditioning import MOST

pyo = pytest.importorskip("pyomo.environ", reason="pyomo needed: pip install '.[bench]'")
toolbox = pytest.importorskip(
    "idaes.core.util.diagnostics_tools.diagnostics_toolbox",
    reason="idaes needed: pip install '.[bench]'",
)
parallels = pytest.importorskip("idaes.core.util.diagnostics_tools.utils")
pytestmark = pytest.mark.thorough

FINITE = [case for case in CASES if case is not naive_rodrigues]


@dataclass
class Handed:
    """What IDAES asks a PyNumero problem for."""

    clist: list[Any]
    vlist: list[Any]

    def get_pyomo_constraints(self) -> list[Any]:
        return self.clist

    get_pyomo_equality_constraints = get_pyomo_constraints

    def get_pyomo_variables(self) -> list[Any]:
        return self.vlist


def given_to_idaes(d: Diagnosis) -> tuple[Any, coo_matrix, Handed]:
    """The model, the Jacobian, and who is who in it; variables are called by our indices."""
    J = np.asarray(d.here.dense)
    where = coo_array(d.structure.pattern)
    model = pyo.ConcreteModel()
    model.x = pyo.Var(range(J.shape[1]), initialize=0.0)
    rows: dict[int, list[int]] = {}
    for i, j in zip(*where.coords, strict=True):
        rows.setdefault(int(i), []).append(int(j))
    model.r = pyo.Constraint(
        sorted(rows), rule=lambda m, i: sum((J[i, j] or 1e-300) * m.x[j] for j in rows[i]) == 0
    )
    kept = sorted(rows)
    handed = Handed([model.r[i] for i in kept], [model.x[j] for j in range(J.shape[1])])
    return model, coo_matrix(J[kept]), handed


def index_of(component: Any) -> int:
    return int(component.index())


def ours(d: Diagnosis) -> set[int]:
    """Every unknown that our report names as not seen, hardly seen, weakest, or unread."""
    found = set(d.structure.unread.tolist()) | set(d.structure.under.columns.tolist())
    for direction in (*d.null_directions, *d.weak_directions):
        found |= set(np.flatnonzero(abs(direction.vector) > 1e-9).tolist())
    for weak in d.weakest:
        found |= set(weak.columns)
    return found


def singular_groups(J: np.ndarray) -> Iterator[set[int]]:
    """As SVDToolbox lists them: entries above 0.1 of vectors of singular values below 1e-6."""
    _, s, Vt = np.linalg.svd(J)
    for k in range(J.shape[1]):
        if k >= s.size or s[k] < 1e-6:
            yield set(np.flatnonzero(abs(Vt[k]) > 0.1).tolist())


@pytest.mark.parametrize("case", FINITE, ids=lambda case: case.__name__)
def test_nothing_that_idaes_lists_is_missing_here(case: Any) -> None:
    d = diagnose(*case())
    model, J, handed = given_to_idaes(d)
    box = toolbox.DiagnosticsToolbox(model)
    under, _, over, _ = box.get_dulmage_mendelsohn_partition()
    listed = {index_of(v) for block in under for v in block}
    assert listed <= set(d.structure.under.columns.tolist())
    assert {index_of(v) for block in over for v in block} <= set(d.structure.over.columns.tolist())
    columns = parallels.check_parallel_jacobian(model, 1e-8, "column", jac=J, nlp=handed)
    same = {frozenset((p.first, p.second)) for p in d.parallel_columns}
    for a, b in columns:
        pair = frozenset((index_of(a), index_of(b)))
        assert pair in same or pair <= ours(d), [d.free.label(i) for i in pair]
    rows = parallels.check_parallel_jacobian(model, 1e-8, "row", jac=J, nlp=handed)
    said = {(p.first, p.second) for p in d.parallel_rows}
    pairs = {tuple(sorted((index_of(a), index_of(b)))) for a, b in rows}
    assert pairs <= said or len(said) == MOST  # of more than that, only the first are listed
    for group in singular_groups(J.toarray()):
        assert group <= ours(d), [d.free.label(i) for i in group - ours(d)]
    extreme = parallels.extreme_jacobian_columns(J.tocsr(), handed, large=np.inf, small=1e-4)
    assert {index_of(v) for _, v in extreme} <= ours(d)
