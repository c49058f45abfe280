// Systems of patterns of their own that are solved together as blocks of one, here on the host. Truth: a Solver for
// each, bit by bit; and the same systems one by one, where they are singular, wrong or badly scaled.
#include "batch/groups.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "batch/batch_common.hpp"
#include "batch/easy_values.hpp"
#include "batch/equal_patterns.hpp"
#include "ranks/emulated_gpu.hpp"
#include "solver/gpu/gpu_fixture.hpp"

namespace espalier::test {

namespace {

// Systems that own their arrays.
struct Many {
  void add(SparseMatrix a, Index columns = 1, Transpose transpose = Transpose::no) {
    b.push_back(reference::random_vector(Offset{a.cols} * columns, static_cast<std::uint64_t>(matrices.size())));
    matrices.push_back(std::move(a));
    kinds.push_back({columns, transpose});
  }
  // All unsolved.
  [[nodiscard]] std::vector<System> systems() {
    x.clear();
    for (const auto& of : b) x.emplace_back(of.size(), -1.0);
    std::vector<System> list;
    for (std::size_t k = 0; k < matrices.size(); ++k)
      list.push_back({matrices[k], b[k], x[k], kinds[k].columns, kinds[k].transpose});
    return list;
  }
  [[nodiscard]] std::size_t size() const { return matrices.size(); }

