/* One impact: a two-link arm strikes a wall, as in the book's first tutorial. Usage: impact ROBOT.urdf */
#include <carom.h>
#include <stdio.h>
#include <stdlib.h>

static void check(carom_status status) {
    if (status != CAROM_OK) {
        fprintf(stderr, "error: %s\n", carom_error());
        exit(1);
    }
}

static void print(const char *name, const double *numbers, size_t count) {
    printf("%s", name);
    for (size_t k = 0; k < count; k++) {
        printf(" %.17g", numbers[k] + 0.0); /* without the sign of a zero */
    }
    printf("\n");
}

int main(int argc, char **argv) {
    if (argc != 2) {
        fprintf(stderr, "usage: %s ROBOT.urdf\n", argv[0]);
        return 2;
    }
    /* Load and prepare: here memory is allocated. */
    carom_chain *arm;
    carom_law *law;
    carom_strike *strike;
    size_t tip;
    const double point[3] = {0, 0, 0}, normal[3] = {-1, 0, 0};
    check(carom_chain_load(argv[1], 0, &arm));
    check(carom_chain_frame(arm, "tip", &tip));
    check(carom_law_create("energetic", 0.35, 0.2, 0.0, &law));
    check(carom_strike_prepare(arm, tip, point, normal, NULL, &strike));

    /* The impact: no allocation. */
    const double q[2] = {0.7854, -1.5708}, qd[2] = {-0.15, 0.6};
    double qd_plus[2];
    carom_hit hit;
    check(carom_strike_resolve(strike, law, q, 2, qd, 2, qd_plus, 2, &hit));
    print("qd_plus", qd_plus, 2);
    print("impulse", hit.impulse, 3);
    print("u_minus", hit.u_minus, 3);
    print("u_plus", hit.u_plus, 3);
    print("energy_before", &hit.energy_before, 1);
    print("energy_after", &hit.energy_after, 1);
    print("normal_work", &hit.normal_work, 1);
    print("friction_work", &hit.friction_work, 1);

    carom_strike_free(strike);
    carom_law_free(law);
    carom_chain_free(arm);
    return 0;
}
