/* The closest triangle of each point, and where it is in it; the arithmetic is that of
surface_boxes.py and surface_search.py, operation by operation, so that both say the same.

Compiled without contraction of products and sums; loops over WIDE lanes become vector instructions. */

#include <math.h>
#include <stddef.h>

#define WIDE 8
#define ROWS 18
#define NONE (-1)
#define FAR 1e150
#define TINY 1e-300
#define SHRINK (1 - 1e-14)
#define DEEPEST 24 /* levels: 8^24 triangles are more than there are */

#define EXPORT __attribute__((visibility("default")))
#define INLINE static inline __attribute__((always_inline))

typedef ptrdiff_t integer;
typedef long long number;

typedef struct {
    integer levels;
    const integer *offsets;  /* of each level, in nodes */
    const number *leaves;    /* (L, WIDE) faces */
    const double *triangles; /* (L, ROWS, WIDE) */
    const double *nodes;     /* (nodes, 6, WIDE) */
    const double *normals;   /* (F, 3) */
    const double *turned;    /* (3,) the point's normal, or none */
    double facing;
} tree;

typedef struct { double square; number face; integer leaf, lane; } best;
typedef struct { double square; integer level, index; } waiting;

INLINE double dot(double x, double y, double z, double a, double b, double c)
{
    return x * a + y * b + z * c;
}

INLINE double square(const double *x) { return dot(x[0], x[1], x[2], x[0], x[1], x[2]); }

INLINE void cross(const double *x, const double *y, double *z)
{
    z[0] = x[1] * y[2] - x[2] * y[1];
    z[1] = x[2] * y[0] - x[0] * y[2];
    z[2] = x[0] * y[1] - x[1] * y[0];
}

/* The numbers of all triangles, from the vertices (N, 3); see the attributes of Boxes. */
EXPORT void fit(
    integer L, const number *leaves, const number *faces, const number *rising,
    const double *vertices, double flat, double *triangles, double *normals, double *areas,
    double *turns)
{
    for (integer i = 0; i < L * WIDE; i++) {
        double *t = triangles + i / WIDE * ROWS * WIDE + i % WIDE;
        const number face = leaves[i];
        if (face == NONE) {
            for (integer row = 0; row < ROWS; row++) t[row * WIDE] = row < 9 ? FAR : 0;
            continue;
        }
        const number *of = faces + 3 * face, *to = rising + 3 * face;
        const double *a = vertices + 3 * of[to[0]], *b = vertices + 3 * of[to[1]];
        const double *c = vertices + 3 * of[to[2]];
        double u[3], v[3], w[3], n[3], g[3], h[3];
        for (integer k = 0; k < 3; k++) {
            u[k] = b[k] - a[k], v[k] = c[k] - a[k], w[k] = c[k] - b[k];
            t[k * WIDE] = a[k], t[(3 + k) * WIDE] = b[k], t[(6 + k) * WIDE] = c[k];
        }
        cross(u, v, n);
        const double squares[3] = {square(u), square(v), square(w)};
        double longest = squares[0];
        for (integer k = 0; k < 3; k++) {
            t[(9 + k) * WIDE] = squares[k] > TINY ? 1 / squares[k] : 0;
            longest = squares[k] > longest ? squares[k] : longest;
        }
        const double area = sqrt(square(n)), sign = (to[1] - to[0] + 3) % 3 == 1 ? 1 : -1;
        const int thin = !(area > flat * longest);
        areas[face] = area;
        turns[3 * face + to[0]] = dot(u[0], u[1], u[2], v[0], v[1], v[2]);
        turns[3 * face + to[1]] = -dot(u[0], u[1], u[2], w[0], w[1], w[2]);
        turns[3 * face + to[2]] = dot(v[0], v[1], v[2], w[0], w[1], w[2]);
        for (integer k = 0; k < 3; k++) n[k] = thin ? 0 : n[k] / area;
        cross(v, n, g);
        cross(n, u, h);
        for (integer k = 0; k < 3; k++) {
            normals[3 * face + k] = n[k] * sign;
            t[(12 + k) * WIDE] = thin ? 0 : g[k] / area;
            t[(15 + k) * WIDE] = thin ? 0 : h[k] / area;
        }
    }
}

