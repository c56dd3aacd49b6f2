"""Formulas as a terminal can show them: the TeX of a lecture in letters of Unicode.

`$\\tfrac12 \\|e\\|^2$` becomes `½ ‖e‖²`. This module knows the part of TeX that lectures use; a
test finds formulas that use more.
"""

import re
from collections.abc import Iterator

from workbench.errors import BadFile

_TOKEN = re.compile(r"\\(?:[A-Za-z]+|.)|\s+|.", re.S)


def _named(names: str, letters: str) -> dict[str, str]:
    return dict(zip(names.split(), letters, strict=True))


SYMBOLS = {
    **_named("alpha beta gamma delta epsilon theta kappa", "αβγδεθκ"),
    **_named("lambda mu pi rho sigma tau phi varphi", "λμπρστφφ"),
    **_named("chi psi omega eta xi nu zeta", "χψωηξνζ"),
    **_named("Gamma Delta Theta Lambda Pi Sigma Phi Omega", "ΓΔΘΛΠΣΦΩ"),
    **_named("sum prod int partial nabla infty ell", "∑∏∫∂∇∞ℓ"),
    **_named("times cdot pm circ top | lVert rVert", "×·±∘⊤‖‖‖"),
    **_named("approx ge geq le leq ne neq gg ll", "≈≥≥≤≤≠≠≫≪"),
    **_named("propto sim in to mapsto leftarrow parallel", "∝~∈→↦←∥"),
    **_named("Longleftrightarrow Rightarrow iff", "⟺⇒⟺"),
    **_named("mid langle rangle lfloor rfloor { }", "|⟨⟩⌊⌋{}"),
    **{name: name for name in ("sin", "cos", "tan", "log", "exp", "min", "max", "det", "arg")},
    **{name: name for name in ("arctan", "ln", "tr", "diag")},
    "dots": "...",
    "ldots": "...",
    "%": "%",
    ",": " ",
    ";": " ",
    ":": " ",
    " ": " ",
    "!": "",
    "quad": "  ",
    "qquad": "    ",
    "\\": "; ",
    **{name: "" for name in ("left", "right", "Big", "bigl", "bigr", "big", "displaystyle")},
}
ACCENTS = {
    **{"hat": "\u0302", "bar": "\u0304", "tilde": "\u0303", "vec": "\u20d7"},
    **{"dot": "\u0307", "ddot": "\u0308"},
}
UPRIGHT = ("text", "mathrm", "operatorname", "mathcal", "mathbf", "boldsymbol")
SUPERSCRIPTS = _named(
    "0 1 2 3 4 5 6 7 8 9 + - = ( ) n i j k a b c d T t x p m ⊤ ' *",
    "⁰¹²³⁴⁵⁶⁷⁸⁹⁺⁻⁼⁽⁾ⁿⁱʲᵏᵃᵇᶜᵈᵀᵗˣᵖᵐᵀ'*",
)
SUBSCRIPTS = _named(
    "0 1 2 3 4 5 6 7 8 9 + - = ( ) a e h i j k l m n o p r s t u v x β ρ φ χ",
    "₀₁₂₃₄₅₆₇₈₉₊₋₌₍₎ₐₑₕᵢⱼₖₗₘₙₒₚᵣₛₜᵤᵥₓᵦᵨᵩᵪ",
)
SHARES = {"1/2": "½", "1/3": "⅓", "2/3": "⅔", "1/4": "¼", "3/4": "¾", "1/6": "⅙", "1/8": "⅛"}
_FUNCTION = re.compile(r"(?:sin|cos|tan|log|exp|det)[⁰¹²³]*\s*$")


def in_letters(formula: str) -> str:
    """A formula of TeX, without its dollars, in letters of Unicode; its lines are kept.

    Raises BadFile for a command of TeX that is not known here.
    """
    tokens = iter([*_TOKEN.findall(formula), "}"])
    lines = _group(tokens).strip().splitlines() or [""]
    tidy = (re.sub(r"(?<! ) {2}(?! )", " ", line.strip()) for line in lines)
    return "\n".join(re.sub(r" ([,.;:])(?=\s|$)", r"\1", line) for line in tidy)


def _group(tokens: Iterator[str]) -> str:
    """Everything up to the brace that closes."""
    found: list[str] = []
    for token in tokens:
        if token == "}":
            break
        found.append(_one(token, tokens, found))
    return "".join(found)


def _one(token: str, tokens: Iterator[str], before: list[str]) -> str:
    """What a token stands for, with the arguments that it takes from the ones behind it."""
    if token == "{":
        return _group(tokens)
    if token in "^_":
        return _script(token, _argument(tokens))
    if token.isspace():
        return "\n" if "\n" in token else " "
    if not token.startswith("\\"):
        return {"-": "−", "&": " ", "~": " "}.get(token, token)
    name = token[1:]
    if name in ("frac", "tfrac", "dfrac"):
        share = _fraction(_argument(tokens), _argument(tokens))
        return f"({share})" if "/" in share and _FUNCTION.search("".join(before)) else share
    if name == "binom":
        return f"({_argument(tokens)} over {_argument(tokens)})"
    if name == "sqrt":
        return "√" + _whole(_argument(tokens))
    if name == "underbrace":
        return _argument(tokens)
    if name in ACCENTS:
        inside = _argument(tokens)
        return inside[:1] + ACCENTS[name] + inside[1:]
    if name in UPRIGHT:
        return _argument(tokens)
    if name in ("begin", "end"):
        _argument(tokens)
        return "[" if name == "begin" else "]"
    if name not in SYMBOLS:
        raise BadFile(
            f"a formula has the command \\{name}, which the terminal cannot show; add it to "
            f"SYMBOLS in {__name__}, or write the formula in another way"
        )
    letters = SYMBOLS[name]
    return f" {letters}" if letters.isalpha() and before and before[-1][-1:].isalnum() else letters


def _argument(tokens: Iterator[str]) -> str:
    """The next group or letter."""
    token = next((one for one in tokens if not one.isspace()), "}")
    return _one(token, tokens, [])


def _fraction(above: str, below: str) -> str:
    plain = f"{above}/{below}"
    below = f"({below})" if re.match(r"\d+[^\W\d]", below) else _whole(below)
    return SHARES.get(plain) or f"{_whole(above)}/{below}"


def _whole(text: str) -> str:
    """In brackets, unless it can be read as one thing without them."""
    one = re.fullmatch(r"[^\s+−=·×/]*|\([^()]*\)|‖[^‖]*‖[²₂]*", text)
    return text if one else f"({text})"


def _script(sign: str, text: str) -> str:
    letters = SUPERSCRIPTS if sign == "^" else SUBSCRIPTS
    small = [letters.get("-" if letter == "−" else letter) for letter in text]
    if text and all(small):
        return "".join(one for one in small if one)
    return sign + (text if len(text) == 1 else f"({text})")
