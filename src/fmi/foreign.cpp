#include "fmi/foreign.hpp"

#include <dlfcn.h>
#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <set>

#include "espalier/types.hpp"
#include "fmi/foreign_versions.hpp"

namespace espalier::fmi {
namespace {

namespace fs = std::filesystem;

#if defined(__aarch64__)
constexpr std::string_view kPlatforms[] = {"", "", "linux-aarch64", "aarch64-linux"};
#else
constexpr std::string_view kPlatforms[] = {"", "", "linux64", "x86_64-linux"};
#endif

[[noreturn]] void refuse_file(const std::string& fmu, const std::string& what) {
  throw Error(StatusCode::invalid_input, fmt::format("{}: {}", fmu, what));
}

std::string joined(const std::set<std::string>& names) {
  std::string list;
  for (const std::string& name : names) list += (list.empty() ? "" : ", ") + name;
  return list.empty() ? "none" : list;
}

}  // namespace

UnpackedFmu::UnpackedFmu(const ZipArchive& archive, const ModelDescription& description, const std::string& fmu)
    : folder_("espalier-fmu", fmu) {
  const std::string platform(kPlatforms[description.version]), home = "binaries/" + platform + "/";
  const std::string binary = home + description.identifier + ".so";
  const std::vector<std::string> names = archive.names();
  if (!archive.has(binary)) {
    std::set<std::string> platforms;
    for (const std::string& name : names)
      if (name.starts_with("binaries/")) platforms.insert(name.substr(9, name.find('/', 9) - 9));
    refuse_file(
        fmu,
        fmt::format(
            "it has no binary for this platform, {}; it has binaries for: {}{}", binary, joined(platforms),
            archive.has("sources/buildDescription.xml") || archive.has("sources/") ? "; compile its sources/" : ""));
  }
  try {
    fs::create_directories(resources());
    for (const std::string& name : names) {
      if (!name.starts_with(home) && !name.starts_with("resources/")) continue;
      const fs::path to = fs::path(folder_.path()) / name;
      fs::create_directories(to.parent_path());
      std::ofstream out(to, std::ios::binary);
      const std::string bytes = archive.read(name);
      out.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
      out.close();
      if (!out) refuse_file(fmu, fmt::format("{} cannot be written: is the disk full?", to.string()));
    }
  } catch (const fs::filesystem_error& problem) {
    refuse_file(fmu, fmt::format("it cannot be unpacked: {}", problem.what()));
  }
  binary_ = folder_.path() + "/" + binary;
}

ForeignFmu::ForeignFmu(std::string name, std::string title, ModelDescription description, const ZipArchive& archive)
    : name_(std::move(name)),
      unpacked_(archive, description, title),
      title_(std::move(title)),
      description_(std::move(description)),
      library_(::dlopen(unpacked_.binary().c_str(), RTLD_NOW | RTLD_LOCAL)) {
  if (library_ != nullptr) return;
  const char* why = ::dlerror();
  refuse(fmt::format("its binary cannot be loaded: {}", why == nullptr ? "no reason given" : why));
}

ForeignFmu::~ForeignFmu() {
  if (library_ != nullptr) ::dlclose(library_);
}

void* ForeignFmu::find_function(const char* symbol) const {
  void* found = ::dlsym(library_, symbol);
  if (found == nullptr) refuse(fmt::format("its binary has no function {}", symbol));
  return found;
}

void ForeignFmu::refuse(const std::string& what) const { refuse_file(title_, what); }

void ForeignFmu::check_value(const ForeignVariable& v, double value, bool fits) const {
  if (!fits || !std::isfinite(value))
    refuse(fmt::format("'{}' cannot be {}: {}", v.name, value,
                       std::isfinite(value) ? "its type does not hold it" : "that is no number to tell"));
}

void ForeignFmu::hear(const std::string& message) {
  constexpr std::size_t kMost = 5;
  if (heard_.size() < kMost) heard_.push_back(message);
}

void ForeignFmu::check(FmiStatus status, const char* told) const {
  if (status == FmiStatus::ok || status == FmiStatus::warning) {
    heard_.clear();
    return;
  }
  std::string what = status == FmiStatus::discard ? "was discarded (a shorter 'step' may help)"
                     : status == FmiStatus::error ? "failed"
                     : status == FmiStatus::fatal ? "failed for good"
                     : status == FmiStatus::pending
                         ? "goes on in the background, which is not supported"
                         : fmt::format("returned {}, which is no status of FMI", static_cast<int>(status));
  for (const std::string& message : heard_) what += fmt::format("; the FMU says: {}", message);
  heard_.clear();
  refuse(fmt::format("{} {}", told, what));
}

void ForeignFmu::load_state_functions(const char* prefix, const char* deserialize) {
  if (!description_.serializes_state) return;
  const bool two = description_.version == 2;
  const auto named = [&](const char* two_name, const char* three_name) {
    return std::string(prefix) + (two ? two_name : three_name);
  };
  get_state_ = function<GetState>(named("GetFMUstate", "GetFMUState").c_str());
  set_state_ = function<SetState>(named("SetFMUstate", "SetFMUState").c_str());
  free_state_ = function<GetState>(named("FreeFMUstate", "FreeFMUState").c_str());
  state_size_ = function<StateSize>(named("SerializedFMUstateSize", "SerializedFMUStateSize").c_str());
  serialize_ = function<SerializeState>(named("SerializeFMUstate", "SerializeFMUState").c_str());
  deserialize_ = function<DeserializeState>(deserialize);
}

std::string ForeignFmu::save() {
  void* state = nullptr;
  call("GetFMUState", get_state_, instance_, &state);
  std::size_t size = 0;
  FmiStatus status = status_of("SerializedFMUStateSize", state_size_, instance_, state, &size);
  std::string bytes(size, '\0');
  if (status == FmiStatus::ok)
    status = status_of("SerializeFMUState", serialize_, instance_, state, reinterpret_cast<std::uint8_t*>(bytes.data()),
                       size);
  static_cast<void>(status_of("FreeFMUState", free_state_, instance_, &state));
  check(status, "SerializeFMUState");
  return bytes;
}

void ForeignFmu::restore(std::string_view bytes) {
  void* state = nullptr;
  call("DeserializeFMUState", deserialize_, instance_, reinterpret_cast<const std::uint8_t*>(bytes.data()),
       bytes.size(), &state);
  const FmiStatus status = status_of("SetFMUState", set_state_, instance_, state);
  static_cast<void>(status_of("FreeFMUState", free_state_, instance_, &state));
  check(status, "SetFMUState");
}

std::unique_ptr<ForeignFmu> ForeignFmu::load(const std::string& name, const std::string& file, std::string bytes) {
  const std::string title = fmt::format("FMU '{}' ({})", name, file);
  const ZipArchive archive(title, std::move(bytes));
  ModelDescription d = read_description(archive.read("modelDescription.xml"), title);
  if (d.version == 2) return load_fmi2(name, title, std::move(d), archive);
  return load_fmi3(name, title, std::move(d), archive);
}

}  // namespace espalier::fmi
