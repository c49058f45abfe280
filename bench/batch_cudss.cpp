#include "batch_cudss.hpp"

#include <vector>

#include "rivals/cudss_api.hpp"

namespace espalier::bench {

using namespace cudss;

/// A uniform batch has one pattern and, one system after another, the values of all; so have its dense matrices.
struct CudssBatch::Impl {
  Impl(const SparseMatrix& a, Index count, const CudssBatchSettings& settings)
      : rows(cuda, a.col_ptr.size()),
        columns(cuda, a.row_ind.size()),
        values(cuda, a.values.size() * static_cast<std::size_t>(count)),
        rhs(cuda, static_cast<std::size_t>(a.cols) * static_cast<std::size_t>(count)),
        solution(cuda, static_cast<std::size_t>(a.cols) * static_cast<std::size_t>(count)) {
    const std::vector<std::int32_t> pointers(a.col_ptr.begin(), a.col_ptr.end());
    rows.upload(pointers.data());
    columns.upload(a.row_ind.data());  // the lower triangle by columns: the upper one by rows
    check_cudss(api.create(&handle), "cudssCreate");
    check_cudss(api.config_create(&config), "cudssConfigCreate");
    check_cudss(api.data_create(handle, &data), "cudssDataCreate");
    set(kUniformBatchSize, static_cast<int>(count), "UBATCH_SIZE");
    set(kMatchingAlg, settings.matching ? int{kMaxDiagProduct} : int{kNoMatching}, "MATCHING_ALG");
    if (settings.refinement_steps > 0) set(kRefinementLimit, settings.refinement_steps, "IR_N_STEPS");
    check_cudss(api.create_csr(&matrix, a.cols, a.cols, a.nonzeros(), rows.get(), nullptr, columns.get(), values.get(),
                               kInteger32, kInteger32, kReal64, settings.definite ? kPositiveDefinite : kSymmetric,
                               kUpper, kBaseZero),
                "cudssMatrixCreateCsr");
    check_cudss(api.create_dense(&b, a.cols, 1, a.cols, rhs.get(), kReal64, kColumnMajor), "cudssMatrixCreateDn");
    check_cudss(api.create_dense(&x, a.cols, 1, a.cols, solution.get(), kReal64, kColumnMajor), "cudssMatrixCreateDn");
  }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;
  ~Impl() {
    for (Matrix m : {matrix, b, x})
      if (m != nullptr) api.matrix_destroy(m);
    if (data != nullptr) api.data_destroy(handle, data);
    if (config != nullptr) api.config_destroy(config);
    if (handle != nullptr) api.destroy(handle);
  }

  template <typename T>
  void set(int param, const T& value, const char* name) {
    check_cudss(api.config_set(config, param, &value, sizeof value), name);
  }
  void run(int phase, const char* name) {
    check_cudss(api.execute(handle, phase, config, data, matrix, x, b), name);
    check_cuda(cuda, cuda.synchronize(), name);
  }

  Api api;  // before the runtime: a missing library is told even where no GPU is
  Cuda cuda;
  DeviceArray<std::int32_t> rows, columns;
  DeviceArray<double> values, rhs, solution;
  Handle handle = nullptr;
  Config config = nullptr;
  Data data = nullptr;
  Matrix matrix = nullptr, b = nullptr, x = nullptr;
};

CudssBatch::CudssBatch(const SparseMatrix& a, std::span<const double> values, Index count,
                       const CudssBatchSettings& settings)
    : impl_(std::make_unique<Impl>(a, count, settings)) {
  impl_->values.upload(values.data());
  impl_->run(kAnalysis, "analysis of a batch");
  impl_->run(kFactorization, "factorization of a batch");
}

CudssBatch::~CudssBatch() = default;

CudssBatchTimes CudssBatch::solve(std::span<const double> values, std::span<const double> b, std::span<double> x) {
  CudssBatchTimes times;
  times.whole = timed([&] {
    impl_->values.upload(values.data());
    impl_->rhs.upload(b.data());
    times.phases = timed([&] {
      impl_->run(kRefactorization, "refactorization of a batch");
      impl_->run(kSolve, "solve of a batch");
    });
    impl_->solution.download(x.data());
  });
  return times;
}

}  // namespace espalier::bench
