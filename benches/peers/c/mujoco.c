/* MuJoCo in `kernels`: mujoco CASES ROBOT SECONDS LABEL FOLDER; FOLDER holds ROBOT.mjb with a site `tip`. */
#include <mujoco/mujoco.h>

#include "common.h"

static mjModel *m;
static mjData *d;
static Case c;
static int site, joint_of[MOST];
/* The states in MuJoCo's order of joints. */
static double q[MOST_STATES][MOST], qd[MOST_STATES][MOST], input[MOST_STATES][MOST];
static double jacobian[3 * MOST], solved[3 * MOST], h[9], after[MOST], force[MOST];
static const double NORMAL[3] = {-1, 0, 0};

/* The state is read through these pointers without a copy. */
static void state(int k) {
    d->qpos = q[k];
    d->qvel = qd[k];
    d->qacc = input[k];
}

static void chain(void) {
    mj_kinematics(m, d);
    mj_comPos(m, d);
    mj_makeM(m, d);
    mj_factorM(m, d);
    mj_jacSite(m, d, jacobian, NULL, site);
    mj_solveM(m, d, solved, jacobian, 3);
    double u = 0, k = 0;
    for (int a = 0; a < 3; a++)
        for (int b = 0; b < 3; b++) h[3 * a + b] = mju_dot(jacobian + a * m->nv, solved + b * m->nv, m->nv);
    for (int a = 0; a < 3; a++) {
        u += NORMAL[a] * mju_dot(jacobian + a * m->nv, d->qvel, m->nv);
        for (int b = 0; b < 3; b++) k += NORMAL[a] * h[3 * a + b] * NORMAL[b];
    }
    double impulse = -1.35 * u / k;
    for (int i = 0; i < m->nv; i++) {
        after[i] = d->qvel[i];
        for (int a = 0; a < 3; a++) after[i] += solved[a * m->nv + i] * NORMAL[a] * impulse;
    }
}

static void mass_matrix(void) {
    mj_kinematics(m, d);
    mj_comPos(m, d);
    mj_makeM(m, d);
}

static void inverse(void) {
    mj_kinematics(m, d);
    mj_comPos(m, d);
    mj_comVel(m, d);
    mj_rne(m, d, 1, force);
}

static void forward(const double *tau) {
    mj_kinematics(m, d);
    mj_comPos(m, d);
    mj_comVel(m, d);
    mj_makeM(m, d);
    mj_factorM(m, d);
    mj_rne(m, d, 0, force);
    for (int i = 0; i < m->nv; i++) force[i] = tau[i] - force[i];
    mj_solveM(m, d, after, force, 1);
}

/* From MuJoCo's order of joints to that of the cases; then H's x and y rows. */
static const double *ordered(const double *x) {
    static double out[MOST + 3];
    for (int i = 0; i < c.n; i++) out[i] = x[joint_of[i]];
    out[c.n] = h[0];
    out[c.n + 1] = h[1];
    out[c.n + 2] = h[4];
    return out;
}

/* M times the state's `input`. */
static const double *product(int k) {
    static double y[MOST];
    mj_mulM(m, d, y, input[k]);
    return ordered(y);
}

int main(int argc, char **argv) {
    if (argc != 6 || !find_case(argv[1], argv[2], &c)) return 2;
    double seconds = atof(argv[3]);
    char path[2048];
    snprintf(path, sizeof path, "%s/%s.mjb", argv[5], c.name);
    m = mj_loadModel(path, NULL);
    d = mj_makeData(m);
    site = mj_name2id(m, mjOBJ_SITE, "tip");
    for (int i = 0; i < c.n; i++) {
        int j = joint_of[i] = m->jnt_dofadr[mj_name2id(m, mjOBJ_JOINT, c.joint[i])];
        for (int k = 0; k < c.states; k++) {
            q[k][j] = c.q[k][i];
            qd[k][j] = c.qd[k][i];
            input[k][j] = c.input[k][i];
        }
    }
    TIMED(argv[4], "chain", c, seconds, (state(k), chain()), ordered(after), c.n + 3);
    TIMED(argv[4], "mass", c, seconds, (state(k), mass_matrix()), product(k), c.n);
    TIMED(argv[4], "inverse", c, seconds, (state(k), inverse()), ordered(force), c.n);
    TIMED(argv[4], "forward", c, seconds, (state(k), forward(input[k])), ordered(after), c.n);
    return 0;
}
