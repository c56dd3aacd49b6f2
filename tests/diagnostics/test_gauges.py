"""Null directions by name: as known of the zoo, in any unit, declared, weak; least remedies."""

import re
from collections import Counter

import casadi as cs
import numpy as np
import pytest

from tests.diagnostics.further_zoo import FURTHER_ZOO
from tests.diagnostics.zoo import (
    SIMILARITY,
    ZOO,
    Specimen,
    bearings_of_robots,
    joints_of_a_body,
    people_of_one_shape,
    pixels,
    planar_arm,
    problem_of,
    three_cameras,
)
from tests.diagnostics.zoo import turned as moved
from tests.tiers import few
from workbench import Block, Diagnosis, Problem, Residual, Values, diagnose, residuals
from workbench.arrays import Array
from workbench.blocks import Layout
from workbench.diagnostics import Direction, Gauge
from workbench.diagnostics.identifiability import EntryIdentifiability
from workbench.errors import BadArgument

GAUGES = ("translation", "rotation", "scale", "offset", "mixing", "projective", "gauge")
ALL = [pytest.param(one, id=one.name) for one in (*ZOO, *FURTHER_ZOO)]
METRES = {"nm": 1e-9, "um": 1e-6, "mm": 1e-3, "m": 1.0, "km": 1e3}


@pytest.mark.parametrize("specimen", few(ALL, len(ZOO)))
def test_zoo_is_named_and_remedied_as_known(specimen: Specimen) -> None:
    d = diagnose(*specimen.build())
    assert isinstance(d, Diagnosis)
    assert_directions_are_named(d, specimen)
    assert_the_first_remedy_is_least(d, specimen)


def assert_directions_are_named(d: Diagnosis, specimen: Specimen) -> None:
    assert d.shape[1] - d.rank == specimen.numbers == len(d.null_directions)
    kinds = Counter(direction.kind for direction in d.null_directions)
    told = (*GAUGES, "trade-off") if "trade-off" in specimen.gauges else GAUGES
    assert {kind: kinds[kind] for kind in told if kinds[kind]} == specimen.gauges
    vectors = np.array([direction.vector for direction in d.null_directions])
    assert not len(vectors) or np.linalg.matrix_rank(vectors) == specimen.numbers
    J, slices = d.problem.linearize(d.values).jacobian, d.problem.free.slices
    for direction in d.null_directions:
        assert np.linalg.norm(J @ direction.vector) <= d.tolerance, direction.name
        parts = [direction.vector[slices[block]] for block in slices.keys() & read_in(direction)]
        assert not parts or np.any(np.concatenate(parts)), direction.name
    names = "\n".join(direction.name for direction in d.null_directions)
    assert all(word in names for word in specimen.says.split()), names


def read_in(direction: Direction) -> set[str]:
    """What may be names of blocks in that of a direction, behind the word for its kind."""
    return set(re.findall(r"[\w/]+", direction.name.partition(" of ")[2]))


def assert_the_first_remedy_is_least(d: Diagnosis, specimen: Specimen) -> None:
    least = [s for s in d.suggestions if s.kind == "least"]
    assert bool(least) == bool(specimen.numbers)
    if not least:
        return
    assert least[0] is d.suggestions[0] or least[0].acts > 5 > d.suggestions[0].acts
    assert least[0].acts == specimen.acts
    for suggestion in least:
        after = diagnose(suggestion.problem, suggestion.values)
        assert after.rank == after.shape[1], suggestion.what
        # no more was held than was unknown: the data lose no direction
        assert d.shape[1] - after.shape[1] == specimen.numbers


def read_terms(terms: str, free: Layout) -> tuple[int, Array, dict[str, tuple[int, float]]]:
    """The first entry, those said one by one (n,), and of others by block how many, up to what."""
    first, v, rest = -1, np.zeros(free.size), {}
    places = {free.label(i): i for i in range(free.size)}
    for term in re.split(r" with |, (?=[+-]\d|\d+ more of )", terms):
        if counted := re.fullmatch(r"(\d+) more of (.+?)(?: \(up to (\S+).*\))?", term):
            rest[counted[2]] = int(counted[1]), float(counted[3] or "inf")
        else:
            said, _, label = term.partition(" of ")
            v[places[label]] = float(said.split(" ")[0])
            first = places[label] if first < 0 else first
    return first, v, rest


