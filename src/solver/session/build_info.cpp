#include "solver/session/build_info.hpp"

#include <fmt/format.h>
#include <hwy/base.h>
#include <hwy/highway.h>
#include <zlib.h>

#include "device/registry.hpp"

namespace espalier::solver {

namespace {

std::string compiler_name() {
#if defined(__clang__)
  return fmt::format("clang {}.{}.{}", __clang_major__, __clang_minor__, __clang_patchlevel__);
#elif defined(__GNUC__)
  return fmt::format("gcc {}.{}.{}", __GNUC__, __GNUC_MINOR__, __GNUC_PATCHLEVEL__);
#else
  return "unknown compiler";
#endif
}

}  // namespace

const char* version() { return ESPALIER_VERSION; }

BuildInfo build_info() {
  BuildInfo info;
  info.version = ESPALIER_VERSION;
  info.build_type = ESPALIER_BUILD_TYPE;
  info.compiler = compiler_name();
  info.flags = ESPALIER_BUILD_FLAGS;
  info.processor = ESPALIER_PROCESSOR;
  info.sanitizers = ESPALIER_SANITIZE;
  for (const device::Backend* b : device::registry().backends) info.backends.emplace_back(b->name());
  info.libraries = {
      {"Highway", fmt::format("{}.{}.{}", HWY_MAJOR, HWY_MINOR, HWY_PATCH)},
      {"fmt", fmt::format("{}.{}.{}", FMT_VERSION / 10000, FMT_VERSION / 100 % 100, FMT_VERSION % 100)},
      {"zlib", ZLIB_VERSION},
  };
  return info;
}

}  // namespace espalier::solver
