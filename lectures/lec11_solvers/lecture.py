# %% [markdown]
# # One problem, many solvers
#
# **Which solver should we take, and how would we know?**
#
# The workbench has more than twenty solvers, and for each of them there is a paper in which it is the best. We let
# four of them run on sixteen classical problems, and try the usual ways of comparing them, which all mislead us. We end
# with ways that hold: the same targets for all, effort in one currency, failures that count, and intervals around
# what was counted. Costs in this lecture are pure numbers, and so is effort: it is counted in residuals.

# %%
from math import comb

import casadi as cs
import numpy as np

import workbench as wb
from workbench.comparison.statistics import performance_profile, rate, ratios
from workbench.comparison.targets import TAUS, ReferenceCosts
from workbench.course import Picture, source
from workbench.experiments.more_wild import MORE_WILD
from workbench.geometry.rotation import matrix_from_vector, rodrigues
from workbench.lectures.material.race import Plane, Way, race_page
from workbench.lectures.material.wilson import wilson
from workbench.plots import house_style, sheet

# %% [markdown]
# ## One problem, one start
#
# Rosenbrock's valley is the least-squares problem of $10\,(x_2 - x_1^2)$ and $1 - x_1$, from
# $(-1.2, 1)$. The helical valley is another problem of that age. Which solver is better?

# %% slide [markdown]
# ## More than twenty solvers, each the best in its paper
#
# - Four of them, sixteen classical problems
# - Rosenbrock's valley: $10\,(x_2 - x_1^2)$ and $1 - x_1$, from $(-1.2, 1)$

# %%
NAMES = ("gauss-newton", "levenberg-marquardt", "dogleg", "nlopt-lbfgs")
every = {one.name.removeprefix("more-wild-"): one for one in MORE_WILD}
PROBLEMS = [
    "rosenbrock",
    "rosenbrock-far",
    "helical-valley",
    "helical-valley-far",
    "powell-singular",
    "powell-singular-far",
    "freudenstein-roth",
    "freudenstein-roth-far",
    "bard",
    "bard-far",
    "kowalik-osborne",
    "box",
    "jennrich-sampson",
    "brown-dennis",
    "brown-dennis-far",
    "osborne-1",
]
setups = {name: every[name].setup() for name in PROBLEMS}
solutions = {
    (name, solver): wb.solve(setup.problem, setup.start, wb.SOLVERS[solver])
    for name, setup in setups.items()
    for solver in NAMES
}


def table(name):
    """What the solvers say of themselves."""
    for solver in NAMES:
        one = solutions[name, solver]
        print(
            f"  {solver:20} {one.iterations:4} iterations, cost {one.cost:8.2e}, says {one.status.name}"
        )


for name in ("rosenbrock", "helical-valley"):
    print(name)
    table(name)

# %% slide [markdown]
# ## Who has the fewest iterations? It depends
#
# | iterations | Rosenbrock | helical valley |
# | --- | --- | --- |
# | Gauss-Newton | {{ solutions["rosenbrock", NAMES[0]].iterations}} | {{ solutions["helical-valley", NAMES[0]].iterations}} |
# | Levenberg-Marquardt | {{ solutions["rosenbrock", NAMES[1]].iterations}} | {{ solutions["helical-valley", NAMES[1]].iterations}} |
# | dogleg | {{ solutions["rosenbrock", NAMES[2]].iterations}} | {{ solutions["helical-valley", NAMES[2]].iterations}} |
# | L-BFGS | {{ solutions["rosenbrock", NAMES[3]].iterations}} | {{ solutions["helical-valley", NAMES[3]].iterations}} |

# %% [markdown]
# On the first Gauss-Newton has the fewest iterations, on the second
# Levenberg-Marquardt{{ [min(NAMES, key=lambda s: solutions[name, s].iterations) for name in ('rosenbrock', 'helical-valley')] == list(NAMES[:2]) }}.
# So the answer depends on
# the problem. Moreover, an iteration is not the same thing for every solver: one of Gauss-Newton may try many steps,
# and one of L-BFGS (a method that knows gradients only, and builds a picture of the second derivatives from them)
# takes no Jacobian at all. Nor do solvers mean the same when they report how they ended: L-BFGS has come down to a
# cost of {{ solutions['rosenbrock', 'nlopt-lbfgs'].cost:.0e}}, and says that it
# stalled{{ solutions['rosenbrock', 'nlopt-lbfgs'].status.name == 'STALLED' }}. The opposite is worse:

