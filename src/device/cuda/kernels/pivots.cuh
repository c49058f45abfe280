/// \file
/// The symmetric indefinite factorization of one pivot block in registers. The block of threads holds the matrix as a
/// whole, a lane one or two rows and a warp every fourth pair of columns, and a pivot costs one barrier: its row goes
/// through shared memory, where everybody finds the multipliers, the next search and the products in it.
///
/// Nothing is exchanged: rows and columns stay where they are, and rows that have been eliminated stand still. Column c
/// holds A until it is eliminated, then M D (so M needs no second matrix), since what the elimination adds to it is
/// -2 A(r, c) exactly as if its own pivot were twice as large.
///
/// Both triangles are kept, and rounding makes A(r, c) and A(c, r) differ by eps |A|. Where pivots are not much larger
/// than that, M must come from the numbers that the products were made of, those of the pivot's row: see take_row().
#pragma once

#include "device/cuda/kernels/factor/factor_state.cuh"

namespace espalier::device::cuda {

/// The leading 32 bits of |x|, which order magnitudes to within one part in 2^20 (double) or exactly (float).
__device__ inline unsigned magnitude_key(double x) { return static_cast<unsigned>(__double2hiint(x)) & 0x7fffffffu; }
__device__ inline unsigned magnitude_key(float x) { return __float_as_uint(x) & 0x7fffffffu; }
/// The least magnitude with that key.
__device__ inline double magnitude_of(unsigned key, double) { return __hiloint2double(static_cast<int>(key), 0); }
__device__ inline float magnitude_of(unsigned key, float) { return __uint_as_float(key); }
__device__ inline unsigned largest_key(unsigned key) {
#if defined(__CUDA_ARCH__)
  return __reduce_max_sync(0xffffffffu, key);
#else
  return key;
#endif
}

/// 2 / x to one unit in the last place or two, for x and 2 / x that are normal numbers. Volatile, so that it is made
/// where it stands: beside a search that takes as long.
__device__ __forceinline__ double inverse_of_half(double x) {
  double r;
  asm volatile(
      "{\n.reg .f64 r,e,s;\nrcp.approx.ftz.f64 r,%1;\nfma.rn.f64 e,%2,r,%3;\nadd.f64 s,r,r;\nfma.rn.f64 e,e,e,e;\n"
      "fma.rn.f64 %0,s,e,s;\n}"
      : "=d"(r)
      : "d"(x), "d"(-x), "d"(1.0));
  return r;
}
__device__ __forceinline__ float inverse_of_half(float x) { return 2 * __frcp_rn(x); }
__device__ __forceinline__ bool can_be_inverted_fast(double x) { return magnitude_key(x) - 0x00300000u < 0x7f900000u; }
__device__ __forceinline__ bool can_be_inverted_fast(float x) { return magnitude_key(x) - 0x01800000u < 0x7d000000u; }

inline constexpr int kInverseD = 6;  ///< column of the scratch where D^-1 stands afterwards, by order of elimination
inline constexpr int kInverseE = 7;  ///< its subdiagonal

/// L D L^T of a block that is padded to kSize = 4 J rows, J a multiple of 4; a lane holds H of them.
template <class T, int J>
class PivotBlock {
 public:
  static constexpr int kSize = 4 * J;
  static constexpr int kNearOne = 1 << 16;  ///< in replaced_: see kNear
  static constexpr int H = (kSize + 31) / 32;

  /// @param a  lower triangle, column-major; as scratch from now on, kSize rows of columns 0 .. 7
  /// @param n  pivots
  __device__ __forceinline__ PivotBlock(T* a, int lda, int n, T tiny) : a_(a), lda_(lda), n_(n), tiny_(tiny) {
    // Kept in registers: reading the thread's number again and again costs more than the registers.
    lane_ = __shfl_sync(0xffffffffu, static_cast<int>(threadIdx.x) & 31, static_cast<int>(threadIdx.x) & 31);
    warp_ = __shfl_sync(0xffffffffu, static_cast<int>(threadIdx.x) >> 5, 0);
    twice_tiny_ = magnitude_key(2 * tiny);
#pragma unroll
    for (int h = 0; h < H; ++h) {
      const int r = row(h);
      left_[h] = n >= 32 * (h + 1) ? 0xffffffffu : (n > 32 * h ? (1u << (n - 32 * h)) - 1 : 0u);
      twice_[h] = r < n ? 2 * a[r * lda + r] : T(0);
      place_[h] = r;
      stage_[h] = -1;
      inverse_[h] = pivot_[h] = coupling_[h] = T(0);
      partner_[h] = -1;
#pragma unroll
      for (int j = 0; j < J; ++j) {
        const int c = column(j);
        x_[h][j] = r < n && c < n ? (r >= c ? a[c * lda + r] : a[r * lda + c]) : T(0);
      }
    }
    __syncthreads();
  }

