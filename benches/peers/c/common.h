/* What the C and C++ programs of `kernels` share: reading the cases, the clock, and the lines they write. */
#ifndef CAROM_PEERS_COMMON_H
#define CAROM_PEERS_COMMON_H
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#define MOST 256

/* A robot's hinges, parents first, and a state; `input` is tau for forward, qdd for inverse dynamics. */
typedef struct {
    char name[64], file[1024], joint[MOST][64];
    int n, parent[MOST], tip_link;
    double turn[MOST][9], shift[MOST][3], axis[MOST][3], mass[MOST], centre[MOST][3], inertia[MOST][9], tip[3];
    double q[MOST], qd[MOST], input[MOST];
} Case;

static int numbers(FILE *f, double *to, int count) {
    for (int i = 0; i < count; i++)
        if (fscanf(f, "%lf", to + i) != 1) return 0;
    return 1;
}

static int next_case(FILE *f, Case *c) {
    if (fscanf(f, "%63s %1023s %d %d", c->name, c->file, &c->n, &c->tip_link) != 4) return 0;
    if (c->n > MOST || !numbers(f, c->tip, 3)) exit(3);
    for (int i = 0; i < c->n; i++) {
        if (fscanf(f, "%63s %d", c->joint[i], &c->parent[i]) != 2 || !numbers(f, c->turn[i], 9) || !numbers(f, c->shift[i], 3) ||
            !numbers(f, c->axis[i], 3) || !numbers(f, &c->mass[i], 1) || !numbers(f, c->centre[i], 3) ||
            !numbers(f, c->inertia[i], 9) || !numbers(f, &c->q[i], 1) || !numbers(f, &c->qd[i], 1) || !numbers(f, &c->input[i], 1))
            exit(3);
    }
    return 1;
}

static double seconds_now(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

/* What a kernel reads could have changed between two calls, for all the compiler knows. */
#define TIMED(label, kernel, robot, seconds, work, answer, count)                                      \
    do {                                                                                               \
        double begin_ = seconds_now(), passed_ = 0;                                                    \
        long calls_ = 0;                                                                               \
        do {                                                                                           \
            for (int k_ = 0; k_ < 100; k_++) {                                                         \
                __asm__ volatile("" ::: "memory");                                                     \
                work;                                                                                  \
            }                                                                                          \
            calls_ += 100;                                                                             \
            passed_ = seconds_now() - begin_;                                                          \
        } while (passed_ < (seconds));                                                                 \
        printf("%s %s %s %.17g", label, kernel, robot, passed_ * 1e9 / (double)calls_);                \
        for (int i_ = 0; i_ < (count); i_++) printf(" %.17g", (answer)[i_]);                           \
        printf("\n");                                                                                  \
    } while (0)
#endif
