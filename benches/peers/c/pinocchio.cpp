// Pinocchio in `kernels`: pinocchio CASES ROBOT SECONDS LABEL. Header-only, with the model built joint by joint, so that no
// library compiled with other flags is used. Where Pinocchio offers two conventions, axes of the bodies and of the
// world, the faster one is timed.
#include <pinocchio/algorithm/aba.hpp>
#include <pinocchio/algorithm/cholesky.hpp>
#include <pinocchio/algorithm/crba.hpp>
#include <pinocchio/algorithm/frames.hpp>
#include <pinocchio/algorithm/rnea.hpp>
#include <algorithm>
#include <functional>
#include <pinocchio/multibody.hpp>
#include <vector>

#include "common.h"

using namespace pinocchio;
typedef Eigen::Matrix<double, 3, 3, Eigen::RowMajor> Rows3;

static JointModel hinge(const Eigen::Vector3d &axis) {
    // As in its URDF reader, a hinge about x, y or z has its own joint type.
    if (axis == Eigen::Vector3d::UnitX()) return JointModelRX();
    if (axis == Eigen::Vector3d::UnitY()) return JointModelRY();
    if (axis == Eigen::Vector3d::UnitZ()) return JointModelRZ();
    return JointModelRevoluteUnaligned(axis);
}

int main(int argc, char **argv) {
    static Case c;
    if (argc != 5 || !find_case(argv[1], argv[2], &c)) return 2;
    const double seconds = atof(argv[3]);
    // The joints of each branch must be added one after another.
    std::vector<int> order, place(c.n);
    std::function<void(int)> visit = [&](int parent) {
        for (int i = 0; i < c.n; i++)
            if (c.parent[i] == parent) {
                place[i] = order.size();
                order.push_back(i);
                visit(i);
            }
    };
    visit(-1);
    Model model;
    model.gravity.linear() << 0, -9.81, 0;
    for (int i : order) {
        const SE3 turned(Eigen::Map<Rows3>(c.turn[i]), Eigen::Map<Eigen::Vector3d>(c.shift[i]));
        const JointIndex parent = c.parent[i] < 0 ? 0 : place[c.parent[i]] + 1;
        const JointIndex id = model.addJoint(parent, hinge(Eigen::Map<Eigen::Vector3d>(c.axis[i])), turned, c.joint[i]);
        model.appendBodyToJoint(id, Inertia(c.mass[i], Eigen::Map<Eigen::Vector3d>(c.centre[i]), Eigen::Map<Rows3>(c.inertia[i])));
    }
    const SE3 at(Eigen::Matrix3d::Identity(), Eigen::Map<Eigen::Vector3d>(c.tip));
    const FrameIndex tip = model.addFrame(Frame("tip", place[c.tip_link] + 1, 0, at, OP_FRAME));
    Data data(model);
    std::vector<Eigen::VectorXd> q, qd, input;
    for (int k = 0; k < c.states; k++) {
        auto ordered = [&](const double *x) {
            Eigen::VectorXd out(c.n);
            for (int i = 0; i < c.n; i++) out[place[i]] = x[i];
            return out;
        };
        q.push_back(ordered(c.q[k]));
        qd.push_back(ordered(c.qd[k]));
        input.push_back(ordered(c.input[k]));
    }
    const Eigen::Vector3d normal(-1, 0, 0);
    Data::Matrix6x jacobian(Data::Matrix6x::Zero(6, c.n));
    Eigen::MatrixXd solved(c.n, 3);
    Eigen::Matrix3d h;
    Eigen::VectorXd after(c.n);
    auto chain = [&](int k) {
        // The convention of world axes, which also gives the columns of J.
        crba(model, data, q[k], Convention::WORLD);
        updateFramePlacement(model, data, tip);
        getFrameJacobian(model, data, tip, LOCAL_WORLD_ALIGNED, jacobian);
        cholesky::decompose(model, data);
        solved = jacobian.topRows<3>().transpose();
        cholesky::solve(model, data, solved);
        h.noalias() = jacobian.topRows<3>() * solved;
        const double u = normal.dot(jacobian.topRows<3>() * qd[k]);
        after = qd[k];
        after.noalias() += solved * (normal * (-1.35 * u / normal.dot(h * normal)));
    };
    auto shown = [&](const Eigen::VectorXd &x) {
        static double out[MOST + 3];
        for (int i = 0; i < c.n; i++) out[i] = x[place[i]];
        out[c.n] = h(0, 0), out[c.n + 1] = h(0, 1), out[c.n + 2] = h(1, 1);
        return out;
    };
    // crba fills the upper triangle only.
    auto product = [&](int k) { return shown(data.M.selfadjointView<Eigen::Upper>() * input[k]); };
    auto mass = [&](int k, Convention in) { crba(model, data, q[k], in); };
    auto forward = [&](int k, Convention in) { aba(model, data, q[k], qd[k], input[k], in); };
    auto faster = [&](auto work) {
        double least[2] = {1e9, 1e9};
        for (int turn = 0; turn < 20; turn++) {
            int k = 0;
            const double begin = seconds_now();
            CALLS(c, c.states, work(k, turn % 2 ? Convention::WORLD : Convention::LOCAL))
            least[turn % 2] = std::min(least[turn % 2], seconds_now() - begin);
        }
        return least[1] < least[0] ? Convention::WORLD : Convention::LOCAL;
    };
    TIMED(argv[4], "chain", c, seconds, chain(k), shown(after), c.n + 3);
    TIMED(argv[4], "inverse", c, seconds, rnea(model, data, q[k], qd[k], input[k]), shown(data.tau), c.n);
    const Convention of_mass = faster(mass), of_forward = faster(forward);
    for (const Convention in : {Convention::LOCAL, Convention::WORLD}) {
        // Prints all answers.
        if (!(seconds > 0) || in == of_mass) TIMED(argv[4], "mass", c, seconds, mass(k, in), product(k), c.n);
        if (!(seconds > 0) || in == of_forward) TIMED(argv[4], "forward", c, seconds, forward(k, in), shown(data.ddq), c.n);
    }
    return 0;
}
