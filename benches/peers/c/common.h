/* Shared by the C and C++ programs of `kernels`: reading of cases, timing, and writing of results. */
#ifndef CAROM_PEERS_COMMON_H
#define CAROM_PEERS_COMMON_H
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#define MOST 128
#define MOST_STATES 16
/* Time between two readings of the clock, s; a reading takes about 50 ns. */
#define BETWEEN_LOOKS 5e-5
/* Smallest and largest number of intervals in a sample. */
#define FEWEST 15
#define STRETCHES 65536

/* The hinges of a robot, parents first, and its states; `input` is tau for forward, qdd for inverse dynamics. */
typedef struct {
    char name[64], joint[MOST][64];
    int n, states, parent[MOST], tip_link;
    double turn[MOST][9], shift[MOST][3], axis[MOST][3], mass[MOST], centre[MOST][3], inertia[MOST][9], tip[3];
    double q[MOST_STATES][MOST], qd[MOST_STATES][MOST], input[MOST_STATES][MOST];
} Case;

static int numbers(FILE *f, double *to, int count) {
    for (int i = 0; i < count; i++)
        if (fscanf(f, "%lf", to + i) != 1) return 0;
    return 1;
}

static int next_case(FILE *f, Case *c) {
    if (fscanf(f, "%63s %d %d %d", c->name, &c->n, &c->states, &c->tip_link) != 4) return 0;
    if (c->n > MOST || c->states > MOST_STATES || !numbers(f, c->tip, 3)) exit(3);
    for (int i = 0; i < c->n; i++) {
        if (fscanf(f, "%63s %d", c->joint[i], &c->parent[i]) != 2 || !numbers(f, c->turn[i], 9) || !numbers(f, c->shift[i], 3) ||
            !numbers(f, c->axis[i], 3) || !numbers(f, &c->mass[i], 1) || !numbers(f, c->centre[i], 3) ||
            !numbers(f, c->inertia[i], 9))
            exit(3);
    }
    for (int k = 0; k < c->states; k++)
        if (!numbers(f, c->q[k], c->n) || !numbers(f, c->qd[k], c->n) || !numbers(f, c->input[k], c->n)) exit(3);
    return 1;
}

/* The case of this name. */
static int find_case(const char *file, const char *name, Case *c) {
    FILE *cases = fopen(file, "r");
    if (!cases) return 0;
    while (next_case(cases, c))
        if (!strcmp(c->name, name)) return 1;
    return 0;
}

static double seconds_now(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static int by_size(const void *a, const void *b) {
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* Runs `work` `calls` times on the states `k` in turn. The barrier makes the compiler assume that the states change between two
 * calls. */
#define CALLS(c, calls, work)                     \
    for (long r_ = 0; r_ < (calls); r_++) {       \
        __asm__ volatile("" ::: "memory");        \
        work;                                     \
        k = k + 1 < (c).states ? k + 1 : 0;       \
    }

/* Repeats `work` for `seconds` and prints one line with its time: the median over the intervals between two readings of the
 * clock, so that an interruption affects one interval only. With zero seconds the line holds the answers at all states
 * instead. */
#define TIMED(label, kernel, c, seconds, work, answer, count)                                          \
    do {                                                                                               \
        static double each_[STRETCHES];                                                                \
        double passed_ = 0, begin_ = seconds_now();                                                    \
        long stretches_ = 0, calls_ = 1;                                                               \
        int k = 0;                                                                                     \
        if ((seconds) > 0) {                                                                           \
            CALLS(c, 16, work)                                                                         \
            begin_ = seconds_now();                                                                    \
            CALLS(c, 16, work)                                                                         \
            double first_ = (seconds_now() - begin_) / 16;                                             \
            calls_ = first_ < BETWEEN_LOOKS ? (long)(BETWEEN_LOOKS / first_) : 1;                      \
            begin_ = seconds_now();                                                                    \
            while ((passed_ < (seconds) || stretches_ < FEWEST) && stretches_ < STRETCHES) {           \
                CALLS(c, calls_, work)                                                                 \
                double now_ = seconds_now() - begin_;                                                  \
                each_[stretches_++] = now_ - passed_;                                                  \
                passed_ = now_;                                                                        \
            }                                                                                          \
            qsort(each_, stretches_, sizeof *each_, by_size);                                          \
        }                                                                                              \
        printf("%s %s %.17g", label, kernel, each_[stretches_ / 2] * 1e9 / (double)calls_);            \
        for (k = 0; k < (c).states && !((seconds) > 0); k++) {                                         \
            work;                                                                                      \
            const double *answer_ = answer;                                                            \
            for (int i_ = 0; i_ < (count); i_++) printf(" %.17g", answer_[i_]);                        \
        }                                                                                              \
        printf("\n");                                                                                  \
    } while (0)
#endif
