// FP32 factors on the GPU, whose products come from FP16 tensor cores. Truth: A x = b by an independent residual;
// numbers far from 1 must do no worse than numbers around 1.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "espalier/espalier.hpp"
#include "matrix/generators/generate.hpp"
#include "matrix/residual.hpp"
#include "reference/reference.hpp"
#include "solver/gpu/gpu_fixture.hpp"

namespace espalier {
namespace gpu_precision_test {

using reference::Values;

constexpr double kEps = std::numeric_limits<double>::epsilon();

class GpuPrecision : public test::OnGpu {};

struct System {
  std::string name;
  SparseMatrix a;
};

std::vector<System> systems() {
  std::vector<System> list;
  const std::vector<std::string> made[] = {
      {"elasticity", "12"}, {"plate", "60"}, {"kkt", "6", "8", "5", "5"}, {"gyroscopic", "10"}};
  for (const auto& words : made) list.push_back({words.front(), matrix::generate(matrix::parse_generator(words))});
  list.push_back({"random, positive", reference::random_system(2000, 6, Values::positive, 1)});
  list.push_back({"random, unsymmetric", reference::random_system(1500, 6, Values::general, 3)});
  return list;
}

Options on_gpu(Precision precision) {
  Options o;
  o.device = "gpu:0";
  o.precision = precision;
  return o;
}

double error_of(const SparseMatrix& a, const std::vector<double>& x, const std::vector<double>& b) {
  return matrix::backward_errors(a, x, b, 1, Transpose::no, nullptr).normwise;
}

TEST_F(GpuPrecision, MixedReachesRounding) {
  for (const auto& [name, a] : systems())
    for (const Offset memory : {Offset{0}, Offset{8} << 20}) {
      SCOPED_TRACE(testing::Message() << name << ", memory " << memory);
      Options o = on_gpu(Precision::mixed);
      o.device_memory_bytes = memory;
      Solver s(o);
      ASSERT_TRUE(s.analyze(a).status.ok());
      const FactorResult factor = s.factorize(a);
      const Status& status = factor.status;
      if (memory > 0 && status.code == StatusCode::out_of_memory) continue;  // says what it needs
      ASSERT_TRUE(status.ok()) << status.message;
      const std::vector<double> b = reference::random_vector(a.rows, 5);
      std::vector<double> x(b.size()), again(b.size());
      const SolveResult r = s.solve(b, x);
      ASSERT_TRUE(r.status.ok()) << r.status.message;
      EXPECT_LE(error_of(a, x, b), 2 * kEps);
      EXPECT_NEAR(r.backward_error, error_of(a, x, b), kEps);
      if (factor.precision != Precision::fp64) {  // that of the plate is, for its small pivots
        EXPECT_GE(r.refinement_steps, 1) << "an FP32 factor alone does not reach that";
      }
      EXPECT_LE(r.refinement_steps, 30);
      ASSERT_TRUE(s.refactorize(a.values).status.ok());
      ASSERT_TRUE(s.solve(b, again).status.ok());
      EXPECT_EQ(x, again) << "the bits of every run";
    }
}

// Fronts of more than 1,024 rows, whose tile columns some GPUs take two by two.
TEST_F(GpuPrecision, LargeFronts) {
  struct Case {
    std::vector<std::string> words;
    Kind kind;
  };
  std::vector<std::string> devices{"gpu:0"};
  if (test::has_gpus(2)) devices.emplace_back("gpu:0,1");
  for (const auto& [words, kind] :
       {Case{{"elasticity", "22"}, Kind::llt}, {{"elasticity", "22"}, Kind::ldlt}, {{"gyroscopic", "20"}, Kind::lu}}) {
    const SparseMatrix a = matrix::generate(matrix::parse_generator(words));
    const std::vector<double> b = reference::random_vector(a.rows, 9);
    for (const std::string& device : devices)
      for (const Precision precision : {Precision::fp32, Precision::mixed}) {
        SCOPED_TRACE(testing::Message() << words.front() << ", " << static_cast<int>(kind) << " on " << device);
        Options o = on_gpu(precision);
        o.device = device;
        o.kind = kind;
        o.required_backward_error = 1;
        if (precision == Precision::fp32) o.refinement_steps = 0;
        Solver s(o);
        const AnalysisResult analysis = s.analyze(a);
        ASSERT_TRUE(analysis.status.ok());
        EXPECT_GT(analysis.largest_front, 1024);
        ASSERT_TRUE(s.factorize(a).status.ok());
        std::vector<double> x(b.size()), again(b.size());
        ASSERT_TRUE(s.solve(b, x).status.ok());
        EXPECT_LE(error_of(a, x, b), precision == Precision::fp32 ? 1e-5 : 2 * kEps);
        ASSERT_TRUE(s.refactorize(a.values).status.ok());
        ASSERT_TRUE(s.solve(b, again).status.ok());
        EXPECT_EQ(x, again) << "the bits of every run";
      }
  }
}

// The analysis has scaled other values: what is factored lies far from 1.
TEST_F(GpuPrecision, NumbersFarFromOne) {
  for (const auto& [name, a] : systems()) {
    Options o = on_gpu(Precision::fp32);
    o.required_backward_error = 1;
    Solver s(o);
    ASSERT_TRUE(s.analyze(a).status.ok());
    const std::vector<double> b = reference::random_vector(a.rows, 6);
    std::vector<double> x(b.size());
    ASSERT_TRUE(s.factorize(a).status.ok());
    ASSERT_TRUE(s.solve(b, x).status.ok());
    const double usual = error_of(a, x, b);
    EXPECT_LE(usual, 1e-5) << name;
    for (const double factor : {1e-12, 1e-5, 3e4, 1e9}) {
      SparseMatrix scaled = a;
      for (double& v : scaled.values) v *= factor;
      ASSERT_TRUE(s.refactorize(scaled.values).status.ok()) << name << ", " << factor;
      ASSERT_TRUE(s.solve(b, x).status.ok());
      EXPECT_LE(error_of(scaled, x, b), 4 * usual) << name << ", " << factor;
    }
  }
}

// Stiffnesses over twelve decades in one matrix, which no single factor takes into the range of FP16.
TEST_F(GpuPrecision, NumbersOverManyDecades) {
  for (auto [name, a] : systems()) {
    std::vector<double> scale(static_cast<std::size_t>(a.rows));
    const std::vector<double> random = reference::random_vector(a.rows, 7);
    for (std::size_t i = 0; i < scale.size(); ++i) scale[i] = std::pow(10.0, 6 * random[i]);
    for (Index col = 0; col < a.cols; ++col)
      for (Offset k = a.col_ptr[col]; k < a.col_ptr[col + 1]; ++k)
        a.values[static_cast<std::size_t>(k)] *=
            scale[static_cast<std::size_t>(col)] * scale[static_cast<std::size_t>(a.row_ind[k])];
    Solver s(on_gpu(Precision::mixed));
    ASSERT_TRUE(s.analyze(a).status.ok());
    const Status status = s.factorize(a).status;
    ASSERT_TRUE(status.ok()) << name << ": " << status.message;
    const std::vector<double> b = reference::random_vector(a.rows, 8);
    std::vector<double> x(b.size());
    const SolveResult r = s.solve(b, x);
    ASSERT_TRUE(r.status.ok()) << name << ": " << r.status.message;
    EXPECT_LE(error_of(a, x, b), 2 * kEps) << name;
  }
}

}  // namespace gpu_precision_test
}  // namespace espalier
