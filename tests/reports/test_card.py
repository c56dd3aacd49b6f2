"""A body's card, on the terminal and as a page."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.bodies_made_up import random_body, smpl_like_body
from workbench.bodies.catalogue import load_body
from workbench.reports import card_text, write_card
from workbench.reports.card import card_page, facts, joint_table

CARD = {
    "licence": "CC0 <1.0>",
    "source": {"where": "https://example.org/body?a=1&b=2", "rms_mm": [0.1, 0.2]},
    "provenance": ["made", "not measured"],
}


@pytest.mark.thorough
def test_card_page_holds_sizes_joints_and_provenance(tmp_path: Path) -> None:
    body = replace(smpl_like_body(), card=CARD)
    page = write_card(body, tmp_path / "card")
    text = page.read_text(encoding="utf-8")
    assert {path.name for path in page.parent.iterdir()} == {
        "index.html",
        "card.txt",
        "summary.json",
    }
    for word in ("left_wrist", "vertices moved", "CC0 &lt;1.0&gt;", "not measured", "0.1, 0.2"):
        assert word in text
    assert '<a href="https://example.org/body?a=1&amp;b=2">' in text
    assert text.count("<figure") == 2
    assert "<1.0>" not in text
    assert json.loads((page.parent / "summary.json").read_text())["card"] == CARD
    write_card(body, tmp_path / "card")


def test_card_text_says_what_the_body_is() -> None:
    text = card_text(replace(smpl_like_body(), card=CARD))
    assert text.splitlines()[0] == "made-up"
    assert "linear blend skinning" in text
    assert "  licence: CC0 <1.0>" in text
    assert "    rms_mm: 0.1, 0.2" in text
    assert "    - not measured" in text


def test_card_facts_are_those_of_the_body() -> None:
    body = random_body(n_vertices=40, n_joints=5)
    found = facts(body)
    assert found["vertices V"] == "40"
    assert found["skinning weights"].startswith("at most 4 per vertex")
    columns = list(zip(*joint_table(body).rows, strict=True))
    assert list(columns[2]) == ["–", *(f"joint{p}" for p in body.parents[1:])]
    rest = np.array(columns[3:6], dtype=float).T
    np.testing.assert_allclose(rest, body.joints(), rtol=0, atol=0.0005)
    assert list(map(int, columns[6])) == np.count_nonzero(body.weights, axis=0).tolist()
    assert list(columns[7]) == ["4"] * 5


@pytest.mark.thorough
def test_card_of_a_synthetic_body_says_so() -> None:
    """Where its numbers and its picture are shown, not only far below."""
    body = load_body("small")
    assert "no body was measured" in facts(body)["synthetic"]
    text = card_page(body)
    assert "The synthetic template from the front" in text
    assert text.index("no body was measured") < text.index("How it looks</h2>")
    plain = replace(body, card={})
    assert "synthetic" not in facts(plain)
    assert "The template from the front" in card_page(plain)
