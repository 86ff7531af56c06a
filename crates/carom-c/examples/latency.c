/* Times of single calls of a prepared strike with friction: quantiles and a histogram.
 * Usage: latency ROBOT.urdf [LAW [STRIKES [CORE]]]; on Linux it runs on the core that is named, with locked memory if that is allowed. */
#define _GNU_SOURCE
#include <carom.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#ifdef __linux__
#include <sched.h>
#include <sys/mman.h>
#endif

#define STATES 1024
#define NANOSECONDS 1000000 /* times above 1 ms are counted together */

static uint64_t counts[NANOSECONDS + 1];
static double largest;
static uint64_t least[STATES]; /* of each state */

static void check(carom_status status) {
    if (status != CAROM_OK) {
        fprintf(stderr, "error: %s\n", carom_error());
        exit(1);
    }
}

static uint64_t now(void) {
    struct timespec at;
    clock_gettime(CLOCK_MONOTONIC, &at);
    return (uint64_t)at.tv_sec * 1000000000u + (uint64_t)at.tv_nsec;
}

/* The least time in ns that the share of all calls does not exceed. */
static double quantile(double share, uint64_t all) {
    uint64_t sum = 0;
    for (size_t k = 0; k <= NANOSECONDS; k++) {
        sum += counts[k];
        if ((double)sum >= share * (double)all) {
            return (double)k;
        }
    }
    return NANOSECONDS;
}

static void count(uint64_t took) {
    counts[took < NANOSECONDS ? took : NANOSECONDS]++;
    largest = fmax(largest, (double)took);
}

static void print_quantiles(const char *what, uint64_t all) {
    printf("%s: median %.2f us, p99 %.2f us, p99.9 %.2f us, p99.99 %.2f us, largest %.2f us\n", what, quantile(0.5, all) / 1e3,
           quantile(0.99, all) / 1e3, quantile(0.999, all) / 1e3, quantile(0.9999, all) / 1e3, largest / 1e3);
}

static void print_processor(void) {
#ifdef __linux__
    char line[256];
    FILE *file = fopen("/proc/cpuinfo", "r");
    while (file && fgets(line, sizeof line, file)) {
        if (strncmp(line, "model name", 10) == 0) {
            printf("processor: %s", strchr(line, ':') + 2);
            break;
        }
    }
    if (file) {
        fclose(file);
    }
#endif
}

int main(int argc, char **argv) {
    if (argc < 2) {
        fprintf(stderr, "usage: %s ROBOT.urdf [LAW [STRIKES [CORE]]]\n", argv[0]);
        return 2;
    }
    const char *law_name = argc > 2 ? argv[2] : "energetic";
    const uint64_t all = argc > 3 ? strtoull(argv[3], NULL, 10) : 10000000;
    print_processor();
#ifdef __linux__
    if (argc > 4) {
        cpu_set_t core;
        CPU_ZERO(&core);
        CPU_SET(atoi(argv[4]), &core);
        if (sched_setaffinity(0, sizeof core, &core) != 0) {
            perror("sched_setaffinity");
        }
    }
    if (mlockall(MCL_CURRENT | MCL_FUTURE) != 0) {
        perror("mlockall");
    }
#endif
    carom_chain *arm;
    carom_law *law;
    carom_strike *strike;
    size_t tip;
    const double point[3] = {0, 0, 0}, normal[3] = {0, 0, 1};
    check(carom_chain_load(argv[1], 0, &arm));
    check(carom_chain_frame(arm, "tip", &tip));
    check(carom_law_create(law_name, 0.5, 0.3, 0.0, &law));
    check(carom_strike_prepare(arm, tip, point, normal, NULL, &strike));
    const size_t nq = carom_chain_nq(arm), nv = carom_chain_nv(arm);

    /* Random states whose contact approaches: each is tried once. */
    double *q = calloc(STATES * nq, sizeof *q), *qd = calloc(STATES * nv, sizeof *qd), *qd_plus = calloc(nv, sizeof *qd_plus);
    carom_hit hit;
    srand(1);
    for (size_t k = 0; k < STATES;) {
        for (size_t i = 0; i < nq; i++) {
            q[k * nq + i] = 3.0 * rand() / RAND_MAX - 1.5;
        }
        for (size_t i = 0; i < nv; i++) {
            qd[k * nv + i] = 2.0 * rand() / RAND_MAX - 1.0;
        }
        const carom_status status = carom_strike_resolve(strike, law, q + k * nq, nq, qd + k * nv, nv, qd_plus, nv, &hit);
        k += status == CAROM_OK && hit.mode != CAROM_OPEN;
    }

    /* A tenth of the calls warms up. The states come in the order of a step that is prime to their number. */
    for (uint64_t n = 0; n < all + all / 10; n++) {
        const size_t k = (size_t)(n * 337 % STATES);
        const uint64_t start = now();
        const carom_status status = carom_strike_resolve(strike, law, q + k * nq, nq, qd + k * nv, nv, qd_plus, nv, &hit);
        const uint64_t took = now() - start;
        if (status != CAROM_OK) {
            check(status);
        }
        if (n >= all / 10) {
            count(took);
            least[k] = least[k] == 0 || took < least[k] ? took : least[k];
        }
    }
    printf("%s, %llu strikes, law %s with friction, clock included\n", carom_chain_name(arm), (unsigned long long)all, law_name);
    print_quantiles("strike", all);
    uint64_t slowest = 0;
    for (size_t k = 0; k < STATES; k++) {
        slowest = least[k] > slowest ? least[k] : slowest;
    }
    printf("slowest of %d states, by the least of its times: %.2f us\n", STATES, (double)slowest / 1e3);
    printf("        us   strikes\n");
    for (size_t from = 0, to = 250; from <= NANOSECONDS; from = to, to *= 2) {
        uint64_t sum = 0;
        for (size_t k = from; k < to && k <= NANOSECONDS; k++) {
            sum += counts[k];
        }
        if (sum > 0) {
            printf("%7.2f ..  %8llu  ", (double)from / 1e3, (unsigned long long)sum);
            for (uint64_t bar = sum; bar > 0; bar /= 10) {
                printf("#"); /* one for each digit of the number */
            }
            printf("\n");
        }
    }

    /* What the machine adds: a loop without the library that takes as long as the median strike. */
    const double median = quantile(0.5, all);
    volatile double sum = 0;
    unsigned turns = 1;
    for (uint64_t took = 0; took < median; turns += turns / 8 + 1) {
        took = NANOSECONDS;
        for (int again = 0; again < 100; again++) { /* the least of them */
            const uint64_t start = now();
            for (unsigned i = 0; i < turns; i++) {
                sum = sum + 1;
            }
            const uint64_t own = now() - start;
            took = own < took ? own : took;
        }
    }
    memset(counts, 0, sizeof counts);
    largest = 0;
    for (uint64_t n = 0; n < all; n++) {
        const uint64_t start = now();
        for (unsigned i = 0; i < turns; i++) {
            sum = sum + 1;
        }
        count(now() - start);
    }
    print_quantiles("loop as long, without the library", all);
    free(q);
    free(qd);
    free(qd_plus);
    carom_strike_free(strike);
    carom_law_free(law);
    carom_chain_free(arm);
    return 0;
}
