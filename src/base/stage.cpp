#include "base/stage.hpp"

#include <algorithm>
#include <utility>
#include <vector>

namespace espalier {
namespace base {

using StageClock = std::chrono::steady_clock;

/// The open stages of a thread, and who hears of them.
class StageBoard {
 public:
  StageBoard(std::function<void(const ProgressReport&)> tell, double every)
      : tell_(std::move(tell)),
        every_(std::chrono::duration_cast<StageClock::duration>(std::chrono::duration<double>(every))),
        before_(std::exchange(here, this)) {}
  ~StageBoard() { here = before_; }
  StageBoard(const StageBoard&) = delete;
  StageBoard& operator=(const StageBoard&) = delete;

  void open(Stage& stage) {
    open_.push_back(&stage);
    tell_border();
  }
  void close(Stage& stage) {
    tell_border();
    open_.erase(std::remove(open_.begin(), open_.end(), &stage), open_.end());
  }
  [[nodiscard]] Stage* innermost() const { return open_.empty() ? nullptr : open_.back(); }
  void tell_when_due() {
    if (tell_ && !open_.empty() && StageClock::now() >= told_ + every_) tell();
  }
  [[nodiscard]] ProgressReport report() const;

  static constinit inline thread_local StageBoard* here = nullptr;

 private:
  // The ends of an outermost stage always, others unless they come in quick succession.
  void tell_border() {
    constexpr std::chrono::milliseconds kApart{2};
    if (tell_ && (open_.size() == 1 || StageClock::now() >= told_ + std::min<StageClock::duration>(every_, kApart)))
      tell();
  }
  void tell() {
    told_ = StageClock::now();
    tell_(report());
  }
  static double done_of(const Stage& s) {
    const double done = s.done_.load(std::memory_order_relaxed);
    return s.total_ > 0 ? std::min(done, s.total_) : done;
  }
  static double seconds_left(const Stage& s, double seconds);

  std::function<void(const ProgressReport&)> tell_;
  StageClock::duration every_;
  StageClock::time_point told_{};
  std::vector<Stage*> open_;
  StageBoard* before_;
};

// By the prediction at first, and from a third of the work on by the time that was needed so far: what comes first,
// small fronts, is slower than the rest.
double StageBoard::seconds_left(const Stage& s, double seconds) {
  constexpr double kThird = 1.0 / 3;
  const double share = s.total_ > 0 ? done_of(s) / s.total_ : 0;
  if (s.predicted_ > 0) {
    const double trust = std::min(1.0, share / kThird), by_now = share > 0 ? seconds / share : 0;
    return std::max(0.0, (1 - trust) * s.predicted_ + trust * by_now - seconds);
  }
  return share > 0 ? seconds * (1 - share) / share : std::numeric_limits<double>::quiet_NaN();
}

// The report of the outermost stage that counts something, and what it is at.
ProgressReport StageBoard::report() const {
  ProgressReport r;
  if (open_.empty()) return r;
  const auto counts = std::find_if(open_.begin(), open_.end(), [](const Stage* s) { return !s->unit_.empty(); });
  const Stage& shown = counts != open_.end() ? **counts : *open_.front();
  r.phase = shown.name_;
  r.done = done_of(shown);
  r.total = shown.total_;
  r.unit = shown.unit_;
  r.seconds = std::chrono::duration<double>(StageClock::now() - shown.begin_).count();
  r.seconds_left = seconds_left(shown, r.seconds);
  const Stage& last = *open_.back();
  if (&last == &shown || last.name_ == shown.name_) return r;
  r.inside = last.name_;
  r.inside_done = done_of(last);
  r.inside_total = last.total_;
  r.inside_unit = last.unit_;
  return r;
}

Stage::Stage(std::string_view name, double total, std::string_view unit, double predicted)
    : board_(StageBoard::here), name_(name), unit_(unit), total_(total), predicted_(predicted) {
  if (board_ == nullptr) return;
  begin_ = StageClock::now();
  board_->open(*this);
}

Stage::~Stage() {
  if (board_ != nullptr) board_->close(*this);
}

void Stage::reach(double done) {
  if (board_ == nullptr) return;
  double before = done_.load(std::memory_order_relaxed);
  while (before < done && !done_.compare_exchange_weak(before, done, std::memory_order_relaxed)) {
  }
  if (StageBoard::here == board_) board_->tell_when_due();
}

void Stage::add(double amount) {
  if (board_ == nullptr) return;
  done_.fetch_add(amount, std::memory_order_relaxed);
  if (StageBoard::here == board_) board_->tell_when_due();
}

Stage* Stage::current(std::string_view name) {
  Stage* const last = StageBoard::here != nullptr ? StageBoard::here->innermost() : nullptr;
  return last != nullptr && last->name_ == name ? last : nullptr;
}

void tell_progress() {
  if (StageBoard::here != nullptr) StageBoard::here->tell_when_due();
}

std::function<bool()> telling(std::function<bool()> ask) {
  if (StageBoard::here == nullptr) return ask;
  return [ask = std::move(ask)] {
    tell_progress();
    return ask && ask();
  };
}

}  // namespace base

struct ProgressListener::Board : base::StageBoard {
  using StageBoard::StageBoard;
};

ProgressListener::ProgressListener(std::function<void(const ProgressReport&)> tell, double every)
    : board_(new Board(std::move(tell), every)) {}

ProgressListener::~ProgressListener() { delete board_; }

ProgressReport progress() {
  return base::StageBoard::here != nullptr ? base::StageBoard::here->report() : ProgressReport{};
}

}  // namespace espalier
