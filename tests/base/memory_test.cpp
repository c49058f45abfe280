// Buffers and budgets: what is counted is what is held, and a refusal says what would do.
#include "base/memory.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <limits>
#include <thread>
#include <vector>

#include "base/spare_memory.hpp"
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

// Truth: the addresses that arrays get.
TEST(SpareMemory, IsThatOfArraysThatWereGivenBack) {
  constexpr std::size_t kLarge = std::size_t{5} << 20, kSmall = 1000;
  SpareMemory spare;
  spare.set_limit(4 * kLarge);
  const auto place_of_array = [](std::size_t bytes) {
    void* const p = allocate_aligned(bytes);
    free_aligned(p, bytes);
    return p;
  };
  void* first = nullptr;
  {
    const SpareMemory::Use use(&spare);
    first = place_of_array(kLarge);
    EXPECT_EQ(spare.held(), kept_size(kLarge));
    (void)place_of_array(kSmall);
    EXPECT_EQ(spare.held(), kept_size(kLarge)) << "small arrays do not stay";
    EXPECT_EQ(place_of_array(kLarge), first);
    EXPECT_EQ(place_of_array(kept_size(kLarge)), first) << "an array that is a little larger";
    void* const mine = allocate_aligned(kLarge);
    void* const other = allocate_aligned(kLarge);
    EXPECT_EQ(mine, first);
    EXPECT_NE(other, first);
    EXPECT_EQ(spare.held(), 0U);
    {
      const SpareMemory::Use none(nullptr);
      free_aligned(other, kLarge);
      EXPECT_EQ(spare.held(), 0U);
    }
    free_aligned(mine, kLarge);
    (void)place_of_array(8 * kLarge);
    EXPECT_EQ(spare.held(), kept_size(kLarge)) << "what is beyond the limit goes to the machine";
  }
  (void)place_of_array(kLarge);
  EXPECT_EQ(spare.held(), kept_size(kLarge)) << "nobody uses it";
  spare.set_limit(0);
  EXPECT_EQ(spare.held(), 0U);
}

TEST(SpareMemory, SizesAreFewAndLargeEnough) {
  for (std::size_t bytes = 1; bytes < std::size_t{1} << 36; bytes += 1 + bytes / 7) {
    const std::size_t kept = kept_size(bytes);
    ASSERT_GE(kept, bytes);
    ASSERT_LE(kept, std::max<std::size_t>(bytes + bytes / 16, bytes + (std::size_t{2} << 20)));
    ASSERT_EQ(kept_size(kept), kept);
  }
}

}  // namespace
}  // namespace espalier::base
