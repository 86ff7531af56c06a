// Pinocchio's side of `kernels`: pinocchio CASES SECONDS LABEL. Header-only, the model built joint by joint: no library that
// was compiled with other flags takes part.
#include <cstring>
#include <pinocchio/algorithm/aba.hpp>
#include <pinocchio/algorithm/cholesky.hpp>
#include <pinocchio/algorithm/crba.hpp>
#include <pinocchio/algorithm/frames.hpp>
#include <pinocchio/algorithm/jacobian.hpp>
#include <pinocchio/algorithm/rnea.hpp>
#include <pinocchio/multibody.hpp>

#include "common.h"

using namespace pinocchio;
typedef Eigen::Matrix<double, 3, 3, Eigen::RowMajor> Rows3;

static JointModel hinge(const Eigen::Vector3d &axis) {
    // As its URDF reader does: a hinge about x, y or z has a class of its own.
    if (axis == Eigen::Vector3d::UnitX()) return JointModelRX();
    if (axis == Eigen::Vector3d::UnitY()) return JointModelRY();
    if (axis == Eigen::Vector3d::UnitZ()) return JointModelRZ();
    return JointModelRevoluteUnaligned(axis);
}

int main(int argc, char **argv) {
    if (argc != 4) return 2;
    static Case c;
    const double seconds = atof(argv[2]);
    FILE *cases = fopen(argv[1], "r");
    while (cases && next_case(cases, &c)) {
        Model model;
        model.gravity.linear() << 0, -9.81, 0;
        for (int i = 0; i < c.n; i++) {
            const SE3 place(Eigen::Map<Rows3>(c.turn[i]), Eigen::Map<Eigen::Vector3d>(c.shift[i]));
            const JointIndex id = model.addJoint(c.parent[i] + 1, hinge(Eigen::Map<Eigen::Vector3d>(c.axis[i])), place, c.joint[i]);
            model.appendBodyToJoint(id, Inertia(c.mass[i], Eigen::Map<Eigen::Vector3d>(c.centre[i]), Eigen::Map<Rows3>(c.inertia[i])));
        }
        const SE3 at(Eigen::Matrix3d::Identity(), Eigen::Map<Eigen::Vector3d>(c.tip));
        const FrameIndex tip = model.addFrame(Frame("tip", c.tip_link + 1, 0, at, OP_FRAME));
        Data data(model);
        const Eigen::VectorXd q = Eigen::Map<Eigen::VectorXd>(c.q, c.n), qd = Eigen::Map<Eigen::VectorXd>(c.qd, c.n);
        const Eigen::VectorXd input = Eigen::Map<Eigen::VectorXd>(c.input, c.n);
        const Eigen::Vector3d normal(-1, 0, 0);
        Data::Matrix6x jacobian(Data::Matrix6x::Zero(6, c.n));
        Eigen::MatrixXd solved(c.n, 3);
        Eigen::Matrix3d h;
        Eigen::VectorXd after(c.n);
        auto chain = [&] {
            crba(model, data, q, Convention::WORLD);
            computeJointJacobians(model, data, q);
            updateFramePlacement(model, data, tip);
            getFrameJacobian(model, data, tip, LOCAL_WORLD_ALIGNED, jacobian);
            cholesky::decompose(model, data);
            solved = jacobian.topRows<3>().transpose();
            for (int k = 0; k < 3; k++) {
                auto column = solved.col(k);
                cholesky::solve(model, data, column);
            }
            h.noalias() = jacobian.topRows<3>() * solved;
            const double u = normal.dot(jacobian.topRows<3>() * qd);
            after = qd;
            after.noalias() += solved * (normal * (-1.35 * u / normal.dot(h * normal)));
        };
        TIMED(argv[3], "chain", c.name, seconds, chain(), after.data(), c.n);
        TIMED(argv[3], "mass", c.name, seconds, crba(model, data, q, Convention::LOCAL), after.data(), 0);
        TIMED(argv[3], "inverse", c.name, seconds, rnea(model, data, q, qd, input), data.tau.data(), c.n);
        TIMED(argv[3], "forward", c.name, seconds, aba(model, data, q, qd, input, Convention::LOCAL), data.ddq.data(), c.n);
    }
    return 0;
}