  struct Right {
    Index columns;
    Transpose transpose;
  };
  std::vector<SparseMatrix> matrices;
  std::vector<Right> kinds;
  std::vector<std::vector<double>> b, x;
};

struct Told {
  BatchResult result;
  std::string log;
};

Told solved(Many& many, Options o) {
  Told told;
  o.log = [&](const std::string& line) { told.log += line + "\n"; };
  told.result = solve_systems(many.systems(), o);
  return told;
}

Many of_all_kinds(Index count) {
  Many many;
  for (Index k = 0; k < count; ++k) {
    const auto seed = static_cast<std::uint64_t>(k);
    const Index columns = k % 8 == 7 ? 3 : 1;
    switch (k % 4) {
      case 0:
        many.add(reference::random_system(1 + 5 * k, 3, reference::Values::positive, seed), columns);
        break;
      case 1:
        many.add(constrained_chain(12 + 6 * k), columns);
        break;
      case 2:
        many.add(reference::random_system(1 + 5 * k, 3, reference::Values::general, seed), columns);
        break;
      default:
        many.add(reference::random_system(3 + 5 * k, 3, reference::Values::general, seed), columns, Transpose::yes);
    }
  }
  return many;
}

void expect_answers_of_solvers(const Many& many, const BatchResult& found, const Options& options) {
  ASSERT_EQ(found.systems.size(), many.size());
  for (std::size_t k = 0; k < many.size(); ++k) {
    SCOPED_TRACE(k);
    Solver single(options);
    ASSERT_TRUE(single.analyze(many.matrices[k]).status.ok());
    const FactorResult factor = single.factorize(many.matrices[k]);
    ASSERT_TRUE(factor.status.ok());
    std::vector<double> expected(many.b[k].size());
    const SolveResult solve = single.solve(many.b[k], expected, many.kinds[k].columns, many.kinds[k].transpose);
    const SystemResult& one = found.systems[k];
    EXPECT_TRUE(one.status.ok()) << one.status.message;
    EXPECT_EQ(many.x[k], expected);
    EXPECT_EQ(one.inertia.negative, factor.inertia.negative);
    EXPECT_EQ(one.rank, factor.rank);
    EXPECT_EQ(one.backward_error, solve.backward_error);
    EXPECT_LE(one.backward_error, 8 * kEps);
  }
}

TEST(SystemGroups, HaveTheBitsOfSolvers) {
  Many many = of_all_kinds(40);
  for (const int threads : {1, 2, 5})
    for (const Index group : {2, 7, 40}) {
      SCOPED_TRACE(testing::Message() << threads << " threads, groups of " << group);
      const InChunks together(group);
      const Told told = solved(many, options_of(Kind::automatic, threads));
      EXPECT_TRUE(told.result.status.ok()) << told.result.status.message;
      expect_answers_of_solvers(many, told.result, options_of(Kind::automatic, 1));
      EXPECT_NE(told.log.find("of 40 systems were solved together"), std::string::npos) << told.log;
      if (group == 40) {
        EXPECT_EQ(told.log.find("solve_systems: 0 of"), std::string::npos) << told.log;
      }
    }
}

// What counts as zero is measured by the largest entry of all blocks: each is brought to about 1.
TEST(SystemGroups, OfAnyMagnitude) {
  Many many;
  for (Index k = 0; k < 24; ++k) {
    SparseMatrix a =
        reference::random_system(30 + k, 3, k % 2 == 0 ? reference::Values::positive : reference::Values::general,
                                 static_cast<std::uint64_t>(k));
    for (double& v : a.values) v *= std::pow(10.0, 20 * (k % 7) - 60);
    many.add(std::move(a));
  }
  const InChunks together(24);
  const Told told = solved(many, options_of(Kind::automatic, 2));
  EXPECT_TRUE(told.result.status.ok()) << told.result.status.message;
  EXPECT_NE(told.log.find("24 of 24 systems were solved together"), std::string::npos) << told.log;
  expect_answers_of_solvers(many, told.result, options_of(Kind::automatic, 1));
}

// Each ends as it does alone, and the others are solved.
TEST(SystemGroups, FailuresTouchNobodyElse) {
  for (const Kind kind : {Kind::automatic, Kind::ldlt, Kind::lu}) {
    SCOPED_TRACE(static_cast<int>(kind));
    Many many;
    for (Index k = 0; k < 24; ++k) {
      const auto seed = static_cast<std::uint64_t>(k);
      many.add(k % 2 == 0 ? constrained_chain(30 + k)
                          : reference::random_system(20 + k, 3, reference::Values::positive, seed));
    }
    std::fill(many.matrices[2].values.begin(), many.matrices[2].values.end(), 0.0);  // singular
    many.matrices[5].values[3] = std::numeric_limits<double>::quiet_NaN();
    for (double& v : many.matrices[7].values) v = -v;  // negative definite
    many.matrices[9].row_ind[2] = 1000;                // no matrix
    many.matrices[11].values.clear();
    many.b[13][1] = std::numeric_limits<double>::infinity();
    SparseMatrix& a = many.matrices[14];
    for (Offset q = a.col_ptr[3]; q < a.col_ptr[4]; ++q) a.values[static_cast<std::size_t>(q)] = 0;
    many.matrices[17].rows = 3;  // not square
    many.matrices[19].values[0] = 1e-300;
    const Told alone = solved(many, options_of(kind, 2));
    const std::vector<std::vector<double>> truth = many.x;
    for (const Index group : {3, 24}) {
      const InChunks together(group);
      const Told told = solved(many, options_of(kind, 2));
      EXPECT_EQ(told.result.status.message, alone.result.status.message);
      EXPECT_EQ(told.result.failed, alone.result.failed);
      for (std::size_t k = 0; k < many.size(); ++k) {
        SCOPED_TRACE(k);
        const SystemResult &found = told.result.systems[k], &one = alone.result.systems[k];
        EXPECT_EQ(found.status.code, one.status.code);
        EXPECT_EQ(found.status.message, one.status.message);
        EXPECT_EQ(found.rank, one.rank);
        EXPECT_EQ(found.inertia.negative, one.inertia.negative);
        EXPECT_EQ(std::memcmp(many.x[k].data(), truth[k].data(), truth[k].size() * sizeof(double)), 0);
      }
      EXPECT_EQ(told.log.find("solve_systems: 0 of"), std::string::npos) << told.log;
    }
    EXPECT_GE(alone.result.failed, 6);
  }
}

// Inertia by the signs of each block's pivots. Where pivots fail, a system goes on alone, from its order.
TEST(SystemGroups, IndefiniteSystems) {
  Many many;
  for (Index k = 0; k < 12; ++k) {
    const auto seed = static_cast<std::uint64_t>(k);
    many.add(k % 4 == 3 ? reference::saddle_point(60 + k, 20, seed)
                        : reference::random_system(40 + k, 3, reference::Values::indefinite, seed));
  }
  const InChunks together(6);
  const Told told = solved(many, options_of(Kind::ldlt, 2));
  EXPECT_TRUE(told.result.status.ok()) << told.result.status.message;
  EXPECT_NE(told.log.find("of 12 systems were solved together"), std::string::npos) << told.log;
  EXPECT_EQ(told.log.find("solve_systems: 0 of"), std::string::npos) << told.log;
  expect_answers_of_solvers(many, told.result, options_of(Kind::ldlt, 1));
}

TEST(SystemGroups, EqualPatternsAreFound) {
  Many many;
  const SparseMatrix a = constrained_chain(30), other = constrained_chain(31);
  for (Index k = 0; k < 9; ++k) many.add(k % 3 == 2 ? other : a, k == 6 ? 2 : 1);
  many.add(reference::random_system(30, 3, reference::Values::general, 1));
  many.add(many.matrices.back());
  many.matrices[3].row_ind[0] = -1;
  base::ThreadPool pool(2);
  const std::vector<System> systems = many.systems();
  const auto lists = batch::equal_patterns(systems, Kind::automatic, 3, pool);
  const std::vector<std::vector<Index>> expected = {{0, 1, 4, 7}, {2, 5, 8}};
  EXPECT_EQ(lists, expected);
  EXPECT_EQ(batch::equal_patterns(systems, Kind::lu, 2, pool).size(), 3U) << "values do not decide on the kind";
}

// Systems of one pattern go through a Batch; one that is not like the first is judged for itself.
TEST(SystemGroups, EqualPatternsGoThroughABatch) {
  Many many;
  const SparseMatrix a = constrained_chain(60);
  for (Index k = 0; k < 20; ++k) {
    SparseMatrix own = a;
    for (double& v : own.values) v *= 1 + 0.01 * k;
    many.add(k % 5 == 4 ? constrained_chain(40 + k) : own);
  }
  std::fill(many.matrices[7].values.begin(), many.matrices[7].values.end(), 0.0);
  const InChunks together(8);
  const Told told = solved(many, options_of(Kind::ldlt, 2));
  EXPECT_EQ(told.result.failed, 1);
  EXPECT_EQ(told.result.systems[7].status.code, StatusCode::singular);
  EXPECT_TRUE(std::isnan(many.x[7][0]));
  EXPECT_NE(told.log.find("batch: 15 of 16 systems were solved in chunks of 8"), std::string::npos) << told.log;
  EXPECT_NE(told.log.find("4 of 5 systems were solved together"), std::string::npos) << told.log;
  for (std::size_t k = 0; k < many.size(); ++k)
    if (k != 7) {
      EXPECT_LE(reference::backward_error(many.matrices[k], many.b[k], many.x[k]), 8 * kEps) << k;
    }
}

TEST(SystemGroups, AreCutWhereMemoryIsShort) {
  Many many;
  for (Index k = 0; k < 16; ++k) many.add(constrained_chain(200 + 6 * k));
  const InChunks together(16);
  Options o = options_of(Kind::ldlt, 1);
  o.device = "host:1";
  o.device_memory_bytes = 4000000;
  const Told told = solved(many, o);
  EXPECT_TRUE(told.result.status.ok()) << told.result.status.message;
  EXPECT_NE(told.log.find("16 of 16 systems were solved together, in 1 groups: groups were cut"), std::string::npos)
      << told.log;
  for (std::size_t k = 0; k < many.size(); ++k)
    EXPECT_LE(reference::backward_error(many.matrices[k], many.b[k], many.x[k]), 8 * kEps) << k;
  o.device_memory_bytes = 20000;  // for nothing at all together
  const Told poor = solved(many, o);
  EXPECT_TRUE(poor.result.status.ok()) << poor.result.status.message;
  EXPECT_NE(poor.log.find("0 of 16 systems"), std::string::npos) << poor.log;
  for (std::size_t k = 0; k < many.size(); ++k)
    EXPECT_LE(reference::backward_error(many.matrices[k], many.b[k], many.x[k]), 8 * kEps) << k;
}

TEST(SystemGroups, OptionsThatJudgeOtherwiseAndFewSystems) {
  Many many = of_all_kinds(6);
  const InChunks together(6);
  for (const auto& set : {+[](Options& o) { o.precision = Precision::mixed; },
                          +[](Options& o) { o.rescale = Rescale::on; }, +[](Options& o) { o.zero_pivot = 1e-20; }}) {
    Options o = options_of(Kind::automatic, 2);
    set(o);
    const Told told = solved(many, o);
    EXPECT_TRUE(told.result.status.ok()) << told.result.status.message;
    EXPECT_EQ(told.log.find("together"), std::string::npos) << told.log;
  }
  Options o = options_of(Kind::automatic, 2);
  o.device = "gpu";  // no device
  const Told wrong = solved(many, o);
  EXPECT_EQ(wrong.result.failed, 6);
  Many none;
  EXPECT_TRUE(solved(none, options_of(Kind::automatic, 2)).result.status.ok());
  Many one = of_all_kinds(1);
  EXPECT_TRUE(solved(one, options_of(Kind::automatic, 2)).result.status.ok());
}

TEST(SystemGroups, CanBeStopped) {
  Many many = of_all_kinds(30);
  const InChunks together(5);
  Options o = options_of(Kind::automatic, 2);
  o.interrupted = [] { return true; };
  o.interrupted_every = 0;
  EXPECT_EQ(solve_systems(many.systems(), o).status.code, StatusCode::cancelled);
}

// Where the device that was named has no memory for any, all go on alone on the cores. Of our choice they stay there:
// to order them takes longest, and that is the cores' (docs/notebook/batches.md, "Systems of many patterns").
TEST(SystemGroups, DevicesThatWorkOrRefuse) {
  Many many = of_all_kinds(20);
  for (const bool refuses : {false, true}) {
    SCOPED_TRACE(refuses);
    ranks::EmulatedGpu gpu;
    gpu.refuses = refuses;
    const device::Registry registry{{&device::registry().host(), &gpu}, {}};
    Options o = options_of(Kind::automatic, 2);
    EXPECT_FALSE(batch::Groups::serve(o, registry));  // auto
    std::string log;
    o.log = [&](const std::string& line) { log += line; };
    o.device = "emulated:0";
    ASSERT_TRUE(batch::Groups::serve(o, registry));
    solver::Session session(o, registry);
    BatchResult found;
    found.systems.resize(many.size());
    const std::vector<System> systems = many.systems();
    EXPECT_GE(batch::Groups(session).solve(systems, found.systems), 2);
    if (refuses) expect_answers_of_solvers(many, found, options_of(Kind::automatic, 1));
    for (std::size_t k = 0; k < many.size(); ++k) {
      EXPECT_TRUE(found.systems[k].status.ok()) << found.systems[k].status.message;
      EXPECT_LE(reference::backward_error(many.matrices[k], many.b[k], many.x[k], many.kinds[k].columns,
                                          many.kinds[k].transpose != Transpose::no),
                8 * kEps)
          << k;
    }
    EXPECT_EQ(gpu.work.sent > 0, !refuses);
    EXPECT_EQ(log.find("solve_systems: 0 of") == std::string::npos, !refuses) << log;
    o.device = "cpu";
    EXPECT_FALSE(batch::Groups::serve(o, registry));
  }
}

// A factor of them fails nowhere.
TEST(SystemGroups, EasyValues) {
  base::ThreadPool pool(1);
  const auto prepared = [&](const SparseMatrix& a, Kind kind) {
    solver::PreparedMatrix p = solver::prepare_matrix(a.view(), kind, pool);
    solver::scale_and_match(p, kind, {}, pool);
    return p;
  };
  for (const Kind kind : {Kind::llt, Kind::ldlt, Kind::lu}) {
    const auto values = kind == Kind::lu ? reference::Values::general : reference::Values::positive;
    const solver::PreparedMatrix p = prepared(reference::random_system(40, 3, values, 1), kind);
    std::vector<double> easy(static_cast<std::size_t>(p.a.nonzeros())), scaled(easy.size());
    ASSERT_TRUE(batch::take_easy_values(p, easy));
    EXPECT_NEAR(solver::scale_values(p, {p.row_scale, p.col_scale, 0, false}, easy, scaled.data(), pool), 1, kEps);
    const auto is_one = [](double v) { return std::abs(v - 1) <= kEps; };
    EXPECT_EQ(std::count_if(scaled.begin(), scaled.end(), is_one), 40);
    EXPECT_EQ(std::count(scaled.begin(), scaled.end(), 0.0), std::ssize(scaled) - 40);
  }
  const solver::PreparedMatrix p = prepared(reference::saddle_point(40, 12, 1), Kind::ldlt);  // no diagonal there
  std::vector<double> easy(static_cast<std::size_t>(p.a.nonzeros()));
  EXPECT_FALSE(batch::take_easy_values(p, easy));
}

class SystemsOnGpu : public OnGpu {};

// Thousands of patterns, with failures among them.
TEST_F(SystemsOnGpu, GpuGroupsSolveAndNameFailures) {
  Many many;
  for (Index k = 0; k < 3000; ++k) {
    const auto seed = static_cast<std::uint64_t>(k);
    const Index n = 20 + k % 200;
    switch (k % 4) {
      case 0:
        many.add(reference::random_system(
            n, 3, k % 8 == 0 ? reference::Values::positive : reference::Values::indefinite, seed));
        break;
      case 1:
        many.add(constrained_chain(n));
        break;
      case 2:
        many.add(reference::random_system(n, 3, reference::Values::general, seed), 2, Transpose::yes);
        break;
      default:
        many.add(reference::random_system(n, 3, reference::Values::general, seed));
    }
  }
  std::fill(many.matrices[8].values.begin(), many.matrices[8].values.end(), 0.0);
  std::fill(many.matrices[701].values.begin(), many.matrices[701].values.end(), 0.0);
  many.matrices[1502].values[0] = std::numeric_limits<double>::quiet_NaN();
  Options o = options_of(Kind::automatic, 0);
  o.device = "gpu:0";
  const Told told = solved(many, o);
  EXPECT_EQ(told.result.failed, 3);
  for (std::size_t k = 0; k < many.size(); ++k) {
    const SystemResult& one = told.result.systems[k];
    if (k == 8 || k == 701 || k == 1502) {
      EXPECT_FALSE(one.status.ok()) << k;
      continue;
    }
    ASSERT_TRUE(one.status.ok()) << k << ": " << one.status.message;
    EXPECT_LE(reference::backward_error(many.matrices[k], many.b[k], many.x[k], many.kinds[k].columns,
                                        many.kinds[k].transpose != Transpose::no),
              8 * kEps)
        << k;
    if (k % 4 == 1) {
      EXPECT_EQ(one.inertia.negative, many.matrices[k].cols / 6) << k;
    } else if (k % 8 == 4) {  // indefinite: by the signs of its pivots
      Solver host(options_of(Kind::automatic, 1));
      ASSERT_TRUE(host.analyze(many.matrices[k]).status.ok());
      EXPECT_EQ(one.inertia.negative, host.factorize(many.matrices[k]).inertia.negative) << k;
    }
  }
  EXPECT_NE(told.log.find("systems were solved together, in"), std::string::npos) << told.log;
  EXPECT_EQ(told.log.find("solve_systems: 0 of"), std::string::npos) << told.log;
}

}  // namespace

}  // namespace espalier::test
