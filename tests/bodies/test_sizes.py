"""Bodies with numbers that no body has are refused when they are made."""

from dataclasses import replace

import numpy as np
import pytest

from workbench import load_body, save_body
from workbench.bodies.triangles.body import scape
from workbench.errors import BadBody


@pytest.mark.parametrize("name", ["template", "shapedirs", "posedirs"])
def test_body_refuses_entries_beyond_a_kilometre(name: str) -> None:
    body = load_body("small")
    array = getattr(body, name).copy()
    array[7, 1] = -1e10
    with pytest.raises(BadBody, match=r"vertex 7 .* 1e\+10 m.*check-body"):
        replace(body, **{name: array})


def test_body_in_millimetres_is_refused() -> None:
    body = load_body("small")
    with pytest.raises(BadBody, match="unit"):
        replace(body, template=2000 * body.template)


def test_triangle_body_refuses_far_vertices() -> None:
    body = scape(load_body("small"))
    with pytest.raises(BadBody, match="vertex"):
        replace(body, template=1e10 * np.ones_like(body.template))


def test_loaded_file_with_far_vertices_is_refused(tmp_path: pytest.TempPathFactory) -> None:
    path = f"{tmp_path}/body.npz"
    save_body(load_body("small"), path)
    with np.load(path) as found:
        arrays = dict(found)
    arrays["v_template"] = 1e10 * arrays["v_template"]
    np.savez(path, **arrays)
    with pytest.raises(BadBody, match="1,000 m"):
        load_body(path)
