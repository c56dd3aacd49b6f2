"""The tables of a comparison that tell where runs ended, as rows of text."""

from collections.abc import Callable
from functools import partial

from workbench.comparison import Comparison, EndAnalysis, Record, TargetOutcome
from workbench.reports.page import Columns, Table, TextRow, number

GOOD = TargetOutcome.REACHED, TargetOutcome.ALONE


def ends_table(comparison: Comparison) -> Table:
    """Where the runs of each solver on each problem ended."""
    columns: dict[str, Callable[[str], str]] = {"problem": str}
    for solver in comparison.solvers:
        columns[solver] = partial(_ends, comparison, solver)
    return Table.of(comparison.problems, columns, ())


def _ends(comparison: Comparison, solver: str, problem: str) -> str:
    """`1 of 3 at f*; 2.13 f* other basin; refused`: how many are at f*, and the others."""
    chosen = comparison.instances_of(problem)
    there, others = 0, list[str]()
    for instance in chosen:
        key = (instance.name, solver)
        record, best = comparison.records[key], comparison.references[instance.name].best
        outcome = comparison.outcomes[key]
        if outcome in GOOD:
            there += 1
        elif key in comparison.basins:
            ratio = f"{number(record.cost / best, 3)} f*" if best > 0 else number(record.cost, 3)
            others.append(f"{ratio} {words_of(outcome)}")
        else:
            others.append(words_of(outcome))
    first = [f"{there} of {len(chosen)} at f*"] if there or len(chosen) > 1 else []
    counted = {text: others.count(text) for text in others}
    return "; ".join(first + [t if n == 1 else f"{n} times {t}" for t, n in counted.items()])


def failures_table(comparison: Comparison) -> Table:
    """Every run that did not end at the lowest cost, and what it said."""
    runs = [(i.name, solver) for i in comparison.instances for solver in comparison.solvers]
    failed = [run for run in runs if comparison.outcomes[run] not in GOOD]

    def said(record: Record) -> str:
        claim = f"{record.claim.lower().replace('_', ' ')}: " if record.claim else ""
        return claim + record.message

    columns: Columns[tuple[str, str]] = {
        "start": lambda run: run[0],
        "solver": lambda run: run[1],
        "the run": lambda run: comparison.outcomes[run].value,
        "cost at its end": lambda run: number(comparison.records[run].cost, 6),
        "optimality": lambda run: number(comparison.records[run].optimality, 2),
        "its message": lambda run: said(comparison.records[run]),
    }
    return Table.of(failed, columns, (3, 4))


def end_analyses(comparison: Comparison, problem: str) -> list[tuple[tuple[str, ...], EndAnalysis]]:
    """The analyses of a problem's ends, one for each data set, with the names of its instances."""
    names = {i.name for i in comparison.instances_of(problem)}
    found = zip(comparison.groups, comparison.end_analyses, strict=True)
    return [(group, analysis) for group, analysis in found if group[0] in names]


def basins_table(comparison: Comparison, problem: str) -> Table:
    """The basins that ends of a problem lead to, of each data set by itself."""
    rows: list[TextRow] = []
    analyses = end_analyses(comparison, problem)
    for names, end_analysis in analyses:
        best = comparison.references[names[0]].best
        of = problem if len(names) > 1 else names[0]
        for k, cost in enumerate(end_analysis.costs):
            who = [s for (name, s), b in comparison.basins.items() if b == k and name in names]
            each = ", ".join(f"{s} {who.count(s)}" for s in dict.fromkeys(who))
            rows.append(
                (
                    of,
                    str(k + 1),
                    number(cost, 8),
                    number(cost - best, 3),
                    number(end_analysis.optimality[k], 2),
                    str(len(who)),
                    each,
                )
            )
    head = ("start", "basin", "cost", "above f*", "optimality", "ends", "whose")
    if len(analyses) == 1:  # of the problem as a whole
        return Table(head[1:], tuple(row[1:] for row in rows), (0, 1, 2, 3, 4))
    return Table(head, tuple(rows), (1, 2, 3, 4, 5))


def words_of(outcome: TargetOutcome) -> str:
    """The name of an outcome in words."""
    return outcome.name.lower().replace("_", " ")