/* The boxes of the children of all nodes, those around leaves wider by `wide`. */
EXPORT void enclose(
    integer levels, const integer *counts, const double *triangles, double wide, double *nodes)
{
    integer below = 0, first = 0; /* of the nodes on the level below, and on this */
    for (integer level = 0; level < levels - 1; level++) first += counts[level];
    for (integer level = levels - 2; level >= 0; level--) {
        first -= counts[level];
        for (integer i = 0; i < counts[level] * WIDE; i++) {
            double *to = nodes + (first + i / WIDE) * 6 * WIDE + i % WIDE;
            const int there = i < counts[level + 1], of_leaves = level == levels - 2;
            for (integer k = 0; k < 3; k++) {
                double low = FAR, high = -FAR;
                const double *from = of_leaves ? triangles + (i * ROWS + k) * WIDE
                                               : nodes + ((below + i) * 6 + k) * WIDE;
                for (integer j = 0; there && j < WIDE; j++)
                    if (of_leaves)
                        for (integer corner = 0; corner < 9; corner += 3) {
                            const double x = from[corner * WIDE + j];
                            low = x < low ? x : low;
                            high = x > high && x < FAR ? x : high;
                        }
                    else {
                        low = from[j] < low ? from[j] : low;
                        high = from[3 * WIDE + j] > high ? from[3 * WIDE + j] : high;
                    }
                to[k * WIDE] = of_leaves ? low - wide : low;
                to[(3 + k) * WIDE] = of_leaves ? high + wide : high;
            }
        }
        below = first;
    }
}

