"""Where a prose compares: "fewer than", "twice the", "as far as"."""

import re

_COUNT = "two|three|four|five|six|seven|eight|nine"
_MORE = (
    "more|less|fewer|better|worse|closer|nearer|further|larger|smaller|quicker|slower|faster|wider|"
    "narrower|longer|shorter|higher|lower|cheaper|rarer|earlier|later|tighter|steeper|thinner|"
    "thicker|stronger|weaker|surer"
)
_COMPARISON = re.compile(
    rf"\b(?:(?:(?:{_COUNT}) times|twice|half|a third|a quarter|two thirds) (?:as|the|of|its|this)\b"
    rf"|(?:{_COUNT})fold\b"
    rf"|(?:{_MORE})(?: \w+){{0,4}} than\b"
    r"|as (?:well|good|bad|large|small|far|near|much|many|long) as\b)",
    re.IGNORECASE,
)


def comparisons(prose: str) -> list[tuple[int, int]]:
    """The begin and the end of each comparison. Factors from ten on are numerals and not here."""
    return [match.span() for match in _COMPARISON.finditer(prose)]
