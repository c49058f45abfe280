// Ranks on GPUs, here threads with a GPU each; processes are tests/ranks/mpi's. The truth is one process with one GPU:
// the same bits.
#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <mutex>
#include <string>
#include <vector>

#include "complex_system.hpp"
#include "device/registry.hpp"
#include "espalier/complex_solver.hpp"
#include "espalier/espalier.hpp"
#include "espalier/nodes.hpp"
#include "matrix/generators/generate.hpp"
#include "on_threads.hpp"
#include "ranks/communicator.hpp"
#include "reference/reference.hpp"

#if ESPALIER_WITH_CUDA
#include <cuda_runtime_api.h>
#endif

namespace espalier::ranks {
namespace gpu_ranks_test {

int gpus() {
  const device::Backend* backend = device::registry().find("gpu");
  return backend == nullptr ? 0 : static_cast<int>(backend->find().names.size());
}

SparseMatrix generated(std::vector<std::string> words) { return matrix::generate(matrix::parse_generator(words)); }

struct Answer {
  FactorResult factor;
  Status solve;
  std::vector<double> x, x_again;
};

Answer answer_of(Solver& solver, const SparseMatrix& a, Index columns, Transpose transpose) {
  Answer r;
  const AnalysisResult analysis = solver.analyze(a);
  r.solve = analysis.status;
  if (!r.solve.ok()) return r;
  r.factor = solver.factorize(a);
  r.factor = solver.factorize(a);
  const std::vector<double> b = reference::random_vector(Offset{a.rows} * columns, 5);
  r.x.assign(b.size(), 0.0);
  r.x_again.assign(static_cast<std::size_t>(a.rows), 0.0);
  r.solve = solver.solve(b, r.x, columns, transpose).status;
  if (r.solve.ok()) r.solve = solver.solve(std::span(b).first(r.x_again.size()), r.x_again, 1, transpose).status;
  return r;
}

class OnGpus : public testing::Test {
 protected:
  void SetUp() override {
    if (gpus() < 2) GTEST_SKIP() << "two GPUs are needed, " << gpus() << " can be used";
  }

  // Which ranks are a machine: so many after each other.
  struct Grouping {
    int ranks = 2, of_each = 2;
  };
  static void expect_bits_of_one(const SparseMatrix& a, const Options& given, Index columns = 1,
                                 Transpose transpose = Transpose::no) {
    expect_bits_of_one(a, given, columns, transpose, Grouping());
  }
  static void expect_bits_of_one(const SparseMatrix& a, const Options& given, Index columns, Transpose transpose,
                                 Grouping machines) {
    Options options = given;
    options.device = "gpu:0";
    Solver alone(options);
    const Answer truth = answer_of(alone, a, columns, transpose);
    std::mutex mutex;
    on_threads(machines.ranks, {}, [&](const Ranks& ranks) {
      Options shared = given;
      shared.device = machines.ranks == 2 ? "gpu:0,1" : "gpu:0,1,2,3";
      set_nodes(ranks, machines.of_each == 1 ? Nodes::process : Nodes::host);
      if (machines.ranks > machines.of_each && machines.of_each > 1) ranks.link()->set_machines(machines.of_each);
      Solver solver(ranks, shared);
      const Answer found = answer_of(solver, a, columns, transpose);
      const std::lock_guard lock(mutex);
      EXPECT_EQ(found.factor.status.code, truth.factor.status.code) << found.factor.status.message;
      EXPECT_EQ(found.factor.inertia.negative, truth.factor.inertia.negative);
      if (std::isinf(truth.factor.determinant_log)) {  // singular
        EXPECT_EQ(found.factor.determinant_log, truth.factor.determinant_log);
      } else {  // of L L^T it is multiplied on the host
        EXPECT_NEAR(found.factor.determinant_log, truth.factor.determinant_log, 1e-9);
      }
      EXPECT_EQ(found.solve.code, truth.solve.code) << found.solve.message;
      if (ranks.rank() != 0) return;
      EXPECT_EQ(found.x, truth.x);
      EXPECT_EQ(found.x_again, truth.x_again);
    });
  }

