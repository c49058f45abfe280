// Random changes of patterns, followed by analyze_change() and held against fresh analyses: status, rank,
// inertia, backward errors, entries of the factor. Prints a line for every wrong verdict and a summary; exit code 1
// where one was wrong. Each third system is complex: symmetric, Hermitian or general.
//   espalier_follow [CHANGES [SEED [LARGEST_N]]]     default: 1000 changes, seed 1, n up to 400
#include <algorithm>
#include <cstdio>
#include <cstdlib>

#include "verdict/changes.hpp"
#include "verdict/complex_twin.hpp"

namespace {

using namespace espalier;  // NOLINT(google-build-using-namespace): a program of one file

struct Tally {
  int done = 0, full = 0, wrong = 0;
  double most = 0;
};

// @param most  changes
template <class T>
void follow(std::uint64_t seed, Index largest, int most, Tally& tally) {
  constexpr int kChangesEach = 10;
  std::mt19937_64 random(seed);
  const auto n = static_cast<Index>(2 + random() % static_cast<std::uint64_t>(std::max(1, largest - 1)));
  verdict::ChangingSystem system(static_cast<int>(seed % static_cast<std::uint64_t>(verdict::ChangingSystem::sorts())),
                                 n, seed);
  const bool hermitian = system.kind() != Kind::lu && seed % 2 == 0;
  Options options;
  options.threads = 1 + static_cast<int>(seed % 2);
  options.kind = system.kind();
  if (random() % 4 == 0) options.max_block_size = 16;
  SolverOf<T> solver(options);
  const auto analyze = [&] { return solver.analyze(verdict::twin_of<T>(system.matrix(), hermitian)); };
  AnalysisResult analysis = analyze();
  Offset fill = analysis.nonzeros_factor;
  for (int k = 0; k < kChangesEach && tally.done < most; ++k, ++tally.done) {
    if (solver.state() == Solver::State::empty) {  // the last one was structurally singular
      analysis = analyze();
      fill = analysis.nonzeros_factor;
      if (!analysis.status.ok()) break;
    }
    system.change();
    const verdict::ChangeVerdict v = verdict::follow<T>(solver, system, fill, hermitian);
    tally.full += v.full ? 1 : 0;
    tally.most = std::max(tally.most, v.fill);
    if (v.wrong.empty()) continue;
    ++tally.wrong;
    std::printf("WRONG seed %llu, change %d: %s\n", static_cast<unsigned long long>(seed), k, v.wrong.c_str());
  }
}

}  // namespace

int main(int argc, char** argv) {
  const int changes = argc > 1 ? std::atoi(argv[1]) : 1000;
  const auto first_seed = static_cast<std::uint64_t>(argc > 2 ? std::atoll(argv[2]) : 1);
  const Index largest = argc > 3 ? std::atoi(argv[3]) : 400;
  Tally t;
  for (std::uint64_t seed = first_seed; t.done < changes; ++seed)
    seed % 3 == 0 ? follow<std::complex<double>>(seed, largest, changes, t) : follow<double>(seed, largest, changes, t);
  std::printf("%d changes: %d followed, %d analyzed anew, %d wrong; at most %.3f times the entries of the last order\n",
              t.done, t.done - t.full, t.full, t.wrong, t.most);
  return t.wrong == 0 ? 0 : 1;
}
