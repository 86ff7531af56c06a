// Measures the available share of a processor core: prints the number of independent additions in the time of a dependent one.
// While another hardware thread of the core is busy, it is about half as large, as is the speed of code that saturates the
// core; code that waits for its own results is hardly slower.
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

static double now(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return t.tv_sec * 1e9 + t.tv_nsec;
}

static int order(const void *a, const void *b) {
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

int main(void) {
    double ratios[21];
    for (int i = 0; i < 21; i++) {
        double begin = now();
        unsigned long a = 0, b = 0, c = 0, d = 0, e = 0, f = 0, g = 0, h = 0;
        for (int k = 0; k < 30000; k++) {
            a++, b++, c++, d++, e++, f++, g++, h++;
            // Prevents the compiler from computing the sums in advance.
            __asm__ volatile("" : "+r"(a), "+r"(b), "+r"(c), "+r"(d), "+r"(e), "+r"(f), "+r"(g), "+r"(h));
        }
        double between = now();
        for (int k = 0; k < 30000; k++)
            for (int l = 0; l < 8; l++) {
                a++;
                __asm__ volatile("" : "+r"(a));
            }
        ratios[i] = (now() - between) / (between - begin);
    }
    qsort(ratios, 21, sizeof ratios[0], order);
    printf("%.2f\n", ratios[10]);
}