  static void expect_bits_on(Grouping machines) {
    const auto expect_bits = [&](std::vector<std::string> words, Index columns, Transpose transpose) {
      expect_bits_of_one(generated(std::move(words)), {}, columns, transpose, machines);
    };
    expect_bits({"elasticity", "12", "10", "9"}, 3, Transpose::no);
    expect_bits({"kkt", "3", "8", "4", "4"}, 40, Transpose::no);
    expect_bits({"gyroscopic", "10", "9", "8"}, 2, Transpose::yes);
    Options report;
    report.singular = SingularMatrix::report;
    expect_bits_of_one(generated({"kkt-redundant", "3", "2", "4", "2", "2"}), report, 1, Transpose::no, machines);
  }
};

TEST_F(OnGpus, PositiveDefinite) {
  expect_bits_of_one(generated({"elasticity", "12", "10", "9"}), {}, 3);
  expect_bits_of_one(generated({"poisson", "9"}), {});
}

TEST_F(OnGpus, Indefinite) {
  expect_bits_of_one(generated({"kkt", "3", "8", "4", "4"}), {}, 40);
  expect_bits_of_one(reference::saddle_point(300, 60, 3), {});
}

TEST_F(OnGpus, Unsymmetric) {
  expect_bits_of_one(generated({"gyroscopic", "10", "9", "8"}), {});
  expect_bits_of_one(generated({"gyroscopic", "10", "9", "8"}), {}, 2, Transpose::yes);
}

TEST_F(OnGpus, MixedPrecision) {
  Options o;
  o.precision = Precision::mixed;
  expect_bits_of_one(generated({"elasticity", "9", "8", "7"}), o);
}

TEST_F(OnGpus, SingularMatrices) {
  Options report;
  report.singular = SingularMatrix::report;
  expect_bits_of_one(generated({"kkt-redundant", "3", "2", "4", "2", "2"}), report);
}

// What kernels hand on goes by messages, though the GPUs may reach each other.
TEST_F(OnGpus, EachAMachineOfItsOwn) { expect_bits_on(Grouping{2, 1}); }

// A message lands on one of two GPUs, and goes on to the other.
TEST_F(OnGpus, TwoMachinesOfTwo) {
  if (gpus() < 4) GTEST_SKIP() << "four GPUs are needed, " << gpus() << " can be used";
  expect_bits_on(Grouping{4, 2});
}

TEST_F(OnGpus, AMachineOfThreeAndOneOfOne) {
  if (gpus() < 4) GTEST_SKIP() << "four GPUs are needed, " << gpus() << " can be used";
  expect_bits_on(Grouping{4, 3});
}

// set_nodes() is for solvers that are made later. Other values and wide passes are what takes new memory and messages.
TEST_F(OnGpus, ASolverKeepsTheMachinesOnWhichItWasMade) {
  const SparseMatrix a = generated({"elasticity", "7", "5", "4"});
  SparseMatrix twice = a;
  for (double& v : twice.values) v *= 2;
  constexpr Index kColumns = 40;
  const std::vector<double> b = reference::random_vector(Offset{a.rows} * kColumns, 5);
  for (const bool host_first : {true, false})
    on_threads(2, {}, [&](const Ranks& ranks) {
      Options options;
      options.device = "gpu:0,1";
      set_nodes(ranks, host_first ? Nodes::host : Nodes::process);
      Solver solver(ranks, options);
      const Answer before = answer_of(solver, a, 1, Transpose::no);
      set_nodes(ranks, host_first ? Nodes::process : Nodes::host);
      EXPECT_TRUE(solver.factorize(twice).status.ok());
      std::vector<double> x(b.size());
      const Status status = solver.solve(b, x, kColumns).status;
      EXPECT_TRUE(status.ok()) << status.message;
      for (std::size_t i = 0; i < before.x.size(); ++i)
        ASSERT_NEAR(2 * x[i], before.x[i], 1e-9 * std::abs(before.x[i]) + 1e-12) << i;
    });
}

TEST_F(OnGpus, RanksThatDoNotAgreeOnMachinesAreToldSo) {
  const SparseMatrix a = generated({"poisson", "5"});
  on_threads(2, {}, [&](const Ranks& ranks) {
    set_nodes(ranks, ranks.rank() == 0 ? Nodes::host : Nodes::process);
    Options options;
    options.device = "gpu:0,1";
    Solver solver(ranks, options);
    EXPECT_TRUE(solver.analyze(a).status.ok());
    const Status status = solver.factorize(a).status;
    EXPECT_EQ(status.code, StatusCode::invalid_input);
    EXPECT_NE(status.message.find("--nodes"), std::string::npos) << status.message;
  });
}

// Half of the rows of an upper triangle, as one rank gives them. The columns of the lower one are its rows.
struct Half {
  Half(const SparseMatrix& a, int rank) {
    const Index middle = a.rows / 2, end = rank == 0 ? middle : a.rows;
    first = rank == 0 ? 0 : middle;
    const Offset begin = a.col_ptr[static_cast<std::size_t>(first)];
    for (Index r = first; r <= end; ++r) row_ptr.push_back(a.col_ptr[static_cast<std::size_t>(r)] - begin);
    col.assign(a.row_ind.begin() + begin, a.row_ind.begin() + begin + row_ptr.back());
    values.assign(a.values.begin() + begin, a.values.begin() + begin + row_ptr.back());
  }
  [[nodiscard]] LocalRows rows(Index n) const { return {n, first, row_ptr, col, values, Storage::symmetric_upper}; }

