#include "dynamics/dae/switching.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

#include "dynamics/dae/assembled_system.hpp"

namespace espalier::dynamics {
namespace {

// A switch is found to this share of the step; two that lie nearer to each other are one.
constexpr double kSharp = 1e-10;
// Whole numbers are passed where they are left by so much.
constexpr double kLevelRounding = 1e-9;
// An extremum is looked at that comes so near to the switch, in units of the samples beside it.
constexpr double kNearSwitch = 0.2;

/// Where a branch is: of a sign -1, 0 (as good as on the switch) or 1; of levels the whole number below, or the middle
/// of two where it is on the switch between them.
double side_of(const Branch& b, double absolute) {
  if (b.levels) {
    const double nearest = std::round(b.value);
    return std::abs(b.value - nearest) <= kLevelRounding ? nearest - 0.5 : std::floor(b.value);
  }
  const double dead = b.dead + (b.timed ? 0 : absolute);
  return b.value > dead ? 1 : b.value < -dead ? -1 : 0;
}

bool on_switch(const Branch& b, double side) { return b.levels ? side != std::floor(side) : side == 0; }

class SwitchLocator {
 public:
  SwitchLocator(const StepPath& path, const BranchesOf& branches) : path_(path), branches_(branches) {
    samples_.push_back(sample(0));
    const Branches& first = samples_.front().values;
    if (first.empty()) return;
    timed_ = std::all_of(first.begin(), first.end(), [](const Branch& b) { return b.timed; });
    for (const double share : {0.25, 0.5, 0.75, 1.0}) samples_.push_back(sample(share));
    if (!timed_) add_extrema();
    sharpen();
  }

  [[nodiscard]] double result() const {
    double first = 0;  // sample behind the first switch
    for (std::size_t i = 1; i < samples_.size(); ++i) {
      const double passed = distance(samples_[i - 1], samples_[i]);
      if (passed == 0) continue;
      if (first > 0) return 0.5 * (first + samples_[i - 1].share);
      if (passed > 1)
        if (const auto share = divide(samples_[i - 1], samples_[i])) return *share;
      first = samples_[i].share;
    }
    return 1;
  }

 private:
  struct Sample {
    double share;
    Branches values;
    std::vector<double> sides;
  };

  [[nodiscard]] Sample sample(double share) const {
    Sample s{share, {}, {}};
    StateView state = timed_ ? path_.begin().view() : path_.at(share).view();
    if (timed_) state.t += share * path_.length();
    branches_(state, s.values);
    for (const Branch& b : s.values) s.sides.push_back(side_of(b, path_.absolute()));
    return s;
  }

  /// Number of switches between two samples, as far as they tell.
  [[nodiscard]] static double distance(const Sample& a, const Sample& b) {
    double sum = 0;
    for (std::size_t k = 0; k < a.sides.size(); ++k) {
      const double way = std::abs(b.sides[k] - a.sides[k]);
      sum += a.values[k].levels ? std::floor(way + 0.5) : way > 0 ? 1 : 0;
    }
    return sum;
  }

  [[nodiscard]] static bool is_next(double side, double other) { return std::abs(side - other) < 1.25; }

  /// What lies on a switch within the step is taken for the side that it comes from.
  void settle() {
    for (std::size_t i = 1; i + 1 < samples_.size(); ++i)
      for (std::size_t k = 0; k < samples_[i].sides.size(); ++k)
        if (double& side = samples_[i].sides[k];
            on_switch(samples_[i].values[k], side) && is_next(side, samples_[i - 1].sides[k]))
          side = samples_[i - 1].sides[k];
  }

  /// Parabolas through three samples in a row: where one turns round towards the switch it is looked at once more.
  void add_extrema() {
    std::vector<double> more;
    for (std::size_t k = 0; k < samples_.front().values.size(); ++k) {
      if (samples_.front().values[k].levels) continue;
      for (std::size_t i = 0; i + 2 < samples_.size(); ++i) {
        const double before = samples_[i].values[k].value, middle = samples_[i + 1].values[k].value,
                     after = samples_[i + 2].values[k].value;
        const double bend = before - 2 * middle + after, slope = 0.5 * (after - before);
        const double at = -slope / bend, side = middle < 0 ? -1 : 1;
        if (!(std::abs(at) < 1) || before * side < 0 || after * side < 0 || bend * side < 0) continue;
        const double least = middle + at * (slope + 0.5 * at * bend);
        if (least * side <= kNearSwitch * middle * side) more.push_back(samples_[i + 1].share + 0.25 * at);
      }
    }
    insert(more);
  }

  void insert(const std::vector<double>& shares) {
    for (const double share : shares) samples_.push_back(sample(share));
    std::sort(samples_.begin(), samples_.end(), [](const Sample& a, const Sample& b) { return a.share < b.share; });
  }

  /// Looks at both sides of each switch: what depends on |t - 1| may switch twice next to t = 1.
  void sharpen() {
    settle();
    std::vector<double> more;
    for (std::size_t i = 1; i < samples_.size(); ++i) {
      if (distance(samples_[i - 1], samples_[i]) == 0) continue;
      Sample low = samples_[i - 1], high = samples_[i];
      while (high.share - low.share > kSharp) {
        Sample middle = sample(0.5 * (low.share + high.share));
        more.push_back(middle.share);
        (distance(low, middle) > 0 ? high : low) = std::move(middle);
      }
    }
    insert(more);
    settle();
  }

  /// A share after the first of several switches between two samples, before the second. None: they are one.
  [[nodiscard]] std::optional<double> divide(Sample low, Sample high) const {
    while (high.share - low.share > kSharp) {
      Sample middle = sample(0.5 * (low.share + high.share));
      const double passed = distance(low, middle);
      if (passed == 1) return middle.share;
      (passed > 1 ? high : low) = std::move(middle);
    }
    return std::nullopt;
  }

  const StepPath& path_;
  const BranchesOf& branches_;
  bool timed_ = false;
  std::vector<Sample> samples_;
};

}  // namespace

const State& StepPath::at(double share) const {
  if (share <= 0) return begin_;
  if (share >= 1) return end_;
  for (const auto& known : samples_)
    if (known->share == share) return known->state;
  // The last ones of a search are not asked for again.
  constexpr std::size_t kMost = 32;
  if (samples_.size() == kMost) samples_.pop_back();
  samples_.push_back(std::make_unique<Sample>(Sample{share, between_(begin_.t + share * length())}));
  return samples_.back()->state;
}

double first_unseen(const StepPath& path, const BranchesOf& branches) { return SwitchLocator(path, branches).result(); }

std::vector<Switching*> switching_laws(const System& system) {
  std::vector<Switching*> laws;
  if (const auto* assembled = dynamic_cast<const AssembledSystem*>(&system))
    for (const auto& component : assembled->components())
      if (auto* law = dynamic_cast<Switching*>(component.get())) laws.push_back(law);
  return laws;
}

double Switching::unseen(const StepPath& path) {
  return first_unseen(path, [this](const StateView& s, Branches& out) { branches(s, out); });
}

}  // namespace espalier::dynamics
