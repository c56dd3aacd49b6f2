"""Formulas as a terminal can show them: the TeX of a lecture in letters of Unicode.

`$\\tfrac12 \\|e\\|^2$` becomes `½ ‖e‖²`. Commands of TeX without letters of their own stay.
"""

import re
from collections.abc import Callable
from functools import partial


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
    **_named("Longleftrightarrow Rightarrow iff mid", "⟺⇒⟺|"),
    **_named("langle rangle lfloor rfloor", "⟨⟩⌊⌋"),
    **{"dots": "...", "ldots": "...", "quad": "  ", "qquad": "    ", "\\": "; ", "%": "%"},
    **dict.fromkeys(("left", "right", "Big", "bigl", "bigr", "big", "displaystyle", "!"), ""),
    **dict.fromkeys((",", ";", ":", " "), " "),
    **{name: name for name in ("sin", "cos", "tan", "log", "exp", "min", "max", "det", "arg")},
    **{name: name for name in ("arctan", "ln", "tr", "diag")},
}
ACCENTS = {"hat": "\u0302", "bar": "\u0304", "tilde": "\u0303", "vec": "\u20d7"}
ACCENTS |= {"dot": "\u0307", "ddot": "\u0308"}
SUPERSCRIPTS = _named(
    "0 1 2 3 4 5 6 7 8 9 + - = ( ) n i j k a b c d T t x p m ⊤ ' *",
    "⁰¹²³⁴⁵⁶⁷⁸⁹⁺⁻⁼⁽⁾ⁿⁱʲᵏᵃᵇᶜᵈᵀᵗˣᵖᵐᵀ'*",
)
SUBSCRIPTS = _named(
    "0 1 2 3 4 5 6 7 8 9 + - = ( ) a e h i j k l m n o p r s t u v x β ρ φ χ",
    "₀₁₂₃₄₅₆₇₈₉₊₋₌₍₎ₐₑₕᵢⱼₖₗₘₙₒₚᵣₛₜᵤᵥₓᵦᵨᵩᵪ",
)
CALLIGRAPHIC = _named(
    "A B C D E F G H I J K L M N O P Q R S T U V W X Y Z", "𝒜ℬ𝒞𝒟ℰℱ𝒢ℋℐ𝒥𝒦ℒℳ𝒩𝒪𝒫𝒬ℛ𝒮𝒯𝒰𝒱𝒲𝒳𝒴𝒵"
)
ARGUMENT = r"\s*(?:\{([^{}]*)\}|([^\s{}\\]))"  # a group without groups in it, or a letter
RULES: tuple[tuple[str, Callable[..., str]], ...] = (  # a command, and its letters
    (r"\\[td]?frac" + 2 * ARGUMENT, lambda a, b: _fraction(a, b)),
    (r"\\binom" + 2 * ARGUMENT, lambda a, b: f"({a} over {b})"),
    (r"\\sqrt" + ARGUMENT, lambda a: "√" + _whole(a)),
    (r"\\mathcal" + ARGUMENT, lambda a: "".join(CALLIGRAPHIC.get(letter, letter) for letter in a)),
    (r"\\(?:text|math\w+|operatorname|boldsymbol|underbrace)" + ARGUMENT, lambda a: a),
    *(
        (rf"\\{name}" + ARGUMENT, lambda a, accent=accent: a[:1] + accent + a[1:])
        for name, accent in ACCENTS.items()
    ),
    (r"\^" + ARGUMENT, lambda a: _raised_or_lowered("❛", a, SUPERSCRIPTS)),
    (r"_" + ARGUMENT, lambda a: _raised_or_lowered("❟", a, SUBSCRIPTS)),
)


def in_letters(formula: str) -> str:
    """A formula of TeX, without its dollars, in letters of Unicode; its lines are kept."""
    text = re.sub(r"\\(begin|end)\{\w+\}", lambda m: "[" if m[1] == "begin" else "]", formula)
    text = text.replace("~", " ").replace(r"\{", "❴").replace(r"\}", "❵")  # braces are groups now
    text = re.sub(r"\\([A-Za-z]+|.)", lambda m: SYMBOLS.get(m[1], m[0]), text)
    text, before = text.replace("-", "−").replace("&", " "), ""
    while text != before:  # from the inside to the outside
        before = text
        for pattern, letters in RULES:
            text = re.sub(pattern, partial(_written, letters), text)
    text = re.sub(r"(?<!\w)1/2(?!\w)", "½", re.sub(r"[{}]", "", text)).translate(
        str.maketrans("❴❵❛❟", "{}^_")
    )
    tidy = (re.sub(r"(?<! ) {2}(?! )", " ", line.strip()) for line in text.strip().splitlines())
    return "\n".join(re.sub(r" ([,.;:])(?=\s|$)", r"\1", line) for line in tidy)


def _written(letters: Callable[..., str], match: re.Match[str]) -> str:
    groups = match.groups(default="")
    return letters(*(a or b for a, b in zip(groups[::2], groups[1::2], strict=True)))


def _fraction(above: str, below: str) -> str:
    """`sin (α/2)` has brackets: without them it might be read as a half of a sine."""
    plain = f"{_whole(above)}/{_whole(below)}"
    return f"({plain})" if len(plain) == 3 and not above.isdigit() else plain


def _whole(text: str) -> str:
    """In brackets, unless it can be read as one thing without them."""
    readable = re.fullmatch(r"(?!\d+[^\W\d])[^\s+−=·×/]*|\([^()]*\)|‖[^‖]*‖[²₂]*", text)
    return text if readable else f"({text})"


def _raised_or_lowered(sign: str, text: str, letters: dict[str, str]) -> str:
    small = [letters.get("-" if letter == "−" else letter, "") for letter in text]
    return "".join(small) if all(small) else sign + (text if len(text) == 1 else f"({text})")
