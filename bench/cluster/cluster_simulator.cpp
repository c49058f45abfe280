#include "cluster/cluster_simulator.hpp"

#include <algorithm>
#include <functional>
#include <iterator>
#include <numeric>
#include <queue>
#include <span>
#include <utility>

#include "base/at.hpp"
#include "plan/front_cost.hpp"
#include "plan/layout_steps.hpp"
#include "plan/rank_parts.hpp"
#include "plan/task_list.hpp"

namespace espalier::bench {

namespace {

// Devices with a sub-tree below a front, ascending; of a front of a sub-tree its device.
std::vector<std::vector<Index>> members_of(const plan::Plan& plan) {
  std::vector<std::vector<Index>> members(at(plan.fronts()));
  for (Index f = 0; f < plan.fronts(); ++f) {
    auto& mine = members[at(f)];
    const Index s = plan.ownership.subtree(f);
    if (s >= 0) mine = {plan.ownership.subtrees[at(s)].device};
    if (s < 0 && plan.ownership.devices == 1) mine = {0};
    if (mine.empty()) {  // in the top, and nothing below it
      mine.resize(at(plan.ownership.devices));
      std::iota(mine.begin(), mine.end(), 0);
    }
    const Index parent = plan.tree.parent[at(f)];
    if (parent < 0 || plan.ownership.subtree(parent) >= 0) continue;
    auto& above = members[at(parent)];
    std::vector<Index> both;
    std::set_union(above.begin(), above.end(), mine.begin(), mine.end(), std::back_inserter(both));
    above = std::move(both);
  }
  return members;
}

// Products with the columns to the left, and its own elimination.
double column_flops(const plan::FrontLayout& l, Index j) {
  const double begin = l.begin(j), width = l.width(j), rows = l.rows - begin;
  return rows * width * (2 * std::min<double>(begin, l.pivots) + (j < l.pivot_tiles ? width : 0));
}

class Run {
 public:
  Run(const plan::Plan& plan, const ClusterRates& rates)
      : plan_(plan),
        rates_(rates),
        devices_(plan.ownership.devices),
        members_(members_of(plan)),
        done_(at(plan.fronts()), 0),
        first_(done_),
        chain_(at(plan.fronts()), 0),
        busy_(at(devices_), 0),
        worked_(busy_),
        load_(busy_),
        out_(busy_),
        in_(busy_),
        link_(busy_),
        sent_(busy_),
        received_(busy_) {}

  ClusterRun run() {
    take_subtrees();
    // Fronts of the top as their children end.
    using Ended = std::pair<double, Index>;
    std::priority_queue<Ended, std::vector<Ended>, std::greater<>> open;
    std::vector<Offset> missing(at(plan_.fronts()));
    const auto ended = [&](Index f) {
      const Index parent = plan_.tree.parent[at(f)];
      if (parent < 0 || below(parent) || --missing[at(parent)] > 0) return;
      double last = 0;
      for (const Index c : children(parent)) last = std::max(last, done_[at(c)]);
      open.emplace(last, parent);
    };
    for (Index f = 0; f < plan_.fronts(); ++f) {
      missing[at(f)] = static_cast<Offset>(children(f).size());
      if (!below(f) && missing[at(f)] == 0) open.emplace(0, f);
    }
    for (Index f = 0; f < plan_.fronts(); ++f)
      if (below(f)) ended(f);
    while (!open.empty()) {
      const Index f = open.top().second;
      open.pop();
      take_front(f);
      ended(f);
    }
    return result();
  }

 private:
  [[nodiscard]] bool below(Index f) const { return devices_ == 1 || plan_.ownership.subtree(f) >= 0; }
  [[nodiscard]] std::span<const Index> children(Index f) const {
    return std::span(plan_.children)
        .subspan(static_cast<std::size_t>(plan_.child_ptr[at(f)]),
                 static_cast<std::size_t>(plan_.child_ptr[at(f) + 1] - plan_.child_ptr[at(f)]));
  }
  [[nodiscard]] Index machine(Index device) const { return device / rates_.per_machine; }

  [[nodiscard]] double seconds_of(Index f) const { return plan::front_seconds(plan_, f) / rates_.speed; }

