// The public entry: a model, its files, a description and the library of FMUs, in one archive.
#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <filesystem>

#include "base/checksum.hpp"
#include "base/output_file.hpp"
#include "dynamics/guarded.hpp"
#include "dynamics/mesh/file_source.hpp"
#include "dynamics/mesh/text_file.hpp"
#include "dynamics/model/decks/take.hpp"
#include "dynamics/model/fmu/instant.hpp"
#include "dynamics/model/fmu/library.hpp"
#include "dynamics/model/read/expand.hpp"
#include "dynamics/model/robots/robots.hpp"
#include "espalier/fmu.hpp"
#include "fmi/contents.hpp"
#include "fmi/describe.hpp"
#include "fmi/zip.hpp"
#include "matrix/file.hpp"
#include "solver/session/build_info.hpp"

namespace espalier {
namespace {

using dynamics::model::Runner;
using dynamics::model::Value;
using fmi::Variable;

[[noreturn]] void refuse(const std::string& what) { throw Error(StatusCode::invalid_input, what); }

#if defined(__aarch64__)
constexpr const char* kPlatform2 = "linux-aarch64";
constexpr const char* kPlatform3 = "aarch64-linux";
#else
constexpr const char* kPlatform2 = "linux64";
constexpr const char* kPlatform3 = "x86_64-linux";
#endif

/// Keeps what is read.
class Recording final : public dynamics::FileSource {
 public:
  std::string read(const std::string& path) override {
    std::string text = dynamics::read_from_disk(path);
    const auto known = [&](const auto& file) { return file.first == path; };
    if (std::none_of(files.begin(), files.end(), known)) files.emplace_back(path, text);
    return text;
  }
  bool exists(const std::string& path) override {
    std::error_code unreadable;
    return std::filesystem::exists(path, unreadable);
  }
  std::vector<std::pair<std::string, std::string>> files;  ///< paths and contents
};

/// Letters, digits and _, as C names have them.
std::string identifier_of(const std::string& path) {
  std::string name = std::filesystem::path(path).stem().string();
  for (char& c : name)
    if (std::isalnum(static_cast<unsigned char>(c)) == 0 || static_cast<unsigned char>(c) > 127) c = '_';
  if (name.empty() || std::isdigit(static_cast<unsigned char>(name.front())) != 0) name.insert(0, "model_");
  return name;
}

std::string token_of(const std::vector<fmi::ZipMember>& members, const std::string& rest) {
  base::Checksum one;
  std::string all = rest;
  for (const fmi::ZipMember& m : members) all += fmt::format("{}:{}:", m.name, m.bytes.size()) + m.bytes;
  one.add(all.data(), all.size());
  all += "second half";
  const std::uint64_t a = one.value(), b = base::checksum(all.data(), all.size());
  return fmt::format("{{{:08x}-{:04x}-{:04x}-{:04x}-{:012x}}}", a >> 32, a >> 16 & 0xffff, a & 0xffff, b >> 48,
                     b & 0xffffffffffff);
}

class Exporter {
 public:
  Exporter(const std::string& text, const std::string& name, const FmuOptions& options)
      : text_(text), name_(name), options_(options) {}

  void run(const std::string& given, FmuResult& result) {
    if (options_.version != 2 && options_.version != 3)
      refuse(fmt::format("FMI has the versions 2 and 3, not {}", options_.version));
    const std::string path = given.ends_with(".fmu") ? given : given + ".fmu";
    base::check_path(path);
    library_ = dynamics::model::find_fmu_library(options_.library);
    load();
    variables();
    pack(path, result);
    result.path = path;
    for (const Variable& v : contents_.variables)
      result.variables.push_back({v.name, std::string(fmi::row_of(v.kind).name), v.unit, v.start});
    for (const auto& file : recording_.files) result.files.push_back(file.first);
    result.model_exchange = why_not_.empty();
    result.no_model_exchange = why_not_;
  }