@pytest.mark.parametrize("specimen", few(ALL, 12))
def test_what_is_printed_is_the_direction(specimen: Specimen) -> None:
    """In units, whole: what is not said is counted; all of it changes no residual."""
    d = diagnose(*specimen.build())
    J, free = d.problem.linearize(d.values).jacobian, d.problem.free
    lengths = np.linalg.norm(J, axis=0)
    for one in d.null_directions:
        first, said, rest = read_terms(one.terms, free)
        shown = np.flatnonzero(said)
        v = one.vector / one.vector[first]
        np.testing.assert_allclose(said[shown], v[shown], rtol=6e-3)
        counts = {
            b.name: v[free.slices[b.name]] * (said[free.slices[b.name]] == 0) for b in free.blocks
        }
        assert len(shown) <= 6
        assert len(rest) <= 4
        assert sum(map(np.count_nonzero, counts.values())) == sum(
            count for count, _ in rest.values()
        )
        for name, (count, largest) in rest.items():
            if name in counts:
                assert np.count_nonzero(counts[name]) == count
                assert abs(counts[name]).max() == pytest.approx(largest, rel=6e-3)
        if not rest:
            assert np.linalg.norm(J @ said) <= 6e-3 * np.linalg.norm(lengths * said)
        assert len(shown) > 1 or not lengths[shown].any()  # a trade-off has two sides
        if one.kind in ("trade-off", "mixed"):
            assert one.name.endswith(one.terms)


def names(problem: Problem, at: Values) -> list[str]:
    return [one.name for one in diagnose(problem, at).null_directions]


def test_an_offset_and_a_start_are_said_in_units() -> None:
    """x0 + v (t - t0) with v = 2: half a second for a metre."""
    x0, t0 = Block("x0", (), "m"), Block("t0", (), "s")
    path = x0.symbol + 2 * (cs.DM(np.linspace(0, 3, 9)) - t0.symbol)
    problem = problem_of([Residual("path", path, 0.1, "m")], x0, t0)
    (name,) = names(problem, {"x0": np.array(0.3), "t0": np.array(0.2)})
    assert name == "a trade-off of x0 and t0: +1 m of x0 with +0.5 s of t0"


def test_an_entry_that_residuals_hardly_depend_on_leads() -> None:
    """c moves by a hundred times what a and b do, though what these do matters more."""
    a, b, c = (Block(name, (), "rad") for name in "abc")
    rows = cs.vertcat(a.symbol + b.symbol + 1e-4 * c.symbol, a.symbol + 1.01 * b.symbol)
    problem = problem_of([Residual("r", rows, 1.0)], a, b, c)
    (name,) = names(problem, dict.fromkeys("abc", np.array(0.1)))
    assert name == ("a trade-off of a, b, c: +1 rad of c with -0.0101 rad of a, +0.01 rad of b")


def test_a_common_factor_is_no_offset() -> None:
    f, size, depth = Block("f", (), "px"), Block("size", (), "m"), Block("depth", (), "m")
    width = Residual("width", f.symbol * size.symbol / depth.symbol, 1.0, "px")
    at = {"f": np.array(900.0), "size": np.array(0.3), "depth": np.array(4.0)}
    assert set(names(problem_of([width], f, size, depth), at)) == {
        "a common factor of size and depth",
        "a common factor of f, undone by size",
    }


def test_a_density_in_one_row_is_no_gauge() -> None:
    """sqrt(2 nlp) of a proper Gaussian has level sets, as any single row; the cost is asked."""
    x = Block("x", (3,))
    density = Residual("nlp", cs.sqrt(cs.bilin(cs.diag(cs.DM([1.0, 2, 3])), x.symbol - 1)), 1.0)
    d = diagnose(problem_of([density], x), {"x": np.array([1.5, 0.5, 0.0])})
    assert [one.kind for one in d.null_directions] == ["mixed", "mixed"]
    assert all(one.name.startswith("to first order (0.") for one in d.null_directions)


