#include "dynamics/model/fmu/library.hpp"

#include <dlfcn.h>
#include <fmt/format.h>
#include <link.h>

#include <algorithm>
#include <filesystem>
#include <memory>

#include "espalier/types.hpp"

namespace espalier::dynamics::model {
namespace {

namespace fs = std::filesystem;

constexpr const char* kLibrary = "espalier_fmu.so";
constexpr const char* kLicenses = "espalier_fmu_licenses";

[[noreturn]] void refuse_library(const std::string& what) { throw Error(StatusCode::invalid_input, what); }

/// The program or library that this code is part of.
fs::path own_file() {
  Dl_info info = {};
  if (::dladdr(reinterpret_cast<const void*>(&find_fmu_library), &info) == 0 || info.dli_fname == nullptr) return {};
  std::error_code error;
  const fs::path program = fs::read_symlink("/proc/self/exe", error);
  const fs::path named = fs::canonical(info.dli_fname, error);  // of a program: as it was called
  return named.empty() ? program : named;
}

/// What glibc and GCC bring, on every system.
bool of_system(std::string_view name) {
  for (const std::string_view known : {"libc.so", "libm.so", "libdl.so", "librt.so", "libpthread.so", "libstdc++.so",
                                       "libgcc_s.so", "ld-linux", "libmvec.so", "libasan.so", "libubsan.so"})
    if (name.starts_with(known)) return true;
  return false;
}

struct CloseLibrary {
  void operator()(void* handle) const { ::dlclose(handle); }
};
using LoadedLibrary = std::unique_ptr<void, CloseLibrary>;

LoadedLibrary load_library(const std::string& path, int flags) {
  LoadedLibrary handle(::dlopen(path.c_str(), RTLD_LAZY | RTLD_LOCAL | flags));
  if (handle) return handle;
  const char* why = ::dlerror();
  refuse_library(
      fmt::format("{}: the library of FMUs cannot be loaded: {}", path, why == nullptr ? "no reason given" : why));
}

const link_map& map_of(const LoadedLibrary& library) {
  link_map* map = nullptr;
  if (::dlinfo(library.get(), RTLD_DI_LINKMAP, &map) != 0 || map == nullptr)
    refuse_library("the system does not tell where libraries lie");
  return *map;
}

/// Names that a library asks for.
std::vector<std::string> needed_by(const link_map& map) {
  std::vector<std::string> names;
  const char* texts = nullptr;
  for (const ElfW(Dyn)* entry = map.l_ld; entry->d_tag != DT_NULL; ++entry)
    if (entry->d_tag == DT_STRTAB) texts = reinterpret_cast<const char*>(entry->d_un.d_ptr);  // glibc: an address
  for (const ElfW(Dyn)* entry = map.l_ld; texts != nullptr && entry->d_tag != DT_NULL; ++entry)
    if (entry->d_tag == DT_NEEDED) names.emplace_back(texts + entry->d_un.d_val);
  return names;
}

}  // namespace

std::string find_fmu_library(const std::string& given) {
  std::error_code error;
  if (!given.empty()) {
    if (!fs::is_regular_file(given, error)) refuse_library(fmt::format("{}: there is no such library of FMUs", given));
    return given;
  }
  const fs::path folder = own_file().parent_path();
  // Build: beside the program, two folders above Python's extension. Installation: lib/espalier beside bin. Package of
  // Python: espalier/lib, beside espalier/bin and below the extension.
  for (const char* place :
       {".", "../..", "../lib/espalier", "../lib64/espalier", "lib", "../lib", "../espalier/lib", "../../espalier/lib"})
    if (const fs::path at = folder / place / kLibrary; fs::is_regular_file(at, error))
      return fs::canonical(at, error).string();
  refuse_library(
      fmt::format("{} is not there, beside {} or in the library folder of an installation; build it (cmake --build "
                  "build/release --target espalier_fmu), or name it (--library PATH, FmuOptions::library)",
                  kLibrary, folder.string()));
}

std::vector<std::pair<std::string, std::string>> fmu_binaries(const std::string& library, const std::string& name) {
  std::vector<std::pair<std::string, std::string>> found;
  const LoadedLibrary own = load_library(library, 0);
  std::vector<std::string> wanted = needed_by(map_of(own));
  for (std::size_t k = 0; k < wanted.size(); ++k) {
    if (of_system(wanted[k])) continue;
    const LoadedLibrary other = load_library(wanted[k], RTLD_NOLOAD);
    const link_map& map = map_of(other);
    found.emplace_back(wanted[k], map.l_name);
    for (const std::string& next : needed_by(map))
      if (std::find(wanted.begin(), wanted.end(), next) == wanted.end()) wanted.push_back(next);
  }
  found.insert(found.begin(), {name, library});
  return found;
}

std::vector<std::pair<std::string, std::string>> fmu_licenses(const std::string& library) {
  const fs::path folder = fs::path(library).parent_path() / kLicenses;
  std::vector<std::pair<std::string, std::string>> found;
  std::error_code error;
  for (auto it = fs::directory_iterator(folder, error); !error && it != fs::directory_iterator(); it.increment(error))
    found.emplace_back(it->path().filename().string(), it->path().string());
  std::sort(found.begin(), found.end());
  if (std::none_of(found.begin(), found.end(), [](const auto& f) { return f.first == "license.txt"; }))
    refuse_library(
        fmt::format("{}: the licences of the library of FMUs are not there, which go into each of them; the build and "
                    "installations lay them beside the library",
                    folder.string()));
  return found;
}

}  // namespace espalier::dynamics::model
