// Values and right-hand sides in device memory. On machines without a GPU: the answer is an error that says what to do.
// With one: the same systems through host arrays and through device arrays, judged by an independent residual.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "device/cuda/executor/cuda_executor.hpp"
#include "espalier/espalier.h"
#include "espalier/espalier.hpp"
#include "reference/reference.hpp"
#include "solver/gpu/gpu_fixture.hpp"

#if ESPALIER_WITH_CUDA
#include <cuda_runtime_api.h>
#endif

namespace espalier {
namespace device_arrays_test {

using reference::Values;

TEST(DeviceArrays, AHostFactorRefusesThem) {
  const SparseMatrix a = reference::random_system(40, 5, Values::positive, 1);
  Options o;
  o.device = "cpu";
  o.threads = 2;
  Solver s(o);
  EXPECT_THROW((void)s.refactorize_device(a.values.data(), a.nonzeros()), std::logic_error) << "not analyzed";
  ASSERT_TRUE(s.analyze(a).status.ok());
  EXPECT_THROW((void)s.refactorize_device(a.values.data(), a.nonzeros() - 1), std::invalid_argument);
  EXPECT_THROW((void)s.refactorize_device(nullptr, a.nonzeros()), std::invalid_argument);
  const FactorResult f = s.refactorize_device(a.values.data(), a.nonzeros());
  EXPECT_EQ(f.status.code, StatusCode::device_error);
  EXPECT_NE(f.status.message.find("use refactorize()"), std::string::npos) << f.status.message;
  std::vector<double> b(40, 1.0), x(40);
  EXPECT_THROW((void)s.solve_device(b.data(), x.data()), std::logic_error) << "not factorized";
  ASSERT_TRUE(s.refactorize(a.values).status.ok()) << "the host's calls work as before";
  EXPECT_EQ(s.solve_device(b.data(), x.data()).status.code, StatusCode::device_error);
  EXPECT_THROW((void)s.solve_device(b.data(), x.data(), 0), std::invalid_argument);
  EXPECT_TRUE(s.solve(b, x).status.ok());
}

#if ESPALIER_WITH_CUDA

class Gpu : public test::OnGpu {};

// n doubles on the GPU.
class OnDevice {
 public:
  explicit OnDevice(const std::vector<double>& from) : size_(from.size()) {
    EXPECT_EQ(cudaMalloc(reinterpret_cast<void**>(&data_), size_ * sizeof(double)), cudaSuccess);
    EXPECT_EQ(cudaMemcpy(data_, from.data(), size_ * sizeof(double), cudaMemcpyHostToDevice), cudaSuccess);
  }
  OnDevice(const OnDevice&) = delete;
  OnDevice& operator=(const OnDevice&) = delete;
  ~OnDevice() { (void)cudaFree(data_); }
  [[nodiscard]] double* data() const { return data_; }
  [[nodiscard]] std::vector<double> host() const {
    std::vector<double> to(size_);
    EXPECT_EQ(cudaMemcpy(to.data(), data_, size_ * sizeof(double), cudaMemcpyDeviceToHost), cudaSuccess);
    return to;
  }