# %% slide [markdown]
# ## An iteration is not the same thing twice
#
# - Gauss-Newton may try many steps in one; L-BFGS takes no Jacobian at all.
# - L-BFGS at a cost of {{ solutions['rosenbrock', 'nlopt-lbfgs'].cost:.0e}}: it says
#   `{{ solutions['rosenbrock', 'nlopt-lbfgs'].status.name }}`.
# - The opposite is worse.

# %%
for name in ("bard-far", "freudenstein-roth"):
    print(f"{name}, least cost known {setups[name].known.cost:.2e}")
    table(name)

# %% slide [markdown]
# ## "Converged", to the wrong place
#
# - Freudenstein-Roth: {{ sum(solutions['freudenstein-roth', s].status.name == 'CONVERGED' for s in NAMES)}}
#   of four say `CONVERGED` at {{ solutions['freudenstein-roth', 'dogleg'].cost:.1f}};
#   {{ setups['freudenstein-roth'].known.cost:.0f}} can be reached.
# - They are not wrong: a *stationary point* is all that they can see.

# %% [markdown]
# On the second problem {{ sum(solutions['freudenstein-roth', s].status.name == 'CONVERGED' for s in NAMES)}} of the
# four say `CONVERGED` at a cost of {{ solutions['freudenstein-roth', 'dogleg'].cost:.1f}}, although
# {{ setups['freudenstein-roth'].known.cost:.0f}} can be reached.
# They are not wrong: the gradient does vanish there. A *stationary point* is all that these methods can
# see. On the first problem Gauss-Newton ends at
# {{ solutions['bard-far', 'gauss-newton'].cost / setups['bard-far'].known.cost:,.0f}} times the least cost, where the
# cost still falls a little while unknowns run off, and says
# `{{ solutions['bard-far', 'gauss-newton'].status.name}}`{{ solutions['bard-far', 'gauss-newton'].diverging != () }}.
# So whoever counts
# "converged" counts all stationary points, and whoever compares times lets a solver win by stopping early.

# %% slide [markdown]
# ## Two ways to be misled
#
# - Count "converged", and you count all stationary points.
# - Compare times, and a solver wins by stopping early.

# %% [markdown]
# ## Counting what was spent
#
# A fair comparison needs a common currency. The workbench counts what each solver asked for, whatever it
# says. We say that a residual costs 1, a gradient 4 (going backwards through a program costs a few times
# the program, whatever the number of unknowns), and a Jacobian $n$, one residual for each unknown, as
# finite differences need them.
# These prices are a choice, and one that is easily made in somebody's favour; so it has to be said.


# %% slide [markdown]
# ## A common currency
#
# - Residual: 1. Gradient: 4. Jacobian: $n$
# - Count what each solver *asked for*, whatever it says.
# - Prices are a choice; so they have to be said.


# %%
def course_of(name, solver):
    """Effort (k,) in residuals and cost (k,) along a run."""
    n = setups[name].start["x"].size
    effort = [
        i.evaluations.residual + 4 * i.evaluations.gradient + n * i.evaluations.jacobian
        for i in solutions[name, solver].trace
    ]
    return np.array(effort), np.array([i.cost for i in solutions[name, solver].trace])


runs = {(name, solver): course_of(name, solver) for name in PROBLEMS for solver in NAMES}
least = {
    name: min([setups[name].known.cost, *(runs[name, solver][1].min() for solver in NAMES)])
    for name in PROBLEMS
}


def arrived(name):
    """Which solvers end within a thousandth of the way to the least cost."""
    ends = [runs[name, solver][1] for solver in NAMES]
    return [bool(cost.min() - least[name] <= 1e-3 * (cost[0] - least[name])) for cost in ends]


