// Stores of which a part is on disk. Truth: plain arrays in memory; the bits of the same factorization with its store
// in memory; which bytes of the file were changed behind its back; the folder, which must be empty whatever happens.
#include "out_of_core/disk_store.hpp"

#include <dirent.h>
#include <fcntl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <filesystem>
#include <random>
#include <thread>

#include "out_of_core/disk_folder.hpp"
#include "out_of_core/fixture.hpp"

namespace espalier {
namespace {

namespace fs = std::filesystem;
using base::ScratchFile;
using out_of_core::DiskOptions;
using out_of_core::DiskStore;
using out_of_core::StoreRange;
using out_of_core::StoreUse;
using test::DiskFault;
using test::DiskFolder;
using test::kDiskBlock;
using test::same_bits;
using test::says;
using test::status_of;

TEST(ScratchFile, FoldersThatAreNoneAreNamed) {
  const DiskFolder folder;
  for (const std::string& path : {folder.path() + "/missing", std::string("/proc/self/status")}) {
    const Status s = status_of([&] { const ScratchFile file(path, 0); });
    EXPECT_EQ(s.code, StatusCode::invalid_input);
    EXPECT_TRUE(says(s, path) && says(s, "--scratch")) << s.message;
  }
  const Status full = status_of([&] { const ScratchFile file(folder.path(), Offset{1} << 60); });
  EXPECT_EQ(full.code, StatusCode::out_of_memory);
  EXPECT_TRUE(says(full, "1024.00 PiB are needed") && says(full, "are free")) << full.message;
}

TEST(ScratchFile, ALimitOfFileSizesIsAnErrorAndNoSignal) {
  const DiskFolder folder;
  rlimit before{};
  ASSERT_EQ(::getrlimit(RLIMIT_FSIZE, &before), 0);
  ScratchFile file(folder.path(), 0);
  std::vector<std::byte> memory(3 * kDiskBlock);
  std::byte* at =
      memory.data() + (kDiskBlock - reinterpret_cast<std::uintptr_t>(memory.data()) % kDiskBlock) % kDiskBlock;
  const rlimit less{2 * kDiskBlock, before.rlim_max};
  ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &less), 0);
  file.write(kDiskBlock, at, kDiskBlock);
  const Status s = status_of([&] { file.write(2 * kDiskBlock, at, kDiskBlock); });
  ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &before), 0);
  EXPECT_EQ(s.code, StatusCode::out_of_memory);
  EXPECT_TRUE(says(s, folder.path()) && says(s, "limit of file sizes")) << s.message;
  file.write(2 * kDiskBlock, at, kDiskBlock);
}

// A plan of writes and reads at random, by two threads as a factorization has them: what is read must have been
// written before.
struct DiskProgram {
  std::vector<StoreUse> uses;
  std::vector<std::int32_t> truth;  // what stands in each word at the end
};

constexpr Offset kWord = sizeof(std::int32_t);

DiskProgram random_disk_program(std::mt19937_64& random, Offset bytes) {
  DiskProgram p;
  p.truth.assign(static_cast<std::size_t>(bytes / kWord), 0);
  std::uniform_int_distribution<Offset> place(0, bytes / kWord - 1), size(1, 3 * kDiskBlock / kWord);
  Index step = 0;
  Offset filled = 0;
  while (filled < bytes) {
    const Offset now = std::min(size(random) * kWord, bytes - filled);
    p.uses.push_back({step++, true, {filled, now}});
    filled += now;
    for (int k = 0; k < 2; ++k) {
      const Offset at = place(random) * kWord % filled;
      p.uses.push_back({step++, k == 1, {at, std::min(size(random) * kWord, filled - at)}});
    }
  }
  return p;
}

void carry_out_on_disk(DiskStore& store, DiskProgram& p, Offset lasts) {
  store.set_plan(p.uses, lasts, 1, static_cast<Index>(p.uses.size()));
  store.begin_plan();
  for (const StoreUse& u : p.uses) {
    store.at_step(0, u.step);
    const auto access = u.write ? DiskStore::Access::write : DiskStore::Access::read;
    store.each_piece(u.range.at, u.range.bytes, access, [&](std::byte* at, Offset before, Offset bytes) {
      auto* words = reinterpret_cast<std::int32_t*>(at);
      for (Offset k = 0; k < bytes / kWord; ++k) {
        std::int32_t& truth = p.truth[static_cast<std::size_t>((u.range.at + before) / kWord + k)];
        if (u.write) truth = words[k] = static_cast<std::int32_t>(u.step * 1000003 + k);
        ASSERT_EQ(words[k], truth) << "step " << u.step;
      }
    });
  }
  store.at_step(0, DiskStore::kEnd);
  store.end();
}

