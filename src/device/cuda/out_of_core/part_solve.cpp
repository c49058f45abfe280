#include "device/cuda/out_of_core/part_solve.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

namespace espalier::device::cuda {

namespace {

// `rows` rows of `columns` values, into rows of `padded` values whose rest is zero, and back.
template <class T>
void pad_rows(const T* from, Offset rows, Index columns, Index padded, T* to) {
  if (columns == padded) {
    std::copy_n(from, rows * columns, to);
    return;
  }
  for (Offset r = 0; r < rows; ++r, from += columns, to += padded)
    std::fill(std::copy_n(from, columns, to), to + padded, T(0));
}
template <class T>
void unpad_rows(const T* from, Offset rows, Index columns, Index padded, T* to) {
  if (columns == padded) {
    std::copy_n(from, rows * columns, to);
    return;
  }
  for (Offset r = 0; r < rows; ++r, from += padded, to += columns) std::copy_n(from, columns, to);
}

}  // namespace

template <class T>
PartSolve<T>::PartSolve(const PartContext& context) : context_(context), uploads_(&context.pool) {
  call("launch shape of the solve kernel", [&] { return SolveKernel<T>::resident(shape_); });
  make_tables(!context.places.streamed.empty());
}

template <class T>
void PartSolve<T>::make_tables(bool with_store) {
  ready_ = false;
  tables_.emplace(context_.plan, context_.tables, context_.places, with_store);
  with_store_ = with_store;
  at_ = tables_->places(context_.kind, sizeof(T), most_columns());
}

template <class T>
const std::vector<Index>& PartSolve<T>::prepare(const T* store, const std::vector<T>& inverse_d,
                                                const std::vector<T>& inverse_e) {
  if (const bool with_store = store != nullptr; with_store != with_store_) make_tables(with_store);
  if (!ready_) send_tables(store, inverse_d, inverse_e);
  ready_ = true;
  return tables_->part;
}

// The rows of the vectors come with each solve.
template <class T>
void PartSolve<T>::send_tables(const T* store, const std::vector<T>& inverse_d, const std::vector<T>& inverse_e) {
  const auto upload = [&](Offset at, const auto& list) {
    uploads_.copy(memory() + at, list.data(), static_cast<Offset>(list.size() * sizeof(list[0])), context_.stream);
  };
  upload(at_.fronts, tables_->fronts);
  upload(at_.up, tables_->up);
  upload(at_.down, tables_->down);
  upload(at_.links, tables_->links);
  upload(at_.bounds, tables_->bounds);
  upload(at_.relative, tables_->relative);
  upload(at_.rows, tables_->rows);
  upload(at_.base, std::vector<const T*>{reinterpret_cast<const T*>(context_.arena), store});
  if (context_.kind == Kind::ldlt) {
    std::vector<T> d, e;
    for (const Index f : tables_->part)
      for (Index p = context_.plan.tree.first[f]; p < context_.plan.tree.first[f + 1]; ++p) {
        d.push_back(inverse_d[static_cast<std::size_t>(p)]);
        e.push_back(inverse_e[static_cast<std::size_t>(p)]);
      }
    upload(at_.inverse_d, d);
    upload(at_.inverse_e, e);
  }
}

template <class T>
void PartSolve<T>::copy(void* to, const void* from, Offset bytes, cudaMemcpyKind kind) {
  if (bytes == 0) return;
  call("cudaMemcpyAsync",
       [&] { return cudaMemcpyAsync(to, from, static_cast<std::size_t>(bytes), kind, context_.stream); });
  wait();  // the memory on the host is used again
}

template <class T>
void PartSolve<T>::fill(Offset at, int byte, Offset bytes) {
  call("cudaMemsetAsync",
       [&] { return cudaMemsetAsync(memory() + at, byte, static_cast<std::size_t>(bytes), context_.stream); });
}

template <class T>
void PartSolve<T>::wait() {
  call("cudaStreamSynchronize", [&] { return cudaStreamSynchronize(context_.stream); });
}

template <class T>
void PartSolve<T>::launch(const PartTables::Tasks& tasks, bool up, bool down) {
  std::byte* const m = memory();
  const bool lu = context_.kind == Kind::lu, ldlt = context_.kind == Kind::ldlt;
  SolveState<T> s{};
  s.fronts = reinterpret_cast<const Front*>(m + at_.fronts);
  s.up = reinterpret_cast<const SolveTask*>(m + at_.up) + tasks.up;
  s.down = reinterpret_cast<const SolveTask*>(m + at_.down) + tasks.down;
  s.up_tasks = up ? tasks.ups : 0;
  s.down_tasks = down ? tasks.downs : 0;
  s.small_up = up ? tasks.small_up : 0;
  s.small_down = down ? tasks.small_down : 0;
  s.links = reinterpret_cast<const ChildRows*>(m + at_.links);
  s.bounds = reinterpret_cast<const std::int32_t*>(m + at_.bounds);
  s.relative = reinterpret_cast<const std::int32_t*>(m + at_.relative);
  s.rows = reinterpret_cast<const std::int32_t*>(m + at_.rows);
  s.base = reinterpret_cast<T* const*>(m + at_.base);
  s.inverse_d = ldlt ? reinterpret_cast<const T*>(m + at_.inverse_d) : nullptr;
  s.inverse_e = ldlt ? reinterpret_cast<const T*>(m + at_.inverse_e) : nullptr;
  s.up_second = lu && transpose_;
  s.down_second = lu && !transpose_;
  s.up_triangular = context_.kind == Kind::llt || s.up_second;  // all others hold permutations, too
  s.down_triangular = context_.kind == Kind::llt || s.down_second;
  s.rhs = reinterpret_cast<const T*>(m + at_.rhs);
  s.result = reinterpret_cast<T*>(m + at_.rhs);
  s.columns = static_cast<int>(columns_);
  s.pass = static_cast<int>(columns_);
  s.forward = reinterpret_cast<T*>(m + at_.forward);
  s.updates = reinterpret_cast<T*>(m + at_.updates);
  s.solution = reinterpret_cast<T*>(m + at_.solution);
  s.control = reinterpret_cast<int*>(m + at_.control);
  s.patience = static_cast<std::uint64_t>(context_.patience_seconds * 1e9);
  // The kernel counts its tasks; that it was given up stays.
  const Offset counters = static_cast<Offset>(2 * sizeof(int));
  fill(at_.control + counters, 0, PartPlaces::kControlBytes - counters);
  call("launch of the solve kernel", [&] { return SolveKernel<T>::launch(shape_, s, context_.stream); });
}

template <class T>
template <class Use>
void PartSolve<T>::over_fronts(Use&& use) const {
  constexpr std::int64_t kFronts = 256;  // per range of work
  context_.pool.for_each_range(
      static_cast<std::int64_t>(tables_->part.size()), kFronts, [&](std::int64_t begin, std::int64_t end) {
        for (auto k = static_cast<std::size_t>(begin); k < static_cast<std::size_t>(end); ++k) {
          const Front& x = tables_->fronts[k];
          use(x, static_cast<Offset>(context_.plan.tree.first[tables_->part[k]]));
        }
      });
}

template <class T>
T* PartSolve<T>::stage(Offset rows) {
  if (staged_.size() < rows * columns_) {
    staged_ = PinnedArray<T>();
    staged_ = PinnedArray<T>(rows * columns_);
  }
  return staged_.data();
}

template <class T>
void PartSolve<T>::start(const T* x, Index columns, bool transpose) {
  transpose_ = transpose;
  columns_ = columns == 1 ? 1 : kSlab;
  T* staged = stage(tables_->pivots);
  over_fronts([&](const Front& f, Offset first) {
    pad_rows(x + first * columns, f.pivots, columns, columns_, staged + Offset{f.position} * columns_);
  });
  copy(memory() + at_.rhs, staged, Offset{tables_->pivots} * columns_ * static_cast<Offset>(sizeof(T)),
       cudaMemcpyHostToDevice);
  fill(at_.forward, 0xff, at_.control - at_.forward);
  fill(at_.control, 0, PartPlaces::kControlBytes);
  if (tables_->streamed.ups > 0) launch(tables_->streamed, true, false);
}

template <class T>
void PartSolve<T>::turn(T* x, const T* updates, Index columns) {
  const plan::Plan& plan = context_.plan;
  const Offset first = tables_->child_updates, rows = tables_->updates - first;
  T* const staged = stage(rows);
  T* to = staged;
  for (const Index f : tables_->children)
    for (Offset r = plan.tree.row_ptr[f]; r < plan.tree.row_ptr[f + 1]; ++r, to += columns_)
      for (Index c = 0; c < columns_; ++c) {
        const T value = c < columns ? updates[r * columns + c] : T(0);
        to[c] = std::isnan(value) ? std::numeric_limits<T>::quiet_NaN() : value;  // never what says "not there yet"
      }
  const auto size = columns_ * static_cast<Offset>(sizeof(T));
  copy(memory() + at_.updates + first * size, staged, rows * size, cudaMemcpyHostToDevice);
  launch(tables_->resident, true, true);
  fetch(x, columns, true);
  if (tables_->streamed.downs > 0) launch(tables_->streamed, false, true);
}

template <class T>
void PartSolve<T>::finish(T* x, Index columns) {
  if (tables_->streamed.downs > 0) fetch(x, columns, false);
}

// Solutions of fronts that stay, or of the others; and whether the kernel was given up.
template <class T>
void PartSolve<T>::fetch(T* x, Index columns, bool resident) {
  T* const staged = stage(tables_->pivots);
  copy(staged, memory() + at_.rhs, Offset{tables_->pivots} * columns_ * static_cast<Offset>(sizeof(T)),
       cudaMemcpyDeviceToHost);
  int control[2] = {};
  copy(control, memory() + at_.control, sizeof control, cudaMemcpyDeviceToHost);
  if (control[1] != 0)
    throw Error(StatusCode::device_error, "the solve on the GPU was given up after waiting " +
                                              std::to_string(context_.patience_seconds) +
                                              " s for one of its own blocks");
  over_fronts([&](const Front& f, Offset first) {
    if ((f.region == 0) == resident)
      unpad_rows(staged + Offset{f.position} * columns_, f.pivots, columns, columns_, x + first * columns);
  });
}

template class PartSolve<double>;
template class PartSolve<float>;

}  // namespace espalier::device::cuda
