#include "experiments/bench.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <limits>

#include "experiments/ceilings.hpp"
#include "rivals/environment.hpp"
#include "rivals/systems.hpp"
#include "rivals/table.hpp"

namespace espalier::bench {

namespace fs = std::filesystem;

namespace {

bool is_matrix_file(const fs::path& path) {
  std::string name = path.filename().string();
  if (name.ends_with(".gz")) name.resize(name.size() - 3);
  if (name.ends_with("_rhs.mtx")) return false;  // of `simulate --dump-matrices`
  for (const char* end : {".mtx", ".rb", ".rsa", ".rua", ".esp"})
    if (name.ends_with(end)) return true;
  return false;
}

std::vector<std::string> matrices_in(const std::string& folder) {
  std::vector<std::string> files;
  for (const auto& entry : fs::recursive_directory_iterator(folder))
    if (entry.is_regular_file() && is_matrix_file(entry.path())) files.push_back(entry.path().string());
  if (files.empty()) throw Error(StatusCode::invalid_input, folder + ": there is no .mtx, .rb or .esp file in it");
  std::sort(files.begin(), files.end());
  return files;
}

/// Matrices of one pattern, in the order of their files.
struct Sequence {
  System first;
  std::vector<std::vector<double>> values;
};

/// The matrices of a folder by pattern; the pattern that most have.
Sequence longest_sequence(const std::string& folder) {
  std::vector<Sequence> all;
  for (const std::string& file : matrices_in(folder)) {
    System next = make_any_system(file);
    SparseMatrix& a = next.a;
    const auto same = std::find_if(all.begin(), all.end(), [&](const Sequence& s) {
      const SparseMatrix& b = s.first.a;
      return s.first.numbers == next.numbers && b.rows == a.rows && b.storage == a.storage && b.col_ptr == a.col_ptr &&
             b.row_ind == a.row_ind;
    });
    if (same == all.end()) {
      std::vector<double> values = a.values;
      all.push_back({std::move(next), {std::move(values)}});
    } else {
      same->values.push_back(std::move(a.values));
    }
  }
  return *std::max_element(all.begin(), all.end(),
                           [](const auto& a, const auto& b) { return a.values.size() < b.values.size(); });
}

/// "elasticity 64 as ldlt": the system and its kind; without the last two words, `kind`.
std::pair<std::string, std::string> split_kind(const std::string& system, const std::string& kind) {
  const std::size_t at = system.rfind(" as ");
  if (at == std::string::npos || fs::exists(system)) return {system, kind};
  return {system.substr(0, at), system.substr(at + 4)};
}

/// In front of a kind: "complex " or "Hermitian ".
const char* numbers_word(const SystemView& a) {
  return a.numbers == Numbers::real ? "" : a.numbers == Numbers::complex ? "complex " : "Hermitian ";
}

nlohmann::json settings_record(const Settings& settings) {
  const Plan& plan = settings.plan;
  return {{"threads", plan.threads},
          {"repetitions", plan.repetitions},
          {"analyses", plan.analyses},
          {"right_hand_sides", plan.columns},
          {"one_at_a_time", plan.one_at_a_time},
          {"warm", plan.warm},
          {"wrong_above", plan.wrong_above},
          {"timeout_seconds", plan.child.timeout_seconds},
          {"memory_limit_bytes", plan.child.memory_limit_bytes},
          {"environment", plan.child.environment}};
}

}  // namespace

struct Bench::Loaded {
  std::string words;
  System system;
  std::vector<std::vector<double>> sequence;  ///< of a folder
  Kind kind = Kind::llt;
};

std::string rivals_folder() {
  const fs::path own = fs::read_symlink("/proc/self/exe").parent_path();
  std::vector<fs::path> places = {own / "bench" / "rivals", own / "rivals", own.parent_path() / "libexec" / "espalier"};
  if (const char* chosen = std::getenv("ESPALIER_RIVALS_DIR")) places.insert(places.begin(), fs::path(chosen));
  for (const fs::path& place : places)
    if (fs::is_regular_file(place / "espalier_rival_host")) return place.string();
  return places.back().string();
}

Bench::Bench(std::string experiment, Settings settings, Voice voice)
    : settings_(std::move(settings)), voice_(std::move(voice)) {
  if (!voice_.progress) voice_.progress = [](const std::string&) {};
  Plan& plan = settings_.plan;
  if (settings_.repetitions) plan.repetitions = *settings_.repetitions;
  if (settings_.analyses > 0) plan.analyses = settings_.analyses;
  if (plan.child.folder.empty()) plan.child.folder = rivals_folder();
  plan.child.environment = rival_environment(plan.threads);
  document_ =
      measure::new_document({std::move(experiment), settings_.command, settings_.version, settings_record(settings_)});
  const double load = document_["machine"].at("load_average_before");
  if (load > 0.25 * document_["machine"].at("cores").get<double>())
    print(fmt::format("Note: load average {:.1f} before the start; wall-clock times are disturbed.\n", load));
  if (!settings_.ceilings) return;
  progress("ceilings of this machine");
  document_["ceilings"] = measure_ceilings({plan.threads, 0.2});
}

Bench::~Bench() = default;

double Bench::seconds_gone() const {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
}

Bench Bench::aside(int repetitions) const {
  Settings settings = settings_;
  settings.analyses = 1;
  settings.repetitions = repetitions;
  settings.plan.columns = 1;
  settings.ceilings = false;
  settings.out.clear();
  return {document_.at("experiment"), std::move(settings), {}};
}

int Bench::gpus() const { return static_cast<int>(document_.at("machine").at("gpus").size()); }

std::vector<std::string> Bench::systems(std::vector<std::string> defaults) const {
  if (settings_.systems.empty()) return defaults;
  std::vector<std::string> all;
  for (const std::string& words : settings_.systems) {
    if (!fs::is_directory(words)) {
      all.push_back(words);
      continue;
    }
    for (std::string& file : matrices_in(words)) all.push_back(std::move(file));
  }
  return all;
}

std::vector<std::string> Bench::points(std::vector<std::string> defaults) const {
  return settings_.points.empty() ? std::move(defaults) : settings_.points;
}

void Bench::print(const std::string& text) const {
  voice_.progress("");
  if (voice_.print) voice_.print(text);
}

void Bench::progress(const std::string& what) const { voice_.progress(what); }

void Bench::read(const std::string& words) {
  progress(words + ": reading");
  loaded_.reset();  // before the next one takes its memory
  auto next = std::make_unique<Loaded>();
  next->words = words;
  if (fs::is_directory(words)) {
    Sequence sequence = longest_sequence(words);
    next->system = std::move(sequence.first);
    next->sequence = std::move(sequence.values);
  } else {
    next->system = make_any_system(words);
  }
  const SparseMatrix& a = next->system.a;
  if (a.rows != a.cols || a.rows == 0 || a.values.empty())
    throw Error(StatusCode::invalid_input, fmt::format("{}: the matrix is {} x {} with {} values; a square one with "
                                                       "values is needed",
                                                       words, a.rows, a.cols, a.values.size()));
  loaded_ = std::move(next);
}

const Bench::Loaded& Bench::load(const std::string& system) {
  const auto [words, kind] = split_kind(system, settings_.kind);
  if (!loaded_ || loaded_->words != words) read(words);
  loaded_->kind = kind_named(kind);
  if (loaded_->kind == Kind::automatic) loaded_->kind = automatic_kind(loaded_->system.view());
  if (loaded_->kind != Kind::lu && !loaded_->system.a.symmetric())
    throw Error(StatusCode::invalid_input,
                fmt::format("{}: kind {} needs a matrix in symmetric storage", system, kind));
  if (loaded_->kind == Kind::llt && loaded_->system.numbers == Numbers::complex)
    throw Error(StatusCode::invalid_input,
                fmt::format("{}: a complex symmetric matrix has kinds ldlt and lu; llt needs a Hermitian one", system));
  return *loaded_;
}

nlohmann::json Bench::rows_of(const std::string& system, const Loaded& loaded,
                              const std::vector<Contestant>& contestants) {
  Plan plan = settings_.plan;
  const SystemView a = loaded.system.view();
  plan.kind = loaded.kind;
  plan.sequence = loaded.sequence;
  plan.rivals.clear();
  for (const Contestant& contestant : contestants) plan.rivals.push_back(contestant.spec);
  print(fmt::format("{}: {} unknowns, {} entries, {}{}, {} threads, medians of {}\n", system, a.rows, a.nonzeros(),
                    numbers_word(a), kind_name(plan.kind), plan.threads, plan.repetitions));
  const std::vector<Row> rows = compare(a, plan, voice_.progress);
  print(text_table(rows, plan.columns));
  nlohmann::json records = nlohmann::json::array();
  for (std::size_t k = 0; k < rows.size(); ++k) {
    nlohmann::json record = {{"system", system},
                             {"unknowns", a.rows},
                             {"nonzeros", a.nonzeros()},
                             {"numbers", a.numbers == Numbers::real ? "real" : "complex"},
                             {"kind", kind_name(loaded.kind)},
                             {"parameters", contestants[k].parameters}};
    if (!loaded.sequence.empty()) record["parameters"]["matrices"] = loaded.sequence.size();
    record.update(row_record(rows[k]));
    records.push_back(std::move(record));
  }
  return records;
}

nlohmann::json Bench::measure(const std::string& system, const std::vector<Contestant>& contestants, double estimate) {
  const double gone = seconds_gone(), allowed = settings_.time_seconds;
  const std::size_t before = document_["rows"].size();
  const auto none = [&](const std::string& outcome, const std::string& message) {
    for (const Contestant& one : contestants) add_row(system, one, outcome, message);
    print(fmt::format("{}: {}: {}\n\n", system, outcome, message));
  };
  try {
    if (allowed > 0 && gone + estimate > allowed) {
      const std::string needs = estimate > 0 ? fmt::format("it takes about {:.0f} s, and ", estimate) : "";
      none("left out", fmt::format("{}{:.0f} s of the {:.0f} s allowed were gone", needs, gone, allowed));
    } else {
      const Loaded* loaded = nullptr;
      try {
        loaded = &load(system);
      } catch (const Error&) {
        unreadable_.push_back(system);
        throw;
      }
      for (auto& row : rows_of(system, *loaded, contestants)) document_["rows"].push_back(std::move(row));
      print(fmt::format("{}: {:.1f} s in all\n\n", system, seconds_gone() - gone));
    }
  } catch (const std::bad_alloc&) {
    none("out of memory", "the system does not fit here");
  } catch (const std::exception& error) {
    none("failed", error.what());
  }
  save();
  const auto& rows = document_["rows"];
  return {rows.begin() + static_cast<std::ptrdiff_t>(before), rows.end()};
}

void Bench::add_row(const std::string& system, const Contestant& contestant, const std::string& outcome,
                    const std::string& message) {
  document_["rows"].push_back({{"system", system},
                               {"rival", contestant.spec},
                               {"parameters", contestant.parameters},
                               {"outcome", outcome},
                               {"message", message}});
}

void Bench::save() const {
  if (settings_.out.empty()) return;
  measure::write_document(document_, settings_.out);
}

}  // namespace espalier::bench
