// Truth: whoever does what, the operations are the same, so every way of sharing gives the same bits; and a switch that
// is off is not used.
#include <gtest/gtest.h>

#include <numeric>

#include "espalier/solver.hpp"
#include "matrix/generators/generate.hpp"

namespace espalier {
namespace sharing_test {

struct Answer {
  std::vector<double> x;
  Index stolen = 0;
};

Answer solve_with(const SparseMatrix& a, const Sharing& sharing) {
  Options options;
  options.device = "host:3,1";
  options.sharing = sharing;
  Solver solver(options);
  EXPECT_TRUE(solver.analyze(a).status.ok());
  Answer answer;
  for (int round = 0; round < 5; ++round) {
    const FactorResult factor = solver.factorize(a);
    EXPECT_TRUE(factor.status.ok()) << factor.status.message;
    for (const DeviceReport& device : factor.devices) answer.stolen += device.stolen_subtrees;
  }
  std::vector<double> b(static_cast<std::size_t>(a.rows));
  std::iota(b.begin(), b.end(), 1.0);
  answer.x.resize(b.size());
  EXPECT_TRUE(solver.solve(b, answer.x).status.ok());
  return answer;
}

TEST(Sharing, SwitchesChangeWhoWorksNotWhatComesOut) {
  const SparseMatrix a = matrix::generate(matrix::parse_generator(std::vector<std::string>{"elasticity", "7"}));
  const Answer reference = solve_with(a, {});
  for (const double additional : {0.0, 1.0, 3.0})
    for (const bool stealing : {false, true})
      for (const bool top : {false, true}) {
        const Answer answer = solve_with(a, {additional, stealing, top});
        EXPECT_EQ(answer.x, reference.x) << additional << stealing << top;
        if (!stealing) {
          EXPECT_EQ(answer.stolen, 0);
        }
      }
}

}  // namespace sharing_test
}  // namespace espalier
