"""Training SCAPE and BlendSCAPE from meshes in known poses, and comparing them with vertex PCA.

Training starts from SMPL's on the same registrations and takes shapes, pose deformations, poses and
subjects in turn; none raises the common objective. While SCAPE's matrices D (shape) and Q (pose)
are learned, triangles need not fit together. `symbolic` writes the same terms as residuals.
"""
