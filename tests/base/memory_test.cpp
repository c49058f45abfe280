// Buffers and budgets: what is counted is what is held, and a refusal says what would do.
#include "base/memory.hpp"

#include <gtest/gtest.h>

#include <cstring>
#include <limits>
#include <thread>
#include <vector>

#include "espalier/types.hpp"

namespace espalier::base {
namespace {

TEST(MemoryBudget, RefusesAndNamesTheBudgetNeeded) {
  MemoryBudget budget("host memory", 1000);
  const Buffer<char> first(600, &budget);
  EXPECT_EQ(budget.held(), 600);
  try {
    const Buffer<char> second(500, &budget);
    ADD_FAILURE() << "1100 bytes of 1000";
  } catch (const Error& e) {
    EXPECT_EQ(e.status().code, StatusCode::out_of_memory);
    const std::string message = e.what();
    for (const char* part : {"host memory", "500 B", "600 B", "1000 B", "1.07 KiB"})
      EXPECT_NE(message.find(part), std::string::npos) << part << " not in: " << message;
  }
  EXPECT_EQ(budget.held(), 600);
  EXPECT_EQ(budget.peak(), 600);
  const Buffer<char> exact(400, &budget);
  EXPECT_EQ(budget.peak(), 1000);
}

TEST(MemoryBudget, ThreadsCountExactly) {
  MemoryBudget budget("b");
  std::vector<std::thread> threads;
  for (int t = 0; t < 4; ++t)
    threads.emplace_back([&] {
      for (int k = 0; k < 1000; ++k) {
        budget.take(3);
        budget.give_back(3);
      }
    });
  for (auto& t : threads) t.join();
  EXPECT_EQ(budget.held(), 0);
  EXPECT_GE(budget.peak(), 3);
  EXPECT_LE(budget.peak(), 12);
}

TEST(Buffer, AlignedZeroSizedMovedAndGivenBack) {
  MemoryBudget budget("b");
  {
    Buffer<double> none(0, &budget);
    EXPECT_EQ(none.data(), nullptr);
    EXPECT_EQ(none.span().size(), 0U);
    Buffer<double> a(5, &budget);
    EXPECT_EQ(reinterpret_cast<std::uintptr_t>(a.data()) % 64, 0U);
    std::fill(a.begin(), a.end(), 2.5);
    Buffer<double> b(std::move(a));
    EXPECT_EQ(b.size(), 5);
    EXPECT_EQ(b[4], 2.5);
    EXPECT_EQ(budget.held(), 40);
    none = std::move(b);
    EXPECT_EQ(none.size(), 5);
    none = Buffer<double>();
    EXPECT_EQ(none.size(), 0);
    Buffer<char> huge(5 << 20, &budget);  // by huge pages
    std::memset(huge.data(), 1, static_cast<std::size_t>(huge.size()));
    EXPECT_EQ(budget.held(), 5 << 20);
  }
  EXPECT_EQ(budget.held(), 0);
  EXPECT_EQ(budget.peak(), 5 << 20);
}

TEST(Buffer, ImpossibleSizesAreAnErrorAndLeaveTheCountAlone) {
  MemoryBudget budget("b");
  for (const std::int64_t size : {std::int64_t{1} << 58, std::numeric_limits<std::int64_t>::max() - 100}) {
    try {
      const Buffer<char> b(size, &budget);
      ADD_FAILURE() << "the machine gave " << size << " bytes";
    } catch (const Error& e) {
      EXPECT_EQ(e.status().code, StatusCode::out_of_memory);
    }
    EXPECT_EQ(budget.held(), 0);
  }
}

TEST(FormatBytes, PicksTheUnit) {
  EXPECT_EQ(format_bytes(0), "0 B");
  EXPECT_EQ(format_bytes(1023), "1023 B");
  EXPECT_EQ(format_bytes(1536), "1.50 KiB");
  EXPECT_EQ(format_bytes(std::int64_t{3} << 30), "3.00 GiB");
}

}  // namespace
}  // namespace espalier::base
