// Factorization through a memory that holds only a part of it, on every backend that can. Truth: the textbook's backend
// in core (answers to rounding, inertia exactly), the budget, and the bits of another run.
#include "device/backends.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>

#include "matrix/generators/generate.hpp"
#include "out_of_core/executor.hpp"
#include "out_of_core/factory.hpp"
#include "reference/reference.hpp"

namespace espalier::out_of_core {
namespace {

std::vector<const device::Backend*> able_backends() {
  std::vector<const device::Backend*> list;
  for (const device::Backend* b : test::backends_here())
    if (b->out_of_core() != nullptr) list.push_back(b);
  return list;
}

// The solution for a fixed right-hand side, `columns` times (row by row), in the matrix' own order.
std::vector<double> solved(device::Executor<double>& executor, const plan::Plan& plan, bool transpose,
                           Index columns = 1) {
  const std::vector<double> b = reference::random_vector(plan.tree.n, 5);
  const auto width = static_cast<std::size_t>(columns);
  std::vector<double> x(b.size() * width), out(x.size());
  for (std::size_t k = 0; k < x.size(); ++k) x[k] = b[static_cast<std::size_t>(plan.tree.order[k / width])];
  executor.solve(x.data(), columns, transpose);
  for (std::size_t k = 0; k < x.size(); ++k)
    out[static_cast<std::size_t>(plan.tree.order[k / width]) * width + k % width] = x[k];
  return out;
}

double difference(const std::vector<double>& x, const std::vector<double>& truth) {
  double most = 0, size = 0;
  for (std::size_t k = 0; k < x.size(); ++k) {
    most = std::max(most, std::abs(x[k] - truth[k]));
    size = std::max(size, std::abs(truth[k]));
  }
  return most / size;
}

struct Tested {
  std::vector<std::string> words;
  Kind kind;
};

class OutOfCore : public ::testing::TestWithParam<const device::Backend*> {};

TEST_P(OutOfCore, GivesTheAnswerOfTheTextbook) {
  const device::Backend& backend = *GetParam();
  const device::Backend& textbook = *device::registry().find("reference");
  base::ThreadPool pool(2);
  for (const auto& [words, kind] :
       {Tested{{"elasticity", "10"}, Kind::llt}, Tested{{"kkt", "20", "6", "4", "4"}, Kind::ldlt},
        Tested{{"gyroscopic", "8"}, Kind::lu}}) {
    SCOPED_TRACE(words.front());
    const SparseMatrix a = matrix::generate(matrix::parse_generator(words), &pool);
    const plan::Plan dense = test::plan_for<double>(textbook, a, kind), plan = test::plan_for<double>(backend, a, kind);
    const device::PivotRule rule{0.01, 1e-14};
    const auto truth = textbook.make_executor({dense, kind, false, rule, pool}, device::Scalar<double>());
    const device::FactorOutcome expected = truth->factorize(a.values);

    OutOfCoreOptions options;
    const Offset need = plan.memory.size * static_cast<Offset>(sizeof(double));
    const Offset budget = std::max<Offset>(need / 2, backend.limits().own_memory ? Offset{4} << 20 : 0);
    options.devices = {{budget, 1}};
    options.slot_bytes = 64 << 10;
    options.rates = PlanningRates(plan.options.machine.out_of_core, kind);
    const device::Job job{plan, kind, false, rule, pool};
    // With what seems best, and with factors on the device and sub-trees that stream from a pinned store.
    for (const double resident : {-1.0, 0.3}) {
      options.rates.resident = resident;
      options.pinned_bytes = resident > 0 ? Offset{1} << 40 : 0;
      const auto executor = make_out_of_core_executor<double>(
          backend.out_of_core()->make(job, device::Scalar<double>()), options, nullptr);
      const device::FactorOutcome outcome = executor->factorize(a.values);
      EXPECT_LE(executor->peak_bytes(), budget);
      EXPECT_EQ(executor->peak_bytes(), executor->out_of_core().predicted_bytes);
      EXPECT_EQ(outcome.negative, expected.negative);
      EXPECT_EQ(outcome.replaced, expected.replaced);
      // The systems' condition numbers are below 1e6 (scaled or small ones).
      const double tolerance = 1e6 * std::numeric_limits<double>::epsilon() * std::sqrt(static_cast<double>(a.cols));
      for (const bool transpose : {false, true}) {
        const std::vector<double> x = solved(*executor, plan, transpose);
        EXPECT_LE(difference(x, solved(*truth, dense, transpose)), tolerance) << "transpose " << transpose;
        (void)executor->factorize(a.values);
        EXPECT_EQ(std::memcmp(solved(*executor, plan, transpose).data(), x.data(), x.size() * sizeof(double)), 0);
        // The same right-hand side sixteen times.
        constexpr Index kColumns = 16;
        const std::vector<double> many = solved(*executor, plan, transpose, kColumns);
        for (Index c = 0; c < kColumns; ++c) {
          std::vector<double> column;
          for (std::size_t k = 0; k < x.size(); ++k) column.push_back(many[k * kColumns + static_cast<std::size_t>(c)]);
          EXPECT_LE(difference(column, x), tolerance) << "column " << c;
        }
      }
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Backends, OutOfCore, ::testing::ValuesIn(able_backends()),
                         [](const auto& tested) { return test::name_of(tested.param); });

}  // namespace
}  // namespace espalier::out_of_core
