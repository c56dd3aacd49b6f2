"""What holds symbols is not pickled, in a sentence; numbers and bodies are."""

import copy
import pickle

import numpy as np
import pytest

import workbench as wb
from workbench.errors import BadArgument
from workbench.residuals import gaussian

X = wb.Block("x", (3,))
RESIDUAL = gaussian(X.symbol)
PROBLEM = wb.Problem([RESIDUAL], "x")
AT = {"x": np.ones(3)}
BODY = wb.load_body("small")
SYMBOLIC = {
    "Residual": RESIDUAL,
    "Constraint": wb.Constraint("c", X.symbol, 0, 1),
    "Points": BODY.points(*(block.symbol for block in BODY.blocks())),
    "Problem": PROBLEM,
}


@pytest.mark.parametrize("name", SYMBOLIC)
def test_symbolic_things_refuse_pickling_and_can_be_copied(name: str) -> None:
    with pytest.raises(BadArgument, match=f"a {name} cannot be pickled"):
        pickle.dumps(SYMBOLIC[name])
    assert vars(copy.copy(SYMBOLIC[name])) == vars(SYMBOLIC[name])
    assert copy.deepcopy({"it": SYMBOLIC[name]})["it"] is SYMBOLIC[name]


def test_diagnosis_and_posterior_refuse_pickling_by_their_problem() -> None:
    for held in (wb.diagnose(PROBLEM, AT), wb.laplace(PROBLEM, AT)):
        with pytest.raises(BadArgument, match="a Problem cannot be pickled"):
            pickle.dumps(held)


def test_solution_and_body_survive_pickling() -> None:
    solution = wb.solve(PROBLEM, AT)
    again = pickle.loads(pickle.dumps(solution))
    assert again.status is solution.status
    np.testing.assert_array_equal(again.values["x"], solution.values["x"])
    body = pickle.loads(pickle.dumps(BODY))
    np.testing.assert_array_equal(body.vertices(), BODY.vertices())
