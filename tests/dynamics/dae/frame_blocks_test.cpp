// The tangent of what acts between frames. Truth: the same formula with whole matrices.
#include "dynamics/dae/frame_blocks.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <random>

#include "dynamics/bodies/carried_frame.hpp"
#include "dynamics/bodies/flexible_frame.hpp"
#include "dynamics/bodies/rigid_body.hpp"
#include "dynamics/dae/assembled_system.hpp"
#include "dynamics/meshers/parts.hpp"

namespace espalier::dynamics {
namespace frame_blocks_test {

using Jacobian = Eigen::Matrix<double, 6, Eigen::Dynamic>;

/// A block with faces of so many nodes that their columns are several tasks, a rigid body and a beam, all somewhere and
/// in motion, and frames on them.
struct Scene {
  AssembledSystem system;
  std::vector<std::unique_ptr<Frame>> frames;
  std::vector<double> q, v;
  std::mt19937 generator{11};
  std::uniform_real_distribution<double> uniform{-1, 1};

  Scene() {
    const Material material{SolidLaw::st_venant_kirchhoff, 200, 0.3, 7};
    const Mesh mesh = make_block({1, 1, 1}, 1, 8, 8);
    FlexibleBody& block = system.add(make_solid_body("block", mesh, material));
    FlexibleBody& beam =
        system.add(make_beam_body("beam", {0, 0, 0}, {1, 0, 0}, {0, 1, 0}, 2, rectangular_section(material, 0.1, 0.2)));
    RigidBody& rigid = system.add(std::make_unique<RigidBody>("rigid", RigidBodyData{}));
    const auto face = [&](const char* name) { return make_face_frame(block, mesh, mesh.face_set(name)); };
    frames.push_back(face("x1"));
    frames.push_back(std::make_unique<CarriedFrame>(face("x0"), Vec3(0.1, 0.2, -0.3), turn(0.4)));
    frames.push_back(make_node_frame(block, 7));
    frames.push_back(make_beam_frame(beam, 1));
    frames.push_back(std::make_unique<RigidFrame>(rigid, Vec3(0.3, 0.1, 0.2), turn(0.2)));
    frames.push_back(std::make_unique<GroundFrame>());
    frames.push_back(std::make_unique<CarriedFrame>(std::make_unique<RigidFrame>(rigid), Vec3(1, 2, 3), turn(1)));
    system.finish();
    q.resize(at(system.sizes().configuration));
    v.resize(at(system.sizes().velocity));
    system.initial(q, v);
    std::vector<double> step(v.size());
    for (double& x : step) x = 0.02 * uniform(generator);
    system.retract(q, step, q);
    for (double& x : v) x = uniform(generator);
  }
  static std::size_t at(Index i) { return static_cast<std::size_t>(i); }
  static Mat3 turn(double angle) { return Eigen::AngleAxisd(angle, Vec3(1, 2, -1).normalized()).matrix(); }

