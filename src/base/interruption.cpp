#include "base/interruption.hpp"

#include "espalier/types.hpp"

namespace espalier::base {

Interruption::Call::Call(Interruption& interruption)
    : interruption_(interruption.ask_ && interruption.owner_ == std::thread::id{} ? &interruption : nullptr) {
  if (interruption_ == nullptr) return;
  interruption_->owner_ = std::this_thread::get_id();
  interruption_->due_ = Clock::now() + interruption_->period_;
}

Interruption::Call::~Call() {
  if (interruption_ == nullptr) return;
  interruption_->stop_ = false;
  interruption_->owner_ = {};
}

void Interruption::throw_if_stopped() {
  if (asks_here()) ask_when_due();
  if (stop_.load(std::memory_order_relaxed)) throw Error(StatusCode::cancelled, "the caller has interrupted the call");
}

void Interruption::ask_when_due() noexcept {
  if (stop_.load(std::memory_order_relaxed) || Clock::now() < due_) return;
  bool stop = true;
  try {
    stop = ask_();
  } catch (...) {
  }
  if (stop) stop_.store(true, std::memory_order_relaxed);
  due_ = Clock::now() + period_;
}

}  // namespace espalier::base