@pytest.mark.thorough
def test_points_seen_once_leave_the_names_of_others() -> None:
    """Ten cameras and 200 points, 40 of them in one image: they slide along their rays."""
    rng = np.random.default_rng(0)
    X = Block("points", (200, 3), "m")
    blocks, at, seen = [X], {"points": rng.normal(size=(200, 3))}, []
    for k in range(10):
        turn, place = Block(f"cam{k}/turn", (3,), "rad"), Block(f"cam{k}/place", (3,), "m")
        blocks += [turn, place]
        at[turn.name] = rng.normal(scale=0.3, size=3)
        at[place.name] = np.array([0.0, 0.0, 6.0]) + rng.normal(size=3)
        own = [i for i in range(200) if (rng.random() < 0.6 if i < 160 else i % 10 == k)]
        there = moved(turn.symbol, X.symbol[:, own]) + cs.repmat(place.symbol, 1, len(own))
        seen.append(Residual(f"image {k}", pixels(there), 1.0, "px"))
    found = diagnose(problem_of(seen, *blocks), at).null_directions
    assert Counter(one.kind for one in found) == SIMILARITY | {"trade-off": 40}
    slides = [one for one in found if one.kind == "trade-off"]
    assert all(one.name.startswith("a trade-off within points: ") for one in slides)
    assert all(np.count_nonzero(one.vector) == 3 for one in slides)


# Declared, broken and weak ones.


def flat_network() -> tuple[Problem, Values]:
    """Five points in the plane as a vector of ten numbers, which nobody can take for points."""
    x = Block("x", (10,), "m")
    ends = [(i, j) for i in range(5) for j in range(i)]
    apart = [
        cs.norm_2(x.symbol[[2 * i, 2 * i + 1]] - x.symbol[[2 * j, 2 * j + 1]]) for i, j in ends
    ]
    problem = Problem([Residual("r", cs.vertcat(*apart), 0.01, "m")], ("x",), blocks=(x,))
    return problem, {"x": np.random.default_rng(0).normal(size=10)}


def turned(values: Values) -> Values:
    x = values["x"].reshape(5, 2)
    return {"x": np.column_stack([-x[:, 1], x[:, 0]]).ravel()}


def test_a_declared_gauge_gets_its_name() -> None:
    problem, at = flat_network()
    turn = Gauge("a rotation of the plane", turned)
    without, found = diagnose(problem, at), diagnose(problem, at, gauges=[turn])
    named = [d.name for d in found.null_directions if d.kind == "gauge"]
    assert named == ["a rotation of the plane of x"]
    assert not any(d.kind == "gauge" for d in without.null_directions)
    assert found.rank == without.rank == 7
    assert len(found.null_directions) == 3


def test_a_declared_gauge_that_is_none_is_a_warning() -> None:
    problem, at = flat_network()
    growth = Gauge("a change of scale", lambda values: {"x": values["x"]})
    found = diagnose(problem, at, gauges=[growth])
    assert any("a change of scale is declared" in f.text for f in found.warnings)
    assert not any(d.kind == "gauge" for d in found.null_directions)
    with pytest.raises(BadArgument, match="gauges"):
        diagnose(problem, at, gauges=["a change of scale"])  # type: ignore[list-item]


def test_one_distance_takes_the_scale_away() -> None:
    problem, at = three_cameras()
    X = problem.free["points"].symbol
    known = Residual("tape", cs.norm_2(X[:, 0] - X[:, 1]) - 1.0, 0.01, "m")
    more = Problem((*problem.residuals, known), problem.free.names, blocks=problem.free.blocks)
    kinds = [d.kind for d in diagnose(more, at).null_directions]
    assert kinds == ["translation"] * 3 + ["rotation"] * 3


def test_no_words_for_bodies_are_used_of_a_robot() -> None:
    said = diagnose(*planar_arm()).report()
    assert not any(word in said for word in ("pose", "bone", "joint", "body", "shape of"))


def held_loosely(problem: Problem, at: Values, sigma: float) -> Diagnosis:
    """A problem with a wide prior on every block."""
    loose = [
        residuals.gaussian(
            b.symbol, mean=np.ravel(at[b.name]), covariance=sigma**2, unit=b.unit, name=b.name
        )
        for b in problem.free.blocks
    ]
    free = problem.free
    found = diagnose(Problem((*problem.residuals, *loose), free.names, blocks=free.blocks), at)
    assert isinstance(found, Diagnosis)
    return found


