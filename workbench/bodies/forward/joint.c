/* The kinematics of a body, one number at a time: loops over the joints of a tree around the functions of one joint;
parents come first. */

#include <math.h>
#include <stddef.h>
#include <string.h>

typedef double v;
typedef double anywhere;
typedef ptrdiff_t integer;

#define EXPORT __attribute__((visibility("default")))
#define ALWAYS_INLINE inline __attribute__((always_inline))
#define BROADCAST(x) (x)
#define TRUTH(condition) ((double)(condition)) /* as in CasADi */
#define IF(condition, x) ((condition) != 0.0 ? (x) : 0.0)
#define each_sqrt sqrt
#define each_sin sin
#define each_cos cos

/* the functions of c_functions.py */

typedef struct {
    const double *mean;     /* (K, 3) m, the joints of the mean person at rest */
    const double *by_betas; /* (K, 3, B) m, how betas move them */
    const double *bind;     /* (K, 9) each joint's rotation in its parent's frame, in the bind pose */
    const double *unbind;   /* (K, 9) the transpose of its rotation in the world, in the bind pose */
} skeleton_t;

static const integer parents[JOINTS] = PARENTS;
static const double nowhere[12] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
static const double unturned[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};

/* found: the features 9 (K - 1), the motions G (K, 12) and the joints (K, 3), at a pose (K, 3) */
static void moved(const skeleton_t *of, const double *pose, const double *betas, double *found)
{
    double world[JOINTS][12], rest[JOINTS][3];
    double *features = found, *G = features + 9 * (JOINTS - 1), *joints = G + 12 * JOINTS;
    for (integer k = 0; k < JOINTS; ++k) {
        const integer up = parents[k];
        double turn[9], away[3], place[3];
        local(pose + 3 * k, turn);
        for (int d = 0; d < 3; ++d) {
            rest[k][d] = of->mean[3 * k + d];
            for (integer b = 0; b < BETAS; ++b) rest[k][d] += of->by_betas[(3 * k + d) * BETAS + b] * betas[b];
            away[d] = place[d] = rest[k][d] - (k ? rest[up][d] : 0.0);
        }
        if (k) placed(of->unbind + 9 * up, away, place);
        follow(k ? world[up] : nowhere, turn, place, world[k]);
        bound(world[k], of->unbind + 9 * k, rest[k], G + 12 * k);
        for (int n = 0; k && n < 9; ++n) features[9 * (k - 1) + n] = turn[n] - of->bind[9 * k + n];
        for (int d = 0; d < 3; ++d) joints[3 * k + d] = world[k][4 * d + 3];
    }
}

/* found: three axes (3, 3) of each joint, the derivatives (9, 3) of its features, and the shifts of G by betas
(B, K, 3), at a pose with these motions G */
static void derived(const skeleton_t *of, const double *pose, const double *G, double *found)
{
    double *each = found, *d_features = each + 9 * JOINTS, *d_shift = d_features + 27 * JOINTS;
    memset(d_features, 0, 27 * sizeof(double));
    for (integer k = 0; k < JOINTS; ++k) {
        const double *above = k ? G + 12 * parents[k] : nowhere;
        double turn[36];
        d_local(pose + 3 * k, turn);
        axes(above, k ? of->unbind + 9 * parents[k] : unturned, turn, each + 9 * k);
        for (int n = 0; k && n < 9; ++n)
            for (int a = 0; a < 3; ++a) d_features[27 * k + 3 * n + a] = turn[9 + 9 * a + n];
        for (int d = 0; d < 3; ++d) { /* G_k and that of the parent agree in joint k, which is linear in betas */
            const double *from = of->by_betas + 3 * BETAS * k;
            double step[3];
            for (int c = 0; c < 3; ++c) step[c] = above[4 * d + c] - G[12 * k + 4 * d + c];
            for (integer b = 0; b < BETAS; ++b) {
                double sum = k ? d_shift[3 * (JOINTS * b + parents[k]) + d] : 0.0;
                for (int c = 0; c < 3; ++c) sum += step[c] * from[BETAS * c + b];
                d_shift[3 * (JOINTS * b + k) + d] = sum;
            }
        }
    }
}

#define MOTION (24 * JOINTS - 9)
#define DERIVATIVES ((36 + 3 * BETAS) * JOINTS)

/* the numbers of the motions at so many poses (K, 3) with their betas */
EXPORT void motions(const skeleton_t *of, const double *poses, const double *betas, double *found, integer count)
{
    for (integer m = 0; m < count; ++m) moved(of, poses + 3 * JOINTS * m, betas + BETAS * m, found + MOTION * m);
}

/* the numbers of the derivatives of these motions */
EXPORT void derivatives(const skeleton_t *of, const double *poses, const double *motions, double *found,
                        integer count)
{
    for (integer m = 0; m < count; ++m)
        derived(of, poses + 3 * JOINTS * m, motions + MOTION * m + 9 * (JOINTS - 1), found + DERIVATIVES * m);
}