 private:
  std::size_t size_;
  double* data_ = nullptr;
};

struct Case {
  const char* name;
  SparseMatrix a;
  Precision precision;
};

std::vector<Case> cases() {
  std::vector<Case> list;
  list.push_back({"llt", reference::random_system(3000, 6, Values::positive, 1), Precision::fp64});
  list.push_back({"llt of a general matrix",
                  reference::stored_as(reference::random_system(2500, 6, Values::positive, 2), Storage::general),
                  Precision::fp64});
  list.push_back({"ldlt", reference::saddle_point(1200, 300, 3), Precision::fp64});
  list.push_back({"lu", reference::random_system(2500, 6, Values::general, 4), Precision::fp64});
  list.push_back({"duplicates",
                  reference::stored_as(reference::random_system(900, 6, Values::general, 5), Storage::general, true),
                  Precision::fp64});
  list.push_back({"mixed", reference::random_system(2000, 6, Values::positive, 6), Precision::mixed});
  return list;
}

TEST_F(Gpu, DeviceArraysGiveWhatHostArraysGive) {
  for (const Case& c : cases())
    for (const Index columns : {1, 3, 40})
      for (const bool transpose : {false, true}) {
        SCOPED_TRACE(std::string(c.name) + ", columns " + std::to_string(columns));
        Options o;
        o.device = "gpu:0";
        o.precision = c.precision;
        Solver s(o);
        const AnalysisResult analysis = s.analyze(c.a);
        ASSERT_TRUE(analysis.status.ok()) << analysis.status.message;
        const FactorResult on_host = s.factorize(c.a);
        ASSERT_TRUE(on_host.status.ok()) << on_host.status.message;
        const std::vector<double> b = reference::random_vector(std::int64_t{c.a.rows} * columns, 7);
        std::vector<double> x(b.size());
        const Transpose how = transpose ? Transpose::yes : Transpose::no;
        ASSERT_TRUE(s.solve(b, x, columns, how).status.ok());
        EXPECT_LE(reference::backward_error(c.a, b, x, columns, transpose), 1e-15);

        // Other values: what is solved must be the new system.
        SparseMatrix scaled = c.a;
        for (double& v : scaled.values) v *= 3;
        const OnDevice values(scaled.values), rhs(b), out(x);
        const FactorResult f = s.refactorize_device(values.data(), scaled.nonzeros());
        ASSERT_TRUE(f.status.ok()) << f.status.message;
        EXPECT_EQ(f.inertia.negative, on_host.inertia.negative);
        EXPECT_NEAR(f.determinant_log - on_host.determinant_log, c.a.rows * std::log(3.0),
                    c.precision == Precision::fp64 ? 1e-8 * c.a.rows : 1e-3 * c.a.rows);
        const SolveResult r = s.solve_device(rhs.data(), out.data(), columns, how);
        ASSERT_TRUE(r.status.ok()) << r.status.message;
        EXPECT_EQ(rhs.host(), b) << "the right-hand sides are left alone";
        const std::vector<double> y = out.host();
        EXPECT_LE(reference::backward_error(scaled, b, y, columns, transpose), 1e-15);
        EXPECT_NEAR(r.backward_error, reference::backward_error(scaled, b, y, columns, transpose), 1e-15);
        // In place, and back to the host's calls, which must know the values on the device.
        ASSERT_TRUE(s.solve_device(out.data(), out.data(), columns, how).status.ok());
        EXPECT_LE(reference::backward_error(scaled, y, out.host(), columns, transpose), 1e-15);
        ASSERT_TRUE(s.solve(b, x, columns, how).status.ok());
        EXPECT_LE(reference::backward_error(scaled, b, x, columns, transpose), 1e-15);
        if (c.precision == Precision::fp64) {
          EXPECT_GT(s.condition_estimate().estimate, 1);
        }
      }
}

// The GPU multiplies the pivots in an order of its own, the same in every run. Truth: the host's factorization.
TEST_F(Gpu, DeterminantsAndInertiaAreTheHosts) {
  for (const Case& c : cases()) {
    SCOPED_TRACE(c.name);
    Options o;
    o.device = "cpu";
    o.threads = 2;
    o.precision = c.precision;
    Solver host(o);
    ASSERT_TRUE(host.analyze(c.a).status.ok());
    const FactorResult h = host.factorize(c.a);
    o.device = "gpu:0";
    Solver gpu(o);
    ASSERT_TRUE(gpu.analyze(c.a).status.ok());
    const FactorResult g = gpu.factorize(c.a);
    ASSERT_TRUE(g.status.ok()) << g.status.message;
    EXPECT_EQ(g.determinant_sign, h.determinant_sign);
    // Each of n pivots is right to a few eps times the growth of errors (the condition is small): log(1 + d) = d.
    const double eps = c.precision == Precision::fp64 ? std::numeric_limits<double>::epsilon()
                                                      : double{std::numeric_limits<float>::epsilon()};
    EXPECT_NEAR(g.determinant_log, h.determinant_log, 1e3 * eps * c.a.rows);
    EXPECT_EQ(g.inertia.positive, h.inertia.positive);
    EXPECT_EQ(g.inertia.negative, h.inertia.negative);
    EXPECT_EQ(g.inertia.zero, h.inertia.zero);
    EXPECT_EQ(gpu.refactorize(c.a.values).determinant_log, g.determinant_log) << "the same bits";
  }
}

// Two pivots of 1e-300 to one of 1e+300: no partial product may leave the range. Truth: powers of ten, counted.
TEST_F(Gpu, DeterminantsOfWildDiagonalsAreExact) {
  const Index n = 5000;
  SparseMatrix a{n, n, {0}, {}, {}, Storage::symmetric_lower};
  Index powers = 0;  // of 1e300
  for (Index k = 0; k < n; ++k) {
    a.row_ind.push_back(k);
    a.values.push_back(k % 3 == 2 ? 1e300 : 1e-300);
    powers += k % 3 == 2 ? 1 : -1;
    a.col_ptr.push_back(k + 1);
  }
  Options o;
  o.device = "gpu:0";
  o.kind = Kind::llt;
  Solver s(o);
  ASSERT_TRUE(s.analyze(a).status.ok());
  const FactorResult f = s.factorize(a);
  ASSERT_TRUE(f.status.ok()) << f.status.message;
  EXPECT_EQ(f.determinant_sign, 1);
  // Products of n factors, each rounded once: n eps in the logarithm, and that of 1e300 itself is rounded.
  const double log = powers * 300 * std::log(10.0), eps = std::numeric_limits<double>::epsilon();
  EXPECT_NEAR(f.determinant_log, log, n * eps + 4 * eps * std::abs(log));
}

TEST_F(Gpu, HostArraysAreNoDeviceArrays) {
  const SparseMatrix a = reference::random_system(300, 6, Values::positive, 11);
  Options o;
  o.device = "gpu:0";
  Solver s(o);
  ASSERT_TRUE(s.analyze(a).status.ok());
  EXPECT_THROW((void)s.refactorize_device(a.values.data(), a.nonzeros()), std::invalid_argument);
  ASSERT_TRUE(s.refactorize_device(OnDevice(a.values).data(), a.nonzeros()).status.ok()) << "the GPU still works";
  std::vector<double> b(300, 1.0), x(300);
  EXPECT_THROW((void)s.solve_device(b.data(), OnDevice(x).data()), std::invalid_argument);
  EXPECT_THROW((void)s.solve_device(OnDevice(b).data(), x.data()), std::invalid_argument);
  ASSERT_TRUE(s.solve(b, x).status.ok());
  EXPECT_LE(reference::backward_error(a, b, x), 1e-15);
}

TEST_F(Gpu, SingularAndNotFiniteValuesAreRefused) {
  const SparseMatrix a = reference::random_system(400, 6, Values::indefinite, 8);
  Options o;
  o.device = "gpu:0";
  Solver s(o);
  ASSERT_TRUE(s.analyze(a).status.ok());
  ASSERT_TRUE(s.factorize(a).status.ok());
  std::vector<double> bad = a.values;
  bad[17] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(s.refactorize_device(OnDevice(bad).data(), a.nonzeros()).status.code, StatusCode::invalid_input);
  EXPECT_EQ(s.refactorize_device(OnDevice(std::vector<double>(bad.size(), 0.0)).data(), a.nonzeros()).status.code,
            StatusCode::singular);
  const FactorResult regular = s.refactorize_device(OnDevice(a.values).data(), a.nonzeros());
  EXPECT_TRUE(regular.status.ok()) << regular.status.message;
}

TEST_F(Gpu, ASemidefiniteMatrixIsSingularNotPositive) {
  // A free chain of springs: one zero eigenvalue; rounding makes its last pivot a tiny positive or negative number.
  const Index n = 1000;
  SparseMatrix a{n, n, {0}, {}, {}, Storage::symmetric_lower};
  for (Index k = 0; k < n; ++k) {
    a.row_ind.push_back(k);
    a.values.push_back((k > 0 ? 0.1 + k % 7 : 0) + (k + 1 < n ? 0.1 + (k + 1) % 7 : 0));
    if (k + 1 < n) {
      a.row_ind.push_back(k + 1);
      a.values.push_back(-(0.1 + (k + 1) % 7));
    }
    a.col_ptr.push_back(static_cast<Offset>(a.row_ind.size()));
  }
  Options o;
  o.device = "gpu:0";
  Solver s(o);
  ASSERT_TRUE(s.analyze(a).status.ok());
  EXPECT_EQ(s.factorize(a).status.code, StatusCode::singular);
}

TEST_F(Gpu, TheCInterfaceTakesThem) {
  const SparseMatrix a = reference::random_system(500, 6, Values::positive, 9);
  std::vector<std::int64_t> indices(a.row_ind.begin(), a.row_ind.end());
  espalier_matrix_i64 m{};
  m.size = sizeof m;
  m.rows = m.cols = 500;
  m.nonzeros = a.nonzeros();
  m.layout = ESPALIER_CSC;
  m.storage = ESPALIER_SYMMETRIC_LOWER;
  m.pointers = a.col_ptr.data();
  m.indices = indices.data();
  m.values = a.values.data();
  espalier_solver* s = nullptr;
  ASSERT_EQ(espalier_create(&s), ESPALIER_OK);
  ASSERT_EQ(espalier_set_option(s, "device", "gpu:0"), ESPALIER_OK);
  ASSERT_EQ(espalier_analyze_i64(s, &m, nullptr), ESPALIER_OK) << espalier_last_error(s);
  const std::vector<double> b = reference::random_vector(500, 10);
  const OnDevice values(a.values), rhs(b), x(b);
  ASSERT_EQ(espalier_refactorize_device(s, values.data(), a.nonzeros(), nullptr, nullptr), ESPALIER_OK)
      << espalier_last_error(s);
  ASSERT_EQ(espalier_solve_device(s, rhs.data(), x.data(), 1, ESPALIER_NO_TRANSPOSE, nullptr, nullptr), ESPALIER_OK);
  EXPECT_LE(reference::backward_error(a, b, x.host()), 1e-15);
  espalier_destroy(s);
}

#endif

}  // namespace device_arrays_test
}  // namespace espalier