def plane(name):
    """The runs on a problem of two unknowns, and its cost."""
    ways = {}
    for solver in NAMES:
        x = np.array([i.values["x"] for i in solutions[name, solver].trace])
        effort, cost = runs[name, solver]
        ways[solver] = Way(x, effort, (cost - least[name]) / (cost[0] - least[name]))
    best = min(ways.values(), key=lambda way: way.left[-1]).x[-1]
    return Plane(
        setups[name].problem.costs(*setups[name].problem.split(setups[name].start), None),
        best,
        ways,
    )


with house_style():
    figure, axes = sheet(10, 3.8, columns=2)
    for ax, name in zip(axes, ("rosenbrock", "bard-far"), strict=True):
        for solver, dash in zip(NAMES, ("-", "--", "-.", ":"), strict=True):
            effort, cost = runs[name, solver]
            left = (cost - least[name]) / (cost[0] - least[name])
            ax.loglog(np.maximum(effort, 1), np.maximum(left, 1e-16), dash, label=solver)
        ax.axhline(1e-5, color="0.6", lw=0.8)
        ax.set(title=name, xlabel="effort (residuals)", ylabel="share of the way that is left")
    axes[0].legend(fontsize=8)
Picture(
    figure,
    "Cost above the least one known, as a share of that at the start. Left: all arrive, and who is "
    "ahead changes on the way. Right: two arrive; the others stall on the way. The "
    "grey line is a target, the same for all. Below 1e-16 is drawn at 1e-16.",
    lambda: race_page({name: plane(name) for name in ("rosenbrock", "freudenstein-roth")}, 1e-5),
)

# %% slide still [markdown]
# ## Who is ahead changes on the way
#
# - Left, all arrive; right, two do. The grey line is a target, the same for all.

# %% slide [markdown]
# ## Run the race
#
# - Effort in residuals; the same target for everybody
# - Freudenstein-Roth: where do they end?

# %% [markdown]
# ## Targets
#
# So no solver is asked whether it has
# arrived{{ arrived('rosenbrock') == [True] * 4 and arrived('bard-far') == [False, True, False, True] }}. [Moré and
# Wild](https://doi.org/10.1137/080724083) (2009) take the lowest cost $f^*$ that is known for the problem, from
# anybody, and the cost $f_0$ at the start. A run meets the **target**
# $\tau$ when it visits a point with
#
# $$ f - f^* \le \tau\, (f_0 - f^*) , $$
#
# and its effort is what it had spent by then, or infinite if it never meets the target. The workbench
# does the same, with room for rounding:

# %% slide [markdown]
# ## Targets
#
# $$ f - f^* \le \tau\, (f_0 - f^*) $$
#
# - $f^*$: the lowest cost known, from anybody; $f_0$: the cost at the start
# - Effort: what was spent by then, **infinite** if the target is never met

# %%
source(ReferenceCosts.target)


# %%
def needed(tau):
    """(P, S) residuals until the target; infinite if it was never met."""
    found = np.full((len(PROBLEMS), len(NAMES)), np.inf)
    for p, name in enumerate(PROBLEMS):
        for s, solver in enumerate(NAMES):
            effort, cost = runs[name, solver]
            below = np.flatnonzero(cost - least[name] <= tau * (cost[0] - least[name]))
            if len(below):
                found[p, s] = effort[below[0]]
    return found


times = needed(1e-5)
print(f"{'':24}" + "".join(f"{solver:>21}" for solver in NAMES))
for name, row in zip(PROBLEMS, times, strict=True):
    print(f"{name:24}" + "".join(f"{t:21.0f}" if np.isfinite(t) else f"{'-':>21}" for t in row))
met = np.isfinite(times)
print(f"{'met':24}" + "".join(f"{count:21}" for count in met.sum(axis=0)))
means = [times[m, s].mean() for s, m in enumerate(met.T)]
print(f"{'mean where it was met':24}" + "".join(f"{mean:21.0f}" for mean in means))
print(f"{'median, - as infinite':24}" + "".join(f"{t:21.0f}" for t in np.median(times, axis=0)))

