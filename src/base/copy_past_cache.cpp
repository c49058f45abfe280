#include "base/copy_past_cache.hpp"

#include <cstdint>
#include <cstring>

#if defined(__SSE2__)
#include <emmintrin.h>
#endif

namespace espalier::base {

void copy_past_cache(void* to, const void* from, std::size_t bytes) {
#if defined(__SSE2__)
  auto* out = static_cast<std::byte*>(to);
  const auto* in = static_cast<const std::byte*>(from);
  constexpr std::size_t kLine = 64;
  const std::size_t misaligned = reinterpret_cast<std::uintptr_t>(out) % kLine;
  if (bytes < 16 * kLine) {
    std::memcpy(out, in, bytes);
    return;
  }
  if (misaligned != 0) {
    const std::size_t head = kLine - misaligned;
    std::memcpy(out, in, head);
    out += head;
    in += head;
    bytes -= head;
  }
  for (; bytes >= kLine; bytes -= kLine, in += kLine, out += kLine) {
    __m128i v[4];
    for (int k = 0; k < 4; ++k) v[k] = _mm_loadu_si128(reinterpret_cast<const __m128i*>(in) + k);
    for (int k = 0; k < 4; ++k) _mm_stream_si128(reinterpret_cast<__m128i*>(out) + k, v[k]);
  }
  _mm_sfence();
  std::memcpy(out, in, bytes);
#else
  std::memcpy(to, from, bytes);
#endif
}

}  // namespace espalier::base
