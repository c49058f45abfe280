// Factors on file whose matrix a GPU factorizes again, and factors of a GPU itself after singular ones. Truth:
// residuals of solutions as the factor gives them.
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <limits>
#include <random>

#include "espalier/factor_file.hpp"
#include "reference/reference.hpp"
#include "solver/gpu/gpu_fixture.hpp"
#include "verdict/sequence_truth.hpp"

namespace espalier {
namespace gpu_factor_file_test {

using Number = std::complex<double>;

class GpuFactorFile : public test::OnGpu {};

// Positive definite, Hermitian, in each storage, some entries in two parts.
ComplexSparseMatrix definite(Index n, std::uint64_t seed) {
  static const Storage storages[] = {Storage::symmetric_lower, Storage::symmetric_upper, Storage::symmetric_both};
  const SparseMatrix real = reference::stored_as(reference::random_system(n, 4, reference::Values::positive, seed),
                                                 storages[seed % 3], seed % 2 != 0);
  ComplexSparseMatrix a{real.rows,    real.cols, real.col_ptr,
                        real.row_ind, {},        static_cast<Storage>(static_cast<int>(real.storage) + 3)};
  a.values.assign(real.values.begin(), real.values.end());
  return a;
}

void turn(ComplexSparseMatrix& a, std::mt19937& random) {
  std::uniform_real_distribution<double> size(0.4, 2.5);
  std::vector<double> d(static_cast<std::size_t>(a.rows));
  for (double& v : d) v = size(random);
  for (std::size_t j = 0; j < d.size(); ++j)
    for (auto q = static_cast<std::size_t>(a.col_ptr[j]); q < static_cast<std::size_t>(a.col_ptr[j + 1]); ++q)
      a.values[q] *= d[static_cast<std::size_t>(a.row_ind[q])] * d[j];
}

double error_of(ComplexSolver& s, const ComplexSparseMatrix& a) {
  std::vector<Number> b(static_cast<std::size_t>(a.rows), {1, 0.3}), x(b.size());
  EXPECT_TRUE(s.solve(b, x).status.ok());
  return verdict::backward_error<Number>(a, b, x, 1, Transpose::no);
}

TEST_F(GpuFactorFile, WhatIsFactorizedAgainIsTheMatrix) {
  const std::string path =
      (std::filesystem::temp_directory_path() / ("espalier-gpu-factor-" + std::to_string(::getpid()))).string();
  for (std::uint64_t seed = 1; seed <= 60; ++seed) {
    std::mt19937 random(static_cast<unsigned>(seed));
    ComplexSparseMatrix a = definite(static_cast<Index>(5 + seed), seed);
    Options options;
    options.device = "gpu:0";
    options.threads = 1;
    options.kind = seed % 4 == 0 ? Kind::automatic : Kind::ldlt;
    options.partial_refactorization = seed % 5 < 2;
    options.rescale = static_cast<Rescale>(seed % 3);
    options.precision = seed % 7 < 4 ? Precision::mixed : Precision::fp64;
    options.refinement_steps = 0;
    options.required_backward_error = std::numeric_limits<double>::infinity();
    ComplexSolver s(options);
    ASSERT_TRUE(s.analyze(a).status.ok());
    if (seed % 3 != 0) {  // a singular one before
      ComplexSparseMatrix zero = a;
      for (std::size_t j = 0; j < static_cast<std::size_t>(a.rows); ++j)
        for (auto q = static_cast<std::size_t>(a.col_ptr[j]); q < static_cast<std::size_t>(a.col_ptr[j + 1]); ++q)
          if (a.row_ind[q] == a.rows / 2 || static_cast<Index>(j) == a.rows / 2) zero.values[q] = 0;
      (void)s.factorize(zero);
    }
    for (int k = 0; k < 2; ++k) {
      turn(a, random);
      ASSERT_TRUE(s.factorize(a).status.ok());
    }
    ASSERT_TRUE(save_factor(s, path).ok());
    const std::string about = "seed " + std::to_string(seed);
    EXPECT_LE(error_of(s, a), 1e-5) << about << ": the factor that was saved";
    for (int rescale = 0; rescale < 3; ++rescale)
      for (const bool partial : {false, true}) {
        Options other = options;
        other.rescale = static_cast<Rescale>(rescale);
        other.partial_refactorization = partial;
        LoadedComplexFactor loaded = load_complex_factor(path, other);
        ASSERT_TRUE(loaded.result.status.ok()) << loaded.result.status.message;
        const std::string how = about + ", rescale " + std::to_string(rescale) + (partial ? ", partial" : "") +
                                ", precision " + std::to_string(static_cast<int>(loaded.solver.options().precision)) +
                                ", kind " + std::to_string(static_cast<int>(loaded.solver.analysis().kind));
        EXPECT_LE(error_of(loaded.solver, a), 1e-5) << how << ": loaded";
        EXPECT_TRUE(loaded.solver.refactorize(factorized_matrix(loaded.solver).values).status.ok()) << how;
        EXPECT_LE(error_of(loaded.solver, a), 1e-5) << how << ": factorized once more";
        other.precision = loaded.solver.options().precision;
        other.kind = loaded.solver.analysis().kind;
        ComplexSolver own(other);
        EXPECT_TRUE(own.analyze(a).status.ok() && own.factorize(a).status.ok()) << how;
        EXPECT_LE(error_of(own, a), 1e-5) << how << ": without a file";
      }
  }
  std::filesystem::remove(path);
}

}  // namespace gpu_factor_file_test
}  // namespace espalier
