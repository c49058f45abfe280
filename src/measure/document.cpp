#include "measure/document.hpp"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <utility>

#include "base/output_file.hpp"
#include "measure/machine.hpp"

namespace espalier::measure {

namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

}  // namespace

double Samples::median() const {
  if (seconds.empty()) return kNone;
  std::vector<double> sorted = seconds;
  std::sort(sorted.begin(), sorted.end());
  const std::size_t half = sorted.size() / 2;
  return sorted.size() % 2 == 1 ? sorted[half] : (sorted[half - 1] + sorted[half]) / 2;
}

double Samples::least() const {
  if (seconds.empty()) return kNone;
  return *std::min_element(seconds.begin(), seconds.end());
}

std::size_t Samples::middle() const {
  const double wanted = median();
  const auto nearest = std::min_element(
      seconds.begin(), seconds.end(), [&](double a, double b) { return std::abs(a - wanted) < std::abs(b - wanted); });
  return static_cast<std::size_t>(nearest - seconds.begin());
}

Json samples_record(const Samples& samples) {
  if (samples.empty()) return nullptr;
  return {{"median", samples.median()}, {"least", samples.least()}, {"seconds", samples.seconds}};
}

Json new_document(DocumentHead head) {
  return {{"schema", kSchema},
          {"experiment", std::move(head.experiment)},
          {"command", std::move(head.command)},
          {"date", utc_now()},
          {"commit", source_commit()},
          {"version", std::move(head.version)},
          {"machine", machine_record()},
          {"settings", std::move(head.settings)},
          {"rows", Json::array()}};
}

Json empty_row(const std::string& system, const std::string& rival, const std::string& version) {
  Json row = {{"system", system}, {"rival", rival}, {"version", version}, {"outcome", "ok"}, {"message", ""}};
  for (const char* key :
       {"unknowns", "nonzeros", "kind", "analysis", "first_factorization", "refactorization", "solve_one", "solve_many",
        "nonzeros_factor", "flops", "inertia", "perturbed", "refinement_steps", "backward_error"})
    row[key] = nullptr;
  row["memory"] = {{"peak_bytes", nullptr}, {"device_bytes", nullptr}, {"predicted_bytes", nullptr}};
  row["parameters"] = Json::object();
  row["devices"] = Json::array();
  return row;
}

void write_document(const Json& document, const std::string& path) {
  namespace fs = std::filesystem;
  const std::string name = document.at("experiment").get<std::string>() + ".json";
  base::OutputFile file(fs::is_directory(path) ? (fs::path(path) / name).string() : path);
  file.write(document.dump(1, ' ', false, Json::error_handler_t::replace) + "\n");
  file.commit();
}

double number(const Json& object, const char* key) {
  const auto found = object.find(key);
  return found != object.end() && found->is_number() ? found->get<double>() : kNone;
}

double number(const Json& object, const std::vector<const char*>& path) {
  const Json* at = &object;
  for (const char* key : path) {
    if (!at->is_object() || !at->contains(key)) return kNone;
    at = &(*at)[key];
  }
  return at->is_number() ? at->get<double>() : kNone;
}

double median(const Json& row, const char* phase) { return number(row, {phase, "median"}); }

bool solved(const Json& row) { return row.at("outcome") == "ok"; }

std::string text(const Json& object, const char* key) {
  const auto found = object.find(key);
  if (found == object.end() || found->is_null()) return "";
  return found->is_string() ? found->get<std::string>() : found->dump();
}

}  // namespace espalier::measure