  // A device works through its sub-trees; none ends before the chain of its pivots.
  void take_subtrees() {
    const double pivot = rates_.gpu.pivot.llt;
    std::vector<double> begin = busy_;
    Index last = -1;
    std::vector<Index> order(at(plan_.fronts()));
    std::iota(order.begin(), order.end(), 0);
    if (devices_ > 1)
      std::stable_sort(order.begin(), order.end(),
                       [&](Index x, Index y) { return plan_.ownership.subtree(x) < plan_.ownership.subtree(y); });
    for (const Index f : order) {
      if (!below(f)) continue;
      const Index d = members_[at(f)].front(), s = devices_ == 1 ? 0 : plan_.ownership.subtree(f);
      if (s != last) begin[at(d)] = busy_[at(d)];
      last = s;
      work(d, seconds_of(f));
      for (const Index c : children(f)) chain_[at(f)] = std::max(chain_[at(f)], chain_[at(c)]);
      chain_[at(f)] += pivot * plan_.layout[at(f)].pivots;
      first_[at(f)] = done_[at(f)] = std::max(busy_[at(d)], begin[at(d)] + chain_[at(f)]);
    }
    load_ = busy_;
  }

  void work(Index device, double seconds) {
    busy_[at(device)] += seconds;
    worked_[at(device)] += seconds;
  }

  // A queue that serves `bytes` from `begin` on; when it is done.
  static double serve(double& queue, double begin, double seconds) {
    queue = std::max(queue, begin) + seconds;
    return queue;
  }
  double send(Index from, double begin, double bytes) {
    sent_[at(from)] += bytes;
    return serve(out_[at(from)], begin, bytes / rates_.network);
  }
  double receive(Index to, double begin, double bytes) {
    received_[at(to)] += bytes;
    return serve(in_[at(to)], begin, bytes / rates_.network);
  }

  // When what the children hand on is where it is needed: each part comes from its maker as it is made, and goes in
  // equal parts to all members of the front. `early_` is when the first columns have theirs.
  double gathered(Index f) {
    const auto& to = members_[at(f)];
    double ready = 0;
    early_ = 0;
    for (const Index c : children(f)) {
      const double rows = plan_.layout[at(c)].below(), bytes = 4 * rows * (rows + 1), begin = first_[at(c)];
      const auto& from = members_[at(c)];
      const double share = bytes / static_cast<double>(from.size()), part = share / static_cast<double>(to.size());
      ready = std::max(ready, done_[at(c)]);
      early_ = std::max(early_, begin);
      for (const Index s : from) {
        double far = 0, near = 0;
        for (const Index t : to) {
          if (machine(t) != machine(s)) far += part;
          if (machine(t) == machine(s) && t != s) near += part;
        }
        if (near > 0) ready = std::max(ready, serve(link_[at(s)], begin, near / rates_.nvlink) + rates_.hop);
        if (far > 0) ready = std::max(ready, send(s, begin, far) + rates_.hop + rates_.network_hop);
      }
      for (const Index t : to) {
        double far = 0;
        for (const Index s : from) far += machine(t) != machine(s) ? part : 0;
        if (far > 0) ready = std::max(ready, receive(t, begin, far) + rates_.hop + rates_.network_hop);
      }
      chain_[at(f)] = std::max(chain_[at(f)], chain_[at(c)]);
    }
    return ready;
  }

  // As the plan deals columns: a group to the member with least to do, among equals in turn.
  Index next_owner(const std::vector<Index>& members, std::size_t turn) const {
    Index best = -1;
    for (std::size_t k = 0; k < members.size(); ++k) {
      const Index d = members[(turn + k) % members.size()];
      if (best < 0 || load_[at(d)] < load_[at(best)]) best = d;
    }
    return best;
  }
  [[nodiscard]] Index group_at(const plan::FrontLayout& l, Index j) const {
    constexpr Index kRowsOfTask = 128;
    if (j >= l.pivot_tiles) return plan_.options.column_group;
    return std::clamp<Index>(rates_.gpu.tasks_at_once() / ((l.rows - l.begin(j)) / kRowsOfTask + 1), 1,
                             plan_.options.column_group);
  }

  void take_front(Index f) {
    const plan::FrontLayout& l = plan_.layout[at(f)];
    const auto& members = members_[at(f)];
    const double ready = gathered(f);
    double flops = 0;
    for (Index j = 0; j < l.tiles; ++j) flops += column_flops(l, j);
    const double scale = seconds_of(f) / std::max(flops, 1.0);
    arrived_.assign(at((devices_ - 1) / rates_.per_machine) + 1, early_);
    diagonal_ = early_;
    made_ = early_;
    last_ = -1;
    done_[at(f)] = ready;
    first_[at(f)] = 0;
    std::size_t turn = at(f) % members.size();
    for (Index j = 0; j < l.tiles; ++turn) {
      const Index owner = next_owner(members, turn % members.size());
      for (const Index end = std::min(l.tiles, j + group_at(l, j)); j < end; ++j) {
        const double seconds = scale * column_flops(l, j);
        load_[at(owner)] += seconds;
        take_column(f, j, owner, seconds, early_ + (ready - early_) * (j + 1) / l.tiles);
      }
    }
  }

