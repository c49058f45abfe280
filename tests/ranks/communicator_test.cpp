// The link by itself: which ranks are one machine, and whose memory messages come into.
#include "ranks/communicator.hpp"

#include <gtest/gtest.h>

#include <array>
#include <barrier>
#include <string>
#include <vector>

#include "on_threads.hpp"
#include "ranks/machines.hpp"

namespace espalier::ranks {
namespace link_test {

TEST(Communicator, MachinesAreThoseOfTheMomentAndTheSameOnAll) {
  on_threads(4, {}, [](const Ranks& ranks) {
    Communicator& link = *ranks.link();
    link.begin_call();
    link.set_machines(2);
    const Machines pairs = Machines::agreed(link);
    link.set_machines(0);
    const Machines one = Machines::agreed(link);
    EXPECT_TRUE(one.is_one());
    EXPECT_FALSE(pairs.is_one());
    EXPECT_TRUE(pairs.are_near(0, 1));
    EXPECT_FALSE(pairs.are_near(1, 2));
    EXPECT_EQ(pairs.apart_from(1), 0b1100U);
    EXPECT_EQ(pairs.apart_from(2), 0b0011U);
    EXPECT_EQ(one.apart_from(2), 0U);
    EXPECT_TRUE(link.end_call({}).ok());
  });
}

// Each has more than one machine, and yet they are not the same.
TEST(Communicator, MachinesThatDifferAreToldToAll) {
  on_threads(4, {}, [](const Ranks& ranks) {
    Communicator& link = *ranks.link();
    link.begin_call();
    link.set_machines(link.rank() == 3 ? 2 : 1);
    try {
      (void)Machines::agreed(link);
      ADD_FAILURE() << "rank " << link.rank() << " agrees";
    } catch (const Error& e) {
      EXPECT_EQ(e.status().code, StatusCode::invalid_input);
      EXPECT_NE(std::string(e.what()).find("--nodes"), std::string::npos) << e.what();
    }
    link.set_machines(0);
    EXPECT_TRUE(Machines::agreed(link).is_one());
    EXPECT_TRUE(link.end_call({}).ok());
  });
}

// Whose owner goes does not take the memory of who came after.
TEST(Communicator, MemoryIsItsOwnersAlone) {
  std::barrier together(2);  // else a message could come before the memory is changed
  on_threads(2, {}, [&](const Ranks& ranks) {
    Communicator& link = *ranks.link();
    std::array<int, 2> taken = {0, 0};
    const auto counting = [&](std::size_t owner) {
      return [&taken, owner](std::size_t) -> std::shared_ptr<std::byte[]> {
        ++taken[owner];
        return nullptr;
      };
    };
    const auto expect = [&](bool first, bool second) {
      taken = {0, 0};
      together.arrive_and_wait();
      (void)link.all_numbers(1);
      EXPECT_EQ(taken[0] > 0, first);
      EXPECT_EQ(taken[1] > 0, second);
    };
    link.begin_call();
    const int owners[2] = {0, 1};
    link.use_memory(&owners[0], counting(0));
    expect(true, false);
    link.use_memory(&owners[1], counting(1));
    expect(false, true);
    link.forget_memory(&owners[0]);
    expect(false, true);
    link.forget_memory(&owners[1]);
    expect(false, false);
    EXPECT_TRUE(link.end_call({}).ok());
  });
}

// Longer than a part, of which several are on their way; and one that has nothing.
TEST(Communicator, LongMessagesComeWhole) {
  Faults faults;
  faults.reorder = true;
  faults.most_delay = 0.0002;
  faults.credits = 2;
  on_threads(3, faults, [](const Ranks& ranks) {
    Communicator& link = *ranks.link();
    link.begin_call();
    const auto size_of = [](int rank) { return rank == 1 ? std::size_t{0} : (std::size_t{9} << 20) + 5; };
    std::vector<std::uint32_t> mine(size_of(link.rank()) / 4);
    for (std::size_t k = 0; k < mine.size(); ++k)
      mine[k] = static_cast<std::uint32_t>(k * 3 + static_cast<std::size_t>(link.rank()));
    const auto all = link.all_gather_of(std::span<const std::uint32_t>(mine));
    for (int r = 0; r < 3; ++r) {
      const auto& theirs = all.at(static_cast<std::size_t>(r));
      ASSERT_EQ(theirs.size(), size_of(r) / 4);
      for (std::size_t k = 0; k < theirs.size(); ++k)
        ASSERT_EQ(theirs[k], static_cast<std::uint32_t>(k * 3 + static_cast<std::size_t>(r)));
    }
    EXPECT_TRUE(link.end_call({}).ok());
  });
}

}  // namespace link_test
}  // namespace espalier::ranks
