// One impact as in impact.c, with handles that free themselves, and a law on H and u without a robot. Usage: impact ROBOT.urdf
#include <carom.h>

#include <array>
#include <cmath>
#include <cstdio>
#include <memory>
#include <stdexcept>
#include <vector>

namespace {

void check(carom_status status) {
    if (status != CAROM_OK) {
        throw std::runtime_error(carom_error());
    }
}

template <class T>
struct Free {
    void (*with)(T *);
    void operator()(T *handle) const { with(handle); }
};

template <class T>
using Own = std::unique_ptr<T, Free<T>>;

// The handle that `make` writes.
template <class T, class Make>
Own<T> own(void (*free)(T *), Make make) {
    T *handle = nullptr;
    check(make(&handle));
    return Own<T>(handle, Free<T>{free});
}

template <class Numbers>
void print(const char *name, const Numbers &numbers) {
    std::printf("%s", name);
    for (double x : numbers) {
        std::printf(" %.17g", x + 0.0);  // without the sign of a zero
    }
    std::printf("\n");
}

void run(const char *urdf) {
    const auto arm = own<carom_chain>(carom_chain_free, [&](auto at) { return carom_chain_load(urdf, 0, at); });
    const auto law = own<carom_law>(carom_law_free, [](auto at) { return carom_law_create("energetic", 0.35, 0.2, 0.0, at); });
    std::size_t tip = 0;
    check(carom_chain_frame(arm.get(), "tip", &tip));
    const std::array<double, 3> point{}, normal{-1.0, 0.0, 0.0};
    const auto strike = own<carom_strike>(carom_strike_free, [&](auto at) {
        return carom_strike_prepare(arm.get(), tip, point.data(), normal.data(), nullptr, at);
    });

    const std::vector<double> q{0.7854, -1.5708}, qd{-0.15, 0.6};
    std::vector<double> qd_plus(carom_chain_nv(arm.get()));
    carom_hit hit;
    check(carom_strike_resolve(strike.get(), law.get(), q.data(), q.size(), qd.data(), qd.size(), qd_plus.data(), qd_plus.size(), &hit));
    print("qd_plus", qd_plus);
    print("impulse", hit.impulse);
    print("u_minus", hit.u_minus);
    print("u_plus", hit.u_plus);
    print("energy_before", std::array{hit.energy_before});
    print("energy_after", std::array{hit.energy_after});
    print("normal_work", std::array{hit.normal_work});
    print("friction_work", std::array{hit.friction_work});

    // The same impact as another simulator would compute it, from its own H and u in contact axes: here those of carom. The axes of
    // the contact are (y, z, x) with the normal -x, so that two of them change their signs.
    const auto dynamics = own<carom_dynamics>(carom_dynamics_free, [&](auto at) { return carom_dynamics_create(arm.get(), at); });
    double world[9];
    check(carom_delassus(dynamics.get(), q.data(), q.size(), tip, point.data(), world));
    const double axes[2][3] = {{0, 1, 0}, {-1, 0, 0}};  // the tangent in the plane, then the normal
    double h[4] = {}, u[2] = {};
    for (int i = 0; i < 2; i++) {
        for (int a = 0; a < 3; a++) {
            u[i] += axes[i][a] * hit.u_minus[a];
            for (int k = 0; k < 2; k++) {
                for (int b = 0; b < 3; b++) {
                    h[2 * i + k] += axes[i][a] * world[3 * a + b] * axes[k][b];
                }
            }
        }
    }
    carom_hit alone;
    check(carom_law_resolve(law.get(), h, 4, u, 2, &alone));
    const double along_normal = -hit.impulse[0], along_wall = hit.impulse[1];
    if (std::abs(alone.impulse[1] - along_normal) > 1e-12 || std::abs(alone.impulse[0] - along_wall) > 1e-12) {
        throw std::runtime_error("the law on H and u gives another impulse");
    }
}

}  // namespace

int main(int argc, char **argv) {
    if (argc != 2) {
        std::fprintf(stderr, "usage: %s ROBOT.urdf\n", argv[0]);
        return 2;
    }
    try {
        run(argv[1]);
    } catch (const std::exception &error) {
        std::fprintf(stderr, "error: %s\n", error.what());
        return 1;
    }
}
