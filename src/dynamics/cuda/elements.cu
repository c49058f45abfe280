
#include <cmath>
#include <stdexcept>

#include "dynamics/cuda/elements.hpp"
#include "dynamics/elements/anywhere.hpp"

namespace espalier::dynamics::cuda {

namespace {

/// One element of a row of kRow. See lane_algebra-inl.hpp.
struct Lane {
  using Mask = bool;
  static constexpr int kWidth = kRow;
  double v;
  Lane() = default;
  __device__ explicit Lane(double x) : v(x) {}
  static __device__ Lane load(const double* from) { return Lane(*from); }
  __device__ void store(double* to) const { *to = v; }
  static __device__ Mask all() { return true; }
  static __device__ unsigned bits(Mask mask) { return mask ? 1 : 0; }
};
__device__ inline Lane operator+(Lane a, Lane b) { return Lane(a.v + b.v); }
__device__ inline Lane operator-(Lane a, Lane b) { return Lane(a.v - b.v); }
__device__ inline Lane operator*(Lane a, Lane b) { return Lane(a.v * b.v); }
__device__ inline Lane operator/(Lane a, Lane b) { return Lane(a.v / b.v); }
__device__ inline Lane mul_add(Lane a, Lane b, Lane c) { return Lane(fma(a.v, b.v, c.v)); }
__device__ inline Lane square_root(Lane a) { return Lane(sqrt(a.v)); }
__device__ inline Lane log_one_plus(Lane a) { return Lane(log1p(a.v)); }
__device__ inline bool and_positive(bool mask, Lane a) { return mask && a.v > 0; }

// Of the hexahedra with assumed strains.
__constant__ hex8::BlockTables the_tables;
__device__ inline const hex8::BlockTables& tables() { return the_tables; }

#undef ESPALIER_ANYWHERE
#define ESPALIER_ANYWHERE __device__
#include "dynamics/elements/lane_algebra-inl.hpp"
//
#include "dynamics/elements/hex8_block-inl.hpp"
//
#include "dynamics/elements/solid_block-inl.hpp"

constexpr int kThreads = 64;

// evaluate(input, output) of one element. @return whether it is whole
template <int kNodes, bool kTangent, class Evaluate>
__device__ void evaluate_element(const ElementsJob& job, const Evaluate& evaluate) {
  const Index e = static_cast<Index>(blockIdx.x) * kThreads + static_cast<Index>(threadIdx.x);
  if (e >= job.elements) return;
  constexpr int kNumbers = 3 * kNodes;
  const Offset lane = e % kRow, at = Offset{e / kRow} * kNumbers * kRow + lane,
               block = Offset{e / kRow} * kNumbers * kNumbers * kRow + lane;
  double energy;
  const BlockInput in{job.reference + at, job.position + at,   job.velocity == nullptr ? nullptr : job.velocity + at,
                      job.damping,        job.position_weight, job.velocity_weight};
  const BlockOutput out{job.force + at, kTangent ? job.tangent + block : nullptr, &energy};
  if (evaluate(in, out)) return;
  atomicMin(job.inverted, job.first + e);
  for (int k = 0; k < kNumbers; ++k) out.force[k * kRow] = NAN;
  for (int k = 0; k < kNumbers * kNumbers && kTangent; ++k) out.tangent[k * kRow] = NAN;
}

template <bool kTangent>
__global__ void __launch_bounds__(kThreads) assumed_strain_kernel(const ElementsJob job) {
  evaluate_element<hex8::kNodes, kTangent>(job, [&](const BlockInput& in, const BlockOutput& out) {
    return evaluate_block<Lane>(job.law.hexahedra, in, out) != 0;
  });
}

template <int kNodes, int kPoints, bool kTangent>
__global__ void __launch_bounds__(kThreads) solid_kernel(const ElementsJob job) {
  const auto& table = *reinterpret_cast<const ShapeTable<kNodes, kPoints>*>(job.table);
  evaluate_element<kNodes, kTangent>(job, [&](const BlockInput& in, const BlockOutput& out) {
    return evaluate_solid_block<Lane, kNodes, kPoints>(job.law.solid, table, in, out) != 0;
  });
}

// use(nodes, points) with the sizes of ShapeTable as constants.
template <class Use>
auto with_sizes(ElementType type, const Use& use) {
  switch (type) {
    case ElementType::tet4:
      return use(std::integral_constant<int, 4>(), std::integral_constant<int, 4>());
    case ElementType::tet10:
      return use(std::integral_constant<int, 10>(), std::integral_constant<int, 14>());
    case ElementType::hex8:
      return use(std::integral_constant<int, 8>(), std::integral_constant<int, 8>());
    case ElementType::hex20:
      return use(std::integral_constant<int, 20>(), std::integral_constant<int, 27>());
    default:
      throw std::invalid_argument("launch_elements: a type that is no simulated solid");
  }
}

template <bool kTangent>
void launch(const ElementsJob& job, cudaStream_t stream) {
  const unsigned blocks = blocks_for(job.elements, kThreads);
  if (job.law.assumed_strain)
    assumed_strain_kernel<kTangent><<<blocks, kThreads, 0, stream>>>(job);
  else
    with_sizes(job.law.type, [&](auto nodes, auto points) {
      solid_kernel<nodes(), points(), kTangent><<<blocks, kThreads, 0, stream>>>(job);
    });
}

}  // namespace

DeviceArray<double> upload_table(const DeviceLaw& law, Gpu& gpu) {
  if (law.assumed_strain) {
    call("cudaMemcpyToSymbol",
         [&] { return cudaMemcpyToSymbol(the_tables, &kHex8BlockTables, sizeof(hex8::BlockTables)); });
    return {};
  }
  return with_sizes(law.type, [&](auto nodes, auto points) {
    const auto& table = solid_table<nodes(), points()>(law.type, law.rule);
    static_assert(sizeof(table) % sizeof(double) == 0);
    return upload(std::span(reinterpret_cast<const double*>(&table), sizeof(table) / sizeof(double)), gpu);
  });
}

void launch_elements(const ElementsJob& job, cudaStream_t stream) {
  if (job.tangent != nullptr)
    launch<true>(job, stream);
  else
    launch<false>(job, stream);
  call("launch of the elements", [&] { return cudaGetLastError(); });
}

}  // namespace espalier::dynamics::cuda
