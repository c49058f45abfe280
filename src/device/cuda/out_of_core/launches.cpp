#include "device/cuda/out_of_core/launches.hpp"

#include <algorithm>

#include "device/cuda/runtime/device_memory.hpp"

namespace espalier::device::cuda {

using out_of_core::ColumnGroup;
using out_of_core::InCoreStep;
using out_of_core::Operation;
using out_of_core::OperationType;

template <class T>
Launches<T>::Launches(const CudaOutOfCoreLayout<T>& layout, const OutOfCoreTables& tables, Kind kind,
                      const out_of_core::OutOfCorePlan& plan, std::byte* arena, double patience_seconds)
    : layout_(layout),
      tables_(tables),
      kind_(kind),
      plan_(plan),
      arena_(arena),
      patience_(static_cast<std::uint64_t>(patience_seconds * 1e9)) {
  choose_shapes(tables);
}

template <class T>
template <class Use>
void Launches<T>::dispatch(const char* name, Use&& use) const {
  call(name, [&] {
    switch (kind_) {
      case Kind::llt:
        return use(FactorKernel<T, Kind::llt>{}, GroupKernels<T, Kind::llt>{});
      case Kind::ldlt:
        return use(FactorKernel<T, Kind::ldlt>{}, GroupKernels<T, Kind::ldlt>{});
      default:
        return use(FactorKernel<T, Kind::lu>{}, GroupKernels<T, Kind::lu>{});
    }
  });
}

template <class T>
void Launches<T>::choose_shapes(const OutOfCoreTables& tables) {
  std::size_t whole = 0;
  for (const Front& f : tables.device_plan().fronts)
    if (f.whole != 0) {
      const auto size = static_cast<std::size_t>(f.total_pad), p = static_cast<std::size_t>(f.pivot_pad);
      whole = std::max(whole, size * (size + 4) + p * (p + 4));
    }
  for (const bool wide : {false, true})
    dispatch("launch shape of the factorization kernel",
             [&](auto kernel, auto) { return decltype(kernel)::shape_for(wide, whole, shape_[wide ? 1 : 0]); });
  dispatch("group kernels", [](auto, auto kernels) { return decltype(kernels)::prepare(); });
}

template <class T>
void Launches<T>::run(const Operation& op, const UnitTables& unit, cudaStream_t stream) {
  unit_ = &unit;
  stream_ = stream;
  if (op.type == OperationType::eliminate) return eliminate(plan_.steps[static_cast<std::size_t>(op.unit)]);
  const ColumnGroup& g = plan_.groups[static_cast<std::size_t>(op.unit)];
  switch (op.type) {
    case OperationType::begin_group:
      return begin_group(g);
    case OperationType::add_child:
      return add_child(g, op);
    case OperationType::update:
      return update(g, op);
    default:
      return launch(state(g), false);
  }
}

// The arguments of the kernels for the unit at hand, whose places these are.
template <class T>
template <class Unit>
FactorState<T> Launches<T>::state(const Unit& places) const {
  const UnitTables& u = *unit_;
  FactorState<T> s{};
  std::byte* tables = arena_ + places.tables_at;
  std::byte* scratch = arena_ + places.scratch_at;
  std::byte* shared = arena_ + plan_.shared_at;
  s.fronts = reinterpret_cast<const Front*>(tables + u.at.fronts);
  s.tasks = reinterpret_cast<const FactorTask*>(tables + u.at.tasks);
  s.links = reinterpret_cast<const ChildRows*>(tables + u.at.links);
  s.bounds = reinterpret_cast<const std::int32_t*>(tables + u.at.bounds);
  s.waits = reinterpret_cast<const std::int32_t*>(tables + u.at.waits);
  s.relative = reinterpret_cast<const std::int32_t*>(tables + u.at.relative);
  s.entry_ptr = reinterpret_cast<const std::int64_t*>(tables + u.at.entry_ptr);
  s.entries = reinterpret_cast<const std::uint64_t*>(tables + u.at.entries);
  s.values = reinterpret_cast<const T*>(arena_ + places.values_at);
  s.base = reinterpret_cast<T* const*>(shared);
  s.inverse_d = reinterpret_cast<T*>(scratch + u.scratch.inverse_d);
  s.inverse_e = reinterpret_cast<T*>(scratch + u.scratch.inverse_e);
  s.pivot = reinterpret_cast<T*>(scratch + u.scratch.pivot);
  s.replaced = reinterpret_cast<unsigned char*>(scratch + u.scratch.replaced);
  s.failed = reinterpret_cast<unsigned char*>(scratch + u.scratch.failed);
  s.control = reinterpret_cast<int*>(scratch + u.scratch.control);
  s.finished = reinterpret_cast<int*>(scratch + u.scratch.finished);
  s.flag = reinterpret_cast<int*>(scratch + u.scratch.flags);
  s.limits = reinterpret_cast<const T*>(shared + kLimitsAt);
  s.patience = patience_;
  s.part_flags = u.scratch.part_flags;
  return s;
}

template <class T>
void Launches<T>::clear_scratch(Offset scratch_at) {
  const ScratchPlaces& at = unit_->scratch;
  std::byte* scratch = arena_ + scratch_at;
  const auto set = [&](Offset begin, int value, Offset bytes) {
    if (bytes > 0)
      call("cudaMemsetAsync",
           [&] { return cudaMemsetAsync(scratch + begin, value, static_cast<std::size_t>(bytes), stream_); });
  };
  set(at.replaced, 0, at.bytes - at.replaced);
  for (int part = 0; part < (kind_ == Kind::lu ? 2 : 1); ++part)
    set(at.flags + 4 * ((part + 1) * at.part_flags - at.set_flags), 1, 4 * at.set_flags);
}

// Steps of two lanes share the multiprocessors: a kernel keeps what it has until its list of tasks is empty.
template <class T>
void Launches<T>::launch(const FactorState<T>& s, bool narrow) {
  const UnitTables& u = *unit_;
  const auto go = [&](bool wide, int first, int end) {
    if (first == end) return;
    LaunchConfiguration shape = shape_[wide ? 1 : 0];
    if (narrow && plan_.lanes == 2) shape.blocks = (shape.blocks + 1) / 2;
    dispatch("launch of the factorization kernel", [&](auto kernel, auto) {
      return decltype(kernel)::launch(wide, shape, s, first, end, u.scratch.pivots, stream_);
    });
  };
  const int split = narrow ? u.narrow_end : 0;
  go(false, 0, split);
  go(true, split, u.end);
}

template <class T>
void Launches<T>::eliminate(const InCoreStep& step) {
  clear_scratch(step.scratch_at);
  launch(state(step), true);
}

template <class T>
void Launches<T>::zero(Offset at, Offset elements) {
  if (elements == 0) return;
  call("cudaMemsetAsync",
       [&] { return cudaMemsetAsync(arena_ + at, 0, static_cast<std::size_t>(elements) * sizeof(T), stream_); });
}

template <class T>
void Launches<T>::begin_group(const ColumnGroup& g) {
  clear_scratch(g.scratch_at);
  const Index pivots = layout_.plan().layout[g.front].pivot_tiles;
  const Offset factor = layout_.factor_offset(g.front, std::min(g.end, pivots)) -
                        layout_.factor_offset(g.front, std::min(g.begin, pivots));
  const Offset below = layout_.contribution_offset(g.front, std::max(g.end, pivots) - pivots) -
                       layout_.contribution_offset(g.front, std::max(g.begin, pivots) - pivots);
  zero(g.factor_at[0], factor);
  if (kind_ != Kind::llt) zero(g.factor_at[1], factor);
  zero(g.contribution_at[0], below);
  if (kind_ == Kind::lu) zero(g.contribution_at[1], below);
  if (g.entries > 0) add(g, AddedColumns<T>{});
}

template <class T>
void Launches<T>::add(const ColumnGroup& g, const AddedColumns<T>& part) {
  dispatch("launch of the assembly kernel", [&](auto, auto kernels) {
    return decltype(kernels)::add(state(g), unit_->end, unit_->group_end, part, stream_);
  });
}

template <class T>
void Launches<T>::add_child(const ColumnGroup& g, const Operation& op) {
  const Front& child = front(op.front);
  const Offset before = layout_.contribution_offset(op.front, op.begin);
  AddedColumns<T> part;
  part.link = tables_.link_of(op.front);
  part.begin = op.begin * child.width;
  part.end = std::min<int>(child.below, op.end * child.width);
  const auto place = [&](Offset at) { return reinterpret_cast<const T*>(arena_ + at) - before; };
  part.lower = place(op.at[0]);
  if (kind_ == Kind::lu) part.upper = place(op.at[1]);
  add(g, part);
}

template <class T>
void Launches<T>::update(const ColumnGroup& g, const Operation& op) {
  SlabColumns<T> slab;
  slab.begin = op.begin;
  slab.end = op.end;
  slab.row = op.slab ? front(op.front).column_begin(op.row) : -1;
  slab.part[0] = reinterpret_cast<const T*>(arena_ + op.at[0]);
  if (kind_ != Kind::llt) slab.part[1] = reinterpret_cast<const T*>(arena_ + op.at[1]);
  dispatch("launch of the update kernel", [&](auto, auto kernels) {
    return decltype(kernels)::update(state(g), unit_->width, unit_->end, unit_->group_end, slab, stream_);
  });
}

template class Launches<double>;
template class Launches<float>;

}  // namespace espalier::device::cuda
