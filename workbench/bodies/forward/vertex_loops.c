/* Loops over groups of vertices around the kernels above. */

/* the motion M (12) of a group */
static ALWAYS_INLINE void motion_of(const group_t *of, const double *motion, v *restrict M)
{
    v sum[12] = {{0}};
    for (integer i = 0; i < of->lists.carriers; ++i) {
        const integer k = of->lists.carrier[i];
        blended(of->weights + k, motion + MOTIONS + 12 * k, sum);
    }
    memcpy(M, sum, sizeof sum);
}

/* the rest vertex; and with `bulges` (9 for each joint that bends it), how the pose of these joints moves it
through what they bend, turned by M. The sums are in the same order with bulges and without, so that their bits
are the same */
static ALWAYS_INLINE void at_rest(const group_t *of, const double *motion, const v *restrict M,
                                  v *restrict bulges, v *restrict rest)
{
    const lists_t *lists = &of->lists;
    v sum[3];
    shaped(of->vertex, of->shapes, motion, sum);
    for (integer i = 0; i < lists->benders; ++i) { /* in the order in which they are stored */
        const integer k = lists->bender[i];
        const double *feature = motion + FEATURES + 9 * (k - 1);
        const double *slope = motion + OF_JOINTS + OF_JOINT * k + 9;
        const stored *bend = of->bends + 27 * i;
        v own[9] = {{0}};
        if (bulges) look_ahead(bend + 27 * AHEAD, 27 * sizeof(stored));
        _Pragma("GCC unroll 9") for (integer n = 0; n < 9; ++n) {
            bent(bend + 3 * n, feature + n, sum);
            if (bulges) bulging(bend + 3 * n, slope + 3 * n, own);
        }
        if (bulges) bulged((const anywhere *)M, (const anywhere *)own, bulges + 9 * i);
    }
    memcpy(rest, sum, sizeof sum);
}

/* found (N, 3) */
EXPORT void points(const body_t *body, const double *betas, const double *moving, double *found)
{
    const v one[3] = {BROADCAST(1.0), BROADCAST(1.0), BROADCAST(1.0)};
    const integer *joints = body->joints;
    double motion[OF_JOINTS];
    group_t of;
    column_of(body, betas, moving, NULL, motion);
    for (integer i = 0; i < body->N; i += LANES) {
        v rest[3], M[12], here[3];
        joints = next_group(body, i, joints, &of);
        motion_of(&of, motion, M);
        at_rest(&of, motion, M, NULL, rest);
        moved((const anywhere *)M, (const anywhere *)rest, here);
        put(here[0], here[1], here[2], at_most_all(body->N - i), one, found + 3 * i);
    }
}

/* the derivative of a group by the pose, to rows from column 3 i on */
static ALWAYS_INLINE void by_pose(const group_t *of, const double *motion, const v *rest, const v *bulges,
                           integer count, const v *factor, double *const *pose, integer i)
{
    const lists_t *lists = &of->lists;
    v hanging[4 * JOINTS]; /* set only where something hangs */
    for (integer m = 0; m < lists->movers; ++m)
        memset(hanging + 4 * lists->mover[m], 0, 4 * sizeof(v));
    for (integer c = 0; c < lists->carriers; ++c) {
        const integer k = lists->carrier[c];
        below(of->weights + k, motion + MOTIONS + 12 * k, (const anywhere *)rest, hanging + 4 * k);
    }
    for (integer m = lists->movers - 1; m > 0; --m) { /* children come after their parents */
        const integer k = lists->mover[m];
        hung((const anywhere *)hanging + 4 * k, hanging + 4 * parents[k]);
    }
    for (integer m = 0, b = 0; m < lists->movers || b < lists->benders;) {
        v own[3], slope[9] = {{0}};
        const integer turns = m < lists->movers ? lists->mover[m] : JOINTS;
        const integer bends = b < lists->benders ? lists->bender[b] : JOINTS;
        const integer k = turns < bends ? turns : bends;
        const double *of_joint = motion + OF_JOINTS + OF_JOINT * k;
        double *const *rows = pose + 3 * k;
        const v *bulge = bulges + 9 * b;
        m += turns == k;
        b += bends == k;
        if (!rows[0] && !rows[1] && !rows[2]) continue; /* a joint that is held */
        if (bends == k) memcpy(slope, bulge, sizeof slope);
        if (turns == k) {
            arm((const anywhere *)hanging + 4 * k, motion + CENTRES + 3 * k, own);
            turned((const anywhere *)own, of_joint, slope);
        }
        spread(slope, 3, count, factor, rows, 3 * i);
    }
}

/* what the derivative is written to: see `tangent` */
typedef struct {
    const double *scale;
    double *const *pose, *const *betas, *const *trans;
    double *points;
} wanted_t;

