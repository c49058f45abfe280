#include "rivals/protocol.hpp"

#include <stdexcept>

namespace espalier {

void to_json(nlohmann::json& json, const Inertia& inertia) {
  json = {{"positive", inertia.positive}, {"negative", inertia.negative}, {"zero", inertia.zero}};
}
void from_json(const nlohmann::json& json, Inertia& inertia) {
  inertia = {json.at("positive"), json.at("negative"), json.at("zero")};
}

void to_json(nlohmann::json& json, const DeviceReport& device) {
  json = {{"name", device.name},
          {"busy_seconds", device.busy_seconds},
          {"idle_fraction", device.idle_fraction},
          {"waiting_seconds", device.waiting_seconds},
          {"peak_bytes", device.peak_bytes},
          {"stolen_subtrees", device.stolen_subtrees}};
}
void from_json(const nlohmann::json& json, DeviceReport& device) {
  device.name = json.at("name");
  device.busy_seconds = json.at("busy_seconds");
  device.idle_fraction = json.at("idle_fraction");
  device.waiting_seconds = json.at("waiting_seconds");
  device.peak_bytes = json.at("peak_bytes");
  device.stolen_subtrees = json.at("stolen_subtrees");
}

}  // namespace espalier

namespace espalier::bench {
namespace {

nlohmann::json with_verdict(const Verdict& verdict) {
  return {{"outcome", verdict.outcome}, {"message", verdict.message}};
}
Verdict verdict_in(const nlohmann::json& json) { return {json.at("outcome"), json.at("message")}; }

}  // namespace

void to_json(nlohmann::json& json, const Hello& hello) {
  json = with_verdict(hello.verdict);
  json["name"] = hello.name;
  json["version"] = hello.version;
}
void from_json(const nlohmann::json& json, Hello& hello) {
  hello = {verdict_in(json), json.at("name"), json.at("version")};
}

void to_json(nlohmann::json& json, const AnalyzeReport& report) {
  json = with_verdict(report.verdict);
  json["seconds"] = report.seconds;
  json["nonzeros_factor"] = report.nonzeros_factor;
  json["flops"] = report.flops;
  json["predicted_bytes"] = report.predicted_bytes;
}
void from_json(const nlohmann::json& json, AnalyzeReport& report) {
  report = {verdict_in(json), json.at("seconds"), json.at("nonzeros_factor"), json.at("flops"),
            json.at("predicted_bytes")};
}

void to_json(nlohmann::json& json, const FactorReport& report) {
  json = with_verdict(report.verdict);
  json["seconds"] = report.seconds;
  json["nonzeros_factor"] = report.nonzeros_factor;
  json["flops"] = report.flops;
  json["inertia"] = report.inertia;
  json["perturbed"] = report.perturbed;
  json["device_bytes"] = report.device_bytes;
  json["devices"] = report.devices;
}
void from_json(const nlohmann::json& json, FactorReport& report) {
  report = {verdict_in(json),   json.at("seconds"),   json.at("nonzeros_factor"), json.at("flops"),
            json.at("inertia"), json.at("perturbed"), json.at("device_bytes"),    json.at("devices")};
}

void to_json(nlohmann::json& json, const SolveReport& report) {
  json = with_verdict(report.verdict);
  json["seconds"] = report.seconds;
  json["refinement_steps"] = report.refinement_steps;
}
void from_json(const nlohmann::json& json, SolveReport& report) {
  report = {verdict_in(json), json.at("seconds"), json.at("refinement_steps")};
}

void to_json(nlohmann::json& json, const MemoryReport& report) { json = {{"peak_bytes", report.peak_bytes}}; }
void from_json(const nlohmann::json& json, MemoryReport& report) { report.peak_bytes = json.at("peak_bytes"); }

std::string kind_name(Kind kind) {
  switch (kind) {
    case Kind::llt:
      return "llt";
    case Kind::ldlt:
      return "ldlt";
    case Kind::lu:
      return "lu";
    case Kind::automatic:
      break;
  }
  return "auto";
}

Kind kind_named(const std::string& name) {
  for (const Kind kind : {Kind::llt, Kind::ldlt, Kind::lu, Kind::automatic})
    if (kind_name(kind) == name) return kind;
  throw std::invalid_argument("kind '" + name + "': known are auto, llt, ldlt, lu");
}

}  // namespace espalier::bench
