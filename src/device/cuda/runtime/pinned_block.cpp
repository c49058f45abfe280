#include "device/cuda/runtime/pinned_block.hpp"

#include <exception>
#include <mutex>
#include <utility>
#include <vector>

namespace espalier::device::cuda {

namespace {

constexpr std::size_t kMostKept = 8;

// Never destroyed: at the end of the process the CUDA runtime may be gone before it.
struct Kept {
  std::mutex mutex;
  std::vector<PinnedArray<std::byte>> blocks;
};
Kept& kept() {
  static Kept& all = *new Kept;
  return all;
}

}  // namespace

PinnedBlock::PinnedBlock() {
  {
    const std::lock_guard lock(kept().mutex);
    if (!kept().blocks.empty()) {
      block_ = std::move(kept().blocks.back());
      kept().blocks.pop_back();
      return;
    }
  }
  block_ = PinnedArray<std::byte>(kBytes);
}

PinnedBlock::~PinnedBlock() {
  try {
    const std::lock_guard lock(kept().mutex);
    if (kept().blocks.size() < kMostKept) kept().blocks.push_back(std::move(block_));
  } catch (const std::exception&) {  // then it is given back
  }
}

void PinnedBlock::keep_ready(std::size_t count) noexcept {
  try {
    for (;;) {
      {
        const std::lock_guard lock(kept().mutex);
        if (kept().blocks.size() >= count) return;
      }
      PinnedArray<std::byte> block(kBytes);
      const std::lock_guard lock(kept().mutex);
      kept().blocks.push_back(std::move(block));
    }
  } catch (const std::exception&) {
  }
}

}  // namespace espalier::device::cuda
