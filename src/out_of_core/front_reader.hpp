/// \file
/// What a substitution asks of a store whose factors are not all in memory.
#pragma once

#include <span>

#include "espalier/types.hpp"

namespace espalier::out_of_core {

/// Thrown out of need() after give_up().
struct GivenUp {};

/// Brings the factors of fronts to memory, in the order in which a substitution needs them, and ahead of it.
class FrontReader {
 public:
  virtual ~FrontReader() = default;
  /// A way up or down begins: these fronts are needed one after another, each once. A way begins when the one before
  /// has ended, and is expected to go back the way that it came. Not safe beside the other calls.
  /// @param fronts  those whose factor is not in the store are always there
  /// @param second  of the second factor array (lu)
  virtual void begin_way(std::span<const Index> fronts, bool second) = 0;
  /// Waits until the factor of a front is in memory; from any thread, as often as one likes. Fronts that come later in
  /// the order wait for those before them to be done.
  /// @throws Error of the disk
  virtual void need(Index front) = 0;
  /// The factor of a front is not read any more.
  virtual void done(Index front) = 0;
  /// Whoever waits in need(), or will, leaves it by GivenUp. From any thread.
  virtual void give_up() noexcept = 0;
  /// All fronts are done, or the way was given up, and nobody waits in need() any more.
  virtual void end_way() noexcept = 0;
  /// Fronts; a number by which they stand in the store, one after another: rising from the leaves to the roots. -1: the
  /// factor is elsewhere, as are those of all fronts above.
  [[nodiscard]] virtual std::span<const Offset> order() const = 0;

  /// Ends the reader's way when it goes; null: there is none.
  class EndOfWay {
   public:
    explicit EndOfWay(FrontReader* reader) : reader_(reader) {}
    ~EndOfWay() {
      if (reader_ != nullptr) reader_->end_way();
    }
    EndOfWay(const EndOfWay&) = delete;
    EndOfWay& operator=(const EndOfWay&) = delete;

   private:
    FrontReader* reader_;
  };
};

}  // namespace espalier::out_of_core
