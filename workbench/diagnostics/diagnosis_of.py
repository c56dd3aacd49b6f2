"""A diagnosis that can say in words what it found."""

from workbench.blocks import Values
from workbench.diagnostics.data import as_data
from workbench.diagnostics.diagnosis import Diagnosis
from workbench.diagnostics.gauges import Gauge
from workbench.diagnostics.remedies import advise
from workbench.diagnostics.report import findings, report, summary
from workbench.diagnostics.wording import Wording
from workbench.problem import Linearization, Problem

WORDING = Wording(findings, summary, report, as_data, advise)


def diagnosis_of(
    problem: Problem,
    at: Values,
    here: Linearization,
    priors: tuple[str, ...] = (),
    gauges: tuple[Gauge, ...] = (),
    scales: Values | None = None,
) -> Diagnosis:
    """The diagnosis of a problem from its linearization; see `Diagnosis` for the arguments."""
    return Diagnosis(problem, at, here, WORDING, priors, gauges, scales or {})
