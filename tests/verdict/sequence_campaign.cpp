// Random sequences of calls: analyses, values in place, a few values, clones, files, and what must be refused between
// them. A solution has to be that of the last values. Prints a line for every wrong one and a summary; exit code 1
// where one was wrong.
//   espalier_sequences [SEQUENCES [SEED [CALLS [DEVICE]]]]     default: 1000 sequences, seed 1, 60 calls each, the host
#include <cstdio>
#include <cstdlib>

#include "verdict/call_sequences.hpp"

int main(int argc, char** argv) {
  const int sequences = argc > 1 ? std::atoi(argv[1]) : 1000;
  const auto first = static_cast<std::uint64_t>(argc > 2 ? std::atoll(argv[2]) : 1);
  const int calls = argc > 3 ? std::atoi(argv[3]) : 60;
  espalier::verdict::SequenceVerdict all;
  int wrong = 0;
  for (int k = 0; k < sequences; ++k) {
    const std::uint64_t seed = first + static_cast<std::uint64_t>(k);
    const espalier::verdict::SequenceVerdict v = espalier::verdict::run_sequence(seed, calls, argc > 4 ? argv[4] : "");
    all.calls += v.calls;
    all.solutions += v.solutions;
    all.bits += v.bits;
    all.errors += v.errors;
    if (v.wrong.empty()) continue;
    ++wrong;
    std::printf("WRONG seed %llu: %s\n", static_cast<unsigned long long>(seed), v.wrong.c_str());
  }
  std::printf(
      "%d sequences, %d calls: %d solutions judged, %d by their bits too, %d errors as they should be; %d wrong\n",
      sequences, all.calls, all.solutions, all.bits, all.errors, wrong);
  return wrong == 0 ? 0 : 1;
}
