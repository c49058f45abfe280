#include "device/cuda/out_of_core/part_solve.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <string>

#include "device/cuda/runtime/device_memory.hpp"

namespace espalier::device::cuda {

template <class T>
PartSolve<T>::PartSolve(const PartContext& context) : context_(context) {
  call("launch shape of the solve kernel", [&] { return SolveKernel<T>::resident(shape_); });
}

template <class T>
const std::vector<Index>& PartSolve<T>::prepare(const T* store, const std::vector<T>& inverse_d,
                                                const std::vector<T>& inverse_e) {
  const bool with_store = store != nullptr;
  if (!tables_ || with_store != with_store_) {
    ready_ = false;
    tables_.emplace(context_.plan, context_.tables, context_.places, with_store);
    with_store_ = with_store;
    at_ = tables_->places(context_.kind, sizeof(T), most_columns());
  }
  if (!ready_) send_tables(store, inverse_d, inverse_e);
  ready_ = true;
  return tables_->part;
}

// One block of bytes; the rows of the vectors come with each solve.
template <class T>
void PartSolve<T>::send_tables(const T* store, const std::vector<T>& inverse_d, const std::vector<T>& inverse_e) {
  std::vector<std::byte> bytes(static_cast<std::size_t>(at_.vectors));
  const auto put = [&](Offset at, const auto& list) {
    if (!list.empty()) std::memcpy(bytes.data() + at, list.data(), list.size() * sizeof(list[0]));
  };
  put(at_.fronts, tables_->fronts);
  put(at_.up, tables_->up);
  put(at_.down, tables_->down);
  put(at_.links, tables_->links);
  put(at_.bounds, tables_->bounds);
  put(at_.relative, tables_->relative);
  put(at_.rows, tables_->rows);
  put(at_.base, std::vector<const T*>{reinterpret_cast<const T*>(context_.arena), store});
  if (context_.kind == Kind::ldlt) {
    std::vector<T> d, e;
    for (const Index f : tables_->part)
      for (Index p = context_.plan.tree.first[f]; p < context_.plan.tree.first[f + 1]; ++p) {
        d.push_back(inverse_d[static_cast<std::size_t>(p)]);
        e.push_back(inverse_e[static_cast<std::size_t>(p)]);
      }
    put(at_.inverse_d, d);
    put(at_.inverse_e, e);
  }
  copy(memory(), bytes.data(), at_.vectors, cudaMemcpyHostToDevice);
}

template <class T>
void PartSolve<T>::copy(void* to, const void* from, Offset bytes, cudaMemcpyKind kind) {
  if (bytes == 0) return;
  call("cudaMemcpyAsync",
       [&] { return cudaMemcpyAsync(to, from, static_cast<std::size_t>(bytes), kind, context_.stream); });
  wait();  // the memory on the host is pageable, and is used again
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
  s.links = reinterpret_cast<const Link*>(m + at_.links);
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
void PartSolve<T>::over_pivots(bool resident, Use&& use) const {
  for (std::size_t k = 0; k < tables_->part.size(); ++k) {
    const Front& x = tables_->fronts[k];
    const Index first = context_.plan.tree.first[tables_->part[k]];
    for (Index p = 0; (x.region == 0) == resident && p < x.pivots; ++p)
      use(static_cast<Offset>(x.position) + p, static_cast<Offset>(first) + p);
  }
}

template <class T>
void PartSolve<T>::start(const T* x, Index columns, bool transpose) {
  transpose_ = transpose;
  columns_ = columns == 1 ? 1 : kSlab;
  const auto size = static_cast<Offset>(sizeof(T));
  staged_.assign(static_cast<std::size_t>(tables_->pivots) * static_cast<std::size_t>(columns_), T(0));
  for (const bool resident : {true, false})
    over_pivots(resident, [&](Offset to, Offset from) {
      std::copy_n(x + from * columns, columns, staged_.data() + to * columns_);
    });
  copy(memory() + at_.rhs, staged_.data(), static_cast<Offset>(staged_.size()) * size, cudaMemcpyHostToDevice);
  fill(at_.forward, 0xff, at_.control - at_.forward);
  fill(at_.control, 0, PartPlaces::kControlBytes);
  if (tables_->streamed.ups > 0) launch(tables_->streamed, true, false);
}

template <class T>
void PartSolve<T>::turn(T* x, const T* updates, Index columns) {
  const plan::Plan& plan = context_.plan;
  const Offset first = tables_->child_updates * columns_;
  staged_.assign(static_cast<std::size_t>(tables_->updates * columns_ - first), T(0));
  T* to = staged_.data();
  for (const Index f : tables_->children)
    for (Offset r = plan.tree.row_ptr[f]; r < plan.tree.row_ptr[f + 1]; ++r, to += columns_)
      for (Index c = 0; c < columns; ++c) {
        const T value = updates[r * columns + c];
        to[c] = std::isnan(value) ? std::numeric_limits<T>::quiet_NaN() : value;  // never what says "not there yet"
      }
  const auto size = static_cast<Offset>(sizeof(T));
  copy(memory() + at_.updates + first * size, staged_.data(), static_cast<Offset>(staged_.size()) * size,
       cudaMemcpyHostToDevice);
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
  const auto size = static_cast<Offset>(sizeof(T));
  staged_.resize(static_cast<std::size_t>(tables_->pivots) * static_cast<std::size_t>(columns_));
  copy(staged_.data(), memory() + at_.rhs, static_cast<Offset>(staged_.size()) * size, cudaMemcpyDeviceToHost);
  int control[2] = {};
  copy(control, memory() + at_.control, sizeof control, cudaMemcpyDeviceToHost);
  if (control[1] != 0)
    throw Error(StatusCode::device_error, "the solve on the GPU was given up after waiting " +
                                              std::to_string(context_.patience_seconds) +
                                              " s for one of its own blocks");
  over_pivots(resident, [&](Offset from, Offset to) {
    std::copy_n(staged_.data() + from * columns_, columns, x + to * columns);
  });
}

template class PartSolve<double>;
template class PartSolve<float>;

}  // namespace espalier::device::cuda