void expect_parts(DiskStore& store, const DiskProgram& p, std::mt19937_64& random) {
  std::vector<StoreRange> parts;
  std::uniform_int_distribution<Offset> size(1, 2 * kDiskBlock / kWord);
  for (Offset at = 0; at < store.bytes();) {
    const Offset now = std::min(size(random) * kWord, store.bytes() - at);
    parts.push_back({at, now});
    at += now;
  }
  for (int way = 0; way < 4; ++way) {
    store.begin_parts(parts);
    std::atomic<std::size_t> next{0};
    const auto take = [&] {
      for (std::size_t k = next++; k < parts.size(); k = next++) {
        store.need_part(k);
        const auto* words = reinterpret_cast<const std::int32_t*>(store.data() + parts[k].at);
        for (Offset w = 0; w < parts[k].bytes / kWord; ++w)
          ASSERT_EQ(words[w], p.truth[static_cast<std::size_t>(parts[k].at / kWord + w)]);
        store.release_part(k);
      }
    };
    std::thread other(take);
    take();
    other.join();
    store.end();
    std::reverse(parts.begin(), parts.end());
  }
}

TEST(DiskStore, AnyPlanReadsWhatItHasWritten) {
  const DiskFolder folder;
  std::mt19937_64 random(11);
  for (const Offset window : {4, 9, 100}) {
    SCOPED_TRACE("window of " + std::to_string(window) + " blocks");
    DiskStore store(60 * kDiskBlock + 24, {folder.path(), window * kDiskBlock, kDiskBlock}, nullptr);
    for (int again = 0; again < 2; ++again) {
      DiskProgram p = random_disk_program(random, store.bytes());
      carry_out_on_disk(store, p, store.bytes());
      expect_parts(store, p, random);
    }
    if (window < 60) {
      EXPECT_GT(store.traffic().written_bytes, 0);
      EXPECT_GT(store.traffic().read_bytes, 0);
    }
  }
}

// The prediction has other ties than the store, and no threads that run ahead.
TEST(DiskStore, TheTrafficIsWhatTheRuleSays) {
  const DiskFolder folder;
  std::mt19937_64 random(12);
  constexpr Offset kWindow = 16, kSmallest = 64 << 10;
  DiskStore store(60 * kSmallest, {folder.path(), kWindow * kSmallest, kSmallest}, nullptr);
  DiskProgram p;
  p.truth.assign(static_cast<std::size_t>(store.bytes() / kWord), 0);
  for (Index k = 0; k < 60; ++k) p.uses.push_back({k, true, {k * kSmallest, kSmallest}});
  for (Index k = 0; k < 20; ++k) p.uses.push_back({60 + k, false, {3 * k * kSmallest, kSmallest}});
  const auto predicted = out_of_core::traffic_of(p.uses, store.bytes(), store.bytes(), kWindow * kSmallest);
  EXPECT_GE(predicted.written_bytes, (60 - kWindow) * kSmallest);
  carry_out_on_disk(store, p, store.bytes());
  const auto made = store.traffic();
  EXPECT_NEAR(static_cast<double>(made.written_bytes), static_cast<double>(predicted.written_bytes), 12.0 * kSmallest);
  EXPECT_NEAR(static_cast<double>(made.read_bytes), static_cast<double>(predicted.read_bytes), 12.0 * kSmallest);
}

// What nobody reads again is not written.
TEST(DiskStore, WhatIsUsedUpDoesNotGoToTheDisk) {
  const DiskFolder folder;
  DiskStore store(100 * kDiskBlock, {folder.path(), 10 * kDiskBlock, kDiskBlock}, nullptr);
  DiskProgram p;
  p.truth.assign(static_cast<std::size_t>(store.bytes() / kWord), 0);
  for (Index k = 0; k < 100; ++k) {
    p.uses.push_back({2 * k, true, {k * kDiskBlock, kDiskBlock}});
    p.uses.push_back({2 * k + 1, false, {k * kDiskBlock, kDiskBlock}});
  }
  carry_out_on_disk(store, p, 0);
  EXPECT_EQ(store.traffic().written_bytes, 0);
}

