"""Landmarks: named points on the surface, such as the nose."""

import numpy as np
from scipy.sparse import csr_array

import workbench as wb

body = wb.load_body("small")
top = body.template[:, 1].argmax()
row = csr_array(([1.0], ([0], [top])), shape=(1, body.n_vertices))
marks = wb.Landmarks(("top_of_head",), row)
print(marks.names, marks.regressor @ body.vertices(np.zeros((24, 3))))
print(body.landmarks["coco"].names[:3])
