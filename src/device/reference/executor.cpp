#include "device/reference/executor.hpp"

#include <algorithm>
#include <deque>

#include "device/reference/dense_front.hpp"

namespace espalier::device::reference {

namespace {

template <class T>
class ReferenceExecutor final : public Executor<T> {
 public:
  explicit ReferenceExecutor(const Job& job)
      : plan_(job.plan), kind_(job.kind), rule_(job.rule), budget_(job.budget != nullptr ? job.budget : &own_budget_) {
    if (plan_.ownership.devices != 1)
      throw Error(StatusCode::invalid_input, "the reference backend is one device; the plan is for several");
    for (Index f = 0; f < plan_.fronts(); ++f)
      fronts_.emplace_back(plan_.tree.first[f], plan_.layout[f].pivots, plan_.layout[f].rows, budget_);
  }

  void set_pivot_rule(const PivotRule& rule) override { rule_ = rule; }

  FactorOutcome factorize(std::span<const T> values) override {
    const double start = base::now_seconds();
    FactorOutcome out;
    Determinant determinant;
    for (Index f = 0; f < plan_.fronts(); ++f) {
      assemble(f, values);
      if (!eliminate(f, out, determinant)) break;
    }
    for (auto* list : {&out.replaced, &out.small, &out.failed}) {
      std::sort(list->begin(), list->end());
      list->erase(std::unique(list->begin(), list->end()), list->end());
    }
    out.determinant_sign = determinant.sign();
    out.determinant_log = determinant.log();
    out.seconds = out.busy_seconds = base::now_seconds() - start;
    return out;
  }

  void solve(T* x, Index columns, bool transpose) override {
    for (Index c = 0; c < columns; ++c) {
      for (Index f = 0; f < plan_.fronts(); ++f)
        with_rows(f, x + c, columns, [&](std::vector<T>& part) { fronts_[at(f)].forward(kind_, transpose, part); });
      for (Index f = plan_.fronts() - 1; f >= 0; --f)
        with_rows(f, x + c, columns, [&](std::vector<T>& part) { fronts_[at(f)].backward(kind_, transpose, part); });
    }
  }

  [[nodiscard]] std::string name() const override { return "reference (1 thread)"; }
  [[nodiscard]] Offset peak_bytes() const override { return budget_->peak(); }

 private:
  static std::size_t at(Index f) { return static_cast<std::size_t>(f); }

  // The entries of A, then what the children leave.
  void assemble(Index f, std::span<const T> values) {
    DenseFront<T>& front = fronts_[at(f)];
    front.clear();
    const plan::FrontLayout& l = plan_.layout[f];
    if (plan_.whole[f] != 0) {
      add_entries(front, plan_.first_tile[f], plan_.first_tile[f + 1], 0, 0, values);
    } else {
      for (Index j = 0; j < l.pivot_tiles; ++j)
        for (Index i = j; i < l.tiles; ++i) {
          const Offset tile = plan_.first_tile[f] + l.tile_index(i, j);
          add_entries(front, tile, tile + 1, l.begin(i), l.begin(j), values);
        }
    }
    for (Offset c = plan_.child_ptr[f]; c < plan_.child_ptr[f + 1]; ++c) add_child(front, plan_.children[c]);
  }

  void add_entries(DenseFront<T>& front, Offset first_tile, Offset end_tile, Index row, Index col,
                   std::span<const T> values) {
    for (Offset q = plan_.entry_ptr[first_tile]; q < plan_.entry_ptr[end_tile]; ++q) {
      const plan::EntryPlace& e = plan_.entries[static_cast<std::size_t>(q)];
      Index i = row + e.row(), j = col + e.col();
      if (e.transposed()) std::swap(i, j);
      const T value = values[static_cast<std::size_t>(e.source())];
      front(i, j) += value;
      if (kind_ != Kind::lu && i != j) front(j, i) += value;
    }
  }

  void add_child(DenseFront<T>& front, Index child) {
    const DenseFront<T>& c = fronts_[at(child)];
    const Index* place = plan_.relative.data() + plan_.tree.row_ptr[child];
    const Index below = c.rows() - c.pivots();
    for (Index j = 0; j < below; ++j)
      for (Index i = 0; i < below; ++i) front(place[i], place[j]) += c(c.pivots() + i, c.pivots() + j);
  }

  // @returns whether the factorization can go on
  bool eliminate(Index f, FactorOutcome& out, Determinant& determinant) {
    DenseFront<T>& front = fronts_[at(f)];
    if (kind_ == Kind::llt) return front.llt(rule_, out, determinant);
    if (kind_ == Kind::ldlt)
      front.ldlt(rule_, out, determinant);
    else
      front.lu(rule_, out, determinant);
    return true;
  }

  // Calls use() with the front's rows of a vector whose values are `stride` apart, and puts them back.
  template <class Use>
  void with_rows(Index f, T* x, Index stride, Use&& use) {
    const auto& t = plan_.tree;
    const Index pivots = plan_.layout[f].pivots;
    const auto row = [&](std::size_t k) -> T& {
      const Index p = static_cast<Index>(k) < pivots
                          ? t.first[f] + static_cast<Index>(k)
                          : t.rows[static_cast<std::size_t>(t.row_ptr[f]) + k - static_cast<std::size_t>(pivots)];
      return x[static_cast<Offset>(p) * stride];
    };
    part_.resize(static_cast<std::size_t>(plan_.layout[f].rows));
    for (std::size_t k = 0; k < part_.size(); ++k) part_[k] = row(k);
    use(part_);
    for (std::size_t k = 0; k < part_.size(); ++k) row(k) = part_[k];
  }

  const plan::Plan& plan_;
  Kind kind_;
  PivotRule rule_;
  base::MemoryBudget own_budget_{"host memory"};
  base::MemoryBudget* budget_;
  std::deque<DenseFront<T>> fronts_;
  std::vector<T> part_;
};

}  // namespace

template <class T>
std::unique_ptr<Executor<T>> make_reference_executor(const Job& job) {
  return std::make_unique<ReferenceExecutor<T>>(job);
}

template std::unique_ptr<Executor<double>> make_reference_executor(const Job&);
template std::unique_ptr<Executor<float>> make_reference_executor(const Job&);

}  // namespace espalier::device::reference