// A run may end at any time: while blocks are read ahead, when no memory is left for the next one, too. Whoever reads
// must hear of it (a test that fails by never ending).
TEST(DiskStore, EndsWhileItReadsAhead) {
  const DiskFolder folder;
  constexpr Offset kBlocks = 120, kWindow = 12;
  DiskStore store(kBlocks * kDiskBlock, {folder.path(), kWindow * kDiskBlock, kDiskBlock}, nullptr);
  DiskProgram p;
  p.truth.assign(static_cast<std::size_t>(store.bytes() / kWord), 0);
  for (Index k = 0; k < kBlocks; ++k) p.uses.push_back({k, true, {k * kDiskBlock, kDiskBlock}});
  carry_out_on_disk(store, p, store.bytes());
  std::vector<StoreUse> reads;
  for (Index k = 0; k < 3; ++k) reads.push_back({k, false, {40 * k * kDiskBlock, 40 * kDiskBlock}});
  store.set_plan(reads, store.bytes(), 1, 3);
  std::mt19937_64 random(14);
  std::uniform_int_distribution<int> microseconds(0, 600);
  for (int again = 0; again < 400; ++again) {
    store.begin_plan(true);
    store.at_step(0, again % 3);
    std::this_thread::sleep_for(std::chrono::microseconds(microseconds(random)));
    store.end();
  }
  expect_parts(store, p, random);
}

// Every place of the file is damaged in turn, and its end is cut off.
TEST(DiskStore, ChangedBytesAndShortFilesAreFound) {
  const DiskFolder folder;
  std::mt19937_64 random(13);
  DiskStore store(40 * kDiskBlock, {folder.path(), 6 * kDiskBlock, kDiskBlock}, nullptr);
  const int file = folder.open_file();
  ASSERT_GE(file, 0);
  std::vector<StoreRange> parts;
  for (Offset b = 0; b < 40; ++b) parts.push_back({b * kDiskBlock, kDiskBlock});
  const auto read_all = [&] {
    return status_of([&] {
      store.begin_parts(parts);
      for (std::size_t k = 0; k < parts.size(); ++k) {
        store.need_part(k);
        store.release_part(k);
      }
    });
  };
  for (const Offset place : {Offset{0}, 7 * kDiskBlock + 4095, 20 * kDiskBlock + 8}) {
    DiskProgram p = random_disk_program(random, store.bytes());
    carry_out_on_disk(store, p, store.bytes());
    EXPECT_TRUE(read_all().ok());
    EXPECT_TRUE(read_all().ok());  // the first blocks are not in memory any more
    char byte = 0;
    // Through the cache, which direct reads are coherent with.
    ASSERT_EQ(::pread(file, &byte, 1, place), 1);
    byte = static_cast<char>(byte ^ 0x10);
    Status s;
    for (int k = 0; k < 6 && s.ok(); ++k) {  // a write that was on its way may have put the block back
      ASSERT_EQ(::pwrite(file, &byte, 1, place), 1);
      std::reverse(parts.begin(), parts.end());
      s = read_all();
    }
    store.end();
    EXPECT_EQ(s.code, StatusCode::device_error);
    EXPECT_TRUE(says(s, "checksums differ")) << s.message;
  }
  DiskProgram p = random_disk_program(random, store.bytes());
  carry_out_on_disk(store, p, store.bytes());
  ASSERT_EQ(::ftruncate(file, 0), 0);
  const Status s = read_all();
  store.end();
  EXPECT_EQ(s.code, StatusCode::device_error);
  EXPECT_TRUE(says(s, "the file ends there")) << s.message;
  carry_out_on_disk(store, p, store.bytes());  // as good as new
  EXPECT_TRUE(read_all().ok());
  ::close(file);
}

