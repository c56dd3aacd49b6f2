/* Loops over the joints of a tree around the functions of one joint above; parents come first. */

typedef struct {
    const double *mean;   /* (K, 3) m, the joints of the mean person at rest */
    const double *slopes; /* (K, 3, B) m, how betas move them */
    const double *bind;   /* (K, 9) each joint's rotation in its parent's frame, in the bind pose */
    const double *unbind; /* (K, 9) the transpose of its rotation in the world, in the bind pose */
} skeleton_t;

static const integer parents[JOINTS] = PARENTS;
static const double nowhere[12] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};

/* from local rotations (K, 9): the motion of each joint in the world, the motion G that takes what is at
rest along, and the joints at rest (K, 3) */
static void walk(const skeleton_t *of, const double *local, const double *betas,
                 double world[JOINTS][12], double *G, double rest[JOINTS][3])
{
    for (integer k = 0; k < JOINTS; ++k) {
        const integer up = parents[k];
        double away[3], place[3];
        for (int d = 0; d < 3; ++d) {
            rest[k][d] = of->mean[3 * k + d];
            for (integer b = 0; b < BETAS; ++b)
                rest[k][d] += of->slopes[(3 * k + d) * BETAS + b] * betas[b];
            away[d] = place[d] = rest[k][d] - (k ? rest[up][d] : 0.0);
        }
        if (k) placed(of->unbind + 9 * up, away, place);
        follow(k ? world[up] : nowhere, local + 9 * k, place, world[k]);
        bound(world[k], of->unbind + 9 * k, rest[k], G + 12 * k);
    }
}

/* found: the features 9 (K - 1), the motions G (K, 12) and the joints (K, 3) at a pose (K, 3); and the motion of
each joint in the world. Not inlined, so that its bits are the same for whoever calls it */
static __attribute__((noinline)) void moved(const skeleton_t *of, const double *pose, const double *betas,
                                            double world[JOINTS][12], double *found)
{
    double turn[JOINTS][9], rest[JOINTS][3];
    double *features = found, *G = features + 9 * (JOINTS - 1), *joints = G + 12 * JOINTS;
    for (integer k = 0; k < JOINTS; ++k) local(pose + 3 * k, turn[k]);
    walk(of, turn[0], betas, world, G, rest);
    for (integer k = 0; k < JOINTS; ++k) {
        for (int n = 0; k && n < 9; ++n) features[9 * (k - 1) + n] = turn[k][n] - of->bind[9 * k + n];
        for (int d = 0; d < 3; ++d) joints[3 * k + d] = world[k][4 * d + 3];
    }
}

EXPORT void motion(const skeleton_t *of, const double *pose, const double *betas, double *found)
{
    double world[JOINTS][12];
    moved(of, pose, betas, world, found);
}

/* found, for vertices: three axes and slopes (9, 3) of features, of each joint (K, OF_JOINT), and the shifts of G by betas (B, K, 3); and once more as NumPy reads it: the turns
(K, 9, 3), the slopes (K - 1, 3, 9), and the shifts (3 B, K). `moving` is what `motion` finds, or absent */
EXPORT void slopes(const skeleton_t *of, const double *pose, const double *betas, double *found, double *moving)
{
    double world[JOINTS][12], aside[9 * (JOINTS - 1) + 15 * JOINTS];
    double *of_joints = found, *of_betas = of_joints + OF_JOINT * JOINTS, *turns = of_betas + 3 * BETAS * JOINTS;
    double *d_features = turns + 27 * JOINTS, *d_shift = d_features + 27 * (JOINTS - 1);
    if (!moving) moving = aside;
    const double *G = moving + 9 * (JOINTS - 1);
    moved(of, pose, betas, world, moving);
    memset(found, 0, (OF_JOINT + 27) * JOINTS * sizeof(double) + 3 * BETAS * JOINTS * sizeof(double));
    for (integer k = 0; k < JOINTS; ++k) {
        const double *above = k ? G + 12 * parents[k] : nowhere;
        double turn[36], *own = of_joints + OF_JOINT * k;
        local_slopes(pose + 3 * k, turn);
        axes(k ? world[parents[k]] : nowhere, turn, own);
        for (int a = 0; a < 3; ++a) {
            const double *axis = own + 3 * a;
            double *skew = turns + 27 * k + 9 * a;
            skew[1] = -axis[2], skew[2] = axis[1], skew[3] = axis[2];
            skew[5] = -axis[0], skew[6] = -axis[1], skew[7] = axis[0];
            for (int n = 0; k && n < 9; ++n)
                own[9 + 3 * n + a] = d_features[27 * (k - 1) + 9 * a + n] = turn[9 + 9 * a + n];
        }
        for (int d = 0; d < 3; ++d) { /* G_k and that of the parent agree in joint k, which is linear in betas */
            const double *from = of->slopes + 3 * BETAS * k;
            double step[3];
            for (int c = 0; c < 3; ++c) step[c] = above[4 * d + c] - G[12 * k + 4 * d + c];
            for (integer b = 0; b < BETAS; ++b) {
                double sum = k ? of_betas[3 * (JOINTS * b + parents[k]) + d] : 0.0;
                for (int c = 0; c < 3; ++c) sum += step[c] * from[BETAS * c + b];
                of_betas[3 * (JOINTS * b + k) + d] = d_shift[(3 * b + d) * JOINTS + k] = sum;
            }
        }
    }
}

/* what `motion` finds at each of so many poses (K, 3) with their betas */
EXPORT void motions(const skeleton_t *of, const double *poses, const double *betas, double *found, integer count)
{
    for (integer m = 0; m < count; ++m)
        motion(of, poses + 3 * JOINTS * m, betas + BETAS * m, found + (9 * (JOINTS - 1) + 15 * JOINTS) * m);
}

/* what `slopes` finds at each of them */
EXPORT void slopes_of_all(const skeleton_t *of, const double *poses, const double *betas, double *found,
                          integer count)
{
    const integer size = (OF_JOINT + 27) * JOINTS + 27 * (JOINTS - 1) + 6 * BETAS * JOINTS;
    for (integer m = 0; m < count; ++m)
        slopes(of, poses + 3 * JOINTS * m, betas + BETAS * m, found + size * m, NULL);
}