  Index first = 0;
  std::vector<Offset> row_ptr;
  std::vector<Index> col;
  std::vector<double> values;
};

// One rank has a number that is none among its values: all say so, nobody waits, and the next values are taken.
TEST_F(OnGpus, ValuesOfOneRankThatAreNotFinite) {
  const SparseMatrix a = generated({"elasticity", "9", "8", "7"});
  for (const Nodes nodes : {Nodes::host, Nodes::process}) {
    std::vector<Status> ends(2);
    on_threads(2, {}, [&](const Ranks& ranks) {
      set_nodes(ranks, nodes);
      Options options;
      options.device = "gpu:0,1";
      Solver solver(ranks, options);
      const Half half(a, ranks.rank());
      EXPECT_TRUE(solver.analyze(half.rows(a.rows)).status.ok());
      EXPECT_TRUE(solver.refactorize(half.values).status.ok());
      std::vector<double> bad = half.values;
      if (ranks.rank() == 1) bad.back() = std::nan("");
      ends[static_cast<std::size_t>(ranks.rank())] = solver.refactorize(bad).status;
      const Status again = solver.refactorize(half.values).status;
      EXPECT_TRUE(again.ok()) << again.message;
    });
    EXPECT_FALSE(ends[0].ok());
    EXPECT_EQ(ends[0].code, ends[1].code);
    EXPECT_EQ(ends[0].message, ends[1].message);
  }
}

// Complex systems, as real ones of twice the size.
class ComplexOnGpus : public OnGpus {
 protected:
  using Value = std::complex<double>;

  struct ComplexAnswer {
    ComplexFactorResult factor;
    Status solve;
    double condition = 0;
    std::vector<Value> x, x_again;
  };

  static ComplexAnswer complex_answer(ComplexSolver& solver, const ComplexSparseMatrix& a, Transpose transpose) {
    constexpr Index kColumns = 10;
    ComplexAnswer r;
    r.solve = solver.analyze(a).status;
    if (!r.solve.ok()) return r;
    for (int again = 0; again < 3; ++again) r.factor = solver.factorize(a);
    const std::vector<double> parts = reference::random_vector(2 * Offset{a.rows} * kColumns, 5);
    std::vector<Value> b;
    for (std::size_t k = 0; k < parts.size(); k += 2) b.emplace_back(parts[k], parts[k + 1]);
    r.x.resize(b.size());
    r.x_again.resize(static_cast<std::size_t>(a.rows));
    r.solve = solver.solve(b, r.x, kColumns, transpose).status;
    if (r.solve.ok()) r.solve = solver.solve(std::span(b).first(r.x_again.size()), r.x_again, 1, transpose).status;
    r.condition = solver.condition_estimate().estimate;
    return r;
  }