  __device__ __forceinline__ void eliminate() {
    int p = lowest();
    for (int turn = 0; done_ < n_; ++turn, p = lowest()) {
      publish(p, line(turn));
      __syncthreads();
      if (try_one(p, line(turn))) continue;
      int other = -1;
      search(p, other, turn);
      if (other < 0)
        eliminate_one(p, line(turn));
      else
        eliminate_two(p, line(turn), other, line(turn - 1));
      __syncthreads();  // the places of all rows are free again
    }
  }

  /// M to m, kSize x kSize, and D^-1 and the pivots to where they are kept. Ends with a barrier.
  template <class Sink>
  __device__ __forceinline__ void store(T* m, int ldm, const Sink& sink) {
    const auto& s = *sink.state;
    T *inverse = a_ + 2 * lda_, *coupling = a_ + 3 * lda_;
    int *stage = reinterpret_cast<int*>(a_ + 4 * lda_), *partner = reinterpret_cast<int*>(a_ + 5 * lda_);
    if (threadIdx.x < 32) {
#pragma unroll
      for (int h = 0; h < H; ++h) {
        const int r = row(h), to = sink.position + place_[h];
        if (r >= kSize) continue;
        inverse[r] = inverse_[h];
        coupling[r] = coupling_[h];
        stage[r] = r < n_ ? stage_[h] : n_;
        partner[r] = partner_[h];
        if (r >= n_) continue;
        a_[kInverseD * lda_ + place_[h]] = inverse_[h];
        a_[kInverseE * lda_ + place_[h]] = place_[h] == stage_[h] ? coupling_[h] : T(0);
        s.inverse_d[to] = inverse_[h];
        s.inverse_e[to] = place_[h] == stage_[h] ? coupling_[h] : T(0);
        s.pivot[to] = pivot_[h];
        if (small_ >> h & 1) s.replaced[to] = 1;
      }
    }
    if (pairs_ > 0) {
#pragma unroll
      for (int h = 0; h < H; ++h)
#pragma unroll
        for (int j = 0; j < J; ++j)
          if (row(h) < kSize) m[column(j) * ldm + row(h)] = x_[h][j];
    }
    __syncthreads();
#pragma unroll
    for (int j = 0; j < J; ++j) {
      const int c = column(j);
      const int since = stage[c], with = partner[c];
      const T factor = inverse[c], other = coupling[c];
#pragma unroll
      for (int h = 0; h < H; ++h) {
        const int r = row(h);
        T v = r == c ? T(1) : T(0);
        if (since < stage_[h]) {
          v = x_[h][j] * factor;
          if (with >= 0) v += m[with * ldm + r] * other;
        }
        x_[h][j] = v;
      }
    }
    if (pairs_ > 0) __syncthreads();
#pragma unroll
    for (int h = 0; h < H; ++h)
#pragma unroll
      for (int j = 0; j < J; ++j)
        if (row(h) < kSize) m[column(j) * ldm + place_[h]] = x_[h][j];
    if (threadIdx.x == 0) {
      if (negative_ > 0) atomicAdd(s.control + kNegative, negative_);
      if (pairs_ > 0) atomicAdd(s.control + kTwoByTwo, pairs_);
      if ((replaced_ & kNearOne) != 0) s.control[kNear] = 1;
      if ((replaced_ & ~kNearOne) > 0) atomicAdd(s.control + kReplaced, replaced_ & ~kNearOne);
    }
    __syncthreads();
  }

 private:
  __device__ __forceinline__ int row(int h) const { return lane_ + 32 * h; }
  __device__ __forceinline__ int column(int j) const { return ((j >> 1) * 4 + warp_) * 2 + (j & 1); }
  __device__ __forceinline__ static T alpha() { return T(0.6403882032022076); }  // (1 + sqrt 17) / 8
  __device__ __forceinline__ static T magnitude(T x) { return x < T(0) ? -x : x; }
  __device__ __forceinline__ T* line(int turn) const { return a_ + (turn & 1) * lda_; }
  __device__ __forceinline__ bool waits(int h) const { return (left_[h] >> lane_ & 1) != 0; }

  /// All rows 32 h + l but p; no branch, which the compiler would make an address of.
  __device__ __forceinline__ static unsigned without(int h, int p) {
    return (H == 1 || p >> 5 == h) ? ~(1u << (p & 31)) : 0xffffffffu;
  }
  __device__ __forceinline__ int lowest() const {
    return H == 1 || left_[0] != 0 ? __ffs(static_cast<int>(left_[0])) - 1 : 31 + __ffs(static_cast<int>(left_[H - 1]));
  }