  FrameBlocks::Derivatives derivatives(std::size_t count, bool rotations_alone) {
    const auto n = static_cast<Eigen::Index>(6 * count);
    FrameBlocks::Derivatives d;
    d.k.resize(n, n);
    d.d.resize(n, n);
    d.wrench.resize(n);
    for (auto* matrix : {&d.k, &d.d})
      for (double& x : matrix->reshaped()) x = uniform(generator);
    for (double& x : d.wrench.reshaped()) x = uniform(generator);
    for (Eigen::Index i = 0; rotations_alone && i < n; ++i)
      if (i % 6 < 3) d.k.row(i).setZero(), d.k.col(i).setZero();
    if (rotations_alone) d.d.resize(0, 0);
    return d;
  }
};

/// J^T (k J + d d(J v)/dq) + d(J^T w)/dq over all coordinates of the system.
Eigen::MatrixXd whole(const Scene& s, const std::vector<const Frame*>& frames, const FrameBlocks::Derivatives& d) {
  const auto n = static_cast<Eigen::Index>(s.v.size()), count = static_cast<Eigen::Index>(frames.size());
  Eigen::MatrixXd j = Eigen::MatrixXd::Zero(6 * count, n), rate = j, sum = Eigen::MatrixXd::Zero(n, n);
  for (Eigen::Index f = 0; f < count; ++f) {
    const Frame& frame = *frames[static_cast<std::size_t>(f)];
    const std::span<const Index> coordinates = frame.coordinates();
    const auto nd = static_cast<Eigen::Index>(coordinates.size());
    Jacobian own(6, nd), own_rate(6, nd);
    Eigen::MatrixXd stiffness = Eigen::MatrixXd::Zero(nd, nd);
    frame.jacobian(s.q, own.data());
    frame.rate_jacobian(s.q, s.v, own_rate.data());
    frame.wrench_stiffness(s.q, d.wrench.segment<6>(6 * f), 1, stiffness.data());
    for (Eigen::Index l = 0; l < nd; ++l) {
      const Index column = coordinates[static_cast<std::size_t>(l)];
      j.block<6, 1>(6 * f, column) = own.col(l);
      rate.block<6, 1>(6 * f, column) = own_rate.col(l);
      for (Eigen::Index k = 0; k < nd; ++k) sum(coordinates[static_cast<std::size_t>(k)], column) += stiffness(k, l);
    }
  }
  sum += j.transpose() * (d.k * j);
  if (d.d.size() > 0) sum += j.transpose() * (d.d * rate);
  return sum;
}

/// The frames with these numbers; W by columns, with what was there before: ones.
void check(const std::vector<std::size_t>& chosen, FrameBlocks::Coupling coupling) {
  SCOPED_TRACE(testing::Message() << testing::PrintToString(chosen) << (coupling.turning_only ? ", turning" : ""));
  Scene s;
  std::vector<const Frame*> frames;
  for (const std::size_t k : chosen) frames.push_back(s.frames[k].get());
  const Index n = s.system.sizes().velocity;
  FrameBlocks blocks(frames, coupling);
  PatternBuilder builder(n, n, true);
  builder.add_diagonal();
  blocks.declare(builder);
  const SparsePattern pattern = builder.build();
  FrameBlocks::Derivatives d = s.derivatives(chosen.size(), coupling.turning_only);
  if (coupling.turning_only && !coupling.between_rotations) d.k.setZero();
  const Eigen::MatrixXd truth = whole(s, frames, d);
  std::vector<double> alone;
  for (const int threads : {0, 1, 3}) {
    std::unique_ptr<base::ThreadPool> pool;
    if (threads > 0) pool = std::make_unique<base::ThreadPool>(threads);
    blocks.bind(pattern, pool.get());
    std::vector<double> values(pattern.ind.size(), 1.0);
    blocks.add(s.q, s.v, d, pool.get(), values);
    Eigen::MatrixXd w = Eigen::MatrixXd::Zero(n, n);
    for (Index c = 0; c < n; ++c)
      for (auto e = Scene::at(static_cast<Index>(pattern.ptr[Scene::at(c)]));
           e < static_cast<std::size_t>(pattern.ptr[Scene::at(c + 1)]); ++e)
        w(pattern.ind[e], c) = values[e] - 1;
    EXPECT_LT((w - truth).cwiseAbs().maxCoeff(), 1e-12 * truth.cwiseAbs().maxCoeff());
    EXPECT_GT(truth.cwiseAbs().maxCoeff(), 1e-3);
    if (threads == 0) alone = values;
    EXPECT_EQ(values, alone) << threads;
  }
}

TEST(FrameBlocks, AreThoseOfWholeMatrices) {
  for (const std::vector<std::size_t>& chosen : std::vector<std::vector<std::size_t>>{
           {0, 1}, {0, 5}, {5, 0}, {0, 0}, {2, 0}, {1, 3}, {3, 4}, {4, 6}, {0, 2, 4, 3}, {1}})
    check(chosen, {});
}

// Joints that hold rotations alone leave coordinates out that turn no frame, and joints that hold points alone couple
// no frames, but a carried one with itself.
TEST(FrameBlocks, LeaveOutWhatDoesNotTurn) {
  for (const std::vector<std::size_t>& chosen : std::vector<std::vector<std::size_t>>{{0, 3}, {0, 4}, {3, 4}, {0, 0}}) {
    check(chosen, {.turning_only = true, .between_rotations = true});
    check(chosen, {.turning_only = true, .between_rotations = false});
  }
}

// Zeros are no work, and nothing is written.
TEST(FrameBlocks, NothingComesOfNothing) {
  Scene s;
  FrameBlocks blocks({s.frames[0].get(), s.frames[5].get()}, {});
  const Index n = s.system.sizes().velocity;
  PatternBuilder builder(n, n, true);
  blocks.declare(builder);
  const SparsePattern pattern = builder.build();
  blocks.bind(pattern, nullptr);
  FrameBlocks::Derivatives d = s.derivatives(2, false);
  d.k.setZero();
  d.d.setZero();
  d.wrench.setZero();
  std::vector<double> values(pattern.ind.size(), -0.0);
  blocks.add(s.q, s.v, d, nullptr, values);
  for (const double x : values) EXPECT_TRUE(x == 0 && std::signbit(x));
}

}  // namespace frame_blocks_test
}  // namespace espalier::dynamics
