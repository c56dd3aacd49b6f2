"""`workbench body check`: a card and a doctor for model files."""

import json
from pathlib import Path

import numpy as np

from tests.bodies.model_files import foreign, smplx, written
from tests.cli.conftest import Run


def test_a_file_without_faults_has_exit_code_0(tmp_path: Path, workbench: Run) -> None:
    written(foreign("hand"), tmp_path / "MANO_RIGHT.pkl")
    code, out, _ = workbench("body", "check", "MANO_RIGHT.pkl")
    assert code == 0
    for said in ("in the layout of MANO", "778", "a right hand", "kept, and saved again", "pickle"):
        assert said in out
    assert out.rstrip().endswith("nothing was found to be wrong")
    code, out, _ = workbench("body", "check", "small")
    assert code == 0
    assert "left is x, up is y, front is z" in out
    assert "CC0" in out


def test_a_file_with_faults_has_exit_code_1(tmp_path: Path, workbench: Run) -> None:
    raw = foreign("small")
    raw["weights"] *= 0.98
    written(raw | {"licence": np.array("Only for tests.")}, tmp_path / "model.npz")
    code, out, _ = workbench("body", "check", "model.npz")
    assert code == 1
    assert "warning: weights: The weights of 369 of 369 vertices do not sum to 1" in out
    assert "Only for tests." in out
    assert "sum to 0.98, but must sum to 1" in out  # as load_body says


def test_what_cannot_be_read_has_exit_code_2(tmp_path: Path, workbench: Run) -> None:
    (tmp_path / "page.npz").write_text("<html>log in</html>")
    (tmp_path / "code.pkl").write_bytes(b"cos\nsystem\n(S'touch ran'\ntR.")
    np.savez(tmp_path / "motion.npz", poses=np.zeros((2, 72)), trans=np.zeros((2, 3)))
    (tmp_path / "cut.npz").write_bytes(written(smplx(), tmp_path / "x.npz").read_bytes()[:9000])
    (tmp_path / "a.json").write_text(json.dumps({}))
    for name, said in (
        ("page.npz", "is a web page"),
        ("code.pkl", "it asks for os.system"),
        ("motion.npz", "looks like a motion"),
        ("cut.npz", "cannot be read"),
        ("a.json", "is neither an .npz nor a .pkl file; a body is one of these"),
        ("missing.npz", "there is no file"),
    ):
        code, _, wrong = workbench("body", "check", name)
        assert code == 2, name
        assert said in " ".join(wrong.split()), wrong
    assert not (tmp_path / "ran").exists()