 private:
  void load() {
    root_ = dynamics::model::parse_toml(text_, name_);
    SimulationOptions o;
    o.page = false;
    o.quantities = options_.outputs;
    Value expanded = root_;
    dynamics::model::expand(expanded, options_.set);
    const dynamics::FileSource::Scope scope(recording_);
    dynamics::model::Description model = dynamics::model::read_description(expanded, name_);
    for (const auto& [key, value] : model.solver)
      if (key == "device" && value.starts_with("gpu"))
        refuse(
            fmt::format("{}: solver.device is '{}', but an FMU computes on the host, wherever it runs: --set "
                        "solver.device=cpu",
                        name_, value));
    if (model.statics || !model.moves)
      refuse(fmt::format("{}: an FMU moves in time; the model needs [integrator], and no [statics]", name_));
    integrator_ = model.integrator;
    if (!options_.outputs.empty()) model.output.quantities.clear();
    title_ = model.title;
    model.harmonic.reset();
    runner_ = std::make_unique<Runner>(std::move(model), std::move(o), summary_);
    if (runner_->chosen().empty())
      refuse(
          fmt::format("{}: an FMU without outputs tells nothing; name quantities (--outputs hinge.angle), or give the "
                      "model [output] quantities",
                      name_));
  }

  void variables() {
    contents_.variables.push_back({Variable::Kind::time, "time", runner_->time(), {}});
    contents_.model = name_;
    contents_.end = std::isfinite(integrator_.end) ? integrator_.end : runner_->time() + 1;
    contents_.adaptive = integrator_.method == dynamics::model::Method::bdf && integrator_.bdf.fixed_step == 0;
    contents_.set = options_.set;
    inputs();
    parameters();
    const std::vector<SimulationQuantity> known = runner_->all_quantities();
    for (const auto& found : summary_.values) {
      const auto it = std::find_if(known.begin(), known.end(), [&](const auto& q) { return q.name == found.first; });
      add({Variable::Kind::output, found.first, found.second, it == known.end() ? "" : it->unit});
    }
    why_not_ = dynamics::model::why_no_ode(*runner_);
    if (why_not_.empty()) states();
  }

  void add(Variable v) {
    for (const Variable& other : contents_.variables)
      if (other.name == v.name)
        refuse(fmt::format("the variable '{}' would be there twice, as {} and as output", v.name,
                           other.kind == Variable::Kind::input ? "input" : "parameter"));
    contents_.variables.push_back(std::move(v));
  }

  void inputs() {
    const auto all = runner_->inputs();
    std::vector<std::string> names;
    for (const auto& [name, value] : all) names.push_back(name);
    const std::vector<std::string> wanted = options_.inputs.empty() ? names : options_.inputs;
    for (const std::string& given : wanted) {
      const std::string name = given.starts_with("inputs.") ? given.substr(7) : given;
      const auto it = std::find(names.begin(), names.end(), name);
      if (it == names.end())
        refuse(fmt::format("there is no input '{}' in the model's [inputs]{}", name,
                           names.empty() ? ", which is not there: expressions of forces and motors read 'inputs.NAME'"
                                         : dynamics::model::suggestion(name, names)));
      add({Variable::Kind::input, name, all[static_cast<std::size_t>(it - names.begin())].second, {}});
    }
  }

  void parameters() {
    const Value* table = root_.find("parameters");
    std::vector<std::string> names, wanted = options_.parameters;
    for (std::size_t k = 0; table != nullptr && k < table->entries.size(); ++k) {
      names.push_back(table->entries[k].first);
      const Value::Type type = table->entries[k].second.type;
      const bool plain = type == Value::Type::real || type == Value::Type::integer;
      if (options_.parameters.empty() && plain) wanted.push_back("parameters." + names.back());
    }
    for (const std::string& given : wanted) {
      const bool path = given.find('.') != std::string::npos;
      if (!path && std::find(names.begin(), names.end(), given) == names.end())
        refuse(
            fmt::format("there is no parameter '{}' in the model's [parameters]{}; other numbers have paths, "
                        "bodies.NAME.mass",
                        given, dynamics::model::suggestion(given, names)));
      const std::string name = path ? given : "parameters." + given;
      if (name.starts_with("inputs.") || name == "integrator.start" || name == "integrator.end")
        refuse(fmt::format("'{}' is no parameter: inputs and times are the caller's", name));
      add({Variable::Kind::parameter, name, dynamics::model::number_at(root_, options_.set, name), {}});
    }
  }

