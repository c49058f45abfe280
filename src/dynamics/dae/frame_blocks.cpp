#include "dynamics/dae/frame_blocks.hpp"

#include <algorithm>
#include <utility>

#include "base/at.hpp"
#include "base/parallel.hpp"

namespace espalier::dynamics {
namespace {

using Twists = Eigen::Matrix<double, 6, Eigen::Dynamic>;

/// Entries of one column, asked for in an order that mostly rises: the next one is near the last.
class EntryFinder {
 public:
  EntryFinder(const SparsePattern& pattern, Index column) : pattern_(pattern), column_(column) {}
  [[nodiscard]] Offset find(Index row) {
    constexpr Offset kNear = 8;
    if (last_ >= 0) {
      const Offset end = std::min(pattern_.ptr[at(column_ + 1)], last_ + kNear);
      for (Offset p = last_; p < end; ++p)
        if (pattern_.ind[at(p)] == row) return last_ = p;
    }
    return last_ = find_entry(pattern_, column_, row);
  }

 private:
  const SparsePattern& pattern_;
  Index column_;
  Offset last_ = -1;
};

/// Columns of a task: their entries stay in a core's second cache. It depends on the frames alone.
std::int64_t grain_for(std::size_t rows) {
  constexpr std::size_t kEntries = 1 << 15;
  return static_cast<std::int64_t>(std::max<std::size_t>(1, kEntries / std::max<std::size_t>(rows, 1)));
}

}  // namespace

FrameBlocks::FrameBlocks(std::vector<const Frame*> frames, Coupling coupling)
    : frames_(std::move(frames)), coupling_(coupling) {}

bool FrameBlocks::coupled(std::size_t f, std::size_t g) const {
  if (!coupling_.turning_only || coupling_.between_rotations) return true;
  return f == g && frames_[f]->has_wrench_stiffness();
}

FrameBlocks::Side FrameBlocks::side_of(const Frame& frame) const {
  const std::span<const Index> coordinates = frame.coordinates();
  Side side;
  for (std::size_t k = 0; k < coordinates.size(); ++k)
    if (!coupling_.turning_only || frame.turns(k)) side.local.push_back(k);
  // Nodes bring three rows each, which stand one below the other in every column of W.
  bool nodes = side.local.size() % 3 == 0;
  for (std::size_t k = 0; nodes && k < side.local.size(); k += 3) {
    const std::size_t l = side.local[k];
    nodes = side.local[k + 2] == l + 2 && coordinates[l] >= 0 && coordinates[l + 1] == coordinates[l] + 1 &&
            coordinates[l + 2] == coordinates[l] + 2;
  }
  side.step = nodes ? 3 : 1;
  std::vector<Index> sorted;
  for (const std::size_t k : side.local)
    if (coordinates[k] >= 0) sorted.push_back(coordinates[k]);
  std::sort(sorted.begin(), sorted.end());
  side.distinct = std::adjacent_find(sorted.begin(), sorted.end()) == sorted.end();
  return side;
}

void FrameBlocks::declare(PatternBuilder& w) const {
  std::vector<std::vector<Index>> taking_part;
  for (const Frame* frame : frames_) {
    std::vector<Index>& own = taking_part.emplace_back();
    for (const std::size_t k : side_of(*frame).local) own.push_back(frame->coordinates()[k]);
  }
  for (std::size_t f = 0; f < frames_.size(); ++f)
    for (std::size_t g = 0; g < frames_.size(); ++g)
      if (coupled(f, g)) w.add_block(taking_part[f], taking_part[g]);
}

void FrameBlocks::bind(const SparsePattern& w, base::ThreadPool* pool) {
  sides_.clear();
  for (const Frame* frame : frames_) sides_.push_back(side_of(*frame));
  columns_.assign(frames_.size(), {});
  for (std::size_t g = 0; g < frames_.size(); ++g) bind_columns(w, g, pool);
}

void FrameBlocks::bind_columns(const SparsePattern& w, std::size_t g, base::ThreadPool* pool) {
  Columns& own = columns_[g];
  for (std::size_t f = 0; f < frames_.size(); ++f) {
    own.offset.push_back(own.rows);
    if (coupled(f, g)) own.rows += sides_[f].local.size() / sides_[f].step;
  }
  const std::span<const Index> coordinates = frames_[g]->coordinates();
  own.start.assign(coordinates.size(), -1);
  for (const std::size_t l : sides_[g].local)
    if (coordinates[l] >= 0) own.start[l] = w.ptr[at(coordinates[l])];
  own.shift.assign(own.rows * coordinates.size(), -1);
  const auto count = static_cast<std::int64_t>(coordinates.size());
  base::for_each_range(pool, count, grain_for(own.rows), [&](std::int64_t begin, std::int64_t end) {
    for (auto l = at(begin); l < at(end); ++l) {
      if (own.start[l] < 0) continue;
      EntryFinder column(w, coordinates[l]);
      for (std::size_t f = 0; f < frames_.size(); ++f) {
        if (!coupled(f, g)) continue;
        std::int32_t* shift = own.shift.data() + l * own.rows + own.offset[f];
        for (std::size_t k = 0; k < sides_[f].local.size(); k += sides_[f].step, ++shift) {
          const Index row = frames_[f]->coordinates()[sides_[f].local[k]];
          if (row >= 0) *shift = static_cast<std::int32_t>(column.find(row) - own.start[l]);
        }
      }
    }
  });
}

/// The columns of frame g.
struct FrameBlocks::Product {
  std::size_t g;
  ConstSpan q;
  const Derivatives& derivatives;
  Twists jacobian, rate;  // of frame g; rate is empty where d is zero
};

void FrameBlocks::add(ConstSpan q, ConstSpan v, const Derivatives& derivatives, base::ThreadPool* pool,
                      Span w_values) const {
  const bool rates = !derivatives.d.isZero(0);
  if (!rates && derivatives.k.isZero(0) && derivatives.wrench.isZero(0)) return;
  for (std::size_t g = 0; g < frames_.size(); ++g) {
    const auto count = static_cast<Eigen::Index>(frames_[g]->coordinates().size());
    if (count == 0) continue;
    Product product{g, q, derivatives, Twists(6, count), {}};
    frames_[g]->jacobian(q, product.jacobian.data());
    if (rates) {
      product.rate.resize(6, count);
      frames_[g]->rate_jacobian(q, v, product.rate.data());
    }
    const std::int64_t grain = sides_[g].distinct ? grain_for(columns_[g].rows * sides_[g].step) : count;
    base::for_each_range(pool, count, grain, [&](std::int64_t begin, std::int64_t end) {
      add_columns(product, at(begin), at(end - begin), w_values);
    });
  }
}

void FrameBlocks::add_columns(const Product& p, std::size_t first, std::size_t count, Span w_values) const {
  const Columns& own = columns_[p.g];
  const auto column = static_cast<Eigen::Index>(first), width = static_cast<Eigen::Index>(count);
  const auto g6 = static_cast<Eigen::Index>(6 * p.g);
  const auto twists = p.jacobian.middleCols(column, width);
  std::vector<double> block;
  for (std::size_t f = 0; f < frames_.size(); ++f) {
    const std::size_t rows = frames_[f]->coordinates().size();
    if (!coupled(f, p.g) || rows == 0) continue;
    const auto f6 = static_cast<Eigen::Index>(6 * f);
    const Eigen::Matrix<double, 6, 6> k = p.derivatives.k.block<6, 6>(f6, g6);
    Twists c = k * twists;
    if (p.rate.size() > 0) c += p.derivatives.d.block<6, 6>(f6, g6) * p.rate.middleCols(column, width);
    const Vec6 wrench = f == p.g ? Vec6(p.derivatives.wrench.segment<6>(f6)) : Vec6(Vec6::Zero());
    if (c.isZero(0) && wrench.isZero(0)) continue;
    block.resize(rows * count);
    frames_[f]->tangent_columns(p.q, {first, count, c.data(), twists.data(), wrench}, block.data());
    const Side& side = sides_[f];
    for (std::size_t l = 0; l < count; ++l) {
      const Offset start = own.start[first + l];
      if (start < 0) continue;
      const std::int32_t* shift = own.shift.data() + (first + l) * own.rows + own.offset[f];
      const double* from = block.data() + l * rows;
      double* to = w_values.data() + start;
      if (side.step == 3) {
        for (std::size_t i = 0; i < side.local.size(); i += 3, ++shift)
          for (std::size_t j = 0; j < 3; ++j) to[at(*shift) + j] += from[side.local[i] + j];
      } else {
        for (std::size_t i = 0; i < side.local.size(); ++i)
          if (shift[i] >= 0) to[shift[i]] += from[side.local[i]];
      }
    }
  }
}

}  // namespace espalier::dynamics