TEST(DiskStore, ADeathLeavesNothingBehind) {
  const DiskFolder folder;
  int ready[2];
  ASSERT_EQ(::pipe(ready), 0);
  const pid_t child = ::fork();
  if (child == 0) {
    std::mt19937_64 random(14);
    DiskStore store(40 * kDiskBlock, {folder.path(), 6 * kDiskBlock, kDiskBlock}, nullptr);
    for (;;) {
      DiskProgram p = random_disk_program(random, store.bytes());
      carry_out_on_disk(store, p, store.bytes());
      (void)!::write(ready[1], "x", 1);
    }
  }
  char c = 0;
  ASSERT_EQ(::read(ready[0], &c, 1), 1);  // it has written, and goes on
  ::kill(child, SIGKILL);
  int how = 0;
  ASSERT_EQ(::waitpid(child, &how, 0), child);
  EXPECT_TRUE(WIFSIGNALED(how) && WTERMSIG(how) == SIGKILL);
  EXPECT_TRUE(fs::is_empty(folder.path()));
  ::close(ready[0]);
  ::close(ready[1]);
}

class OutOfCoreOnDisk : public test::OutOfCoreFactorization {
 protected:
  std::unique_ptr<device::Executor<double>> start_on_disk(Offset budget, Offset window) {
    disk_ = {folder_.path(), window, kDiskBlock};
    auto executor = start(budget);
    disk_ = {};
    return executor;
  }
  // The bytes of the store, and of its largest front.
  [[nodiscard]] Offset store_bytes(Offset budget) { return start(budget)->out_of_core().store_bytes; }
  [[nodiscard]] Offset least_window() const {
    Offset most = 0;
    for (Index f = 0; f < plan_.fronts(); ++f) most = std::max(most, plan_.layout[f].factor_size());
    return most * static_cast<Offset>(sizeof(double)) + 6 * kDiskBlock;
  }
  DiskFolder folder_;
};

TEST_P(OutOfCoreOnDisk, HasTheBitsOfTheStoreInMemory) {
  for (const Offset budget : {floor_, need_ / 2}) {
    auto in_memory = start(budget);
    expect_the_same(in_memory->factorize(a_.values));
    const std::vector<double> x = solved(*in_memory, false), y = solved(*in_memory, true);
    const Offset store = store_bytes(budget), least = least_window();
    for (const Offset window : {least, (least + store) / 2}) {
      if (window >= store) continue;
      SCOPED_TRACE("budget " + std::to_string(budget) + ", window " + std::to_string(window) + " of " +
                   std::to_string(store));
      auto executor = start_on_disk(budget, window);
      for (int again = 0; again < 2; ++again) {
        expect_the_same(executor->factorize(a_.values));
        EXPECT_TRUE(same_bits(solved(*executor, false), x));
        EXPECT_TRUE(same_bits(solved(*executor, true), y));
      }
      EXPECT_GT(executor->out_of_core().disk_written_bytes, 0);
    }
  }
}

// Writes and reads are refused, one in each run: the first, the fourth, ... until none is left to be refused.
TEST_P(OutOfCoreOnDisk, RefusedCallsAreErrorsAndTheNextFactorizationWorks) {
  const Offset window = least_window();
  if (window >= store_bytes(floor_)) GTEST_SKIP() << "all of it fits";
  auto executor = start_on_disk(floor_, window);
  (void)executor->factorize(a_.values);
  const std::vector<double> x = solved(*executor, false);
  for (const char* call : {"write", "read"}) {
    int failures = 0;
    for (int number = 1; number < 2000; number += 1 + 2 * number) {
      int calls = 0;
      const Status s = status_of([&] {
        DiskFault fault(call, number, std::string(call) == "write" ? ENOSPC : EIO);
        try {
          (void)executor->factorize(a_.values);
          (void)solved(*executor, false);
        } catch (...) {
          calls = fault.calls();
          throw;
        }
        calls = fault.calls();
      });
      if (!s.ok()) {
        ++failures;
        EXPECT_EQ(s.code, std::string(call) == "write" ? StatusCode::out_of_memory : StatusCode::device_error);
        EXPECT_TRUE(says(s, folder_.path()) && says(s, "--scratch")) << s.message;
        (void)executor->factorize(a_.values);
      }
      EXPECT_TRUE(same_bits(solved(*executor, false), x)) << call << " " << number;
      if (calls < number) break;
    }
    EXPECT_GT(failures, 0) << call;
  }
}

INSTANTIATE_TEST_SUITE_P(Systems, OutOfCoreOnDisk, ::testing::ValuesIn(test::out_of_core_systems()));

}  // namespace
}  // namespace espalier
