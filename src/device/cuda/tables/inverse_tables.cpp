#include "device/cuda/tables/inverse_tables.hpp"

#include <algorithm>

#include "base/memory.hpp"

namespace espalier::device::cuda {

namespace {

constexpr Offset kAlign = 16;     // elements: whole panels of a chunk are copied
constexpr int kSmallFront = 96;   // padded rows: smaller tasks do
constexpr Offset kFullGpu = 264;  // tasks of the largest shape that an H200 has in work at a time

Offset whole_panels(Offset x) { return (x + kAlign - 1) / kAlign * kAlign; }

class Tables {
 public:
  Tables(const plan::Plan& plan, std::span<const Front> fronts, InverseKind kind, std::span<const char> needed)
      : plan_(plan), fronts_(fronts), kind_(kind), needed_(needed), number_(fronts.size(), -1) {
    const std::size_t n = fronts.size();
    all_.assign(n, 0);
    least_.assign(n, 0);
    std::vector<Offset> children(n, 0), child(n, 0);
    for (std::size_t f = 0; f < n; ++f) {
      if (needed[f] == 0) continue;
      const Offset stays = square(f), passes = passing(f);
      all_[f] = stays + std::max(passes, children[f]);
      least_[f] = stays + std::max(passes, child[f]);
      if (const Index parent = plan.tree.parent[f]; parent >= 0) {
        children[static_cast<std::size_t>(parent)] += all_[f];
        child[static_cast<std::size_t>(parent)] = std::max(child[static_cast<std::size_t>(parent)], least_[f]);
      }
    }
  }

  InverseTables make(Offset room, Offset element) {
    std::vector<Index> roots;
    for (Index f = 0; f < plan_.fronts(); ++f)
      if (is_needed(f) && plan_.tree.parent[static_cast<std::size_t>(f)] < 0) roots.push_back(f);
    for (const Index f : roots)
      if (const Offset least = least_[static_cast<std::size_t>(f)]; least > room)
        throw Error(StatusCode::out_of_memory, "entries of the inverse need " + base::format_bytes(least * element) +
                                                   " of device memory beside the factor, but " +
                                                   base::format_bytes(room * element) +
                                                   " are available; give it more with --device-memory or use the host");
    put_off(roots, 0, room);
    while (!waiting_.empty()) {
      Group group = std::move(waiting_.back());
      waiting_.pop_back();
      const Offset end = make_group(group);
      std::vector<Index> children;
      for (const Index f : group.fronts)
        for (Offset q = plan_.child_ptr[static_cast<std::size_t>(f)];
             q < plan_.child_ptr[static_cast<std::size_t>(f) + 1]; ++q)
          if (is_needed(plan_.children[static_cast<std::size_t>(q)]))
            children.push_back(plan_.children[static_cast<std::size_t>(q)]);
      put_off(children, end, room);
    }
    if (one_way_) {  // nothing of it is overwritten: all is read at the end
      std::erase_if(t_.launches, [](const InverseLaunch& l) { return l.work == InverseWork::read; });
      t_.launches.push_back({InverseWork::read, 0, 0, static_cast<Offset>(t_.spots.size())});
    }
    return std::move(t_);
  }

 private:
  struct Group {
    std::vector<Index> fronts;
    Offset base = 0;  // of the stack
  };

  [[nodiscard]] bool is_needed(Index f) const { return needed_[static_cast<std::size_t>(f)] != 0; }
  [[nodiscard]] const Front& front(Index f) const { return fronts_[static_cast<std::size_t>(f)]; }
  [[nodiscard]] bool lu() const { return kind_.kind == Kind::lu; }
  [[nodiscard]] int parts() const { return lu() ? 2 : 1; }
  [[nodiscard]] Offset square(std::size_t f) const {
    const Offset rows = fronts_[f].total_pad;
    return parts() * rows * rows;
  }
  [[nodiscard]] static Offset rows_size(const Front& f) { return Offset{f.pivot_pad} * f.total_pad; }
  [[nodiscard]] static Offset blocks_size(const Front& f) {
    return Offset{f.pivot_pad} * std::min(f.inverted, f.pivot_pad);
  }
  [[nodiscard]] Offset staged_size(std::size_t f) const {
    return !kind_.staged.empty() && kind_.staged[f] != 0 ? whole_panels(fronts_[f].factor_size()) : 0;
  }
  // What a front takes while it is made alone.
  [[nodiscard]] Offset passing(std::size_t f) const {
    const Front& x = fronts_[f];
    return parts() * (rows_size(x) + staged_size(f)) + (kind_.kind == Kind::llt ? 1 : 2) * blocks_size(x);
  }