  void states() {
    const dynamics::State& s = runner_->state();
    const dynamics::System& system = runner_->mechanism().system;
    const std::size_t n = s.q.size();
    std::vector<std::string> names;
    for (std::size_t k = 0; k < n; ++k) names.push_back("state " + system.coordinate_name(static_cast<Index>(k)));
    for (std::size_t k = 0; k < n; ++k) add({Variable::Kind::state, names[k], s.q[k], {}});
    for (std::size_t k = 0; k < n; ++k) add({Variable::Kind::state, "velocity of " + names[k], s.v[k], {}});
    for (std::size_t k = 0; k < n; ++k) add({Variable::Kind::derivative, "der(" + names[k] + ")", s.v[k], {}});
    for (std::size_t k = 0; k < n; ++k)
      add({Variable::Kind::derivative, "der(velocity of " + names[k] + ")", s.a[k], {}});
  }

  void pack(const std::string& path, FmuResult& result) {
    std::vector<fmi::ZipMember> members = {{"resources/model.toml", text_}};
    for (std::size_t k = 0; k < recording_.files.size(); ++k) {
      const std::string file =
          fmt::format("{}_{}", k, identifier_of(recording_.files[k].first));  // the reader knows it by its path
      contents_.files.emplace_back(recording_.files[k].first, file);
      members.push_back({"resources/files/" + file, std::move(recording_.files[k].second)});
    }
    const bool three = options_.version == 3;
    fmi::Description d;
    d.version = options_.version;
    d.identifier = identifier_of(path);
    d.name = std::filesystem::path(path).stem().string();
    d.title = title_;
    d.tool = fmt::format("Espalier {}", solver::version());
    d.model_exchange = why_not_.empty();
    const double duration = contents_.end - contents_.variables.front().start;
    d.step = contents_.adaptive || !(integrator_.alpha.step > 0) ? duration / 500 : integrator_.alpha.step;
    contents_.token = token_of(members, fmi::to_text(contents_) + d.tool);
    members.push_back({"resources/espalier.txt", fmi::to_text(contents_)});
    members.insert(members.begin(), {"modelDescription.xml", fmi::describe(d, contents_)});
    for (const auto& [name, file] : dynamics::model::fmu_binaries(library_, d.identifier + ".so"))
      members.push_back({fmt::format("binaries/{}/{}", three ? kPlatform3 : kPlatform2, name),
                         std::string(matrix::FileBytes(file).bytes())});
    for (const auto& [name, file] : dynamics::model::fmu_licenses(library_))
      members.push_back({"documentation/licenses/" + name, dynamics::read_from_disk(file)});
    const std::string archive = fmi::make_zip(members);
    base::OutputFile out(path);
    out.write(archive);
    out.commit();
    result.bytes = archive.size();
  }

  const std::string& text_;
  const std::string& name_;
  const FmuOptions& options_;
  std::string library_, title_, why_not_;
  Value root_;
  Recording recording_;
  dynamics::model::IntegratorSpec integrator_;
  SimulationSummary summary_;
  std::unique_ptr<Runner> runner_;
  fmi::Contents contents_;
};

}  // namespace

FmuResult export_fmu(const std::string& model, const std::string& path, const FmuOptions& options) {
  FmuResult result;
  std::string text;
  result.status = dynamics::guarded([&] {
    text = dynamics::model::robots::is_robot_file(model)
               ? dynamics::model::robots::robot_as_model(dynamics::read_whole_file(model), model).text
               : dynamics::model::read_model_text(model);
  });
  return result.status.ok() ? export_fmu_of_text(text, model, path, options) : result;
}

FmuResult export_fmu_of_text(const std::string& text, const std::string& name, const std::string& path,
                             const FmuOptions& options) {
  FmuResult result;
  result.status = dynamics::guarded([&] { Exporter(text, name, options).run(path, result); });
  return result;
}

}  // namespace espalier