/* the derivatives and points of a group of `count` vertices, of which i is the first one */
static ALWAYS_INLINE void of_group(const body_t *body, const group_t *of, integer i, integer count,
                                   const double *motion, const wanted_t *into)
{
    const v zero = BROADCAST(0.0), unit = BROADCAST(1.0), one[3] = {unit, unit, unit};
    v factor[3] = {unit, unit, unit};
    v rest[3], M[12], here[3], bulges[9 * JOINTS];
    if (into->scale) memcpy(factor, into->scale + 3 * i, 3 * count * sizeof(double));
    look_ahead(of->vertex + ROWS, ROWS * sizeof(v));
    look_ahead(of->shapes + 3 * BETAS, 3 * BETAS * sizeof(stored));
    motion_of(of, motion, M);
    if (into->pose)
        at_rest(of, motion, M, bulges, rest);
    else
        at_rest(of, motion, M, NULL, rest);
    if (into->points) {
        moved((const anywhere *)M, (const anywhere *)rest, here);
        put(here[0], here[1], here[2], count, one, into->points + 3 * i);
    }
    if (into->pose) by_pose(of, motion, rest, bulges, count, factor, into->pose, i);
    if (into->betas) {
        for (int j = 0; j < 12; ++j) /* M is not needed any more but for stored shapes */
            M[j] *= BROADCAST(body->steps[0]);
        for (integer b = 0; b < BETAS; ++b) {
            v slope[3];
            if (!into->betas[b]) continue;
            by_beta(of->shapes + 3 * b, (const anywhere *)M, slope);
            for (integer c = 0; c < of->lists.carriers; ++c) {
                const integer k = of->lists.carrier[c];
                shifted(of->weights + k, motion + OF_BETAS + 3 * (JOINTS * b + k), slope);
            }
            put(slope[0], slope[1], slope[2], count, factor, into->betas[b] + 3 * i);
        }
    }
    if (into->trans) {
        double *const *rows = into->trans;
        if (rows[0]) put(unit, zero, zero, count, factor, rows[0] + 3 * i);
        if (rows[1]) put(zero, unit, zero, count, factor, rows[1] + 3 * i);
        if (rows[2]) put(zero, zero, unit, count, factor, rows[2] + 3 * i);
    }
}

/* the last group, apart, so that the code for all others need not know of fewer vertices */
static __attribute__((noinline)) void of_last(const body_t *body, const group_t *of, integer i,
                                              const double *motion, const wanted_t *into)
{
    of_group(body, of, i, body->N - i, motion, into);
}

/* zeros where a joint leaves vertices alone; pose: see `tangent` */
EXPORT void clear(const body_t *body, double *const *pose)
{
    for (integer s = 0; s < body->stretches; ++s) {
        const integer *stretch = body->still + 3 * s;
        for (integer row = 3 * stretch[0]; row < 3 * stretch[0] + 3; ++row)
            if (pose[row]) memset(pose[row] + 3 * stretch[1], 0, 3 * stretch[2] * sizeof(double));
    }
}

/* pose (3 K, 3 N), betas (B, 3 N), trans (3, 3 N): each absent, or the addresses of its rows, of
which some may be absent; scale (3 N) multiplies columns, or is absent; found (N, 3), or absent: the
points. Where a joint leaves vertices alone, nothing is written */
EXPORT void tangent(const body_t *body, const double *person, const double *moving, const double *slopes,
                    const double *scale, double *const *pose, double *const *betas,
                    double *const *trans, double *found)
{
    const wanted_t into = {scale, pose, betas, trans, found};
    const integer *joints = body->joints;
    double motion[COLUMN];
    group_t of;
    integer i = 0;
    column_of(body, person, moving, slopes, motion);
    for (; i + LANES <= body->N; i += LANES) {
        joints = next_group(body, i, joints, &of);
        of_group(body, &of, i, LANES, motion, &into);
    }
    if (i == body->N) return;
    next_group(body, i, joints, &of);
    of_last(body, &of, i, motion, &into);
}

/* felt (MOTIONS + 12 JOINTS): by betas, features and motions, the sum of pull (N, 3) times the points */
EXPORT void adjoint(const body_t *body, const double *betas, const double *moving, const double *pull,
                    double *felt)
{
    v sum[MOTIONS + 12 * JOINTS] = {{0}};
    const integer *joints = body->joints;
    double motion[OF_JOINTS];
    group_t of;
    column_of(body, betas, moving, NULL, motion);
    for (integer i = 0; i < body->N; i += LANES) {
        v planar[3], rest[3], M[12], inside[3];
        double some[3 * LANES] = {0};
        joints = next_group(body, i, joints, &of);
        memcpy(some, pull + 3 * i, 3 * at_most_all(body->N - i) * sizeof(double));
        for (int lane = 0; lane < LANES; ++lane)
            for (int d = 0; d < 3; ++d) planar[d][lane] = some[3 * lane + d];
        look_ahead(of.vertex + ROWS, ROWS * sizeof(v));
        look_ahead(of.shapes + 3 * BETAS, 3 * BETAS * sizeof(stored));
        motion_of(&of, motion, M);
        at_rest(&of, motion, M, NULL, rest);
        on_rest((const anywhere *)M, (const anywhere *)planar, inside);
        on_betas(of.shapes, (const anywhere *)inside, sum);
        for (integer b = 0; b < of.lists.benders; ++b)
            on_features(of.bends + 27 * b, (const anywhere *)inside,
                        sum + FEATURES + 9 * (of.lists.bender[b] - 1));
        for (integer c = 0; c < of.lists.carriers; ++c) {
            const integer k = of.lists.carrier[c];
            on_motion(of.weights + k, (const anywhere *)rest, (const anywhere *)planar,
                      sum + MOTIONS + 12 * k);
        }
    }
    for (integer k = 0; k < MOTIONS + 12 * JOINTS; ++k) {
        felt[k] = 0;
        for (int lane = 0; lane < LANES; ++lane) felt[k] += sum[k][lane];
    }
}
