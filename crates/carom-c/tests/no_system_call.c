/* What is prepared makes no system call: the kernel ends this process at its first one. Linux; run by .ci/c.
 * Usage: no_system_call ARM7.urdf LAW */
#include <carom.h>
#include <linux/seccomp.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <unistd.h>

#define STATES 64
#define NV 7

static void check(carom_status status) {
    if (status != CAROM_OK) {
        fprintf(stderr, "error: %s\n", carom_error());
        exit(1);
    }
}

int main(int argc, char **argv) {
    if (argc != 3) {
        return 2;
    }
    carom_chain *arm;
    carom_law *law;
    carom_strike *strike;
    carom_dynamics *dynamics;
    size_t tip;
    const double point[3] = {0, 0, 0}, normal[3] = {0, 0, 1}, gravity[3] = {0, 0, -9.81};
    const double h[9] = {2.0, 0.3, -0.5, 0.3, 1.7, 0.4, -0.5, 0.4, 1.1}, u[3] = {0.4, -0.2, -1.0};
    check(carom_chain_load(argv[1], 0, &arm));
    check(carom_chain_frame(arm, "tip", &tip));
    check(carom_law_create(argv[2], 0.5, 0.3, 0, &law));
    check(carom_strike_prepare(arm, tip, point, normal, NULL, &strike));
    check(carom_dynamics_create(arm, &dynamics));

    static double q[STATES * NV], qd[STATES * NV], qd_plus[STATES * NV], mass[NV * NV], qdd[NV];
    static carom_hit hits[STATES];
    srand(1);
    for (int i = 0; i < STATES * NV; i++) {
        q[i] = 3.0 * rand() / RAND_MAX - 1.5;
        qd[i] = 2.0 * rand() / RAND_MAX - 1.0;
    }
    if (prctl(PR_SET_SECCOMP, SECCOMP_MODE_STRICT) != 0) {
        perror("prctl");
        return 1;
    }
    int refused = 0;
    for (int again = 0; again < 20; again++) {
        const size_t n = STATES * NV;
        refused |= carom_strike_many(strike, law, STATES, q, n, qd, n, qd_plus, n, hits) != CAROM_OK;
        refused |= carom_strike_resolve(strike, law, q, NV, qd, NV, qd_plus, NV, hits) != CAROM_OK;
        refused |= carom_law_resolve(law, h, 9, u, 3, hits) != CAROM_OK;
        refused |= carom_mass_matrix(dynamics, q, NV, mass, NV * NV) != CAROM_OK;
        refused |= carom_forward_dynamics(dynamics, q, NV, qd, NV, qd, NV, gravity, qdd, NV) != CAROM_OK;
    }
    syscall(SYS_exit, refused);
}
