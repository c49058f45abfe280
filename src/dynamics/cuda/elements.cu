
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
__device__ inline Lane magnitude(Lane a) { return Lane(fabs(a.v)); }
__device__ inline Lane larger(Lane a, Lane b) { return Lane(a.v > b.v ? a.v : b.v); }
__device__ inline Lane select(bool mask, Lane yes, Lane no) { return mask ? yes : no; }
__device__ inline bool and_positive(bool mask, Lane a) { return mask && a.v > 0; }
__device__ inline bool mask_and(bool a, bool b) { return a && b; }
__device__ inline bool mask_or(bool a, bool b) { return a || b; }
__device__ inline bool mask_not(bool a) { return !a; }

// Tables of the hexahedra with assumed strains, and of shells.
__constant__ hex8::BlockTables the_tables, the_shell_tables;
__device__ inline const hex8::BlockTables& tables() { return the_tables; }
__device__ inline const hex8::BlockTables& shell_tables() { return the_shell_tables; }

__constant__ CableTables the_cable_tables;
__device__ inline const CableTables& cable_tables() { return the_cable_tables; }

#undef ESPALIER_ANYWHERE
#define ESPALIER_ANYWHERE __device__
#undef ESPALIER_APART
#define ESPALIER_APART __device__ __noinline__
#undef ESPALIER_ROLLED
#define ESPALIER_ROLLED _Pragma("unroll 1")
#include "dynamics/elements/lanes/lane_algebra-inl.hpp"
//
#include "dynamics/elements/lanes/hex8_block-inl.hpp"
//
#include "dynamics/elements/lanes/hex8_strain_points-inl.hpp"
//
#include "dynamics/elements/lanes/hex8_strain_block-inl.hpp"
//
#include "dynamics/elements/lanes/ancf_shell_block-inl.hpp"
//
#include "dynamics/elements/lanes/ancf_cable_block-inl.hpp"
//
#include "dynamics/elements/lanes/solid_block-inl.hpp"

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
__global__ void __launch_bounds__(kThreads) hexahedra_kernel(const ElementsJob job, const Hex8Law law) {
  evaluate_element<hex8::kNodes, kTangent>(
      job, [&](const BlockInput& in, const BlockOutput& out) { return evaluate_block<Lane>(law, in, out) != 0; });
}

// The laws of hex8_strain_points-inl.hpp.
template <bool kTangent>
__global__ void __launch_bounds__(kThreads) strains_kernel(const ElementsJob job, const Hex8Law law) {
  evaluate_element<hex8::kNodes, kTangent>(job, [&](const BlockInput& in, const BlockOutput& out) {
    return evaluate_strain_block<Lane>(law, in, out) != 0;
  });
}

template <bool kTangent>
__global__ void __launch_bounds__(kThreads) shells_kernel(const ElementsJob job, const ShellLaw law) {
  evaluate_element<hex8::kNodes, kTangent>(
      job, [&](const BlockInput& in, const BlockOutput& out) { return evaluate_shell_block<Lane>(law, in, out) != 0; });
}

template <bool kTangent>
__global__ void __launch_bounds__(kThreads) cables_kernel(const ElementsJob job, const CableLaw law) {
  evaluate_element<kCableVertices, kTangent>(
      job, [&](const BlockInput& in, const BlockOutput& out) { return evaluate_cable_block<Lane>(law, in, out) != 0; });
}

template <int kNodes, int kPoints, bool kTangent>
__global__ void __launch_bounds__(kThreads) solid_kernel(const ElementsJob job, const SolidConstants law) {
  const auto& table = *reinterpret_cast<const ShapeTable<kNodes, kPoints>*>(job.table);
  evaluate_element<kNodes, kTangent>(job, [&](const BlockInput& in, const BlockOutput& out) {
    return evaluate_solid_block<Lane, kNodes, kPoints>(law, table, in, out) != 0;
  });
}

// use(nodes, points) with the sizes of ShapeTable as constants.
template <class Use>
auto with_sizes(ElementType type, const Use& use) {
  switch (type) {
#define ESPALIER_CASE(kind, nodes, points) \
  case ElementType::kind:                  \
    return use(std::integral_constant<int, nodes>(), std::integral_constant<int, points>());
    ESPALIER_FOR_SOLIDS(ESPALIER_CASE)
#undef ESPALIER_CASE
    default:
      throw std::invalid_argument("launch_elements: a type that is no simulated solid");
  }
}

// Enqueues the kernel of a kind of elements.
template <bool kTangent>
struct Launch {
  const ElementsJob& job;
  cudaStream_t stream;

  void operator()(const SolidElements& solids) const {
    with_sizes(solids.type,
               [&](auto nodes, auto points) { run(solid_kernel<nodes(), points(), kTangent>, solids.law); });
  }
  void operator()(const Hex8Law& law) const {
    run(law.by_strains() ? strains_kernel<kTangent> : hexahedra_kernel<kTangent>, law);
  }
  void operator()(const ShellLaw& law) const { run(shells_kernel<kTangent>, law); }
  void operator()(const CableLaw& law) const { run(cables_kernel<kTangent>, law); }

 private:
  template <class Law>
  void run(void (*kernel)(ElementsJob, Law), const Law& law) const {
    kernel<<<blocks_for(job.elements, kThreads), kThreads, 0, stream>>>(job, law);
  }
};

// The tables that a kind of elements reads.
struct Upload {
  Gpu& gpu;

  DeviceArray<double> operator()(const SolidElements& solids) const {
    return with_sizes(solids.type, [&](auto nodes, auto points) {
      const auto& table = solid_table<nodes(), points()>(solids.type, solids.rule);
      static_assert(sizeof(table) % sizeof(double) == 0);
      return upload(std::span(reinterpret_cast<const double*>(&table), sizeof(table) / sizeof(double)), gpu);
    });
  }
  DeviceArray<double> operator()(const Hex8Law&) const { return fill(the_tables, kHex8BlockTables); }
  DeviceArray<double> operator()(const ShellLaw&) const { return fill(the_shell_tables, kShellBlockTables); }
  DeviceArray<double> operator()(const CableLaw&) const { return fill(the_cable_tables, kCableTables); }

 private:
  template <class Tables>
  static DeviceArray<double> fill(const Tables& constant, const Tables& tables) {
    call("cudaMemcpyToSymbol", [&] { return cudaMemcpyToSymbol(constant, &tables, sizeof(Tables)); });
    return {};
  }
};

}  // namespace

DeviceArray<double> upload_table(const DeviceLaw& law, Gpu& gpu) { return std::visit(Upload{gpu}, law.of_kind); }

void launch_elements(const ElementsJob& job, cudaStream_t stream) {
  if (job.tangent != nullptr)
    std::visit(Launch<true>{job, stream}, job.law.of_kind);
  else
    std::visit(Launch<false>{job, stream}, job.law.of_kind);
  call("launch of the elements", [&] { return cudaGetLastError(); });
}

}  // namespace espalier::dynamics::cuda
