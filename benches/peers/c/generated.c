/* Generated code in `kernels`: straight-line C for one robot, in the file ROBOT_C that symbolic.py writes:
 * generated CASES ROBOT SECONDS LABEL. */
#include "common.h"
#include ROBOT_C

static Case c;
static double work[1 << 16], j[3 * DOF], m[DOF * DOF], out[DOF + 9];
static casadi_int ints[1024];

/* M times the state's `input`. */
static const double *product(int k) {
    static double y[DOF];
    for (int i = 0; i < DOF; i++) {
        y[i] = 0;
        for (int l = 0; l < DOF; l++) y[i] += m[i + DOF * l] * c.input[k][l];
    }
    return y;
}

int main(int argc, char **argv) {
    if (argc != 5 || !find_case(argv[1], argv[2], &c)) return 2;
    const double normal[3] = {-1, 0, 0}, e = 0.35, seconds = atof(argv[3]);
    static double h[9];
    /* H's x and y rows, as in the other programs. */
    double *to[8] = {j, m, h, out};
#define CHAIN chain((const double *[8]){c.q[k], c.qd[k], normal, &e}, to, ints, work, 0)
    TIMED(argv[4], "chain", c, seconds, CHAIN, (out[DOF] = h[0], out[DOF + 1] = h[1], out[DOF + 2] = h[4], out), DOF + 3);
    double *only[8] = {m}, *answer[8] = {out};
    TIMED(argv[4], "mass", c, seconds, mass((const double *[8]){c.q[k]}, only, ints, work, 0), product(k), DOF);
#define STATE (const double *[8]){c.q[k], c.qd[k], c.input[k]}
    TIMED(argv[4], "inverse", c, seconds, inverse(STATE, answer, ints, work, 0), out, DOF);
    TIMED(argv[4], "forward", c, seconds, forward(STATE, answer, ints, work, 0), out, DOF);
    return 0;
}
