"""Arguments of a wrong kind are refused in our sentences, not in those of CasADi or NumPy."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import casadi as cs
import numpy as np
import pytest

import workbench as wb
from workbench.bodies.triangles.body import scape
from workbench.errors import (
    BadArgument,
    BadBody,
    BadConstraint,
    BadFile,
    BadResidual,
    UnknownName,
    UnreadBlock,
)
from workbench.reports.card import card_page, card_text, write_card
from workbench.reports.sliders import sliders_page
from workbench.residuals import edges, gaussian, keypoints, landmarks, stitching, vertices

BODY = wb.load_body("small")
SYMBOLS = tuple(block.symbol for block in BODY.blocks())
JOINTS, SURFACE = BODY.joint_points(*SYMBOLS), BODY.points(*SYMBOLS)
CAMERA = wb.Camera("cam/")
X = wb.Block("x", (3,))
PROBLEM = wb.Problem([gaussian(X.symbol)], "x")

WRONG_KINDS: dict[str, Any] = {
    "SX": cs.SX.sym("q", 3),
    "text": "abc",
    "None": None,
    "an int": 3,
    "NaN": np.full(3, np.nan),
    "a table": np.zeros((2, 7)),
    "MX (2, 7)": cs.MX.sym("m", 2, 7),
    "a list": [1, 2],
    "MX (24, 3)": cs.MX.sym("m", 24, 3),
    "a dict": {"a": 1},
    "a block": X,
    "an object": object(),
    "a negative": -1.0,
    "a function": len,
    "DM": cs.DM(2, 2),
    "points": JOINTS,
    "nothing": np.zeros(0),
    "complex": np.ones(3) * 1j,
}
FACES = np.array([[0, 1, 2], [1, 2, 3]])

# Each takes one thing, of which some of the above are good; whatever is not is told in a sentence.
CALLS: dict[str, Callable[[Any], object]] = {
    "Block, name": lambda v: wb.Block(v, (3,)).symbol,
    "Block, shape": lambda v: wb.Block("b", v).symbol,
    "Block, labels": lambda v: wb.Block("b", (3,), "m", v).entry(1),
    "Layout": lambda v: wb.Layout(v).pack({}),
    "pack": lambda v: wb.Layout((X,)).pack(v),
    "pack, x": lambda v: wb.Layout((X,)).pack({"x": v}),
    "Residual, name": lambda v: wb.Residual(v, X.symbol, 1.0),
    "Residual, expression": lambda v: wb.Problem([wb.Residual("r", v, 1.0)], "x"),
    "Residual, sigma": lambda v: wb.Residual("r", X.symbol, v).whitened,
    "Residual, points": lambda v: wb.Residual("r", X.symbol, 1.0, points=v),
    "Residual, labels": lambda v: wb.Residual("r", X.symbol, 1.0, labels=v),
    "Residual, weights": lambda v: wb.Residual("r", X.symbol, 1.0, weights=v).whitened,
    "Residual, blocks": lambda v: wb.Residual("r", X.symbol, 1.0, blocks=v),
    "gaussian": gaussian,
    "gaussian, mean": lambda v: gaussian(X.symbol, mean=v),
    "gaussian, covariance": lambda v: gaussian(X.symbol, covariance=v),
    "landmarks, points": lambda v: landmarks(v, np.zeros((24, 3)), sigma=1.0),
    "landmarks, observed": lambda v: landmarks(JOINTS, v, sigma=1.0),
    "vertices, sigma": lambda v: vertices(JOINTS, np.zeros((24, 3)), sigma=v),
    "keypoints, points": lambda v: keypoints(v, CAMERA, np.zeros((24, 2)), np.ones(24), sigma=1),
    "keypoints, camera": lambda v: keypoints(JOINTS, v, np.zeros((24, 2)), np.ones(24), sigma=1),
    "keypoints, confidence": lambda v: keypoints(JOINTS, CAMERA, np.zeros((24, 2)), v, sigma=1),
    "edges, points": lambda v: edges(v, np.zeros((24, 3)), [[0, 1]], sigma=1),
    "edges, pairs": lambda v: edges(JOINTS, np.zeros((24, 3)), v, sigma=1),
    "edges, confidence": lambda v: edges(
        JOINTS, np.zeros((24, 3)), [[0, 1]], sigma=1, confidence=v
    ),
    "stitching, vertices": lambda v: stitching(v, np.zeros((4, 3)), FACES, sigma=1),
    "stitching, faces": lambda v: stitching(JOINTS, np.zeros((4, 3)), v, sigma=1),
    "huber": wb.residuals.huber,
    "geman_mcclure": wb.residuals.geman_mcclure,
    "Constraint": lambda v: wb.Constraint("c", v, 0, 1),
    "Constraint, lower": lambda v: wb.Constraint("c", X.symbol, v, 9),
    "Constraint, points": lambda v: wb.Constraint("c", X.symbol, 0, 9, points=v),
    "Problem, residuals": lambda v: wb.Problem(v, "x"),
    "Problem, a residual": lambda v: wb.Problem([v], "x"),
    "Problem, free": lambda v: wb.Problem([gaussian(X.symbol)], v),
    "Problem, bounds": lambda v: wb.Problem([gaussian(X.symbol)], "x", v),
    "Problem, bounds of x": lambda v: wb.Problem([gaussian(X.symbol)], "x", {"x": v}),
    "Problem, blocks": lambda v: wb.Problem([gaussian(X.symbol)], "x", None, v),
    "Problem, constraints": lambda v: wb.Problem([gaussian(X.symbol)], "x", None, (), v),
    "freeing": PROBLEM.freeing,
    "without": PROBLEM.without,
    "linearize": PROBLEM.linearize,
    "solve": lambda v: wb.solve(v, {"x": np.ones(3)}),
    "solve, start": lambda v: wb.solve(PROBLEM, v),
    "diagnose": lambda v: wb.diagnose(v, {"x": np.ones(3)}),
    "diagnose, at": lambda v: wb.diagnose(PROBLEM, v),
    "diagnose, priors": lambda v: wb.diagnose(PROBLEM, {"x": np.ones(3)}, priors=v),
    "body, pose": lambda v: BODY.points(v, *SYMBOLS[1:]),
    "body, some vertices": lambda v: BODY.points(*SYMBOLS, vertices=v),
    "landmark_points": lambda v: BODY.landmark_points(v, *SYMBOLS),
    "landmark": BODY.landmark,
    "body.joints": lambda v: BODY.joints(v),
    "freed": BODY.freed,
    "array": BODY.array,
    "blocks": BODY.blocks,
    "start": BODY.start,
    "with_values": lambda v: BODY.freed("template").with_values(v),
    "Landmarks, names": lambda v: wb.Landmarks(v, np.eye(1, 4)),
    "Landmarks, regressor": lambda v: wb.Landmarks(("a",), v),
    "load_body": wb.load_body,
    "save_body": lambda v: wb.save_body(v, "nowhere.npz"),
    "Camera": lambda v: wb.Camera(v).blocks,
    "project": CAMERA.project,
    "pixels": lambda v: CAMERA.pixels(v, CAMERA.values(K=np.eye(3))),
    "camera, K": lambda v: CAMERA.values(K=v),
    **{
        f"body, {name}": lambda v, name=name: replace(BODY, **{name: v})
        for name in (
            "template",
            "shapedirs",
            "J_regressor",
            "weights",
            "parents",
            "faces",
            "joint_names",
            "mirror",
            "landmarks",
            "bound_in",
            "free",
        )
    },
}


def test_arguments_of_wrong_kinds_get_errors_of_the_workbench() -> None:
    for name, call in CALLS.items():
        messages = []
        for kind, value in WRONG_KINDS.items():
            try:
                call(value)
            except wb.WorkbenchError as error:
                messages.append(str(error))
            except Exception as error:
                pytest.fail(f"{name} of {kind}: {type(error).__name__}: {error}")
        assert messages, f"{name} takes everything"
        raw = [words for words in messages if "Wrong number or type of arguments" in words]
        assert not raw, f"{name} repeats what CasADi says: {raw[0]}"


def test_pages_of_bodies_refuse_other_objects(tmp_path: Path) -> None:
    body = scape(BODY)
    with pytest.raises(BadArgument, match="a page that poses it is made of a SkinnedBody"):
        sliders_page("small")  # type: ignore[arg-type]
    with pytest.raises(BadFile, match="made of a SkinnedBody, not of something of type str"):
        wb.save_body("small", tmp_path / "a.npz")  # type: ignore[arg-type]
    for make in (card_page, card_text, lambda b: write_card(b, tmp_path / "card")):
        with pytest.raises(BadBody, match="a card is made of a SkinnedBody, not of something"):
            make("small")  # type: ignore[arg-type]
    assert not list(tmp_path.iterdir())
    assert body.landmark_names("coco") == BODY.landmark_names("coco")


def test_transposed_symbols_are_refused() -> None:
    bare = wb.Block("p", (24, 3)).symbol
    with pytest.raises(BadResidual, match=r"matrix \(3, N\).* not \(24, 3\); transpose it"):
        keypoints(bare.T, CAMERA, np.zeros((24, 2)), np.ones(24), sigma=1.0)
    with pytest.raises(wb.WorkbenchError, match=r"projects points \(3, N\).* shape \(24, 3\)"):
        CAMERA.project(bare.T)
    trust = wb.Block("c", (2,)).symbol
    with pytest.raises(BadResidual, match=r"2 pairs, but confidences of shape \(1, 2\)"):
        edges(JOINTS, np.zeros((24, 3)), [[0, 1], [1, 2]], sigma=1.0, confidence=trust.T)


def test_free_blocks_must_be_read() -> None:
    y = wb.Block("y", (2,))
    text = r"no residual and no constraint reads the block 'y'.*they read x\. Do not free"
    with pytest.raises(UnreadBlock, match=text):
        wb.Problem([gaussian(X.symbol)], ("x", "y"), blocks=[y])
    with pytest.raises(UnreadBlock, match=text):
        wb.Problem([gaussian(X.symbol)], "x", {"y": (0, 1)}, blocks=[y])
    with pytest.raises(UnknownName, match=r"there are x .a block that no residual and no"):
        wb.Problem([gaussian(X.symbol)], ("x", "y"))
    with pytest.raises(
        BadArgument, match=r"texts, but among them is something of type Block; take its \.name"
    ):
        wb.Problem([gaussian(X.symbol)], [X])  # type: ignore[list-item]


def test_points_must_be_listed() -> None:
    text = r"reads placeholder\(vertices\), a symbol that stands for points.*points=\(points"
    with pytest.raises(BadResidual, match=text):
        wb.Residual("r", cs.vec(SURFACE.symbol), 1.0, "m")
    with pytest.raises(BadResidual, match=text):
        vertices(SURFACE.symbol, np.zeros((SURFACE.count, 3)), sigma=1.0)
    with pytest.raises(BadConstraint, match=text):
        wb.Constraint("c", SURFACE.symbol[1, 0], lower=0)
    with pytest.raises(BadResidual, match=r"put the one into a tuple"):
        wb.Residual("r", cs.vec(SURFACE.symbol), 1.0, points=SURFACE)  # type: ignore[arg-type]


def test_landmark_sets_are_checked() -> None:
    one = wb.Landmarks(("a",), np.eye(1, BODY.n_vertices))
    for body in (BODY, scape(BODY)):
        with pytest.raises(BadBody, match="cannot be called 'joints'"):
            replace(body, landmarks={"joints": one})
        with pytest.raises(BadBody, match=r"landmarks must be a dict from names, not .*Landmarks"):
            replace(body, landmarks=one)
        with pytest.raises(BadBody, match=r"must be Landmarks\(names, regressor\), not .* ndarray"):
            replace(body, landmarks={"mine": np.eye(1, BODY.n_vertices)})
        assert replace(body, landmarks={"mine": one}).landmark("mine").shape == (1, 3)
