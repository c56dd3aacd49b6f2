"""Numbers as they stand in prose and in printed lines, and when a quoted one is right."""

import re
from dataclasses import dataclass
from typing import SupportsFloat

import numpy as np

_SMALL = dict(
    zip(
        ["a", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine"],
        (1, *range(1, 10)),
        strict=True,
    )
)
_TEENS = {
    word: k
    for k, word in enumerate(
        [
            "ten",
            "eleven",
            "twelve",
            "thirteen",
            "fourteen",
            "fifteen",
            "sixteen",
            "seventeen",
            "eighteen",
            "nineteen",
        ],
        start=10,
    )
}
_TENS = {
    word: 10 * k
    for k, word in enumerate(
        ["twenty", "thirty", "forty", "fifty", "sixty", "seventy", "eighty", "ninety"], 2
    )
}
_LARGE = {"dozen": 12, "hundred": 100, "thousand": 1000, "million": 10**6}

_DIGITS = re.compile(r"(?<![\w.^-])[-+]?\d+(?:,\d{3})*(?:\.\d+)?(?:e[-+]?\d+)?(?![\w^])")
_WORDS = re.compile(
    r"\b(?:(?P<small>{small})[ -])?(?P<large>{large})(?=fold\b|\b)"
    r"|\b(?P<tens>{tens})(?:-(?P<unit>{small}))?(?=fold\b|\b)"
    r"|\b(?P<teens>{teens})(?=fold\b|\b)".format(
        small="|".join(_SMALL), large="|".join(_LARGE), tens="|".join(_TENS), teens="|".join(_TEENS)
    ),
    re.IGNORECASE,
)
_NOT_RESULTS = re.compile(
    r"`[^`]*`"  # code
    r"|\blectures? \d+(?:(?:,| to| and|, and) \d+)*"
    r"|\b(?:1[89]|20)\d\d(?=\))"  # the year of a paper, which stands before a bracket
    r"|\b(?:section|chapter|pages?|equations?) \d+(?:\.\d+)*(?:(?: to | and )\d+)?",  # of a source
    re.IGNORECASE,
)
_MATHEMATICS = re.compile(r"\$\$.*?\$\$|\$[^$]*\$")
_A_VALUE = re.compile(r"\$[^$]*=\s*(?P<value>[-+]?\d[\d,]*(?:\.\d+)?)\s*\$")  # $F = 1000$


@dataclass(frozen=True)
class Numeral:
    """A number that stands in a text."""

    begin: int
    end: int
    text: str

    @property
    def value(self) -> float:
        """What it says."""
        if words := _WORDS.fullmatch(self.text):
            part = {name: (found or "").lower() for name, found in words.groupdict().items()}
            if part["large"]:
                return _SMALL.get(part["small"], 1) * _LARGE[part["large"]]
            ones = _TEENS.get(part["teens"], 0) + _SMALL.get(part["unit"], 0)
            return _TENS.get(part["tens"], 0) + ones
        return float(self.text.replace(",", ""))

    @property
    def rounding(self) -> float:
        """Half a unit of the last digit quoted.

        Zeros at the end of a whole number are not digits that somebody vouches for ("230 mm"), but
        at most 5 % are allowed for them.
        """
        mantissa, _, exponent = self.text.lower().partition("e")
        if not re.fullmatch(r"[-+\d.,]+", mantissa):
            mantissa, exponent = str(round(self.value)), ""
        decimals = len(mantissa.partition(".")[2])
        if decimals or exponent:
            return float(0.5 * 10.0 ** (int(exponent or 0) - decimals))
        digits = mantissa.replace(",", "")
        zeros = len(digits) - len(digits.rstrip("0"))
        return max(0.5, min(0.5 * 10.0**zeros, 0.05 * abs(self.value))) if self.value else 0.5


@dataclass(frozen=True)
class below:  # noqa: N801 (it reads as a word of a claim)
    """The run's value is below the quoted number: `less than 5 mm`."""

    value: float


@dataclass(frozen=True)
class above:  # noqa: N801
    """The run's value is above the quoted number: `more than 20`."""

    value: float


def numerals(text: str) -> list[Numeral]:
    """The numbers of a prose: digits, and words from ten on.

    Formulas, code, years of papers and numbers of lectures are left out, but not the value in
    `$F = 1000$`.
    """

    def blanked(match: re.Match[str]) -> str:
        kept = _A_VALUE.fullmatch(match[0])
        if not kept:
            return " " * len(match[0])
        begin, end = kept.span("value")
        return " " * begin + match[0][begin:end] + " " * (len(match[0]) - end)

    plain = _MATHEMATICS.sub(blanked, text)
    plain = _NOT_RESULTS.sub(lambda match: " " * len(match[0]), plain)
    found = [*_DIGITS.finditer(plain), *_WORDS.finditer(plain)]
    return [Numeral(*match.span(), match[0]) for match in sorted(found, key=re.Match.start)]


def printed_numbers(line: str) -> list[int | float]:
    """The numbers of a printed line in order; whole ones are int."""
    found = (match[0].replace(",", "") for match in _DIGITS.finditer(line))
    return [int(text) if re.fullmatch(r"[-+]?\d+", text) else float(text) for text in found]


def right(quoted: Numeral, value: SupportsFloat | below | above) -> bool:
    """Whether the run bears a quoted number out.

    A whole number of the run (`int`) has to be quoted exactly; another one to the digits quoted.
    """
    if isinstance(value, below):
        return bool(value.value < quoted.value)
    if isinstance(value, above):
        return bool(value.value > quoted.value)
    if isinstance(value, int | np.integer):
        return bool(value == quoted.value)
    return abs(float(value) - quoted.value) <= quoted.rounding * (1 + 1e-9)