# %% slide [markdown]
# ## Sixteen problems, $\tau = 10^{-5}$
#
# | | met | mean where met | median, failures infinite |
# | --- | --- | --- | --- |
# | Gauss-Newton | {{ met.sum(axis=0)[0]}} | {{ means[0]:.0f}} | {{ np.median(times, axis=0)[0]:.0f}} |
# | Levenberg-Marquardt | {{ met.sum(axis=0)[1]}} | {{ means[1]:.0f}} | {{ np.median(times, axis=0)[1]:.0f}} |
# | dogleg | {{ met.sum(axis=0)[2]}} | {{ means[2]:.0f}} | {{ np.median(times, axis=0)[2]:.0f}} |
# | L-BFGS | {{ met.sum(axis=0)[3]}} | {{ means[3]:.0f}} | {{ np.median(times, axis=0)[3]:.0f}} |

# %% [markdown]
# Look at the last lines. By the **mean over the problems that were solved** Gauss-Newton takes
# {{ means[0] / means[2]:.1f}} times as long as the dogleg, by the median
# {{ np.median(times[:, 0]) / np.median(times[:, 2]):.1f}} times: one problem, brown-dennis, makes up
# {{ 100 * times[PROBLEMS.index('brown-dennis'), 0] / times[met[:, 0], 0].sum():.0f}} % of its
# mean{{ met.sum(axis=0)[0] < met.sum(axis=0)[2] < len(PROBLEMS) }}. Such a mean also leaves out the problems on which
# a solver fails, which are often the hard ones.
# The median, with failures as infinite, has neither fault, but it is a single number.

# %% slide [markdown]
# ## Take no mean over successes
#
# - One problem, brown-dennis, is
#   {{ 100 * times[PROBLEMS.index('brown-dennis'), 0] / times[met[:, 0], 0].sum():.0f}} % of Gauss-Newton's
#   mean.
# - A mean leaves out the problems on which a solver fails: often the hard ones.
# - A median with failures as infinite has neither fault, and is one number.

# %% [markdown]
# One target is not enough either. The far start of freudenstein-roth costs so much that $10^{-5}$ of
# the way is met at the wrong stationary point. Closer targets show it:

# %%
for tau in TAUS:
    count = np.isfinite(needed(tau)).sum(axis=0)
    print(
        f"tau = {tau:5g}: met by "
        + ", ".join(f"{s} {k}" for s, k in zip(NAMES, count, strict=True))
        + " of 16"
    )

# %% slide [markdown]
# ## One target is not enough
#
# - Met at $10^{-5}$ by the dogleg: {{ np.isfinite(needed(1e-5)).sum(axis=0)[2]}}; at {{ TAUS[-1]:g}}:
#   {{ np.isfinite(needed(TAUS[-1])).sum(axis=0)[2]}} of 16
# - From a far start, $10^{-5}$ of the way is met at a wrong stationary point.

# %% [markdown]
# At the closest target {{ np.isfinite(needed(TAUS[-1])).sum(axis=0).max()}} of the 16 are met at
# most{{ met[PROBLEMS.index('freudenstein-roth-far')].all() and not np.isfinite(needed(1e-7))[PROBLEMS.index('freudenstein-roth-far')].any() }}.
#
# ## Performance profiles
#
# Problems differ in size. So Dolan and Moré ([*Benchmarking Optimization Software with Performance
# Profiles*](https://doi.org/10.1007/s101070100263), 2002) divide the effort $t_{ps}$ of solver $s$ on problem $p$ by
# that of the best solver on the same problem,
# $r_{ps} = t_{ps} / \min_s t_{ps}$. Then
#
# $$ \rho_s(\alpha) = \text{share of all problems on which } r_{ps} \le \alpha $$
#
# says how often $s$ is within a factor $\alpha$ of the best. As a function of $\alpha$ it is called the
# **performance profile** of $s$. At $\alpha = 1$ it says how often $s$ *is* the best. Far to the right it says how
# often $s$ meets the target at all.

# %% slide [markdown]
# ## Performance profiles
#
# $$ \rho_s(\alpha) = \text{share of all problems on which } \frac{t_{ps}}{\min_s t_{ps}} \le \alpha $$
#
# - How often is $s$ within a factor $\alpha$ of the best?
# - $\alpha = 1$: how often it *is* the best. Far right: how often it arrives at all

# %%
source(ratios)

# %%
source(performance_profile)

