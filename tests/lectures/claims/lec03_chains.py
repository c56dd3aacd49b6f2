"""What lecture 3 says of its run."""

import numpy as np

from tests.lectures.prose import Run


def numbers_of_parts(run: Run) -> int:
    return int(run["turns"].size + run["places"].size)


def numbers_of_chain(run: Run) -> int:
    return int(run["solution"].values["pose"].size + run["solution"].values["trans"].size)


SAYS = {
    "How do 24 rotations place 24 bones?": lambda run: (len(run["truth"]), run["body"].n_joints),
    "four markers on each of the 24 parts of the body": lambda run: (
        len(run["markers"]),
        run["markers"].shape[1] == 4,
    ),
    "so fitting the whole body consists of 24 small fits, with $24 \\times 6 = 144$ numbers in all": lambda run: (
        len(run["turns"]),
        numbers_of_parts(run),
    ),
    "nothing in the 144 free numbers says that": numbers_of_parts,
    "The fit reproduces the markers to within their noise.": lambda run: (
        run.line("markers are fitted to")[0] < 10  # mm of noise
    ),
    "Now the parts hang together: there are 24 rotations, each relative to the part that it hangs on, and one position of the whole body, $72 + 3 = 75$ numbers.": lambda run: (
        len(run["solution"].values["pose"]),
        numbers_of_chain(run),
    ),
    "Fewer numbers, and a better answer": lambda run: (
        numbers_of_chain(run) < numbers_of_parts(run),
        run.line("a chain", "surface")[0] < 0.8 * run.line("on its own", "surface")[0],
    ),
    "24 free parts have 144 numbers and fall apart; a chain has 75 numbers and cannot fall apart": lambda run: (
        len(run["turns"]),
        numbers_of_parts(run),
        numbers_of_chain(run),
        run.line("joints are torn by", "on average")[0] > 10,  # mm
        run.line("joints are torn by at most")[0] < 1e-14,  # m
    ),
    "Left: the bones where 24 separate parts put them": lambda run: len(run["turns"]),
    "the gaps grow with the noise of the markers; those of the chain are zero": lambda run: (
        bool((np.diff(np.array(run["torn_by"]), axis=0) > 0).all()),
        run.line("joints are torn by at most")[0] < 1e-14,
    ),
    "The loop in the library is the same": lambda run: (
        run.line("off the library's joints")[0] < 1e-14
    ),
    "Both mistakes keep the lengths of all bones, so a test of lengths notices neither": lambda run: (
        all(
            run.line(f"{name:6} bones too long or short")[0] < 1e-14
            and run.line(f"{name:6} bones too long or short")[1] > 100
            for name in ("order", "bone")
        )
    ),
    "This body has its pelvis at the origin, whatever its shape, so the mistake does"
    " not show. Other bodies stand on the ground.": lambda run: (
        run.line("as it comes")[-1] < 0.05,  # mm
        run.line("on the ground")[-1] > 1000,
        np.allclose(run["body"].joints(betas=np.ones(run["body"].n_betas))[0], 0, atol=1e-5),
    ),
    "If $G_k$ is applied to them, it adds the position of the joint once more": lambda run: (
        run.line("no joint is turned")[0] > 0.5
    ),
    "drawn with its arms lowered by 45 degrees. Then the body looks like the template in the pose with lowered arms, and not in the pose zero": lambda run: (
        float(np.degrees(np.abs(run["lowered"]).max())),
        run.line("in its own pose")[0] < 1e-14,
        run.line("in the pose 0")[1] > 0.1,
    ),
    "At rest this is the origin itself, for every joint. In every pose its distance from the posed joint is "
    "the distance of $j_k$ from the origin.": lambda run: (
        np.abs(run["still"] @ np.linalg.inv(run["still"]) - np.eye(4)).max() < 1e-12,
        np.allclose(
            np.linalg.norm(run["bound"][:, :3, 3] - run["body"].joints(run["truth"]), axis=1),
            np.linalg.norm(run["joints"], axis=1),
        ),
    ),
    "The posed joint is the offset of $G_k$. It is also $G'_k\\, j_k$": lambda run: (
        max(run.line("offset of G ")[-2:]) < 1,  # mm
        max(run.line("G' times the joint at rest")[-2:]) < 1,
        min(run.line("offset of G'")[-2:]) > 100,
    ),
    "at rest all 24 are at the origin": lambda run: len(run["joints"]),
    "Because there the skin around a joint has been bent": lambda run: (
        run.line("at rest:", "posed:")[0] < 1e-10,  # mm
        run.line("at rest:", "posed:")[1] > 5,
    ),
    "A rotation of the whole body does no harm": lambda run: (
        run.line("if the root alone turns")[0] < 1e-10
    ),
}

GIVEN = ("for a template in the T-pose, $\\theta^* = 0$,",)
