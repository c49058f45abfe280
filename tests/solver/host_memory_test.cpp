// The budget of the host's memory: analyze() says what is needed, factorize() takes no more, and refuses less. Truths:
// the counted peak, the peak of the process as the kernel saw it.
#include <gtest/gtest.h>

#include <fstream>
#include <string>

#include "process.hpp"
#include "solver/solver_common.hpp"

namespace espalier {
namespace host_memory_test {

using namespace test;

std::vector<SparseMatrix> systems() {
  return {generated({"elasticity", "6"}), generated({"kkt", "5", "4", "3", "3"}), generated({"gyroscopic", "5"}),
          generated({"poisson", "40", "40", "1"})};
}

TEST(HostMemory, OneFigureForThePredictionTheCheckAndThePeak) {
  for (const SparseMatrix& a : systems())
    for (const Precision precision : {Precision::fp64, Precision::mixed})
      for (const int threads : {1, 3}) {
        SCOPED_TRACE("n " + std::to_string(a.rows) + ", " + std::to_string(threads) + " threads");
        Options o;
        o.device = "cpu";
        o.threads = threads;
        o.precision = precision;
        Solver s(o);
        const AnalysisResult free = s.analyze(a);
        ASSERT_TRUE(free.status.ok()) << free.status.message;
        const std::vector<double> b = reference::random_vector(Offset{a.rows} * 20, 3);
        const auto run = [&](Offset budget) {
          o.host_memory_bytes = budget;
          Solver limited(o);
          const AnalysisResult r = limited.analyze(a);
          EXPECT_TRUE(r.status.ok());
          EXPECT_EQ(r.predicted_bytes, free.predicted_bytes) << "a prediction does not depend on the budget";
          FactorResult f = limited.factorize(a);
          if (!f.status.ok()) return f.status;
          EXPECT_LE(f.peak_host_bytes, budget);
          std::vector<double> x(b.size());
          Status solved = limited.solve(b, x, 20).status;
          EXPECT_LE(reference::backward_error(a, b, x, 20), 8 * kEps);
          f = limited.refactorize(a.values);
          EXPECT_LE(f.peak_host_bytes, budget) << "with 20 right-hand sides solved";
          return solved;
        };
        const Status enough = run(free.predicted_bytes);
        EXPECT_TRUE(enough.ok()) << enough.message;
        const Status short_of_it = run(free.predicted_bytes - 1);
        EXPECT_EQ(short_of_it.code, StatusCode::out_of_memory);
        EXPECT_NE(short_of_it.message.find(std::to_string(free.predicted_bytes) + " bytes would do"), std::string::npos)
            << short_of_it.message;
      }
}

// The devices are the host's: their arenas, the rings through which they are filled, and the store are memory of its. A
// small share of it is the solution's, and a bound (as in core).
TEST(HostMemory, OneFigureForThePredictionAndThePeakOutOfCore) {
  int out_of_core = 0;
  for (const SparseMatrix& a : {generated({"elasticity", "9"}), generated({"kkt", "5", "6", "6", "3"}),
                                generated({"gyroscopic", "7"}), generated({"poisson", "70", "70", "1"})})
    for (const Precision precision : {Precision::fp64, Precision::fp32})
      for (const int devices : {1, 2, 3})
        for (const int part : {1, 2, 6}) {
          SCOPED_TRACE(testing::Message() << "n " << a.rows << ", precision " << static_cast<int>(precision) << ", "
                                          << devices << " devices, budget 1/" << part);
          Options o;
          o.device = "host:" + std::to_string(devices);
          o.threads = devices;
          o.precision = precision;
          Solver whole(o);
          ASSERT_TRUE(whole.analyze(a).status.ok());
          Offset most = 0;
          for (const DeviceReport& d : whole.factorize(a).devices) most = std::max(most, d.peak_bytes);
          o.device_memory_bytes = most / part + (part == 1 ? most / 8 : 0);
          Solver s(o);
          const AnalysisResult r = s.analyze(a);
          const FactorResult f = s.factorize(a);
          if (f.status.code == StatusCode::out_of_memory) continue;  // the budget is below what any plan needs
          ASSERT_TRUE(f.status.ok()) << f.status.message;
          const bool streamed = f.devices.front().predicted_peak_bytes > 0;
          EXPECT_FALSE(streamed && part == 1);
          out_of_core += streamed ? 1 : 0;
          std::vector<double> b = reference::random_vector(a.rows, 3), x(b.size());
          (void)s.solve(b, x);
          const Offset peak = s.refactorize(a.values).peak_host_bytes;
          EXPECT_LE(peak, r.predicted_bytes);
          EXPECT_GE(peak, r.predicted_bytes * 7 / 8);
        }
  EXPECT_GT(out_of_core, 20);
}

std::int64_t kilobytes(const std::string& key) {
  std::ifstream in("/proc/self/status");
  for (std::string word; in >> word;)
    if (std::int64_t value = 0; word == key && in >> value) return value;
  return -1;
}

// What is not counted: code, thread stacks, the allocator's own, the ordering (gone before the factor comes).
TEST(HostMemory, ThePeakOfTheProcess) {
#if defined(ESPALIER_SANITIZED)
  GTEST_SKIP() << "the sanitizers take memory of their own";
#endif
  constexpr std::int64_t kRest = 48 << 10;  // KiB
  EXPECT_EQ(in_child([&] {
              const SparseMatrix a = generated({"elasticity", "18"});
              std::vector<double> b = reference::random_vector(a.rows, 3), x(b.size());
              std::ofstream("/proc/self/clear_refs") << 5;
              const std::int64_t before = kilobytes("VmRSS:");
              Options o;
              o.device = "cpu";
              o.threads = 2;
              Solver probe(o);
              o.host_memory_bytes = probe.analyze(a).predicted_bytes;
              probe = Solver(o);
              const bool solved =
                  probe.analyze(a).status.ok() && probe.factorize(a).status.ok() && probe.solve(b, x).status.ok();
              const std::int64_t peak = kilobytes("VmHWM:") - before, budget = o.host_memory_bytes >> 10;
              std::fprintf(stderr, "budget %ld KiB, peak %ld KiB\n", static_cast<long>(budget),
                           static_cast<long>(peak));
              return solved && peak <= budget + kRest && peak >= budget / 2;
            }),
            0);
}

}  // namespace host_memory_test
}  // namespace espalier