# %%
alphas = np.geomspace(1, 30, 300)
shares = performance_profile(times, alphas)
with house_style():
    figure, (ax,) = sheet(7.5, 4)
    for s, (solver, dash) in enumerate(zip(NAMES, ("-", "--", "-.", ":"), strict=True)):
        ax.step(alphas, 100 * shares[:, s], dash, where="post", label=solver)
    ax.set(
        xscale="log",
        xlabel="effort over the least of all (ratio α)",
        ylabel="share of the problems (%)",
        ylim=(0, 103),
    )
    ax.set_xticks([1, 2, 5, 10, 20], ["1", "2", "5", "10", "20"])
    ax.minorticks_off()
    ax.legend()
Picture(
    figure,
    "Performance profiles for the target 1e-5. At the left edge: how often a solver is the "
    "quickest of all. At the right edge: how often it arrives at all. L-BFGS is never the "
    "quickest, and as reliable as the dogleg; Levenberg-Marquardt is mostly the quickest, and "
    "Gauss-Newton the least reliable.",
)

# %% slide [markdown]
# ## Quick at the left, reliable at the right
#
# - Levenberg-Marquardt is the quickest on {{ 100 * shares[0, 1]:.0f}} %, L-BFGS on
#   {{ 100 * shares[0, 3]:.0f}} %, and it arrives as often as the
#   dogleg.{{ met.sum(axis=0)[3] == met.sum(axis=0)[2] }}

# %% [markdown]
# ## What a profile does not say
#
# At the left edge Levenberg-Marquardt has {{ 100 * shares[0, 1]:.0f}} %, L-BFGS {{ 100 * shares[0, 3]:.0f}}
# %{{ met.sum(axis=0)[3] == met.sum(axis=0)[2] > met.sum(axis=0)[0] }}. The ratio is taken to the best *of those
# present*. Take one solver out, and on each problem on which
# it alone was the best, another one becomes the best. So the order of two solvers can turn because a
# third one has left (Gould and Scott, [*A Note on Performance Profiles for Benchmarking
# Software*](https://doi.org/10.1145/2950048), 2016): a profile of many solvers is no ranking. To learn which of two is
# better, compare these two alone.

# %%
quickest = {}
for kept in (NAMES, NAMES[:2] + NAMES[3:], NAMES[1:]):
    at = [NAMES.index(solver) for solver in kept]
    first = performance_profile(times[:, at], [1.0])[0]
    quickest.setdefault(len(kept), first)
    told = ", ".join(
        f"{solver} {100 * share:.0f} %" for solver, share in zip(kept, first, strict=True)
    )
    print(f"quickest among {len(kept)}: {told}")

# %% slide [markdown]
# ## A profile of many solvers is no ranking
#
# - The ratio is to the best *of those present*: take one out, and the others move.
# - Without the dogleg, Gauss-Newton is the quickest on {{ 100 * quickest[3][0]:.0f}} % in place of
#   {{ 100 * quickest[4][0]:.0f}} %.
# - Which of two is better? Compare these two alone.

# %% [markdown]
# Without the dogleg, Gauss-Newton's share rises from {{ 100 * quickest[4][0]:.0f}} to {{ 100 * quickest[3][0]:.0f}}
# %{{ quickest[3][0] >= quickest[4][0] }}. Prices matter, too. A Jacobian may be as cheap as one residual, where both
# share their work, or as
# expensive as ten, where it comes from slower code. With these prices:

# %%
for price, said in ((1, "1 residual"), (10, "10 residuals")):
    changed = np.full_like(times, np.inf)
    for p, name in enumerate(PROBLEMS):
        for s, solver in enumerate(NAMES):
            cost = runs[name, solver][1]
            below = np.flatnonzero(cost - least[name] <= 1e-5 * (cost[0] - least[name]))
            if len(below):
                e = solutions[name, solver].trace[below[0]].evaluations
                changed[p, s] = e.residual + 4 * e.gradient + price * e.jacobian
    first = performance_profile(changed, [1.0])[0]
    print(
        f"a Jacobian for {said:12}: quickest "
        + ", ".join(f"{s} {100 * share:.0f} %" for s, share in zip(NAMES, first, strict=True))
    )

# %% slide [markdown]
# ## Prices matter, too
#
# - A Jacobian for ten residuals: Levenberg-Marquardt is the quickest on {{ 100 * first[1]:.0f}} %, L-BFGS on
#   {{ 100 * first[3]:.0f}} %.
# - At the price of $n$: {{ 100 * quickest[4][1]:.0f}} % and {{ 100 * quickest[4][3]:.0f}} %