  // When the panel before is all on the owner's GPU.
  [[nodiscard]] double operand(Index owner) const { return owner == last_ ? made_ : arrived_[at(machine(owner))]; }

  void take_column(Index f, Index j, Index owner, double seconds, double ready) {
    const plan::FrontLayout& l = plan_.layout[at(f)];
    const double rows = l.rows - l.begin(j), width = l.width(j);
    const double begin = std::max(busy_[at(owner)], ready);
    busy_[at(owner)] = begin;
    work(owner, seconds);
    double end = busy_[at(owner)];
    const bool pivots = j < l.pivot_tiles;
    // The last products wait for the last panel.
    if (last_ >= 0) end = std::max(end, operand(owner) + 2 * rows * width * l.pivot_width / rates_.gpu.flops);
    if (!pivots) {
      if (first_[at(f)] == 0) first_[at(f)] = end;
      done_[at(f)] = std::max(done_[at(f)], end);
      return;
    }
    const double step = rates_.diagonal * width / 64 + (last_ < 0 || last_ == owner ? 0 : rates_.hop) +
                        (last_ < 0 || machine(last_) == machine(owner) ? 0 : rates_.network_hop);
    diagonal_ = std::max(diagonal_, ready) + step;
    chain_[at(f)] += step;
    end = std::max(end, diagonal_);
    hand_on(f, owner, begin, end, 8 * rows * width);
    last_ = owner;
    made_ = end;
    done_[at(f)] = std::max(done_[at(f)], end);
  }

  // A panel, block by block as it is made from `begin` to `end`: to the GPUs of its machine, and once to each other
  // machine, to the GPU of the same place there, which spreads it. The maker sends to all of them, or (relay) to two,
  // which send to two more each, and so on.
  void hand_on(Index f, Index owner, double begin, double end, double bytes) {
    const auto& members = members_[at(f)];
    struct Stop {
      Index rail;
      double copies;  // for the other GPUs of the machine
    };
    std::vector<Stop> stops = {{owner, 0}};
    for (std::size_t k = 0; k < members.size();) {
      const Index m = machine(members[k]);
      double here = 0;
      for (; k < members.size() && machine(members[k]) == m; ++k) ++here;
      if (m == machine(owner))
        stops.front().copies = here - 1;
      else
        stops.push_back({std::min(devices_ - 1, m * rates_.per_machine + owner % rates_.per_machine), here - 1});
    }
    for (std::size_t k = 0; k < stops.size(); ++k) {
      const auto [rail, copies] = stops[k];
      double came = end;
      if (k > 0) {
        const Index from = stops[rates_.relay ? (k - 1) / 2 : 0].rail;
        came = std::max({rates_.relay ? arrived_[at(machine(from))] : end, send(from, begin, bytes),
                         receive(rail, begin, bytes)}) +
               rates_.network_hop;
      }
      const double spread = serve(link_[at(rail)], begin, copies * bytes / rates_.nvlink);
      arrived_[at(machine(rail))] = std::max(came, spread) + (k > 0 || copies > 0 ? rates_.hop : 0);
    }
  }

  ClusterRun result() {
    ClusterRun r;
    for (const double done : done_) r.seconds = std::max(r.seconds, done);
    r.seconds += rates_.gpu.start;
    for (Index d = 0; d < devices_; ++d) {
      r.work += worked_[at(d)] / devices_;
      r.network_bytes += sent_[at(d)];
      r.network = std::max({r.network, sent_[at(d)] / rates_.network, received_[at(d)] / rates_.network});
    }
    r.busy = r.work / r.seconds;
    for (const double c : chain_) r.chain = std::max(r.chain, c);
    for (const KeptFactor& kept : kept_factors(plan_))
      r.factor_bytes = std::max(r.factor_bytes, kept.subtrees + kept.top);
    return r;
  }

