/// \file
/// Linked into test programs by scripts/mutate.py. ESPALIER_MUTANT is the number of a mutant; with
/// ESPALIER_MUTANTS_REACHED, each test appends a line to that file: its name, whether it passed, its milliseconds, the
/// mutants that it came past.
#include "mutate_runtime.hpp"

#include <gtest/gtest.h>
#include <sys/mman.h>

#include <cstdlib>
#include <cstring>
#include <fstream>
#include <string>

namespace espalier_mutants {

int chosen = 0;
unsigned char* reached = nullptr;

namespace {

constexpr int kMost = 1 << 20;

class Listener : public testing::EmptyTestEventListener {
  void OnTestStart(const testing::TestInfo&) override { std::memset(reached, 0, kMost); }

  void OnTestEnd(const testing::TestInfo& test) override {
    std::ofstream out(std::getenv("ESPALIER_MUTANTS_REACHED"), std::ios::app);
    const testing::TestResult& result = *test.result();
    out << test.test_suite_name() << '.' << test.name() << ' ' << (result.Passed() && !result.Skipped()) << ' '
        << result.elapsed_time();
    for (int k = 1; k < kMost; ++k) {
      if (reached[k]) out << ' ' << k;
    }
    out << '\n';
  }
};

// Before tables that are made when the program starts.
[[gnu::constructor(101)]] void choose() {
  if (const char* number = std::getenv("ESPALIER_MUTANT")) chosen = std::atoi(number);
}

const bool started = [] {
  if (std::getenv("ESPALIER_MUTANTS_REACHED")) {
    void* shared =
        mmap(nullptr, kMost, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);  // with forked children
    reached = static_cast<unsigned char*>(shared);
    testing::UnitTest::GetInstance()->listeners().Append(new Listener);
  }
  return true;
}();

}  // namespace

}  // namespace espalier_mutants
