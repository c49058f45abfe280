// Random changes of patterns, followed by Solver::analyze_change() and held against fresh analyses: status, rank,
// inertia, backward errors, entries of the factor. Prints a line for every wrong verdict and a summary; exit code 1
// where one was wrong.
//   espalier_follow [CHANGES [SEED [LARGEST_N]]]     default: 1000 changes, seed 1, n up to 400
#include <algorithm>
#include <cstdio>
#include <cstdlib>

#include "verdict/changes.hpp"

int main(int argc, char** argv) {
  using namespace espalier;  // NOLINT(google-build-using-namespace): a program of one file
  const int changes = argc > 1 ? std::atoi(argv[1]) : 1000;
  const auto first_seed = static_cast<std::uint64_t>(argc > 2 ? std::atoll(argv[2]) : 1);
  const Index largest = argc > 3 ? std::atoi(argv[3]) : 400;
  constexpr int kChangesEach = 10;
  int done = 0, full = 0, wrong = 0;
  double most = 0;
  for (std::uint64_t seed = first_seed; done < changes; ++seed) {
    std::mt19937_64 random(seed);
    const auto n = static_cast<Index>(2 + random() % static_cast<std::uint64_t>(std::max(1, largest - 1)));
    verdict::ChangingSystem system(
        static_cast<int>(seed % static_cast<std::uint64_t>(verdict::ChangingSystem::sorts())), n, seed);
    Options options;
    options.threads = 1 + static_cast<int>(seed % 2);
    options.kind = system.kind();
    if (random() % 4 == 0) options.max_block_size = 16;
    Solver solver(options);
    AnalysisResult analysis = solver.analyze(system.matrix());
    Offset fill = analysis.nonzeros_factor;
    for (int k = 0; k < kChangesEach && done < changes; ++k, ++done) {
      if (solver.state() == Solver::State::empty) {  // the last one was structurally singular
        analysis = solver.analyze(system.matrix());
        fill = analysis.nonzeros_factor;
        if (!analysis.status.ok()) break;
      }
      system.change();
      const verdict::ChangeVerdict v = verdict::follow(solver, system, fill);
      full += v.full ? 1 : 0;
      most = std::max(most, v.fill);
      if (v.wrong.empty()) continue;
      ++wrong;
      std::printf("WRONG seed %llu, change %d: %s\n", static_cast<unsigned long long>(seed), k, v.wrong.c_str());
    }
  }
  std::printf("%d changes: %d followed, %d analyzed anew, %d wrong; at most %.3f times the entries of the last order\n",
              done, done - full, full, wrong, most);
  return wrong == 0 ? 0 : 1;
}
