#include "rivals/shared_library.hpp"

#include <dlfcn.h>

#include <cstdlib>
#include <filesystem>

#include "rivals/rival.hpp"

namespace espalier::bench {
namespace {

/// Folders to look into, each with its closing slash; the empty one stands for the loader's own path.
std::vector<std::string> search_folders() {
  std::vector<std::string> folders;
  if (const char* chosen = std::getenv("ESPALIER_RIVALS_DIR")) {
    folders.push_back(std::string(chosen) + "/lib/");
    folders.push_back(std::string(chosen) + "/");
  }
  // libexec/espalier/espalier_rival_host of the bundle
  std::error_code none;
  const std::filesystem::path own = std::filesystem::read_symlink("/proc/self/exe", none).parent_path();
  folders.push_back((own / "../../lib/rivals/").string());
  folders.emplace_back(ESPALIER_RIVALS_DEFAULT_DIR "/lib/");
  folders.emplace_back("");
  folders.emplace_back("/usr/local/cuda/lib64/");
  return folders;
}

}  // namespace

SharedLibrary::SharedLibrary(const std::vector<std::string>& names, Scope scope) {
  const int flags = RTLD_LAZY | (scope == Scope::global ? RTLD_GLOBAL : RTLD_LOCAL);
  std::string reason;
  for (const std::string& name : names) {
    for (const std::string& folder : search_folders()) {
      path_ = folder + name;
      handle_ = dlopen(path_.c_str(), flags);
      if (handle_ != nullptr) return;
      const char* error = dlerror();
      // The loader's complaint about a file that exists tells more than "no such file".
      if (reason.empty() || std::string(error).find("No such file") == std::string::npos) reason = error;
    }
  }
  throw Failure(Outcome::missing, names.front() + " cannot be loaded (" + reason + "); run scripts/get_rivals.sh");
}

void* SharedLibrary::optional_address(const char* name) const { return dlsym(handle_, name); }

void* SharedLibrary::address(const char* name) const {
  void* found = optional_address(name);
  if (found == nullptr) throw Failure(Outcome::missing, path_ + " has no function " + name);
  return found;
}

std::string blas_in_use() {
  using Text = char* (*)();
  if (const auto core = reinterpret_cast<Text>(dlsym(RTLD_DEFAULT, "openblas_get_corename")); core != nullptr)
    return std::string("OpenBLAS ") + core();
  return "BLAS unknown";
}

}  // namespace espalier::bench