# %% [markdown]
# (Shares may add up to more than 100 %, because two solvers can be the quickest at once.)
#
# ## Chance
#
# Sixteen problems are a sample. Had we drawn others, the counts would be others. How sure can we be of a share that
# was counted? Let $p$ be the true share of successes, and $\hat p = k / n$ the share that we found, with $k$ successes
# in $n$ trials. The standard deviation of $\hat p$ is $\sqrt{p (1 - p) / n}$. So with a probability of about 95 % it is
# no further than $z = 1.96$ times that from $p$. Wilson ([*Probable Inference, the Law of Succession, and Statistical
# Inference*](https://doi.org/10.1080/01621459.1927.10502953), 1927) takes the interval of all $p$ for which this is so,
#
# $$ (\hat p - p)^2 \le z^2\, \frac{p (1 - p)}{n} . $$
#
# This is a quadratic inequality in $p$. Multiplied out and sorted by powers of $p$, it is
#
# $$ \left( 1 + \frac{z^2}{n} \right) p^2 - 2 \left( \hat p + \frac{z^2}{2 n} \right) p + \hat p^2 \le 0 , $$
#
# which holds between the two zeros of its left side. So the ends of the interval are
#
# $$ \frac{\hat p + \frac{z^2}{2n} \pm z \sqrt{\frac{\hat p (1 - \hat p)}{n} + \frac{z^2}{4 n^2}}}
#         {1 + \frac{z^2}{n}} . $$
#
# The interval that is usually taken, $\hat p \pm z \sqrt{\hat p (1 - \hat p) / n}$, puts $\hat p$ in the place of $p$
# in the standard deviation, and so it shrinks to a point: at 0 and at $n$ successes.

# %% slide [markdown]
# ## Chance: a share has an interval
#
# $$ (\hat p - p)^2 \le z^2\, \frac{p (1 - p)}{n} $$
#
# - Wilson, 1927: all $p$ for which $\hat p = k/n$ is within $z = 1.96$ deviations
# - The usual $\hat p \pm z \sqrt{\hat p (1 - \hat p) / n}$ shrinks to a point at 0 and at $n$.

# %%
source(wilson)

# %%
intervals = [wilson(int(count), len(PROBLEMS)) for count in met.sum(axis=0)]
for solver, found in zip(NAMES, intervals, strict=True):
    print(
        f"{solver:20} meets the target on {100 * found.value:3.0f} % of such problems, "
        f"between {100 * found.low:.0f} and {100 * found.high:.0f} %"
    )

# %% slide [markdown]
# ## Sixteen problems do not tell who is the most reliable
#
# | | met | between |
# | --- | --- | --- |
# | Gauss-Newton | {{ 100 * intervals[0].value:.0f}} % | {{ 100 * intervals[0].low:.0f}} and {{ 100 * intervals[0].high:.0f}} % |
# | Levenberg-Marquardt | {{ 100 * intervals[1].value:.0f}} % | {{ 100 * intervals[1].low:.0f}} and {{ 100 * intervals[1].high:.0f}} % |
# | dogleg | {{ 100 * intervals[2].value:.0f}} % | {{ 100 * intervals[2].low:.0f}} and {{ 100 * intervals[2].high:.0f}} % |
# | L-BFGS | {{ 100 * intervals[3].value:.0f}} % | {{ 100 * intervals[3].low:.0f}} and {{ 100 * intervals[3].high:.0f}} % |
#
# - All overlap. That is a result, too.

# %% [markdown]
# The intervals overlap{{ max(one.low for one in intervals) < min(one.high for one in intervals) }}: sixteen problems
# do not tell which of these four is the most reliable. That is
# a result, too. Pairs tell more: since all four had the same starts, one may compare two solvers at a
# time, on the problems on which exactly one of the two arrived.
#
# Two warnings. Wilson's interval covers the truth in 95 % of the cases *on average* over all true shares;
# for some of them it covers less. With three trials, how often does it cover the true share, for the share where
# it does worst?


