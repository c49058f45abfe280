// Searches in the memory of a GPU: the modes of the host, and tall blocks beside plain loops.
#include <memory>

#include "device/registry.hpp"
#include "modes/blocks.hpp"
#include "modes/modes_common.hpp"
#include "modes/product.hpp"
#include "solver/gpu/refused_calls.hpp"

namespace espalier {

using namespace test;

namespace {

const device::Backend* gpu() {
  const device::Backend* backend = device::registry().find("gpu");
  return backend != nullptr && !backend->find().names.empty() ? backend : nullptr;
}

class ModesOnGpu : public testing::Test {
 protected:
  void SetUp() override {
    if (gpu() == nullptr) GTEST_SKIP() << "no GPU";
  }

  static void expect_modes_of_the_host(const SparseMatrix& k, const SparseMatrix& m, ModesOptions o) {
    o.solver.device = "cpu";
    const ModesResult here = find_modes(k, m, o);
    ASSERT_TRUE(here.status.ok()) << here.status.message;
    std::string log;
    o.solver.device = "gpu:0";
    o.solver.log = [&](const std::string& line) { log += line + "\n"; };
    const ModesResult there = find_modes(k, m, o);
    ASSERT_TRUE(there.status.ok()) << there.status.message;
    EXPECT_EQ(log.find("basis"), std::string::npos) << log;  // nothing went to the host
    EXPECT_EQ(there.complete, here.complete);
    ASSERT_EQ(there.count(), here.count());
    const double size = std::abs(here.eigenvalues.back());
    for (std::size_t i = 0; i < here.eigenvalues.size(); ++i)
      EXPECT_NEAR(there.eigenvalues[i], here.eigenvalues[i], 1e-10 * size) << i;
    EXPECT_LT(there.orthogonality, 1e-12);
    for (const double r : there.residuals) EXPECT_LT(r, 1e-9);
    const ModesResult again = find_modes(k, m, o);
    EXPECT_EQ(again.eigenvalues, there.eigenvalues);
    EXPECT_EQ(again.vectors, there.vectors);
  }
};

}  // namespace

TEST_F(ModesOnGpu, AreThoseOfTheHost) {
  expect_modes_of_the_host(generated({"elasticity", "8"}), generated({"elasticity-mass", "8"}), lowest(30));
  expect_modes_of_the_host(string(700, false), identity(700), lowest(12));  // free, with a long search
}

TEST_F(ModesOnGpu, SeveralShiftsKeepOutWhatIsKnown) {
  ModesOptions o = lowest(130);
  o.basis_size = 60;
  expect_modes_of_the_host(string(900), identity(900), o);
}

// Room for the factor, none for the basis.
TEST_F(ModesOnGpu, WithoutRoomTheBasisStaysOnTheHost) {
  const SparseMatrix k = generated({"elasticity", "8"}), m = generated({"elasticity-mass", "8"});
  Solver solver([] {
    Options o;
    o.device = "gpu:0";
    return o;
  }());
  ASSERT_TRUE(solver.analyze(k).status.ok());
  const FactorResult factor = solver.factorize(k);
  ASSERT_TRUE(factor.status.ok());
  ModesOptions o = lowest(20);
  o.solver.device = "cpu";
  const ModesResult here = find_modes(k, m, o);
  std::string log;
  o.solver.device = "gpu:0";
  o.solver.device_memory_bytes = factor.devices.front().peak_bytes + (Offset{6} << 20);
  o.solver.log = [&](const std::string& line) { log += line + "\n"; };
  const ModesResult there = find_modes(k, m, o);
  ASSERT_TRUE(there.status.ok()) << there.status.message;
  ASSERT_EQ(there.count(), here.count());
  for (std::size_t i = 0; i < here.eigenvalues.size(); ++i)
    EXPECT_NEAR(there.eigenvalues[i], here.eigenvalues[i], 1e-10 * here.eigenvalues.back()) << i << log;
}

// A multiplier holds one mass of a free row, and another mass has no mass.
TEST_F(ModesOnGpu, MultipliersAndUnknownsWithoutMass) {
  constexpr Index n = 400;
  std::vector<reference::Triple> t;
  for (Index i = 0; i < n; ++i) {
    t.push_back({i, i, i > 0 && i + 1 < n ? 2.0 : 1.0});
    if (i + 1 < n) t.push_back({i + 1, i, -1.0});
  }
  t.push_back({n, 17, 1.0});
  std::vector<double> mass(n + 1, 1.0);
  mass[200] = mass[n] = 0;
  expect_modes_of_the_host(symmetric(n + 1, t), diagonal(mass), lowest(15));
}

TEST_F(ModesOnGpu, BlocksAreThoseOfTheHost) {
  constexpr Index n = 70001, p = 21, b = 11;
  const std::unique_ptr<device::TallSpace> space = gpu()->make_tall_space(n, 0, 0);
  base::ThreadPool pool(2);
  const modes::HostBlocks here(pool, n);
  const modes::DeviceBlocks on_gpu(*space, pool);
  std::vector<double> v = reference::random_vector(Offset{n} * p, 1), w = reference::random_vector(Offset{n} * b, 2);
  double* const on_v = space->block(0, p);
  double* const on_w = space->block(1, b);
  space->send(on_v, v.data(), p);
  space->send(on_w, w.data(), b);
  const auto expect_same = [&](const double* on_device, const std::vector<double>& host, Index columns) {
    std::vector<double> found(static_cast<std::size_t>(n) * static_cast<std::size_t>(columns));
    space->fetch(found.data(), on_device, columns);
    double worst = 0;
    for (std::size_t i = 0; i < found.size(); ++i) worst = std::max(worst, std::abs(found[i] - host[i]));
    EXPECT_LT(worst, 1e-9);
  };
  const modes::Dense h = here.gram(v.data(), p, w.data(), b);
  EXPECT_LT((on_gpu.gram(on_v, p, on_w, b) - h).cwiseAbs().maxCoeff(), 1e-9);
  const modes::Dense small = h / n;
  here.subtract(v.data(), small, w.data());
  on_gpu.subtract(on_v, small, on_w);
  expect_same(on_w, w, b);
  here.combine(v.data(), small, v.data());
  on_gpu.combine(on_v, small, on_v);
  expect_same(on_v, v, b);
  Eigen::VectorXd squares(b);
  space->weighted_squares(on_v, on_w, b, squares.data());
  EXPECT_LT((squares - modes::weighted_squares(pool, n, v.data(), w.data(), b)).cwiseAbs().maxCoeff(), 1e-9);
}

TEST_F(ModesOnGpu, ProductsAreThoseOfTheHost) {
  const SparseMatrix a = generated({"elasticity", "7", "6", "5"});
  base::ThreadPool pool(2);
  const modes::Product product(a, pool);
  const std::unique_ptr<device::TallSpace> space = gpu()->make_tall_space(a.rows, 0, 0);
  const Index matrix = space->add_matrix(product.first(), product.column(), product.value()), columns = 11;
  const std::vector<double> x = reference::random_vector(Offset{a.rows} * columns, 3);
  std::vector<double> y(x.size()), found(x.size());
  product.apply(pool, x.data(), y.data(), columns);
  space->send(space->block(0, columns), x.data(), columns);
  space->multiply(matrix, space->block(0, columns), space->block(1, columns), columns);
  space->fetch(found.data(), space->block(1, columns), columns);
  for (std::size_t i = 0; i < y.size(); ++i) EXPECT_NEAR(found[i], y[i], 1e-11) << i;
}

using ModesFaults = RefusedCalls;

// Calls of CUDA refused in turn to a search. Truth: the modes of the host.
TEST_F(ModesFaults, RefusedCallsAreNamedOrTheModesAreRight) {
  const SparseMatrix k = generated({"elasticity", "5"}), m = generated({"elasticity-mass", "5"});
  ModesOptions o = lowest(12);
  o.solver.device = "cpu";
  const ModesResult truth = find_modes(k, m, o);
  ASSERT_TRUE(truth.status.ok()) << truth.status.message;
  o.solver.device = "gpu:0";
  o.solver.pinned_memory_bytes = 0;
  const Refusals told = refuse_some(
      [&]() -> Attempt {
        auto found = std::make_shared<ModesResult>();
        return {[&, found] {
                  *found = find_modes(k, m, o);
                  return found->status;
                },
                [&, found] {
                  EXPECT_EQ(found->complete, truth.complete);
                  ASSERT_EQ(found->count(), truth.count());
                  for (std::size_t i = 0; i < truth.eigenvalues.size(); ++i)
                    EXPECT_NEAR(found->eigenvalues[i], truth.eigenvalues[i], 1e-10 * truth.eigenvalues.back());
                  for (const double r : found->residuals) EXPECT_LT(r, 1e-9);
                }};
      },
      60);
  EXPECT_GT(told.tried, 30);
}

}  // namespace espalier