  static void expect_bits(const ComplexSparseMatrix& a, Grouping machines, const Options& given = {},
                          Transpose transpose = Transpose::no) {
    Options options = given;
    options.device = "gpu:0";
    ComplexSolver alone(options);
    const ComplexAnswer truth = complex_answer(alone, a, transpose);
    on_threads(machines.ranks, {}, [&](const Ranks& ranks) {
      SCOPED_TRACE(testing::Message() << "rank " << ranks.rank() << " of " << machines.ranks << ", " << machines.of_each
                                      << " a machine");
      Options shared = given;
      shared.device = machines.ranks == 2 ? "gpu:0,1" : "gpu:0,1,2,3";
      set_nodes(ranks, machines.of_each == 1 ? Nodes::process : Nodes::host);
      if (machines.ranks > machines.of_each && machines.of_each > 1) ranks.link()->set_machines(machines.of_each);
      ComplexSolver solver(ranks, shared);
      const ComplexAnswer found = complex_answer(solver, a, transpose);
      EXPECT_EQ(found.factor.status.code, truth.factor.status.code) << found.factor.status.message;
      EXPECT_EQ(found.factor.rank, truth.factor.rank);
      EXPECT_EQ(found.factor.inertia.negative, truth.factor.inertia.negative);
      EXPECT_TRUE(same_number(found.factor.determinant_phase, truth.factor.determinant_phase));
      EXPECT_EQ(found.solve.code, truth.solve.code) << found.solve.message;
      EXPECT_EQ(found.condition, truth.condition);
      if (ranks.rank() != 0) return;
      EXPECT_EQ(found.x, truth.x);
      EXPECT_EQ(found.x_again, truth.x_again);
    });
  }

  static void expect_bits_of_all_kinds(Grouping machines) {
    const SparseMatrix definite = generated({"elasticity", "9", "8", "7"});
    const SparseMatrix indefinite = generated({"kkt", "3", "8", "4", "4"});
    const SparseMatrix general = generated({"gyroscopic", "8", "7", "6"});
    expect_bits(complex_of(definite, Storage::symmetric_lower), machines);
    expect_bits(complex_of(definite, Storage::hermitian_lower), machines, {}, Transpose::yes);
    expect_bits(complex_of(indefinite, Storage::symmetric_lower), machines, {}, Transpose::conjugate);
    Options ldlt;
    ldlt.kind = Kind::ldlt;
    expect_bits(complex_of(indefinite, Storage::hermitian_lower), machines, ldlt);
    for (const Transpose transpose : {Transpose::no, Transpose::yes, Transpose::conjugate})
      expect_bits(complex_of(general, Storage::general), machines, {}, transpose);
    Options mixed;
    mixed.precision = Precision::mixed;
    expect_bits(complex_of(definite, Storage::symmetric_lower), machines, mixed);
  }
};

TEST_F(ComplexOnGpus, HaveTheBitsOfOneGpu) { expect_bits_of_all_kinds(Grouping{2, 2}); }

TEST_F(ComplexOnGpus, HaveTheBitsOfOneGpuOnTwoMachines) { expect_bits_of_all_kinds(Grouping{2, 1}); }

TEST_F(ComplexOnGpus, HaveTheBitsOfOneGpuOnTwoMachinesOfTwo) {
  if (gpus() < 4) GTEST_SKIP() << "four GPUs are needed, " << gpus() << " can be used";
  expect_bits_of_all_kinds(Grouping{4, 2});
}

// A replaced pivot is no pair: all ranks go on with kernels that know of none.
TEST_F(ComplexOnGpus, SingularMatrices) {
  Options report;
  report.kind = Kind::ldlt;
  report.singular = SingularMatrix::report;
  const SparseMatrix a = generated({"kkt-redundant", "3", "2", "4", "2", "2"});
  for (const int of_each : {2, 1})
    for (const Storage storage : {Storage::symmetric_lower, Storage::hermitian_lower})
      expect_bits(complex_of(a, storage), Grouping{2, of_each}, report);
}

TEST_F(ComplexOnGpus, ANumberThatIsNone) {
  const ComplexSparseMatrix a = complex_of(generated({"elasticity", "5", "4", "3"}), Storage::symmetric_lower);
  for (const Nodes nodes : {Nodes::host, Nodes::process})
    on_threads(2, {}, [&](const Ranks& ranks) {
      set_nodes(ranks, nodes);
      Options options;
      options.device = "gpu:0,1";
      ComplexSolver solver(ranks, options);
      ASSERT_TRUE(solver.analyze(a).status.ok());
      ASSERT_TRUE(solver.factorize(a).status.ok());
      std::vector<Value> bad = a.values;
      bad.back() = {1, std::nan("")};
      if (ranks.rank() != 0) bad.clear();
      const Status refused = solver.refactorize(bad).status;
      EXPECT_EQ(refused.code, StatusCode::invalid_input);
      EXPECT_NE(refused.message.find("nan"), std::string::npos) << refused.message;
      const Status again = solver.factorize(a).status;
      EXPECT_TRUE(again.ok()) << again.message;
    });
}

#if ESPALIER_WITH_CUDA

// Doubles on a GPU.
class OnDevice {
 public:
  OnDevice(int gpu, const std::vector<double>& from) : size_(from.size()) {
    EXPECT_EQ(cudaSetDevice(gpu), cudaSuccess);
    EXPECT_EQ(cudaMalloc(reinterpret_cast<void**>(&data_), (size_ + 1) * sizeof(double)), cudaSuccess);
    EXPECT_EQ(cudaMemcpy(data_, from.data(), size_ * sizeof(double), cudaMemcpyHostToDevice), cudaSuccess);
  }
  OnDevice(const OnDevice&) = delete;
  OnDevice& operator=(const OnDevice&) = delete;
  ~OnDevice() { (void)cudaFree(data_); }
  [[nodiscard]] double* data() const { return data_; }
  [[nodiscard]] Offset size() const { return static_cast<Offset>(size_); }
  [[nodiscard]] std::vector<double> host() const {
    std::vector<double> to(size_);
    EXPECT_EQ(cudaMemcpy(to.data(), data_, size_ * sizeof(double), cudaMemcpyDeviceToHost), cudaSuccess);
    return to;
  }

