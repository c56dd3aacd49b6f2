"""What is typed for an argument, and what the builder gets."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from workbench.errors import BadArgument, UnknownName
from workbench.experiments import find
from workbench.experiments.experiment import converted

CONVERTED: list[tuple[object, object, object]] = [
    (int, "60", 60),
    (int, "-1", -1),
    (int, np.int64(3), 3),
    (float, "60", 60.0),
    (float, "1e-3", 0.001),
    (float, 2, 2.0),
    (bool, "true", True),
    (bool, "False", False),
    (bool, True, True),
    (str, "01", "01"),
    (str, "true", "true"),
    (str, Path("a.npz"), Path("a.npz")),
    (tuple[str, ...], "ipopt", ("ipopt",)),
    (Sequence[str], '["a", "b"]', ("a", "b")),
    (list[str], ["a"], ("a",)),
    (Sequence[str], "", ()),
    (int | None, "none", None),
    (int | None, "3", 3),
    (dict, '{"a": 1}', {"a": 1}),
    (dict, "not JSON", "not JSON"),
]


def test_arguments_become_what_the_annotation_says() -> None:
    for annotation, given, expected in CONVERTED:
        value = converted("x", annotation, given)
        assert value == expected, (annotation, given)
        assert type(value) is type(expected), (annotation, given)


REFUSED: list[tuple[object, object, str]] = [
    (int, "abc", "a whole number"),
    (int, "1.5", "a whole number"),
    (int, 1.5, "a whole number"),
    (int, "true", "a whole number"),
    (int, True, "a whole number"),
    (float, "nan", "a finite number"),
    (float, "1e999", "a finite number"),
    (float, None, "a finite number"),
    (bool, "1", "true or false"),
    (str, 3, "a text"),
    (Sequence[str], "[1]", "a name, or names such as"),
    (Sequence[str], "[", "a name, or names such as"),
    (Sequence[str], 3, "a name, or names such as"),
    (int | None, "x", "a whole number or none"),
]


def test_arguments_that_do_not_fit_are_refused() -> None:
    for annotation, given, said in REFUSED:
        with pytest.raises(BadArgument, match=said):
            converted("x", annotation, given)


def test_experiments_get_what_they_ask_for() -> None:
    changed = find("balance", {"frame": "60", "held_out": "cam01", "sigma": "3"})
    assert changed.arguments == {"frame": 60, "held_out": ("cam01",), "sigma": 3.0}
    with pytest.raises(BadArgument, match=r"frame of balance must be .*, not '1\.5'"):
        find("balance", {"frame": "1.5"})
    with pytest.raises(UnknownName, match="no argument of balance is called 'frames'"):
        find("balance", {"frames": 1})
    with pytest.raises(UnknownName, match="self-contact"):
        find("balanse")


def test_arguments_that_break_an_experiment_are_named() -> None:
    with pytest.raises(BadArgument, match="known-correspondences cannot be built with seed=-1: "):
        find("known-correspondences", {"seed": "-1"}).setup()
    with pytest.raises(UnknownName, match="no solver is called 'foo'"):
        find("known-correspondences", {"body": "small", "compared": "foo"}).setup()