def test_gauges_held_by_wide_priors_are_weak() -> None:
    d = held_loosely(*three_cameras(), 10.0)
    assert d.rank == d.shape[1]
    kinds = sorted(one.kind for one in d.weak_directions)
    assert kinds == ["rotation"] * 3 + ["scale"] + ["translation"] * 3
    assert d.weak_count == len(d.weak_directions)
    for one in d.weak_directions:
        assert one.change == pytest.approx(0.1, rel=1e-3), one.name  # a metre of ten


def test_weak_directions_are_apart_from_null_ones() -> None:
    problem, at = joints_of_a_body()
    far = [Residual(r.name, r.expression, 0.5, r.unit, points=r.points) for r in problem.residuals]
    d = diagnose(Problem(far, problem.free.spelled()), at)
    assert isinstance(d, Diagnosis)
    assert d.weak_count == len(d.weak_directions) > 3
    assert all(1e-3 < one.change < 1 for one in d.weak_directions)
    W = np.column_stack([one.vector for one in d.weak_directions])
    N = np.column_stack([one.vector for one in d.null_directions])
    assert np.linalg.matrix_rank(np.column_stack([W, N]), tol=1e-6) == len(W.T) + len(N.T)


def test_a_prior_is_put_on_the_fewest_blocks() -> None:
    d = diagnose(*people_of_one_shape())
    priors = [s for s in d.suggestions if s.kind == "prior"]
    assert [s.acts for s in priors] == [1, 1]
    assert all(s.cured for s in priors)


# Units.


def in_unit(problem: Problem, at: Values, unit: str) -> tuple[Problem, Values]:
    """The same problem with all its lengths in another unit."""
    old = [block for block in problem.free.blocks if block.unit == "m"]
    new = {b.name: Block(b.name, b.shape, unit) for b in old}
    symbols = [b.symbol for b in old]
    metres = [new[b.name].symbol * METRES[unit] for b in old]
    seen = [
        Residual(r.name, cs.graph_substitute([r.expression], symbols, metres)[0], r.sigma, r.unit)
        for r in problem.residuals
    ]
    blocks = [new.get(b.name, b) for b in problem.free.blocks]
    there = {n: x / METRES[unit] if n in new else x for n, x in at.items()}
    return Problem(seen, problem.free.names, blocks=blocks), there


def turn_against_shift() -> tuple[Problem, Values]:
    """A turn by a radian moves by a centimetre what a translation moves too."""
    turn, place = Block("turn", (2,), "rad"), Block("place", (2,), "m")
    (a, b), (x, y) = cs.vertsplit(turn.symbol), cs.vertsplit(place.symbol)
    seen = cs.vertcat(0.01 * a + x, 2 * (0.01 * a + x) + b, b - y, b + y)
    problem = Problem([Residual("r", seen, 0.001, "m")], ("turn", "place"), blocks=(turn, place))
    return problem, {"turn": np.array([0.1, 0.2]), "place": np.array([0.3, 0.4])}


@pytest.mark.parametrize("unit", few(["mm", "um", "km"], 1))
def test_no_verdict_depends_on_a_unit(unit: str) -> None:
    problem, at = turn_against_shift()
    metres, other = diagnose(problem, at), diagnose(*in_unit(problem, at, unit))
    assert metres.identifiability.verdicts == other.identifiability.verdicts
    assert other.identifiability.verdicts[2] == EntryIdentifiability.NUMERICAL
    sizes = np.array([1, 1, METRES[unit], METRES[unit]])
    np.testing.assert_allclose(
        other.identifiability.sigma * sizes, metres.identifiability.sigma, rtol=1e-9
    )
    assert said(metres) == said(other)


def said(d: Diagnosis | object) -> list[str]:
    assert isinstance(d, Diagnosis)
    names = [x.name.partition(": ")[0] for x in d.null_directions]  # what follows is in units
    return names + [s.what for s in d.suggestions if s.acts > 1]


@pytest.mark.parametrize("build", few([bearings_of_robots, three_cameras], 1))
@pytest.mark.parametrize("unit", few(["nm", "mm", "um", "km"], 1))
def test_no_gauge_and_no_remedy_depends_on_a_unit(build, unit: str) -> None:
    problem, at = build()
    assert said(diagnose(*in_unit(problem, at, unit))) == said(diagnose(problem, at))
