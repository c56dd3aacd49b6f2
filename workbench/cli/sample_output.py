"""What `workbench sample` prints once all blocks are drawn: a summary, then each block."""

from collections.abc import Sequence

from rich.console import Console
from rich.markup import escape

from workbench import sampling
from workbench.cli.output import say, warn_of
from workbench.fitting.setup import Setup
from workbench.reports.posterior_summary import (
    BlockPosterior,
    blocks_table,
    contradictions,
    truth_of,
)


def print_posteriors(console: Console, parts: Sequence[BlockPosterior], setup: Setup) -> None:
    """One line for every block, and then all that is known of each."""
    console.print()
    warn_of(console, contradictions(setup, [part.posterior for part in parts]))
    for line in blocks_table(parts, setup).lines():
        say(console, escape(line))
    for part in parts:
        console.print(f"\n[bold]{escape(part.name)}[/]")
        posterior = part.posterior
        say(console, escape(posterior.summary(truth_of(posterior, setup), setup.priors)))
        _print_beside(console, posterior, part.approximation)


def _print_beside(
    console: Console, posterior: sampling.Posterior, approximation: sampling.Posterior
) -> None:
    """How good Laplace's approximation is, and the entries for which it is not good enough."""
    say(console, f"Laplace's approximation: {escape(approximation.verdict)}")
    rows = sampling.compared_with_laplace(posterior, approximation)
    unlike = [row for row in rows if row.remark != "agrees"]
    if not posterior.mixed:
        return
    given = f", conditional too ({posterior.rest})," if posterior.conditional else ""
    agree = f"{len(rows) - len(unlike)} of {len(rows)} entries"
    say(console, escape(f"Laplace's approximation{given} agrees in {agree}"))
    for row in unlike:
        off = f"sd {row.ratio:.2f} times Laplace's, mean off by {row.shift:+.2f} of its sd"
        say(console, f"  {escape(row.label)}: {row.remark} ({off})")