 private:
  std::size_t size_;
  double* data_ = nullptr;
};

// Values and vectors in the memory of each rank's GPU: rows of each rank, and all on rank 0.
TEST_F(OnGpus, ArraysOfTheirMemory) {
  const SparseMatrix a = generated({"elasticity", "9", "8", "7"});
  const Index n = a.rows;
  const std::vector<double> b = reference::random_vector(n, 5);
  Options options;
  options.device = "gpu:0";
  Solver alone(options);
  ASSERT_TRUE(alone.analyze(a).status.ok());
  ASSERT_TRUE(alone.factorize(a).status.ok());
  std::vector<double> truth(b.size());
  ASSERT_TRUE(alone.solve(b, truth).status.ok());
  for (const Nodes nodes : {Nodes::host, Nodes::process})
    for (const bool by_rows : {true, false})
      on_threads(2, {}, [&](const Ranks& ranks) {
        SCOPED_TRACE(testing::Message() << "rank " << ranks.rank() << (by_rows ? ", by rows" : ", all on rank 0"));
        set_nodes(ranks, nodes);
        Options shared;
        shared.device = "gpu:0,1";
        Solver solver(ranks, shared);
        const Half half(a, ranks.rank());
        ASSERT_TRUE((by_rows ? solver.analyze(half.rows(n)) : solver.analyze(a)).status.ok());
        std::vector<double> mine = by_rows ? half.values : a.values;
        if (!by_rows && ranks.rank() != 0) mine.clear();
        const OnDevice values(ranks.rank(), mine);
        for (int again = 0; again < 3; ++again) {
          const Status factor = solver.refactorize_device(values.data(), values.size()).status;
          ASSERT_TRUE(factor.ok()) << factor.message;
        }
        EXPECT_EQ(solver.gpu(), ranks.rank());
        const RowRange rows = solver.rows();
        const OnDevice right(ranks.rank(), {b.begin() + rows.first, b.begin() + rows.first + rows.count});
        const OnDevice x(ranks.rank(), std::vector<double>(static_cast<std::size_t>(rows.count)));
        const Status solve = solver.solve_device(right.data(), x.data()).status;
        ASSERT_TRUE(solve.ok()) << solve.message;
        EXPECT_EQ(x.host(), std::vector<double>(truth.begin() + rows.first, truth.begin() + rows.first + rows.count));
        if (by_rows) return;
        // A NaN that no host has seen is named.
        mine.assign(mine.size(), 1.0);
        if (!mine.empty()) mine.back() = std::nan("");
        const OnDevice bad(ranks.rank(), mine);
        const Status refused = solver.refactorize_device(bad.data(), bad.size()).status;
        EXPECT_EQ(refused.code, StatusCode::invalid_input);
        EXPECT_NE(refused.message.find("is nan"), std::string::npos) << refused.message;
        const Status again = solver.refactorize_device(values.data(), values.size()).status;
        EXPECT_TRUE(again.ok()) << again.message;
      });
}

#endif

// The budget of one rank does not suffice, out of core neither: the same error on all, which says whose it is, and a
// new solver works. Of ranks that are machines of their own the first one goes on with its GPU.
TEST_F(OnGpus, MemoryOfOneRank) {
  const SparseMatrix a = generated({"elasticity", "12", "10", "9"});
  for (const Nodes nodes : {Nodes::host, Nodes::process})
    on_threads(2, {}, [&](const Ranks& ranks) {
      set_nodes(ranks, nodes);
      const auto status_of = [&](Offset bytes) {
        Options options;
        options.device = "gpu:0,1";
        if (ranks.rank() == 1) options.device_memory_bytes = bytes;
        Solver solver(ranks, options);
        const Status status = solver.analyze(a).status;
        return status.ok() ? solver.factorize(a).status : status;
      };
      const Status poor = status_of(100000);
      if (nodes == Nodes::host) {
        EXPECT_EQ(poor.code, StatusCode::out_of_memory) << poor.message;
        EXPECT_NE(poor.message.find("device 1 of 2"), std::string::npos) << poor.message;
      } else {
        EXPECT_TRUE(poor.ok()) << poor.message;
      }
      EXPECT_TRUE(status_of(0).ok());
    });
}

// Messages of a rank end in the midst of its runs: the other says which rank it was, within the patience and some
// seconds.
TEST_F(OnGpus, ARankThatDiesIsNamed) {
  const SparseMatrix a = generated({"elasticity", "9", "8", "7"});
  for (const Nodes nodes : {Nodes::host, Nodes::process})
    for (const std::int64_t at : {60, 97, 131}) {
      Faults faults;
      faults.dead_rank = 1;
      faults.dies_at = at;
      std::vector<Status> ends(2);
      on_threads(
          2, faults,
          [&](const Ranks& ranks) {
            set_nodes(ranks, nodes);
            Options options;
            options.device = "gpu:0,1";
            Solver solver(ranks, options);
            Status& end = ends[static_cast<std::size_t>(ranks.rank())];
            end = solver.analyze(a).status;
            for (int run = 0; run < 60 && end.ok(); ++run) end = solver.factorize(a).status;
          },
          0.5);
      EXPECT_EQ(ends[0].code, StatusCode::device_error) << ends[0].message;
      EXPECT_NE(ends[0].message.find("rank 1 on host"), std::string::npos) << ends[0].message;
    }
}

// One device text for all, and one that ranks can share.
TEST(GpuRanks, WrongDevicesAreRefusedOnAllRanks) {
  const SparseMatrix a = generated({"poisson", "5"});
  const auto codes = [&](const std::string& first, const std::string& second) {
    std::vector<Status> found(2);
    on_threads(2, {}, [&](const Ranks& ranks) {
      Options options;
      options.device = ranks.rank() == 0 ? first : second;
      Solver solver(ranks, options);
      Status status = solver.analyze(a).status;
      if (status.ok()) status = solver.factorize(a).status;
      found[static_cast<std::size_t>(ranks.rank())] = status;
    });
    EXPECT_EQ(found[0].message, found[1].message);
    EXPECT_EQ(found[0].code, found[1].code);
    return found[0];
  };
  EXPECT_EQ(codes("host:2", "host:2").code, StatusCode::device_error);
  EXPECT_NE(codes("reference", "reference").message.find("cannot be shared by 2 ranks"), std::string::npos);
  EXPECT_FALSE(codes("cpu", "reference").ok());
  if (gpus() == 0) {
    EXPECT_EQ(codes("gpu:all", "gpu:all").code, StatusCode::device_error);
  } else {
    EXPECT_NE(codes("gpu:0", "cpu").message.find("name different devices"), std::string::npos);
    EXPECT_NE(codes("gpu:0", "gpu:0").message.find("share GPU 0"), std::string::npos);
  }
}

}  // namespace gpu_ranks_test
}  // namespace espalier::ranks
