#include "device/cuda/out_of_core/layout.hpp"

#include <utility>

#include "plan/regions.hpp"

namespace espalier::device::cuda {

template <class T>
CudaOutOfCoreLayout<T>::CudaOutOfCoreLayout(std::shared_ptr<const OutOfCoreSource> source)
    : source_(std::move(source)), sizes_(plan::array_sizes(source_->plan)) {}

template <class T>
Offset CudaOutOfCoreLayout<T>::factor_offset(Index f, Index column) const {
  const Front& x = front(f);
  return column < x.pivot_tiles ? x.column_offset(column) : sizes_.factor[f];
}

template <class T>
Offset CudaOutOfCoreLayout<T>::contribution_offset(Index f, Index column) const {
  const Front& x = front(f);
  const int first = column * x.width;
  return column < x.tiles - x.pivot_tiles ? x.contribution_offset(first, first) : sizes_.contribution[f];
}

template <class T>
void CudaOutOfCoreLayout<T>::slab(Index f, Index begin, Index end, Index row,
                                  std::vector<out_of_core::Extent>& extents) const {
  const Front& x = front(f);
  const int top = x.column_begin(row);
  for (Index j = begin; j < end; ++j)
    for (int q = x.column_begin(j) / kChunk; q < x.column_end(j) / kChunk; ++q)
      extents.push_back({x.chunk_offset(q, top), static_cast<Offset>(x.total_pad - top) * kChunk});
}

template class CudaOutOfCoreLayout<double>;
template class CudaOutOfCoreLayout<float>;

}  // namespace espalier::device::cuda