  const plan::Plan& plan_;
  const ClusterRates& rates_;
  Index devices_;
  std::vector<std::vector<Index>> members_;  // fronts
  // Fronts: when all is made, when the first column of the contribution is; seconds of the chain up to its end.
  std::vector<double> done_, first_, chain_;
  std::vector<double> busy_, worked_, load_, out_, in_, link_, sent_, received_;  // devices
  // The state of the front at hand: the last diagonal tile and panel, its maker, and when each machine has it.
  double early_ = 0, diagonal_ = 0, made_ = 0;
  Index last_ = -1;
  std::vector<double> arrived_;
};

}  // namespace

plan::Plan plan_of_tree(const analysis::AssemblyTree& tree, Index unknowns, const plan::PlanOptions& options) {
  plan::Plan plan;
  plan.tree.n = unknowns * tree.n;
  plan.tree.parent = tree.parent;
  for (const Index position : tree.first) plan.tree.first.push_back(unknowns * position);
  for (const Offset row : tree.row_ptr) plan.tree.row_ptr.push_back(unknowns * row);
  plan.options = options;
  plan::link_children(plan);
  plan::cut_fronts(plan);
  plan.ownership = plan::assign_owners(plan);
  return plan;
}

ClusterRun simulate(const plan::Plan& plan, const ClusterRates& rates) { return Run(plan, rates).run(); }

std::vector<KeptFactor> kept_factors(const plan::Plan& plan) {
  std::vector<KeptFactor> kept(at(plan.ownership.devices));
  const auto members = members_of(plan);
  for (Index f = 0; f < plan.fronts(); ++f)
    for (const Index d : members[at(f)]) {
      const double bytes = 8 * static_cast<double>(plan.layout[at(f)].factor_size());
      (plan.ownership.devices == 1 || plan.ownership.subtree(f) >= 0 ? kept[at(d)].subtrees : kept[at(d)].top) += bytes;
    }
  return kept;
}

namespace {

// Entries of the lower triangle in the columns of each vertex, by position: with later vertices, and its own block.
std::vector<Index> later_neighbours(const MatrixView& nodes, const analysis::AssemblyTree& tree) {
  std::vector<Index> position(at(tree.n)), later(at(tree.n), 0);
  for (Index k = 0; k < tree.n; ++k) position[at(tree.order[at(k)])] = k;
  for (Index c = 0; c < tree.n; ++c)
    for (Offset q = nodes.col_ptr[at(c)]; q < nodes.col_ptr[at(c) + 1]; ++q)
      if (position[at(nodes.row_ind[static_cast<std::size_t>(q)])] > position[at(c)]) ++later[at(position[at(c)])];
  return later;
}

}  // namespace

std::vector<plan::PlanBytes> planned_bytes(const plan::Plan& plan, const MatrixView& nodes,
                                           const analysis::AssemblyTree& tree, Index unknowns) {
  const std::vector<Index> later = later_neighbours(nodes, tree);
  std::vector<Offset> entries(at(plan.ownership.devices), 0);
  for (Index f = 0; f < plan.fronts(); ++f)
    for (Index c = 0; c < plan.layout[at(f)].pivots; ++c) {
      const Index node = tree.first[at(f)] + c / unknowns;
      entries[at(plan::maker(plan, f, plan.layout[at(f)].tile_of(c)))] +=
          Offset{unknowns} * later[at(node)] + unknowns - c % unknowns;
    }
  std::vector<plan::PlanBytes> all;
  for (Index r = 0; r < plan.ownership.devices; ++r) {
    plan::Plan part = plan;
    part.options.rank = r;
    if (part.options.ranks > 1) plan::number_known(part);
    plan::list_tasks(part);
    const Offset rows = part.row_begin.empty() ? part.tree.row_ptr.back() : part.row_begin.back();
    plan::PlanBytes b = plan::bytes_of(part);
    // The order; places of factor and contribution, a mark and the waits of each front.
    b.tree += Offset{4} * plan.tree.n + Offset{8 + 8 + 1 + 8} * plan.fronts();
    b.rows = 8 * rows;
    b.tiles = 8 * (part.tiles() + 1);
    b.entries = (plan.options.ranks > 1 ? 16 : 8) * entries[at(r)];
    all.push_back(b);
  }
  return all;
}

SparseMatrix brick_nodes(Index n) {
  const Index wide = n + 1, nodes = wide * wide * n;
  SparseMatrix a{nodes, nodes, {0}, {}, {}, Storage::symmetric_both};
  a.row_ind.reserve(at(nodes) * 27);
  a.col_ptr.reserve(at(nodes) + 1);
  for (Index z = 0; z < n; ++z)
    for (Index y = 0; y < wide; ++y)
      for (Index x = 0; x < wide; ++x) {
        for (Index w = std::max(0, z - 1); w <= std::min(n - 1, z + 1); ++w)
          for (Index v = std::max(0, y - 1); v <= std::min(n, y + 1); ++v)
            for (Index u = std::max(0, x - 1); u <= std::min(n, x + 1); ++u)
              a.row_ind.push_back((w * wide + v) * wide + u);
        a.col_ptr.push_back(static_cast<Offset>(a.row_ind.size()));
      }
  return a;
}

}  // namespace espalier::bench