  // Cuts the fronts into groups that fit with all that is below them; what does not goes alone.
  void put_off(const std::vector<Index>& fronts, Offset base, Offset room) {
    std::vector<Group> groups;
    Offset taken = 0;
    for (const Index f : fronts) {
      const Offset all = all_[static_cast<std::size_t>(f)];
      if (groups.empty() || base + taken + all > room) {
        groups.push_back({{}, base});
        taken = 0;
      }
      groups.back().fronts.push_back(f);
      taken += all;
    }
    if (groups.size() > 1) one_way_ = false;
    for (auto g = groups.rbegin(); g != groups.rend(); ++g) waiting_.push_back(std::move(*g));
  }

  // @returns the end of what stays
  Offset make_group(Group& group) {
    std::stable_sort(group.fronts.begin(), group.fronts.end(),
                     [&](Index a, Index b) { return front(a).total_pad > front(b).total_pad; });
    first_ = t_.spots.size();
    Offset at = group.base;
    const auto take = [&at](Offset size) {
      at += size;
      return at - size;
    };
    for (const Index f : group.fronts) {
      InverseTables::Spot spot;
      spot.front = f;
      const Index parent = plan_.tree.parent[static_cast<std::size_t>(f)];
      if (parent >= 0) spot.parent = number_[static_cast<std::size_t>(parent)];
      number_[static_cast<std::size_t>(f)] = static_cast<std::int32_t>(t_.spots.size());
      const Offset square = Offset{front(f).total_pad} * front(f).total_pad;
      spot.z = take(square);
      spot.across = lu() ? take(square) : spot.z;
      t_.spots.push_back(spot);
    }
    const Offset end = at;
    for (std::size_t k = first_; k < t_.spots.size(); ++k) {
      InverseTables::Spot& spot = t_.spots[k];
      const Front& f = front(spot.front);
      const Offset staged = staged_size(static_cast<std::size_t>(spot.front));
      spot.factor = take(staged);
      spot.second = lu() ? take(staged) : spot.factor;
      spot.g = take(rows_size(f));
      spot.h = lu() ? take(rows_size(f)) : spot.g;
      spot.m = take(blocks_size(f));
      spot.v = kind_.kind == Kind::llt ? spot.m : take(blocks_size(f));
    }
    t_.stack = std::max(t_.stack, at);
    list_tasks();
    return end;
  }

  static int blocks(const Front& f) { return (f.pivot_pad + f.inverted - 1) / f.inverted; }

  void list_tasks() {
    const auto end = static_cast<std::int32_t>(t_.spots.size());
    const auto for_each = [&](auto&& use) {
      for (auto k = static_cast<std::int32_t>(first_); k < end; ++k)
        use(k, front(t_.spots[static_cast<std::size_t>(k)].front));
    };
    int most = 0;
    if (!kind_.staged.empty()) t_.launches.push_back({InverseWork::bring, 0, static_cast<Offset>(first_), end});
    launch(InverseWork::gather, 0, [&] {
      for_each([&](std::int32_t k, const Front& f) {
        most = std::max(most, blocks(f));
        for (int part = 0; part < parts(); ++part)
          for (int col = f.pivot_pad; col < f.total_pad; col += kChunk)
            for (int row = f.pivot_pad; row < f.total_pad; row += kGatherRows)
              t_.tasks.push_back({k, 0, row, col, part});
      });
    });
    launch(InverseWork::begin, 0, [&] {
      for_each([&](std::int32_t k, const Front& f) {
        for (int block = 0; block < blocks(f); ++block) t_.tasks.push_back({k, block, 0, 0, 0});
      });
    });
    for (const int shape : {1, 0})
      launch(InverseWork::solve, shape, [&] {
        for_each([&](std::int32_t k, const Front& f) {
          if (is_small(f) != (shape == 0)) return;
          for (int block = 0; block < blocks(f); ++block) {
            const int begin = block * f.inverted, last = std::min(begin + f.inverted, f.pivot_pad);
            for (int part = 0; part < parts(); ++part)
              add_tasks(k, block, part, shape, {0, last - begin}, {last, f.total_pad});
          }
        });
      });
    for (int step = 0; step < most; ++step) list_step(step, for_each);
    t_.launches.push_back({InverseWork::read, 0, static_cast<Offset>(first_), end});
  }

