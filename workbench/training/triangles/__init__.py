"""Training SCAPE and BlendSCAPE from meshes in known poses, and comparing them with vertex PCA."""
