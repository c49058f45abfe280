#include <algorithm>
#include <bit>
#include <cub/device/device_radix_sort.cuh>
#include <utility>

#include "dynamics/cuda/body.hpp"

namespace espalier::dynamics::cuda {

namespace {

constexpr int kThreads = 256;

// The code of a contribution to an entry of the pattern: the vertices of its element and the pair, 5 bits each, and
// where the tangent of the element begins.
constexpr int kStartBits = 48;
__device__ std::int64_t pair_code(int nodes, int a, int b, std::int64_t start) {
  return (static_cast<std::int64_t>((nodes * 32 + a) * 32 + b) << kStartBits) | start;
}

__device__ Offset this_thread() { return static_cast<Offset>(blockIdx.x) * blockDim.x + threadIdx.x; }

struct SpreadJob {
  Index slots;
  int nodes;
  const Index* vertices;
  const double* from;
  double* to;
};

// A field of the body to the elements; one thread per vertex of an element.
__global__ void spread_kernel(const SpreadJob job) {
  const Offset k = this_thread();
  if (k >= Offset{job.slots} * job.nodes) return;
  const Offset from = Offset{3} * job.vertices[k], row = k / kRow;
  for (int i = 0; i < 3; ++i) job.to[(3 * row + i) * kRow + k % kRow] = job.from[from + i];
}

struct ForceJob {
  Offset vertices;
  const std::int64_t *ptr, *from;
  const double* element_force;
  const Offset* pattern_ptr;
  const Index* pattern_ind;
  const double* mass;
  const double *velocity, *acceleration;  // null: zero
  double mass_damping;
  double* force;
};

// One thread per coordinate.
__global__ void gather_force_kernel(const ForceJob job) {
  const Offset k = this_thread();
  if (k >= 3 * job.vertices) return;
  const Offset v = k / 3, i = k % 3;
  double sum = 0;
  for (std::int64_t c = job.ptr[v]; c < job.ptr[v + 1]; ++c) sum += job.element_force[job.from[c] + i * kRow];
  double inertia = 0;
  for (Offset e = job.pattern_ptr[v]; e < job.pattern_ptr[v + 1]; ++e) {
    const Offset other = Offset{3} * job.pattern_ind[e] + i;
    const double a = job.acceleration == nullptr ? 0.0 : job.acceleration[other];
    const double rate = job.velocity == nullptr ? 0.0 : job.velocity[other];
    inertia += job.mass[e] * (a + job.mass_damping * rate);
  }
  job.force[k] = sum + inertia;
}

struct TangentJob {
  Offset entries;
  const std::int64_t *ptr, *from;
  const double* element_tangent;  // null: inertia alone
  bool symmetric;                 // then blocks a > b stand transposed at (b, a)
  const Index* column;            // of an entry of the vertex pattern
  const Offset* column_start;
  const std::int32_t* shift;
  const double* mass;
  double mass_weight;
  double* values;
};

// One thread per column of a 3 x 3 block.
__global__ void gather_tangent_kernel(const TangentJob job) {
  const Offset k = this_thread();
  if (k >= 3 * job.entries) return;
  const Offset entry = k / 3;
  const int j = static_cast<int>(k % 3);
  double sum[3] = {};
  sum[j] = job.mass_weight * job.mass[entry];
  if (job.element_tangent != nullptr)
    for (std::int64_t c = job.ptr[entry]; c < job.ptr[entry + 1]; ++c) {
      const std::int64_t code = job.from[c];
      const int pair = static_cast<int>(code >> kStartBits), rows = 3 * (pair >> 10), a = pair >> 5 & 31, b = pair & 31;
      const double* of_element = job.element_tangent + (code & ((std::int64_t{1} << kStartBits) - 1));
      const bool mirrored = job.symmetric && a > b;
      const Offset at = mirrored ? Offset{3 * a} * rows + 3 * b + j : Offset{3 * b + j} * rows + 3 * a;
      const Offset step = mirrored ? rows : 1;
      for (int i = 0; i < 3; ++i) sum[i] += of_element[(at + i * step) * kRow];
    }
  double* to = job.values + job.column_start[Offset{3} * job.column[entry] + j] + job.shift[k];
  for (int i = 0; i < 3; ++i) to[i] += sum[i];
}

__global__ void loaded_kernel(Offset numbers, const double* force, double load, const double* weight, double* f) {
  const Offset k = this_thread();
  if (k < numbers) f[k] = force[k] - load * weight[k];
}

__global__ void columns_kernel(Offset vertices, const Offset* ptr, Index* column) {
  const Offset v = this_thread();
  if (v >= vertices) return;
  for (Offset e = ptr[v]; e < ptr[v + 1]; ++e) column[e] = static_cast<Index>(v);
}

struct PlacesJob {
  Index elements;
  int nodes;
  bool of_pairs;
  Offset start;           // of the group's forces or tangents
  const Index* vertices;  // in rows
  const Offset* pattern_ptr;
  const Index* pattern_ind;
  Offset entries;  // of the pattern
  std::int64_t *place, *from;
};

// One thread per contribution: what it belongs to, and where it will stand. Those to columns that have no entries are
// somebody else's, and belong to what follows the last place.
__global__ void places_kernel(const PlacesJob job) {
  const Offset k = this_thread();
  const int each = job.of_pairs ? job.nodes * job.nodes : job.nodes, numbers = 3 * job.nodes;
  if (k >= Offset{job.elements} * each) return;
  const Offset e = k / each, row = e / kRow, lane = e % kRow;
  const int what = static_cast<int>(k % each), a = what % job.nodes, b = what / job.nodes;
  const auto vertex = [&](int node) { return job.vertices[(row * job.nodes + node) * kRow + lane]; };
  if (!job.of_pairs) {
    job.place[k] = vertex(a);
    job.from[k] = job.start + (row * numbers + 3 * a) * kRow + lane;
    return;
  }
  Offset low = job.pattern_ptr[vertex(b)], high = job.pattern_ptr[vertex(b) + 1];
  if (low == high) low = job.entries;
  while (high - low > 1) {  // the entry is there
    const Offset middle = (low + high) / 2;
    (job.pattern_ind[middle] <= vertex(a) ? low : high) = middle;
  }
  job.place[k] = low;
  job.from[k] = pair_code(job.nodes, a, b, job.start + row * numbers * numbers * kRow + lane);
}

// ptr[p]: the first contribution of place p or of a later one.
__global__ void starts_kernel(Offset count, const std::int64_t* place, Offset places, std::int64_t* ptr) {
  const Offset k = this_thread();
  if (k > count) return;
  const Offset before = k == 0 ? -1 : place[k - 1], here = k == count ? places : place[k];
  for (Offset p = before + 1; p <= here; ++p) ptr[p] = k;
}

}  // namespace

CudaBody::CudaBody(const DeviceBodyTables& t, Gpu& gpu)
    : gpu_(gpu),
      vertices_(static_cast<Offset>(t.reference.size()) / 3),
      entries_(static_cast<Offset>(t.pattern->ind.size())),
      mass_damping_(t.mass_damping),
      stiffness_damping_(t.stiffness_damping) {
  const DeviceGuard guard(gpu_.number);
  Offset number = 0;
  for (const DeviceElements& g : t.groups) {
    const Offset elements = static_cast<Offset>(g.vertices.size()) / g.nodes, rows = (elements + kRow - 1) / kRow;
    std::vector<Index> side_by_side(static_cast<std::size_t>(rows * g.nodes * kRow));
    for (Offset e = 0; e < rows * kRow; ++e)
      for (Offset a = 0; a < g.nodes; ++a)
        side_by_side[static_cast<std::size_t>((e / kRow * g.nodes + a) * kRow + e % kRow)] =
            g.vertices[static_cast<std::size_t>(std::min(e, elements - 1) * g.nodes + a)];
    groups_.push_back({g.law, g.nodes, static_cast<Index>(elements), static_cast<Index>(rows * kRow),
                       static_cast<std::int32_t>(number), force_numbers_, tangent_numbers_,
                       upload<Index>(side_by_side, gpu_), upload_table(g.law, gpu_)});
    force_numbers_ += rows * kRow * 3 * g.nodes;
    tangent_numbers_ += rows * kRow * 9 * g.nodes * g.nodes;
    number += elements;
  }
  mass_ = upload(t.mass, gpu_);
  weight_ = upload(t.weight, gpu_);
  ptr_ = upload<Offset>(t.pattern->ptr, gpu_);
  ind_ = upload<Index>(t.pattern->ind, gpu_);
  to_vertices_ = sorted_contributions(false);
  to_pairs_ = sorted_contributions(true);
  column_ = make_array<Index>(entries_, gpu_);
  columns_kernel<<<blocks_for(vertices_, kThreads), kThreads, 0, gpu_.stream.get()>>>(vertices_, ptr_.data(),
                                                                                      column_.data());
  call("launch of the columns", [&] { return cudaGetLastError(); });
  state_ = make_array<double>(9 * vertices_, gpu_);
  force_ = make_array<double>(3 * vertices_, gpu_);
  for (auto* array : {&element_reference_, &element_position_, &element_force_})
    *array = make_array<double>(force_numbers_, gpu_);
  if (stiffness_damping_ != 0) element_velocity_ = make_array<double>(force_numbers_, gpu_);
  element_tangent_ = make_array<double>(tangent_numbers_, gpu_);
  inverted_ = make_array<std::int32_t>(1, gpu_);
  staged_state_ = PinnedArray<double>(9 * vertices_);
  staged_force_ = PinnedArray<double>(3 * vertices_);
  staged_inverted_ = PinnedArray<std::int32_t>(1);
  const DeviceArray<double> reference = upload(t.reference, gpu_);
  spread(reference.data(), element_reference_.data());
  gpu_.stream.wait();
  gpu_.budget.give_back(reference.bytes());
}

// Contributions sorted by what they belong to; a stable sort leaves those to one place in the order of the elements.
CudaBody::Contributions CudaBody::sorted_contributions(bool of_pairs) {
  const auto each = [&](const Group& g) { return Offset{g.nodes} * (of_pairs ? g.nodes : 1); };
  const Offset places = of_pairs ? entries_ : vertices_;
  Offset count = 0;
  for (const Group& g : groups_) count += each(g) * g.elements;
  const DeviceArray<std::int64_t> place = make_array<std::int64_t>(count, gpu_),
                                  from = make_array<std::int64_t>(count, gpu_),
                                  sorted_place = make_array<std::int64_t>(count, gpu_);
  Contributions sorted{make_array<std::int64_t>(places + 1, gpu_), make_array<std::int64_t>(count, gpu_)};
  const cudaStream_t stream = gpu_.stream.get();
  Offset first = 0;
  for (const Group& g : groups_) {
    const Offset now = each(g) * g.elements;
    const PlacesJob job{g.elements,
                        g.nodes,
                        of_pairs,
                        of_pairs ? g.tangent_start : g.force_start,
                        g.vertices.data(),
                        ptr_.data(),
                        ind_.data(),
                        entries_,
                        place.data() + first,
                        from.data() + first};
    places_kernel<<<blocks_for(now, kThreads), kThreads, 0, stream>>>(job);
    call("launch of the places", [&] { return cudaGetLastError(); });
    first += now;
  }
  std::size_t bytes = 0;
  const auto sort = [&](void* work) {
    call("sorting of contributions", [&] {
      return cub::DeviceRadixSort::SortPairs(work, bytes, place.data(), sorted_place.data(), from.data(),
                                             sorted.from.data(), count, 0,
                                             std::bit_width(static_cast<std::uint64_t>(places)), stream);
    });
  };
  sort(nullptr);
  const DeviceArray<std::byte> work = make_array<std::byte>(static_cast<Offset>(bytes), gpu_);
  sort(work.data());
  starts_kernel<<<blocks_for(count + 1, kThreads), kThreads, 0, stream>>>(count, sorted_place.data(), places,
                                                                          sorted.ptr.data());
  call("launch of the starts", [&] { return cudaGetLastError(); });
  gpu_.stream.wait();
  gpu_.budget.give_back(place.bytes() + from.bytes() + sorted_place.bytes() + work.bytes());
  return sorted;
}

void CudaBody::bind(std::span<const Offset> column_start, std::span<const std::int32_t> shift) {
  const DeviceGuard guard(gpu_.number);
  column_start_ = upload(column_start, gpu_);
  shift_ = upload(shift, gpu_);
}

void CudaBody::spread(const double* from, double* to) {
  for (const Group& g : groups_) {
    const SpreadJob job{g.slots, g.nodes, g.vertices.data(), from, to + g.force_start};
    const unsigned blocks = blocks_for(Offset{g.slots} * g.nodes, kThreads);
    spread_kernel<<<blocks, kThreads, 0, gpu_.stream.get()>>>(job);
    call("launch of the spreading", [&] { return cudaGetLastError(); });
  }
}

// The last copies have left the staging areas: others of the same GPU may still be at work.
void CudaBody::begin() {
  if (std::exchange(busy_, true)) gpu_.stream.wait();
}

void CudaBody::end() {
  gpu_.stream.wait();
  busy_ = false;
}

void CudaBody::send(const BodyState& state, bool with_velocity, bool with_acceleration) {
  const Offset n = 3 * vertices_;
  const double* from[3] = {state.q, with_velocity ? state.v : nullptr, with_acceleration ? state.a : nullptr};
  for (int part = 0; part < 3; ++part) {
    if (from[part] == nullptr) continue;
    if (state.there) {
      copy(state_.data() + part * n, from[part], n, cudaMemcpyDeviceToDevice, gpu_);
      continue;
    }
    double* stage = staged_state_.data() + part * n;
    gpu_.for_each_range(n,
                        [&](std::int64_t b, std::int64_t e) { std::copy(from[part] + b, from[part] + e, stage + b); });
    copy(state_.data() + part * n, stage, n, cudaMemcpyHostToDevice, gpu_);
  }
  has_velocity_ = from[1] != nullptr;
  has_acceleration_ = from[2] != nullptr;
}

void CudaBody::evaluate(bool tangent, double position_weight, double velocity_weight) {
  const cudaStream_t stream = gpu_.stream.get();
  call("cudaMemsetAsync", [&] { return cudaMemsetAsync(inverted_.data(), 0x7f, sizeof(std::int32_t), stream); });
  const bool damped = has_velocity_ && stiffness_damping_ != 0;
  spread(state_.data(), element_position_.data());
  if (damped) spread(state_.data() + 3 * vertices_, element_velocity_.data());
  for (const Group& g : groups_)
    launch_elements({g.law, g.slots, g.table.data(), element_reference_.data() + g.force_start,
                     element_position_.data() + g.force_start,
                     damped ? element_velocity_.data() + g.force_start : nullptr, damped ? stiffness_damping_ : 0.0,
                     position_weight, velocity_weight, g.first, element_force_.data() + g.force_start,
                     tangent ? element_tangent_.data() + g.tangent_start : nullptr, inverted_.data()},
                    stream);
  call("cudaMemcpyAsync", [&] {
    return cudaMemcpyAsync(staged_inverted_.data(), inverted_.data(), sizeof(std::int32_t), cudaMemcpyDeviceToHost,
                           stream);
  });
}

// After the stream's work is done.
Offset CudaBody::inverted() const {
  constexpr std::int32_t kUntouched = 0x7f7f7f7f;  // as memset leaves it
  return *staged_inverted_.data() < kUntouched ? *staged_inverted_.data() : -1;
}

void CudaBody::start_forces(const BodyState& state) {
  const DeviceGuard guard(gpu_.number);
  begin();
  send(state, stiffness_damping_ != 0 || mass_damping_ != 0, true);
  evaluate(false, 1, 0);
  const double* velocity = has_velocity_ && mass_damping_ != 0 ? state_.data() + 3 * vertices_ : nullptr;
  const double* acceleration = has_acceleration_ ? state_.data() + 6 * vertices_ : nullptr;
  const ForceJob job{vertices_,
                     to_vertices_.ptr.data(),
                     to_vertices_.from.data(),
                     element_force_.data(),
                     ptr_.data(),
                     ind_.data(),
                     mass_.data(),
                     velocity,
                     acceleration,
                     mass_damping_,
                     force_.data()};
  gather_force_kernel<<<blocks_for(3 * vertices_, kThreads), kThreads, 0, gpu_.stream.get()>>>(job);
  call("launch of the gathering of forces", [&] { return cudaGetLastError(); });
  if (!state.there) copy(staged_force_.data(), force_.data(), 3 * vertices_, cudaMemcpyDeviceToHost, gpu_);
}

Offset CudaBody::finish_forces(double load, const double* weight, double* f) {
  const DeviceGuard guard(gpu_.number);
  end();
  const double* from = staged_force_.data();
  gpu_.for_each_range(3 * vertices_, [&](std::int64_t b, std::int64_t e) {
    for (std::int64_t k = b; k < e; ++k) f[k] += from[k] - load * weight[k];
  });
  return inverted();
}

void CudaBody::put_forces(double load, double* f) {
  const DeviceGuard guard(gpu_.number);
  const Offset numbers = 3 * vertices_;
  loaded_kernel<<<blocks_for(numbers, kThreads), kThreads, 0, gpu_.stream.get()>>>(numbers, force_.data(), load,
                                                                                   weight_.data(), f);
  call("launch of the loaded forces", [&] { return cudaGetLastError(); });
}

void CudaBody::start_tangent(const BodyState& state, const TangentWeights& weights, double* values) {
  const DeviceGuard guard(gpu_.number);
  const bool elastic = weights.q != 0 || (weights.v != 0 && stiffness_damping_ != 0);
  begin();
  if (elastic) {
    send(state, stiffness_damping_ != 0, false);
    evaluate(true, weights.q, weights.v);
  } else {
    *staged_inverted_.data() = 0x7f7f7f7f;
  }
  const TangentJob job{entries_,
                       to_pairs_.ptr.data(),
                       to_pairs_.from.data(),
                       elastic ? element_tangent_.data() : nullptr,
                       !(has_velocity_ && stiffness_damping_ != 0),
                       column_.data(),
                       column_start_.data(),
                       shift_.data(),
                       mass_.data(),
                       weights.a + mass_damping_ * weights.v,
                       values};
  gather_tangent_kernel<<<blocks_for(3 * entries_, kThreads), kThreads, 0, gpu_.stream.get()>>>(job);
  call("launch of the gathering of tangents", [&] { return cudaGetLastError(); });
}

Offset CudaBody::finish() {
  const DeviceGuard guard(gpu_.number);
  end();
  return inverted();
}

}  // namespace espalier::dynamics::cuda
