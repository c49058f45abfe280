/// \file
/// Large arrays whose memory is used again.
#pragma once

#include <cstddef>
#include <map>

namespace espalier::base {

/// Memory of large arrays that were given back, for arrays to come. The machine hands out pages that it has cleared,
/// and takes them back one by one: of an analysis that follows another one this takes as long as all that is done with
/// them. For one thread at a time.
class SpareMemory {
 public:
  SpareMemory() = default;
  SpareMemory(const SpareMemory&) = delete;
  SpareMemory& operator=(const SpareMemory&) = delete;
  ~SpareMemory() { clear(); }

  /// While it lives, large arrays that this thread takes come from here, as far as there are such, and those that it
  /// gives back stay here, up to the limit. @param spare  null: nothing is different
  class Use {
   public:
    explicit Use(SpareMemory* spare);
    Use(const Use&) = delete;
    Use& operator=(const Use&) = delete;
    ~Use();

   private:
    SpareMemory* before_;
  };

  /// What may stay here, in bytes; what is more goes to the machine.
  void set_limit(std::size_t bytes);
  [[nodiscard]] std::size_t held() const { return held_; }
  void clear() noexcept;

  /// The spare memory of the thread that calls; null: none is used.
  [[nodiscard]] static SpareMemory* current();
  /// A block of so many bytes; null: there is none.
  [[nodiscard]] void* take(std::size_t bytes);
  /// @returns whether the block stays here
  [[nodiscard]] bool keep(void* block, std::size_t bytes) noexcept;

 private:
  std::multimap<std::size_t, void*> blocks_;  // by bytes
  std::size_t held_ = 0, limit_ = 0;
};

}  // namespace espalier::base