  // The step-th block of each front from its last one.
  template <class ForEach>
  void list_step(int step, ForEach&& for_each) {
    const auto blocks_of_step = [&](bool small, auto&& use) {
      for_each([&](std::int32_t k, const Front& f) {
        const int block = blocks(f) - 1 - step;
        if (block < 0 || is_small(f) != small) return;
        const int begin = block * f.inverted;
        use(k, f, block, begin, std::min(begin + f.inverted, f.pivot_pad));
      });
    };
    Offset largest = 0;  // tasks of the largest shape
    blocks_of_step(false, [&](std::int32_t, const Front& f, int, int begin, int last) {
      largest += parts() * ((f.total_pad - last + 127) / 128) * ((last - begin + 63) / 64);
    });
    const int usual = largest >= kFullGpu ? 2 : 1;
    for (const int shape : {usual, 0})
      launch(InverseWork::multiply, shape, [&] {
        blocks_of_step(shape == 0, [&](std::int32_t k, const Front& f, int block, int begin, int last) {
          for (int part = 0; part < parts(); ++part)
            add_tasks(k, block, part, shape, {last, f.total_pad}, {0, last - begin});
        });
      });
    launch(InverseWork::diagonal, 0, [&] {
      for (const bool small : {false, true})
        blocks_of_step(small, [&](std::int32_t k, const Front&, int block, int begin, int last) {
          for (int col = 0; col < last - begin; col += kInverseCols[0])
            for (int row = lu() ? 0 : col; row < last - begin; row += kInverseRows[0])
              t_.tasks.push_back({k, block, row, col, 0});
        });
    });
  }

  static bool is_small(const Front& f) { return f.total_pad <= kSmallFront; }

  struct Range {
    int begin, end;
  };
  void add_tasks(std::int32_t k, int block, int part, int shape, Range rows, Range cols) {
    for (int row = rows.begin; row < rows.end; row += kInverseRows[shape])
      for (int col = cols.begin; col < cols.end; col += kInverseCols[shape])
        t_.tasks.push_back({k, block, row, col, part});
  }

  template <class List>
  void launch(InverseWork work, int shape, List&& list) {
    const auto begin = static_cast<Offset>(t_.tasks.size());
    list();
    const auto end = static_cast<Offset>(t_.tasks.size());
    if (end > begin) t_.launches.push_back({work, shape, begin, end});
  }

  const plan::Plan& plan_;
  std::span<const Front> fronts_;
  InverseKind kind_;
  std::span<const char> needed_;
  std::vector<std::int32_t> number_;  // fronts; place in spots
  std::vector<Offset> all_, least_;   // fronts; what the sub-tree takes all at once, and front by front
  std::vector<Group> waiting_;
  bool one_way_ = true;    // each group holds all fronts of its level
  std::size_t first_ = 0;  // spot of the group
  InverseTables t_;
};

}  // namespace

InverseTables make_inverse_tables(const plan::Plan& plan, std::span<const Front> fronts, InverseKind kind,
                                  std::span<const char> needed, Offset room, Offset element) {
  return Tables(plan, fronts, kind, needed).make(room, element);
}

}  // namespace espalier::device::cuda
