/* Functions that Siconos calls for a robot of hinges. Included after the C of symbolic.py (functions `mass`, `bias`, `tip`,
 * `jacobian`, `rate`, constant DOF) and after the numbers of the scene: POINT, NORMAL, TANGENT, RADIUS, ROWS. */

static void call(int (*f)(const double **, double **, long long *, double *, int), const double *q, const double *qd, double *out) {
    static double work[65536];
    static long long ints[1024];
    const double *in[8] = {q, qd};
    double *outs[8] = {out};
    f(in, outs, ints, work, 0);
}

static double dot(const double *a, const double *b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

/* Rows of `cartesian` (3 x DOF) along the normal and, with friction, the tangent. Matrices are column-major. */
static void rows(const double *cartesian, double *out) {
    for (int j = 0; j < DOF; j++)
        for (int i = 0; i < ROWS; i++) out[j * ROWS + i] = dot(i ? TANGENT : NORMAL, cartesian + 3 * j);
}

void mass_matrix(unsigned n, double *q, double *m, unsigned nz, double *z) { call(mass, q, 0, m); }

void bias_force(unsigned n, double *q, double *qd, double *f, unsigned nz, double *z) { call(bias, q, qd, f); }

void gap(unsigned n, double *q, unsigned ny, double *y, unsigned nz, double *z) {
    double at[3];
    call(tip, q, 0, at);
    y[0] = dot(NORMAL, at) - dot(NORMAL, POINT) - RADIUS;
    if (ROWS > 1) y[1] = dot(TANGENT, at);
}

void gap_rows(unsigned n, double *q, unsigned ny, double *g, unsigned nz, double *z) {
    double j[3 * DOF];
    call(jacobian, q, 0, j);
    rows(j, g);
}

void gap_rows_rate(unsigned n, double *q, unsigned nd, double *qd, double *g, unsigned nz, double *z) {
    double j[3 * DOF];
    call(rate, q, qd, j);
    rows(j, g);
}