# %%
def worst(interval, trials):
    """The least probability, over true shares p, that the interval of a count holds p."""
    every = [interval(k, trials) for k in range(trials + 1)]
    lowest = 1.0
    for p in np.linspace(0.001, 0.999, 999):
        inside = np.array([one.low <= p <= one.high for one in every])
        chances = np.array(
            [comb(trials, k) * p**k * (1 - p) ** (trials - k) for k in range(trials + 1)]
        )
        lowest = min(lowest, float(chances[inside].sum()))
    return lowest


for interval in (wilson, rate):
    print(
        f"{interval.__name__}: with 3 trials covers the true share, where it does worst, "
        f"in {100 * worst(interval, 3):.1f} % of the cases"
    )

# %% slide [markdown]
# ## Intervals, where they do worst
#
# - Three trials: Wilson's covers the truth in {{ 100 * worst(wilson, 3):.0f}} % of the cases, Clopper and
#   Pearson's in {{ 100 * worst(rate, 3):.0f}} %.
# - All of this counts *independent* trials: ten starts are not ten problems.

# %% [markdown]
# Wilson's covers it in {{ 100 * worst(wilson, 3):.0f}} % of the cases. `rate` is the interval of [Clopper and
# Pearson](https://doi.org/10.1093/biomet/26.4.404) (1934), which promises 95 % whatever the share is, and is wider for
# that reason{{ worst(rate, 3) >= 0.95 }}. And all of this counts *independent* trials. Ten starts of one problem are
# not ten problems: whoever is good at the problem is good from most of its starts.
#
# `workbench compare` does all of this on suites, each run in a process of its own that can be stopped,
# and writes it as a page. Its intervals are Clopper and Pearson's, its pairs are tested on problems and
# not on starts, and its prices are printed: 4 for a gradient as here, which is the bound of Griewank and
# Walther ([*Evaluating Derivatives*](https://doi.org/10.1137/1.9780898717761), 2008) for any program, and n + 1 for
# residual and Jacobian together, what differences would take. Times rank no solver: seconds stand beside the counts,
# with their spread.

# %% slide [markdown]
# ## What `workbench compare` does
#
# - Each run in a process of its own; intervals of Clopper and Pearson
# - Pairs are tested on problems, not on starts.
# - Prices are printed; seconds stand beside counts and rank nobody.

# %% [markdown]
# ## When not every point is allowed
#
# So far every point was allowed. Now eight markers were turned by 90 degrees, and we look for the turn as a
# matrix: nine numbers $R$, of which only those with $R^\top R = I$ are rotations. These are six equations.
# Our four solvers know nothing of equations and refuse the problem. Two others take it: SQP, which puts the
# linearized equations into each step, and IPOPT, an interior-point method (Waechter and Biegler, [*On the
# implementation of an interior-point filter line-search algorithm*](https://doi.org/10.1007/s10107-004-0559-y), 2006).
# The same turn as a rotation vector, three numbers, needs no equations, and all six can be asked.

# %% slide [markdown]
# ## When not every point is allowed
#
# $$ \min_R \|R x - y\|^2 \quad \text{with} \quad R^\top R = I $$
#
# - Nine numbers and six equations, or three numbers and none
# - Four solvers refuse the equations; SQP and IPOPT take them.

# %%
rng = np.random.default_rng(0)
markers = rng.normal(size=(8, 3))
turn = np.array([0.0, 0.0, np.pi / 2])
observed = markers @ matrix_from_vector(turn).T + 0.01 * rng.normal(size=(8, 3))  # m

matrix = wb.Block("matrix", (3, 3))
vector = wb.Block("vector", (1, 3), "rad")
R = matrix.symbol.T  # a symbol of a block (N, 3) is (3, N)
orthonormal = R.T @ R
upper = [(i, j) for i in range(3) for j in range(i, 3)]
six = wb.Constraint(
    "R'R = I",
    cs.vertcat(*(orthonormal[i, j] for i, j in upper)),
    [float(i == j) for i, j in upper],
    [float(i == j) for i, j in upper],
)


def away(rotation):
    """How far the turned markers are from the observed ones."""
    return wb.Residual("markers", cs.vec(rotation @ markers.T - observed.T), 0.01, unit="m")