  /// Row p to shared memory, its diagonal element doubled.
  __device__ __forceinline__ void publish(int p, T* line) const {
    if (lane_ != (p & 31)) return;
    const bool low = H == 1 || p < 32;
#pragma unroll
    for (int j = 0; j < J; j += 2) {
      PairOf<T> word;
      word.x = low ? x_[0][j] : x_[H - 1][j];
      word.y = low ? x_[0][j + 1] : x_[H - 1][j + 1];
      *reinterpret_cast<PairOf<T>*>(line + column(j)) = word;
    }
    if ((p >> 1 & 3) == warp_) line[p] = low ? twice_[0] : twice_[H - 1];
  }

  /// This lane's largest key, plus 1, in a published row without its element p.
  __device__ __forceinline__ unsigned own_key(const T* line, int p) const {
    unsigned key = 0;
#pragma unroll
    for (int h = 0; h < H; ++h)
      if (waits(h) && row(h) != p) key = max(key, magnitude_key(line[row(h)]) + 1);
    return key;
  }
  __device__ __forceinline__ int row_of_key(const T* line, int p, unsigned key) const {
    int found = -1;
#pragma unroll
    for (int h = H - 1; h >= 0; --h) {
      const bool is = waits(h) && row(h) != p && magnitude_key(line[row(h)]) + 1 == key;
      const unsigned who = __ballot_sync(0xffffffffu, is);
      if (who != 0) found = 32 * h + __ffs(static_cast<int>(who)) - 1;
    }
    return found;
  }

  /// The usual case, in one straight run without a branch before the products: row p, which is published, is a pivot of
  /// its own beyond doubt. Magnitudes are compared by their leading bits, while the inverse is being made.
  __device__ __forceinline__ bool try_one(int p, const T* line) {
    const T twice = line[p];
    T v[H];
    unsigned key = 0;
#pragma unroll
    for (int h = 0; h < H; ++h) {
      v[h] = row(h) < kSize ? line[row(h)] : T(0);
      if (!waits(h) || row(h) == p) v[h] = T(0);
      key = max(key, magnitude_key(v[h] * (2 * alpha())));
    }
    PairOf<T> b[J / 2];
#pragma unroll
    for (int j = 0; j < J; j += 2) b[j / 2] = *reinterpret_cast<const PairOf<T>*>(line + column(j));
    const T inverse = inverse_of_half(twice);
    const unsigned best = largest_key(key), own = magnitude_key(twice);
    if (own <= max(best, twice_tiny_) || !can_be_inverted_fast(twice)) return false;
#pragma unroll
    for (int h = 0; h < H; ++h) {
      const T l = v[h] * inverse;
#pragma unroll
      for (int j = 0; j < J; j += 2) {
        x_[h][j] = fma(-l, b[j / 2].x, x_[h][j]);
        x_[h][j + 1] = fma(-l, b[j / 2].y, x_[h][j + 1]);
      }
      twice_[h] = fma(-l, 2 * v[h], twice_[h]);
      note(h, p, inverse, twice / 2);
    }
    take_row(p, v);
    negative_ += twice < T(0) ? 1 : 0;
    ++done_;
    return true;
  }

  /// Column p becomes what the elimination of p makes of row p, -v; v is zero but for rows that wait.
  __device__ __forceinline__ void take_row(int p, const T (&v)[H]) {
    if ((p >> 1 & 3) != warp_) return;
    const int own = (p >> 3) * 2 + (p & 1);
#pragma unroll
    for (int j = 0; j < J; ++j)
#pragma unroll
      for (int h = 0; h < H; ++h) x_[h][j] = j == own ? -v[h] : x_[h][j];
  }

  /// Row p has been eliminated, alone.
  __device__ __forceinline__ void note(int h, int p, T inverse, T pivot) {
    if (row(h) == p) {
      place_[h] = stage_[h] = done_;
      inverse_[h] = inverse;
      pivot_[h] = pivot;
    }
    left_[h] &= without(h, p);
  }

