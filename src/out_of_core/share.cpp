#include "out_of_core/share.hpp"

#include <algorithm>
#include <limits>
#include <numeric>

namespace espalier::out_of_core {

namespace {

// A part may have so much more work than its share before a front is opened instead. Opening costs more than it looks:
// an open front is shared, and its groups wait for one another.
constexpr double kImbalance = 1.12;

constexpr double kNever = std::numeric_limits<double>::infinity();

class Sharer {
 public:
  Sharer(const plan::Plan& plan, const std::vector<double>& speed) : plan_(plan), speed_(speed) {
    const auto n = at(plan.fronts());
    sets_.assign(n, 0);
    seconds_.assign(n, 0);
    closed_.assign(n, 0);
    for (Index f = 0; f < plan.fronts(); ++f) {
      seconds_[f] += plan::front_seconds(plan, f);
      if (plan.tree.parent[f] >= 0) seconds_[plan.tree.parent[f]] += seconds_[f];
    }
    for (const plan::Task& t : plan.tasks)  // one task does them all
      if (t.is_range())
        for (Index f = t.begin; f <= t.front; ++f) closed_[f] = 1;
  }

  DeviceSets run() {
    std::vector<Index> roots;
    for (Index f = 0; f < plan_.fronts(); ++f)
      if (plan_.tree.parent[f] < 0) roots.push_back(f);
    part(std::move(roots), 0, static_cast<Index>(speed_.size()));
    for (Index f = plan_.fronts() - 1; f >= 0; --f)
      if (sets_[f] == 0) sets_[f] = sets_[plan_.tree.parent[f]];
    return std::move(sets_);
  }

 private:
  struct Split {
    Index middle = 0;          // devices [begin, middle) and [middle, end)
    double worst = kNever;     // seconds of the fuller part over its share
    std::vector<char> second;  // roots; 1: of the second part
  };

  [[nodiscard]] static std::uint64_t set_of(Index begin, Index end) {
    std::uint64_t set = 0;
    for (Index d = begin; d < end; ++d) set |= std::uint64_t{1} << d;
    return set;
  }
  [[nodiscard]] double speed(Index begin, Index end) const {
    return std::accumulate(speed_.begin() + begin, speed_.begin() + end, 0.0);
  }

  // The forest under `roots` on devices [begin, end).
  void part(std::vector<Index> roots, Index begin, Index end) {
    for (;;) {
      if (end - begin == 1 || roots.empty()) {
        for (const Index f : roots) sets_[f] = set_of(begin, end);
        return;
      }
      std::stable_sort(roots.begin(), roots.end(), [&](Index x, Index y) { return seconds_[x] > seconds_[y]; });
      const Split best = best_split(roots, begin, end);
      const auto opened = std::find_if(roots.begin(), roots.end(), [&](Index f) { return closed_[f] == 0; });
      if (best.worst <= kImbalance || opened == roots.end()) {
        std::vector<Index> first, second;
        for (std::size_t k = 0; k < roots.size(); ++k) (best.second[k] != 0 ? second : first).push_back(roots[k]);
        part(std::move(first), begin, best.middle);
        roots = std::move(second);
        begin = best.middle;
        continue;
      }
      const Index f = *opened;
      roots.erase(opened);
      sets_[f] = set_of(begin, end);
      for (Offset c = plan_.child_ptr[f]; c < plan_.child_ptr[f + 1]; ++c) roots.push_back(plan_.children[c]);
    }
  }

  // Largest first to the part with the least to do, for its devices, afterwards (Graham 1969), for every middle.
  [[nodiscard]] Split best_split(const std::vector<Index>& roots, Index begin, Index end) const {
    double all = 0;
    for (const Index f : roots) all += seconds_[f];
    Split best;
    for (Index middle = begin + 1; middle < end; ++middle) {
      const double speeds[2] = {speed(begin, middle), speed(middle, end)};
      double load[2] = {0, 0};
      Split split;
      split.middle = middle;
      for (const Index f : roots) {
        const bool second = (load[1] + seconds_[f]) / speeds[1] < (load[0] + seconds_[f]) / speeds[0];
        load[second ? 1 : 0] += seconds_[f];
        split.second.push_back(second ? 1 : 0);
      }
      const double share = all / (speeds[0] + speeds[1]);
      split.worst = std::max(load[0] / speeds[0], load[1] / speeds[1]) / share;
      if (load[0] == 0 || load[1] == 0) split.worst = kNever;
      if (best.second.empty() || split.worst < best.worst) best = std::move(split);
    }
    return best;
  }

  const plan::Plan& plan_;
  const std::vector<double>& speed_;
  DeviceSets sets_;
  std::vector<double> seconds_;  // fronts; of the sub-tree under each
  std::vector<char> closed_;
};

}  // namespace

DeviceSets share_fronts(const plan::Plan& plan, const std::vector<double>& speed) { return Sharer(plan, speed).run(); }

}  // namespace espalier::out_of_core
