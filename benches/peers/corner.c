/* Functions that Siconos calls for a box that moves in a plane, q = (x, z, angle about y). CORNER(K, A, B) defines those of a corner at
 * (A, B) in the axes of the body, x and z. Included after the numbers of the scene: POINT, NORMAL. */

#include <math.h>

/* Rows along the normal and the tangent of an arm's velocity or acceleration (x, z) per unit of the angle's. */
static void corner_rows(double x, double z, double unit, double *out) {
    out[0] = NORMAL[0] * unit, out[2] = NORMAL[2] * unit, out[4] = NORMAL[0] * x + NORMAL[2] * z;
    out[1] = NORMAL[2] * unit, out[3] = -NORMAL[0] * unit, out[5] = NORMAL[2] * x - NORMAL[0] * z;
}

/* A rotation by the angle about y takes x to (cos, -sin) and z to (sin, cos). */
#define CORNER(K, A, B)                                                                                             \
    static double x##K(const double *q) { return cos(q[2]) * (A) + sin(q[2]) * (B); }                               \
    static double z##K(const double *q) { return cos(q[2]) * (B) - sin(q[2]) * (A); }                               \
    void gap##K(unsigned n, double *q, unsigned ny, double *y, unsigned nz, double *z) {                            \
        double px = q[0] + x##K(q) - POINT[0], pz = q[1] + z##K(q) - POINT[2];                                      \
        y[0] = NORMAL[0] * px + NORMAL[2] * pz, y[1] = NORMAL[2] * px - NORMAL[0] * pz;                             \
    }                                                                                                               \
    void rows##K(unsigned n, double *q, unsigned ny, double *g, unsigned nz, double *z) {                           \
        corner_rows(z##K(q), -x##K(q), 1.0, g);                                                                     \
    }                                                                                                               \
    void rate##K(unsigned n, double *q, unsigned nd, double *qd, double *g, unsigned nz, double *z) {               \
        corner_rows(-x##K(q) * qd[2], -z##K(q) * qd[2], 0.0, g);                                                    \
    }
