"""What lecture 4 says of its run."""

import inspect
from dataclasses import replace

import numpy as np

import workbench as wb
from tests.lectures.prose import Run
from workbench.geometry.solids import mesh_edges
from workbench.lectures.material.tubes import tube


def arm(run: Run, name: str) -> np.ndarray:
    """The volume that the bent arm gained, by angle, cm^3."""
    return run["elbow"][name]


def crossing(run: Run) -> float:
    """The angle from which dual quaternions stretch the longest edge more, degrees."""
    more = run["stretch"]["dual quaternions"] > run["stretch"]["linear blending"] * (1 + 1e-9)
    first = int(np.flatnonzero(~more)[-1]) + 1
    return float(np.degrees(run["angles"][first]))


def jump(run: Run, name: str) -> float:
    """The largest change of the ring's turn between twists that are 5 degrees apart, degrees."""
    turns = np.radians(run["turned_by"][name])
    return float(np.abs(np.degrees(np.angle(np.exp(1j * np.diff(turns))))).max())


def middle(run: Run, name: str) -> np.ndarray:
    """The upper and the lower vertex at the joint of the tube bent by 120 degrees, (2, 2) m."""
    upper, lower = run["profile"](run["ways"][name], np.radians(120))
    return np.array([upper[len(upper) // 2], lower[len(lower) // 2]])


def stretch(run: Run, segment: str, parent: str) -> float:
    """How many times longer the longest edge between two segments gets with one bone for each."""
    body = run["whole"]
    edges = mesh_edges(body.faces)
    ends = np.sort(body.weights.argmax(axis=1)[edges], axis=1)
    pair = sorted((body.joint_names.index(segment), body.joint_names.index(parent)))
    across = edges[(ends == pair).all(axis=1)]
    torn = run["skinned"](run["readings"]["one bone for each"], run["dance"])
    before, after = (
        np.linalg.norm(v[across[:, 0]] - v[across[:, 1]], axis=1) for v in (body.template, torn)
    )
    return float((after / before).max())


def slower(run: Run) -> np.ndarray:
    """How many times as far a weight reaches on the tube as on a line, by border."""
    return np.array([line[-2] / line[-1] for line in run.lines("on the tube a weight falls")])


def end_of_the_tube(run: Run) -> float:
    """The same for the widest border, if the tube is three times as long."""
    long, border = run["tube"](half_length=0.9, rings=181), run["borders"][2]
    apart = (long.template[:, 0] > 0).astype(int)
    begun = run["Start"](long.template, long.faces, long.parents, long.joint_names, apart)
    spread = begun.weights(border)[:-2, 1].reshape(-1, 32).mean(axis=1)
    x = long.template[:-2].reshape(-1, 32, 3)[:, 0, 0]
    tail = (x < -0.02) & (x > -0.3) & (spread > 1e-3)
    slope = np.polyfit(x[tail], np.log(spread[tail]), 1)[0]
    return float(np.sqrt(2) / slope / border)


def behind(run: Run) -> float:
    """How far the middle of the skin around the left elbow is in front of the joint, cm."""
    body = run["finer_dual"]
    joint = body.joints()[body.joint_names.index("left_elbow")]
    off = body.template - joint
    around = off[(np.abs(off[:, 0]) < 0.015) & (np.linalg.norm(off[:, 1:], axis=1) < 0.12)]
    return float(100 * (around[:, 2].min() + around[:, 2].max()) / 2)


def meeting(run: Run) -> set[tuple[str, str]]:
    """The names of the segments that meet anywhere on the mesh, the lower number first."""
    begun, names = run["begun"], run["fine"].joint_names
    pairs = np.sort(begun.segmentation[mesh_edges(begun.faces)], axis=1)
    return {(names[a], names[b]) for a, b in pairs.tolist() if a != b}


def bent_in_half(run: Run, rings: int) -> float:
    """The volume that dual quaternions lose of the tube, bent by half a turn, cm^3."""
    pipe = replace(tube(rings=rings), skinning=wb.dual_quaternion_blend)
    (posed,) = run["Limb"](pipe, "joint").posed(run["BEND"], [np.pi])
    return 1e6 * (run["volume"](pipe.template, pipe.faces) - run["volume"](posed, pipe.faces))


SAYS = {
    "the tube that is bent by half a turn loses 20 cm³ with dual quaternions; with twice as many rings it loses 5.": lambda run: (
        bent_in_half(run, 61),
        bent_in_half(run, 121),
    ),
    "so we try four ways to read this": lambda run: len(run["readings"]) == 5,
    "With weights of 0 the body is a point, and with 1 it is 24 times as tall.": lambda run: (
        0,
        1,
        run.line("all weights 1 ", "tall at rest")[1] / run.line("as they are", "tall at rest")[0],
        run.line("all weights 0", "tall at rest")[1] == 0,
    ),
    "Equal weights keep the body together, but no limb follows its bone": lambda run: (
        run.line("all weights 1/24")[-2] < 1e-9,
        run.line("all weights 1/24")[-1] > 100,  # mm
    ),
    "With one bone for each vertex limbs follow, and the skin is torn where they bend, most visibly "
    "at the left shoulder and the left hip.": lambda run: (
        run.line("one bone for each", "tall at rest")[-1] < 5,  # mm
        stretch(run, "left_shoulder", "left_collar") > 2,
        stretch(run, "left_hip", "pelvis") > 2,
    ),
    "We need a mesh whose triangles are smaller than the border": lambda run: (
        np.median(
            np.linalg.norm(
                np.subtract(
                    *run["fine"].template[mesh_edges(run["fine"].faces)].transpose(1, 0, 2)
                ),
                axis=1,
            )
        )
        < 0.03
    ),
    "The front of the waist has none, because there the segments of pelvis and spine2 meet, and "
    "neither is the other's parent.": lambda run: (
        ("pelvis", "spine2") in meeting(run),
        run["fine"].parents[run["fine"].joint_names.index("spine2")]
        == run["fine"].joint_names.index("spine1"),
    ),
    "along which heat flows too, so the weight falls more slowly than on a line: by about a quarter with the "
    "two narrow borders, and by 45 % with the border of 10 cm, which also feels that the tube ends": lambda run: (
        100 * (slower(run)[2] - 1),
        100 * run["borders"][2],
        bool((abs(slower(run)[:2] - 1.25) < 0.07).all()),
        end_of_the_tube(run) < 1.4,
    ),
    "In the arm the joint of the elbow lies 1 cm behind the middle": lambda run: behind(run),
    "Bent to the other side, the arm should gain about as much as it has lost, and on the finer body it does. "
    "On the coarse one it loses volume both ways": lambda run: (
        abs(run.line("body 'full'")[-1] + run.line("body 'full'")[-2]) < 20,
        run.line("body 'full'")[-1] > 100,
        max(run.line("body 'default'")[-2:]) < -100,
    ),
    "what the bend gains on the outside it loses on the inside": lambda run: (
        abs(run["lost"]["dual quaternions"][9]) < 10
    ),
    "the body is 1.40 m tall in the pose": lambda run: float(
        np.ptp(run["skinned"](run["readings"]["all weights 1/24"], run["dance"])[:, 1])
    ),
    "In the end each vertex keeps its four largest weights, divided by their sum": lambda run: (
        int((run["first_weights"] > 0).sum(axis=1).max()) == 4
    ),
    "It is least near 3 cm (dotted), the library's border.": lambda run: (
        100 * inspect.signature(type(run["begun"]).weights).parameters["border"].default,
        bool(0.02 < run["nearest"] < 0.05),
        run.line("at other joints than after training")[1]
        < run.line("at other joints than after training")[0],
    ),
    "a registration (the body's mesh, laid onto a scan) may be off by 2 mm, and a weight by 0.3": lambda run: (
        1e3 * run["Sigmas"]().data,
        run["Sigmas"]().weights,
    ),
    "three borders, and the straight ramp": lambda run: len(run["borders"]) == 3,
    "Each joint moves the part up to the next joint, and shares a zone with its neighbours.": (
        lambda run: all(
            (share > 0.9).any() and ((share > 0.2) & (share < 0.8)).any()
            for name, share in run["shown"].items()
            if name != "spine1"
        )
    ),
    "no face follows spine1 alone": lambda run: run["shown"]["spine1"].max() < 0.9,
    "A tube of 60 cm lies along $x$": lambda run: float(100 * np.ptp(run["pipe"].template[:, 0])),
    "We bend it by 90 degrees.": lambda run: float(np.degrees(run["right_angle"][0])),
    "The tube, bent by 90 degrees, cut": lambda run: float(np.degrees(run["right_angle"][0])),
    "all of the stretch has to happen in the one row of edges between the halves": lambda run: (
        run.line("the longest edge is")[0] > 5
    ),
    "one edge spans the gap": lambda run: run.line("the longest edge is")[0] > 5,
    "One bone for each vertex tears the skin": lambda run: run.line("the longest edge is")[0] > 5,
    "With a sum of 0.98 the vertex lags behind the body by 2 % of the way that the body has gone, "
    "and even at rest it is drawn towards the origin": lambda run: (
        float(run["short"].sum(axis=1)[0]),
        (run.line("all bones moved by   10 m")[1] - run.line("all bones moved by    0 m")[1]) / 100,
        run.line("all bones moved by    0 m")[1] > 1,
    ),
    "At rest it is 10 cm long; the further the tube is bent, the shorter the line is": lambda run: (
        100 * float(np.ptp(run["pipe"].template[:, 1])),
        all(
            np.diff([np.linalg.norm(a[len(a) // 2] - b[len(b) // 2]) for a, b in run["lines"]]) < 0
        ),
    ),
    "the tube bent by 90 and by 150 degrees with": lambda run: tuple(np.degrees(run["two_bends"])),
    "how far a ring with the weight 0.3 is turned when the second bone is twisted. At half a turn "
    "dual quaternions jump from one side to the other": lambda run: (
        float(run["pipe"].weights[run["thirds"][0], 1]),
        jump(run, "dual quaternions") > 90,
        jump(run, "linear blending") < 90,
    ),
    "With linear blending the elbow collapses, and with dual quaternions its outside bulges": (
        lambda run: (
            np.linalg.norm(middle(run, "linear blending")[0] - middle(run, "linear blending")[1])
            < 0.06,
            np.linalg.norm(middle(run, "dual quaternions")[0] - middle(run, "dual quaternions")[1])
            > 0.099,
        )
    ),
    "the share $|\\cos \\tfrac\\alpha2|$ of the radius is left, and at half a turn nothing": (
        lambda run: (
            np.abs(run["thin"] - np.abs(np.cos(run["angles"] / 2))).max() < 1e-13,
            run["thin"][-1] < 1e-13,
        )
    ),
    "Let the weight rise in a straight line from 0 to 1 over a zone": lambda run: (
        int(run["pipe"].weights.min()),
        int(run["pipe"].weights.max()),
    ),
    "$w (1 - w)$ integrates to $l/6$ over the zone": lambda run: all(
        abs(line[k] / line[k + 2] - 1) < 0.01
        for line in run.lines("by 90 and 180 degrees")
        for k in (2, 3)
    ),
    "gives a rigid motion for every vertex": lambda run: (
        abs(run.line("the middle ring keeps")[1] - 1) < 1e-6
    ),
    "This is equal to $w \\alpha$ at $w = 0, \\tfrac12, 1$, and close to it elsewhere": lambda run: (
        run["off"][[0, 50_000, 100_000]].max() < 1e-9,
        0 < run["off"].max() < 10,
    ),
    "give 8.15 degrees": lambda run: float(run["off"].max()),
    "Just before and just after half a turn, the vertex is on opposite sides": lambda run: (
        run.line("a vertex moves by up to")[2] / run.line("a vertex moves by up to")[3] > 0.99
    ),
    "They bulge, jump at half a turn, and are not linear in the weights.": lambda run: (
        run["stretch"]["dual quaternions"][-1] > 1.5,
        run["jump"].max() > 0.09,
        "dual quaternions  linear in the weights: False" in run.printed,
    ),
    "With linear blending, the posed vertices are linear in the weights": lambda run: (
        "linear blending   linear in the weights: True" in run.printed
    ),
    "beyond 110 degrees dual quaternions stretch the outside more": crossing,
    "The wrist and the elbow of a real template are no tubes, but they behave in the same "
    "way.": lambda run: (
        abs(run["wrist"]["linear blending"][3] - np.cos(np.pi / 4)) < 0.05,
        arm(run, "linear blending")[3] < -100,
    ),
    "Blend shapes give back a part of what is lost, but where the arm is bent a little, it "
    "has even less volume with them.": (
        lambda run: (
            arm(run, "linear blending")[3]
            < arm(run, "SMPL (linear, and blend shapes)")[3]
            < arm(run, "dual quaternions")[3],
            arm(run, "SMPL (linear, and blend shapes)")[1] < arm(run, "linear blending")[1],
        )
    ),
}

GIVEN = (
    "$\\cos^2 \\alpha + \\sin^2 \\alpha = 1$",  # mathematics
    "This is never more than 1.",
    "The 1.0 is the fourth coordinate of each point",
    "at both ends of the zone $|c|^2 = 1$",
    "$w_0$ is 1 on one side of the seam and 0 on the other",
    "Left: the tube bent by 120 degrees, cut along its middle.",  # what was chosen to be drawn
    "grey is 0, full red is 1",  # the scale of the colours
    "outline around the joint, twisted by 0, 90 and 180 degrees",
    "nobody's wrist turns by 180 degrees",
)

GENERAL = (  # mathematics, definitions and advice
    "half the product of the quaternion $(0, t)$ with $q$",
    "the upper and the lower half of the tube",
    "is twice the real part of",
    "A quaternion holds the cosine and the sine of *half* of its angle, so the tangent of half of the angle",
    "so that a bend to the front has more of the arm on its inside",
    "at the vertex where a bone's weight is least, all neighbours have as much of it or more",
    "the weight is at least what it was in $W_0$",
    "This agreement proves less than it seems to",
)
