/* The rows of A times a sparse matrix W, transposed: into[k, i] is row i of W times row k of A.

LANES rows of A at a time are put side by side in `room`, (width, LANES), so that every entry of W
is multiplied with all of them by one instruction or two. */

#include <stddef.h>

#define LANES 8
#define EXPORT __attribute__((visibility("default")))

typedef ptrdiff_t integer;

EXPORT void rows_times(
    integer count, integer width, const double *A, integer rows, const integer *starts,
    const integer *columns, const double *restrict entries, double *into, integer stride,
    double *restrict room)
{
    for (integer first = 0; first < count; first += LANES) {
        const integer lanes = count - first < LANES ? count - first : LANES;
        const double *a[LANES];
        for (integer lane = 0; lane < LANES; lane++)
            a[lane] = A + (first + (lane < lanes ? lane : 0)) * width;
        for (integer j = 0; j < width; j++)
            for (integer lane = 0; lane < LANES; lane++) room[LANES * j + lane] = a[lane][j];
        for (integer i = 0; i < rows; i++) {
            double sum[LANES] = {0};
            for (integer j = starts[i]; j < starts[i + 1]; j++) {
                const double *beside = room + LANES * columns[j];
                for (int lane = 0; lane < LANES; lane++) sum[lane] += entries[j] * beside[lane];
            }
            for (integer lane = 0; lane < lanes; lane++) into[(first + lane) * stride + i] = sum[lane];
        }
    }
}
