"""What only a SkinnedBody has, and bodies of other kinds are told so."""

from workbench.bodies.skinned import SkinnedBody


def not_skinned(body: object, what: str, instead: str) -> str:
    """Why `what` cannot be had of this body, which is no SkinnedBody; empty if it is one.

    `instead` says what to do with a body of another kind.
    """
    if isinstance(body, SkinnedBody):
        return ""
    kind, name = type(body).__name__, getattr(body, "name", None)
    if not hasattr(body, "joint_names"):
        return (
            f"{what} is made of a SkinnedBody, not of something of type {kind}; load_body has one"
        )
    return f"{what} is made of a SkinnedBody, but body {name!r} is a {kind}; {instead}"
