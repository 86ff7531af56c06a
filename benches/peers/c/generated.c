/* The yardstick's side of `kernels`: straight-line C for one robot, of which symbolic.py wrote the file given as ROBOT_C:
 * generated CASES SECONDS LABEL ROBOT. It has the chain, the mass matrix and the inverse dynamics. */
#include <string.h>

#include "common.h"
#include ROBOT_C

int main(int argc, char **argv) {
    if (argc != 5) return 2;
    static Case c;
    static double work[1 << 20], j[3 * DOF], m[DOF * DOF], h[9], after[DOF], tau[DOF];
    static casadi_int ints[1024];
    const double normal[3] = {-1, 0, 0}, e = 0.35;
    double seconds = atof(argv[2]);
    FILE *cases = fopen(argv[1], "r");
    while (cases && next_case(cases, &c)) {
        if (strcmp(c.name, argv[4])) continue;
        const double *in[8] = {c.q, c.qd, normal, &e};
        double *out[8] = {j, m, h, after};
        TIMED(argv[3], "chain", c.name, seconds, chain(in, out, ints, work, 0), after, DOF);
        double *only[8] = {m};
        TIMED(argv[3], "mass", c.name, seconds, mass(in, only, ints, work, 0), m, DOF * DOF);
        const double *moving[8] = {c.q, c.qd, c.input};
        double *torque[8] = {tau};
        TIMED(argv[3], "inverse", c.name, seconds, inverse(moving, torque, ints, work, 0), tau, DOF);
    }
    return 0;
}
