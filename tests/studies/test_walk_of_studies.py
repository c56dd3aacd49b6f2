"""How often a reader who follows a study from file to file has to turn back."""

from collections.abc import Callable

import pytest

from tests.studies import test_triangle_study as triangles
from tests.walks import walk
from workbench.problem import gram
from workbench.studies.blend_shapes.study import PredictorPlan, predictor_study
from workbench.studies.triangles.study import compare_models

MOST_RETURNS = 10
# A placeholder is as wide as the source that it is given has points. The source is a body's, behind
# the protocol `PointSource` of `blocks/points.py`, so that residuals need not know bodies.
SIZE_OF_POINTS = "blocks/points -> bodies/triangles/sources (SurfaceMeans.count)"


def study_predictors() -> None:
    plan = PredictorPlan("small", training=40, validation=20, test=20, examples=10)
    predictor_study(plan, None, lambda text: None)


def study_triangles() -> None:
    compare_models(triangles.PLAN, triangles.data(), lambda text: None, triangles.OPTIONS)


@pytest.mark.parametrize("study", [study_predictors, study_triangles])
def test_a_study_leads_a_reader_down(
    study: Callable[[], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(triangles.module, "timings", lambda mesh, models: [])
    triangles.data()
    gram.compiled()  # a library is tried out by a callback when it is loaded
    found = walk(study)
    back = found.returns("studies") + found.unrelated("studies")
    assert len(back) <= MOST_RETURNS, found.described("studies")
    climbs = {str(call) for call in found.climbs} - {SIZE_OF_POINTS}
    assert not climbs, found.described("studies")