forms = {
    "nine numbers": (wb.Problem([away(R)], ["matrix"], constraints=[six]), {"matrix": np.eye(3)}),
    "three numbers": (
        wb.Problem([away(rodrigues(vector.symbol))], ["vector"]),
        {"vector": np.zeros((1, 3))},
    ),
}
answers = {}
for form, (problem, start) in forms.items():
    print(form)
    for solver in (*NAMES, "sqp", "ipopt"):
        try:
            one = answers[form, solver] = wb.solve(problem, start, wb.SOLVERS[solver])
        except wb.WorkbenchError as error:
            print(f"  {solver:20} {str(error).partition(';')[0]:.70}")
            continue
        print(
            f"  {solver:20} {one.iterations:3} iterations, cost {one.cost:.4f}, says {one.status.name}"
        )

turns_found = [
    one.values["matrix"]
    if form == "nine numbers"
    else matrix_from_vector(one.values["vector"].ravel())
    for (form, _), one in answers.items()
]

# %% slide [markdown]
# ## Six answers with three numbers, two with nine
#
# - SQP: {{ answers["nine numbers", "sqp"].iterations}} iterations with nine numbers,
#   {{ answers["three numbers", "sqp"].iterations}} with three
# - IPOPT: {{ answers["nine numbers", "ipopt"].iterations}} and
#   {{ answers["three numbers", "ipopt"].iterations}}
# - All find the same turn.{{ np.ptp(turns_found, axis=0).max() < 1e-5 }}

# %% [markdown]
# All that answer find the same
# turn{{ {solver for form, solver in answers if form == 'nine numbers'} == {'sqp', 'ipopt'} and len(answers) == 8 and np.ptp(turns_found, axis=0).max() < 1e-5 }}.
# But on the way the nine numbers are no rotation: the equations hold at the end and nowhere in between.


# %%
def squeezed(values):
    """The largest entry of R'R - I."""
    found = values["matrix"]
    return np.abs(found.T @ found - np.eye(3)).max()


off_rotation = {
    solver: [squeezed(i.values) for i in answers["nine numbers", solver].trace]
    for solver in ("ipopt", "sqp")
}
with house_style():
    figure, (ax,) = sheet(7.5, 3.8)
    for (solver, off), dash in zip(off_rotation.items(), ("-", "--"), strict=True):
        ax.semilogy(np.maximum(off, 1e-12), dash, marker=".", label=solver)
    ax.set_xlabel("iteration")
    ax.set_ylabel("largest entry of R'R - I")
    ax.legend()
Picture(
    figure,
    "Nine numbers: how far each iterate is from a rotation. The start is one, the identity. The first step "
    "leaves the rotations, and the later ones come back to them.",
)

# %% slide [markdown]
# ## Rotations at the end, and nowhere in between
#
# - Largest entry of $R^\top R - I$ on the way: {{ max(off_rotation["sqp"]):.1f}} (SQP),
#   {{ max(off_rotation["ipopt"]):.1f}} (IPOPT)

# %% [markdown]
# Whoever only wants a rotation is better off with three numbers
# here{{ all(way[0] == 0 and way[-1] < 1e-6 < min(way[1:-1]) for way in off_rotation.values()) }}: fewer unknowns, no
# equations, and every
# point on the way is a turn. Over five problems with twenty draws of noise, `examples/16_nine_numbers_or_three.py`
# measures when that holds and when not. Equations are the way where no such coordinates exist: feet that
# stand on the floor, weights that sum to one.
#
# ## What to remember
#
# - Do not rely on what a solver says of itself: not on its status, its tolerance or its counts.
# - Set targets from the best known cost, and measure effort in one currency with stated prices. The
#   effort of a failure is infinite.
# - Take no mean over successes. A profile shows at its left who is quick and at its right who is
#   reliable, and does not rank many solvers.
# - A share of a few problems has an interval. State it.
# - Bounds and equations are taken by few solvers. The others refuse the problem; none of them ignores an
#   equation.

# %% slide [markdown]
# ## What to remember
#
# - Do not rely on what a solver says of itself. Targets from the best known cost, effort in one currency
# - Failures are infinite. A profile shows who is quick and who is reliable, and ranks no crowd.
# - A share of a few problems has an interval. State it.
