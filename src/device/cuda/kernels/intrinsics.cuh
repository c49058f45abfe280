/// \file
/// Thin wrappers over the PTX that the kernels use. Everything that depends on the architecture stands here: bulk
/// copies with transaction barriers from sm_90 on, plain copies before; FP64 tensor cores from sm_80 on.
#pragma once

#include <cstdint>

#include "device/cuda/tables/tables.hpp"

namespace espalier::device::cuda {

#if defined(__CUDA_ARCH__) && __CUDA_ARCH__ >= 900
#define ESPALIER_BULK_COPIES 1
#else
#define ESPALIER_BULK_COPIES 0
#endif

// Products by a whole warpgroup belong to sm_90a alone; nothing newer or older has them.
#if defined(__CUDA_ARCH_FEAT_SM90_ALL)
#define ESPALIER_WARPGROUP_PRODUCTS 1
#else
#define ESPALIER_WARPGROUP_PRODUCTS 0
#endif

__device__ inline unsigned shared_address(const void* p) { return static_cast<unsigned>(__cvta_generic_to_shared(p)); }

/// The same number in all threads, as the compiler then knows: products of a warpgroup must not stand in branches that
/// threads could take differently.
__device__ inline int uniform(int x) { return __shfl_sync(0xffffffffu, x, 0); }

// ---- flags between blocks ---------------------------------------------------------------------------------------

/// Flags lie in the memory of the device that waits for them; they may be set by another one.
__device__ inline int load_acquire(const int* p) {
  int v;
  asm volatile("ld.acquire.sys.global.s32 %0,[%1];" : "=r"(v) : "l"(p) : "memory");
  return v;
}
__device__ inline int load_relaxed(const int* p) {
  int v;
  asm volatile("ld.relaxed.gpu.global.s32 %0,[%1];" : "=r"(v) : "l"(p) : "memory");
  return v;
}
__device__ inline void store_release(int* p, int v) {
  asm volatile("st.release.gpu.global.s32 [%0],%1;" ::"l"(p), "r"(v) : "memory");
}
__device__ inline void store_relaxed(int* p, int v) {
  asm volatile("st.relaxed.gpu.global.s32 [%0],%1;" ::"l"(p), "r"(v) : "memory");
}
/// As fence_devices(), for this device.
__device__ inline void fence_device() { asm volatile("fence.acq_rel.gpu;" ::: "memory"); }
/// Orders everything that this block of threads has written (as far as a barrier has brought it to this thread's
/// knowledge) before what this thread writes from now on, for all devices.
__device__ inline void fence_devices() { asm volatile("fence.acq_rel.sys;" ::: "memory"); }
__device__ inline void store_relaxed_devices(int* p, int v) {
  asm volatile("st.relaxed.sys.global.s32 [%0],%1;" ::"l"(p), "r"(v) : "memory");
}
template <class U>
__device__ inline void store_pointer_devices(U** p, U* v) {
  asm volatile("st.relaxed.sys.global.u64 [%0],%1;" ::"l"(p), "l"(v) : "memory");
}
__device__ inline int claim_devices(int* p, int v) {
  int before;
  asm volatile("atom.acq_rel.sys.global.cas.b32 %0,[%1],0,%2;" : "=r"(before) : "l"(p), "r"(v) : "memory");
  return before;
}
__device__ inline void add_relaxed(int* p, int v) {
  asm volatile("red.relaxed.gpu.global.add.s32 [%0],%1;" ::"l"(p), "r"(v) : "memory");
}
__device__ inline std::uint64_t global_nanoseconds() {
  std::uint64_t t;
  asm volatile("mov.u64 %0,%%globaltimer;" : "=l"(t));
  return t;
}

/// Orders this thread's ordinary accesses to shared memory with those of the copy engine and the tensor cores.
__device__ inline void fence_shared() {
#if ESPALIER_BULK_COPIES
  asm volatile("fence.proxy.async.shared::cta;" ::: "memory");
#endif
}
/// Orders this thread's ordinary accesses to global memory with the copy engine's. (The fence for both memories at once
/// waits until all that the thread has written has reached the L2 cache, which takes most of a microsecond.)
__device__ inline void fence_global() {
#if ESPALIER_BULK_COPIES
  asm volatile("fence.proxy.async.global;" ::: "memory");
#endif
}

// ---- copies into shared memory that complete on a barrier -----------------------------------------------------------

__device__ inline void barrier_init(std::uint64_t* bar) {
#if ESPALIER_BULK_COPIES
  asm volatile("mbarrier.init.shared.b64 [%0],1;" ::"r"(shared_address(bar)) : "memory");
#endif
}
__device__ inline void barrier_expect(std::uint64_t* bar, unsigned bytes) {
#if ESPALIER_BULK_COPIES
  asm volatile("mbarrier.arrive.expect_tx.shared.b64 _,[%0],%1;" ::"r"(shared_address(bar)), "r"(bytes) : "memory");
#endif
}
__device__ inline void bulk_copy(void* to, const void* from, unsigned bytes, std::uint64_t* bar) {
#if ESPALIER_BULK_COPIES
  asm volatile(
      "cp.async.bulk.shared::cluster.global.mbarrier::complete_tx::bytes [%0],[%1],%2,[%3];" ::"r"(shared_address(to)),
      "l"(from), "r"(bytes), "r"(shared_address(bar))
      : "memory");
#endif
}
__device__ inline void barrier_wait(std::uint64_t* bar, unsigned parity) {
#if ESPALIER_BULK_COPIES
  asm volatile(
      "{\n.reg .pred done;\nWAIT:\nmbarrier.try_wait.parity.shared.b64 done,[%0],%1;\n@done bra END;\nbra "
      "WAIT;\nEND:\n}" ::"r"(shared_address(bar)),
      "r"(parity)
      : "memory");
#endif
}

// ---- products ------------------------------------------------------------------------------------------------------

/// Two neighbouring elements, loaded and stored as one word.
template <class T>
struct Pair;
template <>
struct Pair<double> {
  using type = double2;
};
template <>
struct Pair<float> {
  using type = float2;
};
template <class T>
using PairOf = typename Pair<T>::type;

/// One element of shared memory by a load of its own, at an address as shared_address() gives it.
__device__ inline double load_element(unsigned address, double) {
  double v;
  asm volatile("ld.shared.f64 %0,[%1];" : "=d"(v) : "r"(address));
  return v;
}
/// c (16 x 8) += a (16 x 16) b (16 x 8). Lane (g, t) = (lane / 4, lane % 4) holds a[u] = A(g + 8 (u & 1), 4 (u >> 1) +
/// t), b[u] = B(4 u + t, g), c[e] = C(g + 8 (e >> 1), 2 t + (e & 1)).
__device__ inline void multiply_add(double (&c)[4], const double (&a)[8], const double (&b)[4]) {
#if defined(__CUDA_ARCH__) && __CUDA_ARCH__ >= 900
  asm volatile(
      "mma.sync.aligned.m16n8k16.row.col.f64.f64.f64.f64 "
      "{%0,%1,%2,%3},{%4,%5,%6,%7,%8,%9,%10,%11},{%12,%13,%14,%15},{%0,"
      "%1,%2,%3};"
      : "+d"(c[0]), "+d"(c[1]), "+d"(c[2]), "+d"(c[3])
      : "d"(a[0]), "d"(a[1]), "d"(a[2]), "d"(a[3]), "d"(a[4]), "d"(a[5]), "d"(a[6]), "d"(a[7]), "d"(b[0]), "d"(b[1]),
        "d"(b[2]), "d"(b[3]));
#elif defined(__CUDA_ARCH__)
#pragma unroll
  for (int u = 0; u < 4; ++u)
#pragma unroll
    for (int h = 0; h < 2; ++h)
      asm volatile("mma.sync.aligned.m8n8k4.row.col.f64.f64.f64.f64 {%0,%1},{%2},{%3},{%0,%1};"
                   : "+d"(c[2 * h]), "+d"(c[2 * h + 1])
                   : "d"(a[2 * u + h]), "d"(b[u]));
#endif
}

/// A float as the sum of two that the tensor cores take whole (11 bits of significand each).
struct Split {
  unsigned high, low;
};
__device__ inline Split split(float x) {
  Split s;
  asm("cvt.rna.tf32.f32 %0,%1;" : "=r"(s.high) : "f"(x));
  asm("cvt.rna.tf32.f32 %0,%1;" : "=r"(s.low) : "f"(x - __uint_as_float(s.high)));
  return s;
}
__device__ inline void multiply_add_tf32(float (&c)[4], const unsigned (&a)[4], const unsigned (&b)[2]) {
  asm volatile("mma.sync.aligned.m16n8k8.row.col.f32.tf32.tf32.f32 {%0,%1,%2,%3},{%4,%5,%6,%7},{%8,%9},{%0,%1,%2,%3};"
               : "+f"(c[0]), "+f"(c[1]), "+f"(c[2]), "+f"(c[3])
               : "r"(a[0]), "r"(a[1]), "r"(a[2]), "r"(a[3]), "r"(b[0]), "r"(b[1]));
}
/// FP32 by three products of TF32 parts (Markidis et al. 2018; the product of the low parts is below rounding).
__device__ inline void multiply_add(float (&c)[4], const float (&a)[8], const float (&b)[4]) {
#pragma unroll
  for (int h = 0; h < 2; ++h) {
    unsigned ah[4], al[4], bh[2], bl[2];
#pragma unroll
    for (int u = 0; u < 4; ++u) {
      const Split s = split(a[4 * h + u]);
      ah[u] = s.high;
      al[u] = s.low;
    }
#pragma unroll
    for (int u = 0; u < 2; ++u) {
      const Split s = split(b[2 * h + u]);
      bh[u] = s.high;
      bl[u] = s.low;
    }
    multiply_add_tf32(c, al, bh);
    multiply_add_tf32(c, ah, bl);
    multiply_add_tf32(c, ah, bh);
  }
}

__device__ inline double inverse_square_root(double x) { return rsqrt(x); }
__device__ inline float inverse_square_root(float x) { return 1.0f / sqrtf(x); }

}  // namespace espalier::device::cuda