  /// Bounded Bunch-Kaufman ("rook") search (Ashcraft, Grimes, Lewis 1998) from row p on, which is published and not a
  /// pivot of its own. On return p, and for a pair the other one, are the pivot; the row of p is the last published, of
  /// other the one before. Everybody finds the same.
  __device__ __forceinline__ void search(int& p, int& other, int& turn) {
    unsigned best = largest_key(own_key(line(turn), p));
    if (best == 0 || magnitude(line(turn)[p] / 2) >= alpha() * magnitude_of(best - 1, T())) return;
    if (!(magnitude_of(best - 1, T()) >= tiny_) && !(magnitude(line(turn)[p] / 2) >= tiny_)) return;
    if (magnitude_of(best - 1, T()) < T(kNearTiny) * tiny_) replaced_ |= kNearOne;  // another rule might stop here
    for (int step = 0; step < n_; ++step) {
      const int r = row_of_key(line(turn), p, best);
      ++turn;
      publish(r, line(turn));
      __syncthreads();
      const unsigned key = largest_key(own_key(line(turn), r));
      const bool single = magnitude(line(turn)[r] / 2) >= alpha() * magnitude_of(key - 1, T());
      if (!single && key <= best) other = p;
      p = r;
      best = key;
      if (single || other >= 0) break;
    }
  }

  __device__ __forceinline__ void eliminate_one(int p, T* line) {
    T d = line[p] / 2;
    const bool small = !(magnitude(d) >= tiny_) || d == T(0);
    if (small) {  // see acceptable_pivot()
      const T least = tiny_ > T(0) ? tiny_ : T(1e-30);
      d = d < T(0) ? -least : least;
      ++replaced_;
      __syncthreads();
      if (threadIdx.x == 0) line[p] = 2 * d;
      __syncthreads();
    } else {
      negative_ += d < T(0) ? 1 : 0;
    }
    const T inverse = T(1) / d;
    T v[H];
#pragma unroll
    for (int h = 0; h < H; ++h) {
      v[h] = waits(h) && row(h) != p ? line[row(h)] : T(0);
      const T l = v[h] * inverse;
      twice_[h] = fma(-2 * l, v[h], twice_[h]);
#pragma unroll
      for (int j = 0; j < J; ++j) x_[h][j] = fma(-l, line[column(j)], x_[h][j]);
      if (row(h) == p && small) small_ |= 1 << h;
      note(h, p, inverse, d);
    }
    take_row(p, v);
    ++done_;
  }

  __device__ __forceinline__ void eliminate_two(int p, T* line_p, int q, T* line_q) {
    const T x = line_p[p] / 2, y = line_p[q], z = line_q[q] / 2;
    // inverse of [x y; y z] with y the largest: 1 / (y (x z / y^2 - 1)) [z/y -1; -1 x/y]
    const T xy = x / y, zy = z / y, scale = T(1) / (y * (xy * zy - T(1)));
    const T dx = scale * zy, dz = scale * xy, e = -scale;
    const T det = x * z - y * y;
    negative_ += det < T(0) ? 1 : (x < T(0) ? 2 : 0);
    ++pairs_;
    __syncthreads();
    if (threadIdx.x == 0) {
      line_p[q] *= 2;
      line_q[p] = line_p[q];
    }
    __syncthreads();
    T u[H], v[H], l1[H], l2[H];
#pragma unroll
    for (int h = 0; h < H; ++h) {
      const int r = row(h);
      const bool other = waits(h) && r != p && r != q;
      u[h] = other ? line_p[r] : T(0);
      v[h] = other ? line_q[r] : T(0);
      l1[h] = u[h] * dx + v[h] * e;
      l2[h] = u[h] * e + v[h] * dz;
      twice_[h] -= 2 * (l1[h] * u[h] + l2[h] * v[h]);
      if (r == p || r == q) {
        place_[h] = r == p ? done_ : done_ + 1;
        stage_[h] = done_;
        inverse_[h] = r == p ? dx : dz;
        coupling_[h] = e;
        partner_[h] = r == p ? q : p;
        pivot_[h] = r == p ? det : T(1);
      }
      left_[h] &= without(h, p);
      left_[h] &= without(h, q);
    }
#pragma unroll
    for (int j = 0; j < J; ++j) {
      const T b = line_p[column(j)], c = line_q[column(j)];
#pragma unroll
      for (int h = 0; h < H; ++h) x_[h][j] -= l1[h] * b + l2[h] * c;
    }
    take_row(p, u);
    take_row(q, v);
    done_ += 2;
  }

  T* a_;
  int lda_, n_, lane_, warp_;
  unsigned twice_tiny_;  // leading bits
  T tiny_;
  T x_[H][J];                // rows of A, then of M D
  T twice_[H];               // diagonal of A, doubled
  T inverse_[H], pivot_[H];  // of rows that are eliminated
  T coupling_[H];            // of pairs: off-diagonal element of the inverse of D's block
  int place_[H];             // in the order of elimination
  int stage_[H];             // place of the first of a pair; -1: not eliminated
  int partner_[H];           // of a pair; else -1
  unsigned left_[H];         // bit l: row 32 h + l is not eliminated yet
  int done_ = 0, negative_ = 0, pairs_ = 0, replaced_ = 0, small_ = 0;
};

}  // namespace espalier::device::cuda
