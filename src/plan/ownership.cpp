#include "plan/ownership.hpp"

#include <algorithm>
#include <queue>
#include <utility>

#include "plan/plan.hpp"

namespace espalier::plan {

namespace {

// Neighbouring sub-trees are put together as long as their sum stays below this part of the largest that is allowed.
constexpr double kSmallPart = 0.25;

// Predicted seconds and flops of the sub-tree under every front.
struct Costs {
  std::vector<double> seconds, flops;
};

Costs subtree_costs(const Plan& plan) {
  const auto n = at(plan.fronts());
  Costs c{std::vector<double>(n, 0), std::vector<double>(n, 0)};
  for (Index f = 0; f < plan.fronts(); ++f) {
    const FrontLayout& l = plan.layout[f];
    c.seconds[f] += front_seconds(plan, f);
    c.flops[f] += front_flops(l.pivots, l.rows, plan.options.unsymmetric);
    const Index parent = plan.tree.parent[f];
    if (parent < 0) continue;
    c.seconds[parent] += c.seconds[f];
    c.flops[parent] += c.flops[f];
  }
  return c;
}

// A forest and who shares it.
struct Forest {
  std::vector<Index> roots;  // fronts
  double seconds = 0;        // predicted for all of it
  Index devices = 1;

  Forest(std::vector<Index> the_roots, const Costs& costs, Index the_devices)
      : roots(std::move(the_roots)), devices(the_devices) {
    for (const Index f : roots) seconds += costs.seconds[f];
  }
};

// Roots of the sub-trees that are left when nothing above `largest` seconds is, ascending. What may become one range
// task is not cut.
std::vector<Index> cut_tree(const Plan& plan, const Costs& costs, const Forest& forest, double largest) {
  std::priority_queue<std::pair<double, Index>> open;
  for (const Index f : forest.roots) open.emplace(costs.seconds[f], f);
  std::vector<Index> roots;
  while (!open.empty()) {
    const auto [seconds, f] = open.top();
    open.pop();
    if (seconds <= largest || costs.flops[f] <= plan.options.range_flops) {
      roots.push_back(f);
      continue;
    }
    for (Offset c = plan.child_ptr[f]; c < plan.child_ptr[f + 1]; ++c)
      open.emplace(costs.seconds[plan.children[c]], plan.children[c]);
  }
  std::sort(roots.begin(), roots.end());
  return roots;
}

std::vector<SubTree> gather(const std::vector<Index>& roots, const Costs& costs, double most) {
  std::vector<SubTree> subtrees;
  for (const Index f : roots) {
    if (subtrees.empty() || subtrees.back().seconds + costs.seconds[f] > most) subtrees.emplace_back();
    subtrees.back().roots.push_back(f);
    subtrees.back().seconds += costs.seconds[f];
  }
  return subtrees;
}

// Relative speed of a device.
double speed_of(const Plan& plan, std::size_t device) {
  return device < plan.options.device_speed.size() ? plan.options.device_speed[device] : 1;
}

// Devices work on their largest sub-trees first.
void list_by_device(std::vector<SubTree>& subtrees) {
  std::stable_sort(subtrees.begin(), subtrees.end(), [](const SubTree& a, const SubTree& b) {
    return a.device != b.device ? a.device < b.device : a.seconds > b.seconds;
  });
}

void assign_largest_first(const Plan& plan, std::vector<SubTree>& subtrees, Index devices) {
  std::stable_sort(subtrees.begin(), subtrees.end(),
                   [](const SubTree& a, const SubTree& b) { return a.seconds > b.seconds; });
  std::vector<double> load(at(devices), 0);
  for (SubTree& s : subtrees) {
    std::size_t best = 0;
    const auto end = [&](std::size_t d) { return (load[d] + s.seconds) / speed_of(plan, d); };
    for (std::size_t d = 1; d < load.size(); ++d)
      if (end(d) < end(best)) best = d;
    load[best] += s.seconds;
    s.device = static_cast<Index>(best);
  }
  list_by_device(subtrees);
}

// In the order of the tree, so that siblings share a device and few members share the fronts above them: the first
// device takes sub-trees up to the middle of the one in which its share ends, and so on.
void assign_in_order(const Plan& plan, std::vector<SubTree>& subtrees, Index devices) {
  double all = 0, speeds = 0;
  for (const SubTree& s : subtrees) all += s.seconds;
  for (Index d = 0; d < devices; ++d) speeds += speed_of(plan, at(d));
  double before = 0, share_end = 0;
  Index device = -1;
  for (SubTree& s : subtrees) {
    while (device < 0 || (device + 1 < devices && before + 0.5 * s.seconds > share_end))
      share_end += all / speeds * speed_of(plan, at(++device));
    s.device = device;
    before += s.seconds;
  }
  list_by_device(subtrees);
}

// Largest load over mean load, 1 at best.
double imbalance(const Plan& plan, const std::vector<SubTree>& subtrees, Index devices) {
  std::vector<double> load(at(devices), 0);
  double all = 0, speeds = 0, most = 0;
  for (const SubTree& s : subtrees) load[at(s.device)] += s.seconds;
  for (std::size_t d = 0; d < load.size(); ++d) {
    all += load[d];
    speeds += speed_of(plan, d);
    most = std::max(most, load[d] / speed_of(plan, d));
  }
  return all > 0 ? most * speeds / all : 1;
}

// The tree in sub-trees, with their devices: as few as asked for, or more where these leave one device with too much:
// what the others do meanwhile in the top waits for its part (a plate of 1200 x 1200 on four H200s: 11 % too much).
// In the order of the tree where that is balanced but for what the top makes up for, else largest first. In virtual
// time on 2, 4 and 8 H200s nothing loses by a tolerance of a tenth (64^3 on eight 53 instead of 64 ms, plate 1200 on
// four 109 instead of 117), and a fifth brings no more.
std::vector<SubTree> cut_and_assign(const Plan& plan, const Costs& costs, const Forest& forest) {
  const Index devices = forest.devices;
  constexpr double kEnough = 1.05, kEnoughInOrder = 1.1, kStep = 0.5, kMost = 2;
  std::vector<SubTree> best;
  double least = 0;
  for (double more = 0; more <= kMost; more += kStep) {
    const double largest =
        forest.seconds / (static_cast<double>(devices) * (1 + plan.options.additional_subtrees + more));
    const std::vector<SubTree> cut = gather(cut_tree(plan, costs, forest, largest), costs, kSmallPart * largest);
    std::vector<SubTree> in_order = cut, now = cut;
    assign_in_order(plan, in_order, devices);
    if (imbalance(plan, in_order, devices) <= kEnoughInOrder) return in_order;
    assign_largest_first(plan, now, devices);
    const double here = imbalance(plan, now, devices);
    if (best.empty() || here < least) {
      best = std::move(now);
      least = here;
    }
    if (least <= kEnough) break;
  }
  return best;
}

// For ranks first, then each rank's part for its devices: few fronts then belong to several ranks.
std::vector<SubTree> cut_for_ranks(const Plan& plan, const Costs& costs, std::vector<Index> roots) {
  const Index ranks = plan.options.ranks, each = plan.options.devices / ranks;
  std::vector<SubTree> first = cut_and_assign(plan, costs, Forest(std::move(roots), costs, ranks));
  if (each == 1) return first;
  std::vector<SubTree> all;
  for (Index r = 0; r < ranks; ++r) {
    std::vector<Index> own;
    for (const SubTree& s : first)
      if (s.device == r) own.insert(own.end(), s.roots.begin(), s.roots.end());
    std::sort(own.begin(), own.end());
    for (SubTree& s : cut_and_assign(plan, costs, Forest(std::move(own), costs, each))) {
      s.device += r * each;
      all.push_back(std::move(s));
    }
  }
  return all;
}

// The sub-tree of every front, -1: the top.
void find_subtrees(const Plan& plan, Ownership& a) {
  a.subtree_of.assign(at(plan.fronts()), -1);
  for (std::size_t s = 0; s < a.subtrees.size(); ++s)
    for (const Index f : a.subtrees[s].roots) a.subtree_of[f] = static_cast<Index>(s);
  for (Index f = plan.fronts() - 1; f >= 0; --f) {
    const Index parent = plan.tree.parent[f];
    if (parent >= 0 && a.subtree_of[parent] >= 0) a.subtree_of[f] = a.subtree_of[parent];
  }
}

// The device that has all that stands below front f of the top; -1: several have, or nobody.
Index device_below(const Plan& plan, const Ownership& a, Index f) {
  Index device = -1;
  for (Offset c = plan.child_ptr[f]; c < plan.child_ptr[f + 1]; ++c) {
    const Index s = a.subtree(plan.children[c]);
    const Index its = s >= 0 ? a.subtrees[at(s)].device : -1;
    if (its < 0 || (device >= 0 && its != device)) return -1;
    device = its;
  }
  return device;
}

// A front of the top that has sub-trees of one device alone below it goes to that device, as root of all of them: in
// the top, every device would keep a place for its factor, and the place of its contribution would not be used again.
void take_what_one_device_has(const Plan& plan, const Costs& costs, Ownership& a) {
  for (Index f = 0; f < plan.fronts(); ++f) {
    if (a.subtree(f) >= 0 || device_below(plan, a, f) < 0) continue;
    const Offset begin = plan.child_ptr[f];
    a.subtree_of[f] = a.subtree(plan.children[begin]);
    for (Offset c = begin; c < plan.child_ptr[f + 1]; ++c) {
      const Index child = plan.children[c];
      SubTree& s = a.subtrees[at(a.subtree(child))];
      s.seconds -= costs.seconds[child];
      s.roots.erase(std::find(s.roots.begin(), s.roots.end(), child));
    }
    SubTree& mine = a.subtrees[at(a.subtree(f))];
    mine.seconds += costs.seconds[f];
    mine.roots.push_back(f);
  }
  a.subtrees.erase(
      std::remove_if(a.subtrees.begin(), a.subtrees.end(), [](const SubTree& s) { return s.roots.empty(); }),
      a.subtrees.end());
  for (SubTree& s : a.subtrees) std::sort(s.roots.begin(), s.roots.end());
  list_by_device(a.subtrees);
  find_subtrees(plan, a);
}

// Who works on a front or needs its factor: its sub-tree's device; in the top, everybody with a sub-tree below.
void find_members(const Plan& plan, Ownership& a) {
  const std::uint64_t one = 1;
  const std::uint64_t all = a.devices == Ownership::kMostMembers ? ~std::uint64_t{0} : (one << a.devices) - 1;
  a.members.assign(at(plan.fronts()), 0);
  for (Index f = 0; f < plan.fronts(); ++f) {
    const Index s = a.subtree(f);
    std::uint64_t& mine = a.members[at(f)];
    if (s >= 0) mine = one << a.subtrees[at(s)].device;
    if (s < 0 && !a.shared_top) mine |= 1;  // it makes all of the top
    if (mine == 0) mine = all;              // in the top, and nothing below it
    const Index parent = plan.tree.parent[f];
    if (parent >= 0 && a.subtree(parent) < 0) a.members[at(parent)] |= mine;
  }
}

// Work of a block column: products with the columns to its left, and its own elimination.
double column_flops(const FrontLayout& l, Index j) {
  const double begin = l.begin(j), width = l.width(j), rows = l.rows - begin;
  const double left = std::min<double>(begin, l.pivots);
  return rows * width * (2 * left + (j < l.pivot_tiles ? width : 0));
}

// How many neighbours of block column j of the top one member takes: of pivot columns as many as it works on at a time.
// More would begin when the first ones are done, and all that time hold up the members that have the next columns.
Index group_at(const Plan& plan, const Ownership& a, Index f, Index j) {
  constexpr Index kRowsOfTask = 128;
  const FrontLayout& l = plan.layout[f];
  if (j >= l.pivot_tiles) return a.column_group;
  const Index tasks = ((l.rows - l.begin(j)) / kRowsOfTask + 1) * (plan.options.unsymmetric ? 2 : 1);
  return std::clamp<Index>(plan.options.machine.tasks_at_once() / tasks, 1, a.column_group);
}

// Groups of block columns of the top, in the order of work, go to that member which is predicted to have least to do;
// among equals in turn.
void deal_columns(const Plan& plan, Ownership& a) {
  std::vector<double> load(at(a.devices), 0);
  for (const SubTree& s : a.subtrees) load[at(s.device)] += s.seconds;
  a.owner_ptr.assign(at(plan.fronts()) + 1, 0);
  std::vector<Index> top;
  for (Index f = 0; f < plan.fronts(); ++f) {
    const bool shared = a.subtree(f) < 0;
    a.owner_ptr[f + 1] = a.owner_ptr[f] + (shared ? plan.layout[f].tiles : 0);
    if (shared) top.push_back(f);
  }
  a.owners.assign(at(a.owner_ptr.back()), 0);
  std::stable_sort(top.begin(), top.end(), [&](Index x, Index y) { return plan.tier[x] > plan.tier[y]; });
  for (const Index f : top) {
    const FrontLayout& l = plan.layout[f];
    double flops = 0;
    for (Index j = 0; j < l.tiles; ++j) flops += column_flops(l, j);
    const double scale = front_seconds(plan, f) / std::max(flops, 1.0);
    auto turn = static_cast<Index>(f % a.devices);
    for (Index j = 0; j < l.tiles; turn = (turn + 1) % a.devices) {
      Index best = -1;
      for (Index k = 0; k < a.devices; ++k) {
        const Index d = (turn + k) % a.devices;
        if ((a.members[f] >> d & 1) == 0) continue;
        if (best < 0 || load[d] / speed_of(plan, d) < load[best] / speed_of(plan, best)) best = d;
      }
      for (const Index end = std::min(l.tiles, j + group_at(plan, a, f, j)); j < end; ++j) {
        a.owners[at(a.owner_ptr[f]) + j] = static_cast<std::uint8_t>(best);
        load[best] += scale * column_flops(l, j);
      }
    }
  }
}

// With subtrees_apart, every sub-tree may be stolen. Otherwise the smallest of each device that is worth it.
void choose_stealable(const Plan& plan, Ownership& a) {
  if (plan.options.subtrees_apart) return;
  constexpr double kLeastPart = 0.05;  // of its device's load
  std::vector<double> load(at(a.devices), 0);
  for (const SubTree& s : a.subtrees) load[at(s.device)] += s.seconds;
  SubTree* last = nullptr;
  for (auto s = a.subtrees.begin(); s != a.subtrees.end(); ++s) {
    s->apart = false;
    const bool first = s == a.subtrees.begin() || (s - 1)->device != s->device;
    if (first) last = nullptr;
    if (first || !a.stealing || s->seconds < kLeastPart * load[at(s->device)]) continue;
    if (last != nullptr) last->apart = false;
    last = &*s;
    s->apart = true;
  }
}

}  // namespace

Ownership assign_owners(const Plan& plan) {
  Ownership a;
  a.devices = std::max<Index>(1, plan.options.devices);
  a.stealing = plan.options.stealing;
  a.shared_top = plan.options.shared_top;
  if (a.devices == 1) return a;
  const Costs costs = subtree_costs(plan);
  std::vector<Index> roots;
  for (Index f = 0; f < plan.fronts(); ++f)
    if (plan.tree.parent[f] < 0) roots.push_back(f);
  a.subtrees = plan.options.ranks > 1 ? cut_for_ranks(plan, costs, std::move(roots))
                                      : cut_and_assign(plan, costs, Forest(std::move(roots), costs, a.devices));
  find_subtrees(plan, a);
  if (!plan.options.subtrees_apart && !a.stealing && a.shared_top) take_what_one_device_has(plan, costs, a);
  choose_stealable(plan, a);
  a.column_group = std::max<Index>(1, plan.options.column_group);
  if (a.devices <= Ownership::kMostMembers) find_members(plan, a);
  if (plan.options.balance_columns && a.shared_top && !a.members.empty()) deal_columns(plan, a);
  return a;
}

}  // namespace espalier::plan