/* Squared distances to a, b, c, ab, ac, bc and the inside; shares v, w and along ab, ac, bc. */
INLINE void candidates(const double *t, double x, double y, double z, double *d, double *s)
{
#define AT(row) t[WIDE * (row)]
    const double ax = AT(0), ay = AT(1), az = AT(2), bx = AT(3), by = AT(4), bz = AT(5);
    const double cx = AT(6), cy = AT(7), cz = AT(8);
    const double px = x - ax, py = y - ay, pz = z - az, qx = x - bx, qy = y - by, qz = z - bz;
    const double rx = x - cx, ry = y - cy, rz = z - cz;
    const double ux = bx - ax, uy = by - ay, uz = bz - az, vx = cx - ax, vy = cy - ay, vz = cz - az;
    const double wx = cx - bx, wy = cy - by, wz = cz - bz;
    d[0] = dot(px, py, pz, px, py, pz);
    d[1] = dot(qx, qy, qz, qx, qy, qz);
    d[2] = dot(rx, ry, rz, rx, ry, rz);
#define EDGE(k, p, e, inverse)                                                          \
    {                                                                                   \
        const double along = dot(p##x, p##y, p##z, e##x, e##y, e##z) * inverse;         \
        const double fx = p##x - along * e##x, fy = p##y - along * e##y;                \
        const double fz = p##z - along * e##z, f = dot(fx, fy, fz, fx, fy, fz);         \
        s[k - 1] = along;                                                               \
        d[k] = (along > 0) & (along < 1) ? f : INFINITY;                                \
    }
    EDGE(3, p, u, AT(9))
    EDGE(4, p, v, AT(10))
    EDGE(5, q, w, AT(11))
    double g = 0, h = 0, fx = px, fy = py, fz = pz;
    for (integer i = 0; i < 2; i++) { /* a second time, as the first is inexact in a thin triangle */
        const double more_g = dot(fx, fy, fz, AT(12), AT(13), AT(14));
        const double more_h = dot(fx, fy, fz, AT(15), AT(16), AT(17));
        g += more_g, h += more_h;
        fx = fx - more_g * ux - more_h * vx;
        fy = fy - more_g * uy - more_h * vy;
        fz = fz - more_g * uz - more_h * vz;
    }
    const double f = dot(fx, fy, fz, fx, fy, fz);
    s[0] = g, s[1] = h;
    d[6] = (g > 0) & (h > 0) & (1 - g - h > 0) ? f : INFINITY;
}

INLINE double least(double x, double y) { return x < y ? x : y; }

/* Compare a leaf's triangles with the best so far. */
INLINE void visit(const tree *of, integer leaf, const double *p, best *found)
{
    const double *triangles = of->triangles + leaf * ROWS * WIDE;
    const double x = p[0], y = p[1], z = p[2];
    double squares[WIDE], less[WIDE / 2];
    for (integer i = 0; i < WIDE; i++) {
        double d[7], s[5];
        candidates(triangles + i, x, y, z, d, s);
        const double corner = least(least(d[0], d[1]), d[2]);
        squares[i] = least(least(corner, least(d[3], d[4])), least(d[5], d[6]));
    }
    for (integer i = 0; i < WIDE / 2; i++) less[i] = least(squares[i], squares[i + WIDE / 2]);
    if (!(least(least(less[0], less[1]), least(less[2], less[3])) <= found->square)) return;
    for (integer i = 0; i < WIDE; i++) {
        const number face = of->leaves[leaf * WIDE + i];
        if (!(squares[i] <= found->square) || face == NONE) continue;
        if (squares[i] == found->square && face >= found->face) continue;
        if (of->turned) {
            const double *n = of->normals + 3 * face, *q = of->turned;
            if (!(dot(n[0], n[1], n[2], q[0], q[1], q[2]) >= of->facing)) continue;
        }
        *found = (best){squares[i], face, leaf, i};
    }
}

/* Compare all triangles that may be closer, but those of the leaf `seen`. */
INLINE void descend(const tree *of, integer seen, const double *p, best *found)
{
    waiting stack[DEEPEST * WIDE];
    const double x = p[0], y = p[1], z = p[2];
    const integer last = of->levels - 1;
    integer height = 0;
    stack[height++] = (waiting){0, 0, 0};
    while (height) {
        const waiting here = stack[--height];
        if (!(here.square <= found->square)) continue;
        if (here.level == last) {
            if (here.index != seen) visit(of, here.index, p, found);
            continue;
        }
        const double *sides = of->nodes + (of->offsets[here.level] + here.index) * 6 * WIDE;
        double squares[WIDE];
        for (integer i = 0; i < WIDE; i++) {
            double out[3];
            const double q[3] = {x, y, z};
            for (integer k = 0; k < 3; k++) {
                const double below = sides[k * WIDE + i] - q[k], above = q[k] - sides[(k + 3) * WIDE + i];
                const double most = below > above ? below : above;
                out[k] = most > 0 ? most : 0;
            }
            squares[i] = dot(out[0], out[1], out[2], out[0], out[1], out[2]) * SHRINK;
        }
        const integer bottom = height;
        for (integer i = 0; i < WIDE; i++) {
            if (!(squares[i] <= found->square) || !(squares[i] < FAR)) continue;
            integer place = height++;
            for (; place > bottom && stack[place - 1].square < squares[i]; place--)
                stack[place] = stack[place - 1];
            stack[place] = (waiting){squares[i], here.level + 1, WIDE * here.index + i};
        }
    }
}

/* The sum of the normals around a place in a face. */
INLINE void gather(
    const tree *of, number face, const double *shares, const number *faces, const number *edges,
    number n_edges, const number *starts, const number *corners, const double *angles, double *sum)
{
    const integer count = (shares[0] > 0) + (shares[1] > 0) + (shares[2] > 0);
    if (count == 3) {
        for (integer k = 0; k < 3; k++) sum[k] = of->normals[3 * face + k];
        return;
    }
    integer one = 0; /* the largest share, or the smallest */
    for (integer k = 1; k < 3; k++)
        if (count == 1 ? shares[k] > shares[one] : shares[k] < shares[one]) one = k;
    const number feature = count == 1 ? n_edges + faces[3 * face + one] : edges[3 * face + one];
    sum[0] = sum[1] = sum[2] = 0;
    for (number i = starts[feature]; i < starts[feature + 1]; i++) {
        const double weight = count == 1 ? angles[corners[i]] : 1;
        for (integer k = 0; k < 3; k++) sum[k] += of->normals[corners[i] / 3 * 3 + k] * weight;
    }
}

EXPORT void closest(
    integer M, const double *points, const double *turned, double square, double facing,
    integer levels, const integer *offsets, const number *leaves, const double *triangles,
    const double *nodes, const double *normals, const number *rising, const number *faces,
    const number *edges, number n_edges, const number *starts, const number *corners,
    const double *angles, integer F, number *found, double *shares, double *squares, double *sums)
{
    tree of = {levels, offsets, leaves, triangles, nodes, normals, NULL, facing};
    integer before = 0; /* the leaf that the point before was closest to */
    for (integer i = 0; i < M; i++) {
        best at = {square, F, NONE, 0};
        if (turned) of.turned = turned + 3 * i;
        visit(&of, before, points + 3 * i, &at);
        descend(&of, before, points + 3 * i, &at);
        squares[i] = at.square;
        found[i] = at.face < F ? at.face : NONE;
        for (integer k = 0; k < 3; k++) shares[3 * i + k] = sums[3 * i + k] = 0;
        if (at.face >= F) continue;
        before = at.leaf;
        double d[7], s[5];
        candidates(triangles + at.leaf * ROWS * WIDE + at.lane, points[3 * i], points[3 * i + 1],
                   points[3 * i + 2], d, s);
        integer kind = 0;
        for (integer k = 1; k < 7; k++)
            if (d[k] < d[kind]) kind = k;
        const double abc[7][3] = {
            {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {1 - s[2], s[2], 0}, {1 - s[3], 0, s[3]},
            {0, 1 - s[4], s[4]}, {1 - s[0] - s[1], s[0], s[1]}};
        for (integer k = 0; k < 3; k++) shares[3 * i + rising[3 * at.face + k]] = abc[kind][k];
        gather(&of, at.face, shares + 3 * i, faces, edges, n_edges, starts, corners, angles, sums + 3 * i);
    }
}
