/* MuJoCo's side of `kernels`: mujoco CASES FOLDER SECONDS LABEL; FOLDER holds NAME.mjb with a site `tip`. */
#include <mujoco/mujoco.h>
#include <string.h>

#include "common.h"

static mjModel *m;
static mjData *d;
static int site, joint_of[MOST];
static double jacobian[3 * MOST], solved[3 * MOST], h[9], after[MOST], mass[MOST * MOST], force[MOST];
static const double NORMAL[3] = {-1, 0, 0};

static void chain(const Case *c) {
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

/* From MuJoCo's order of joints to that of the cases. */
static const double *ordered(const double *x, int n) {
    static double out[MOST];
    for (int i = 0; i < n; i++) out[i] = x[joint_of[i]];
    return out;
}

int main(int argc, char **argv) {
    if (argc != 5) return 2;
    static Case c;
    double seconds = atof(argv[3]), tau[MOST];
    static double shown[MOST * MOST];
    FILE *cases = fopen(argv[1], "r");
    while (cases && next_case(cases, &c)) {
        char path[2048];
        snprintf(path, sizeof path, "%s/%s.mjb", argv[2], c.name);
        m = mj_loadModel(path, NULL);
        d = mj_makeData(m);
        site = mj_name2id(m, mjOBJ_SITE, "tip");
        for (int i = 0; i < c.n; i++) {
            int j = m->jnt_dofadr[mj_name2id(m, mjOBJ_JOINT, c.joint[i])];
            joint_of[i] = j;
            d->qpos[j] = c.q[i];
            d->qvel[j] = c.qd[i];
            d->qacc[j] = tau[j] = c.input[i];
        }
        TIMED(argv[4], "chain", c.name, seconds, chain(&c), ordered(after, c.n), c.n);
        TIMED(argv[4], "mass", c.name, seconds, mass_matrix(), shown, 0);
        TIMED(argv[4], "inverse", c.name, seconds, inverse(), ordered(force, c.n), c.n);
        TIMED(argv[4], "forward", c.name, seconds, forward(tau), ordered(after, c.n), c.n);
        mj_deleteData(d);
        mj_deleteModel(m);
    }
    return 0;
}
