/// \file
/// What the benchmark and a rival's process say to each other: one line of JSON per command and per answer.
#pragma once

#include <algorithm>
#include <nlohmann/json.hpp>
#include <string>

#include "rivals/rival.hpp"

namespace espalier::bench {

/// File descriptors that the rival's process finds open.
inline constexpr int kCommandDescriptor = 100;   ///< commands come in
inline constexpr int kAnswerDescriptor = 101;    ///< answers go out
inline constexpr int kSystemDescriptor = 102;    ///< SharedSystem
inline constexpr int kSolutionDescriptor = 103;  ///< SharedMemory with the solutions, as many as right-hand sides

NLOHMANN_JSON_SERIALIZE_ENUM(Outcome, {{Outcome::ok, "ok"},
                                       {Outcome::missing, "missing"},
                                       {Outcome::not_offered, "not offered"},
                                       {Outcome::failed, "failed"},
                                       {Outcome::out_of_memory, "out of memory"},
                                       {Outcome::wrong_answer, "wrong answer"},
                                       {Outcome::crashed, "crashed"},
                                       {Outcome::timed_out, "timed out"}})

/// Prepares a call that will be timed. A turn's first call, of a few milliseconds, finds a processor that was idle
/// during the pause (its clock needs tens of milliseconds to rise) and caches that others filled; a caller who
/// refactorizes and solves step after step has none of that. So calls that took less than kShort the last time are
/// preceded by kWarmUp of the same calls (a refactorization: of the values of the round before). A chain of 200 small
/// bodies, 3.4 ms in a plain loop on two cores: the first call of a turn took 30 to 40 % longer, 10 % without the
/// pause; after 5 ms of such calls 17 %, after 30 ms 4 %, after 60 ms 2.0 % (standard error 0.3), after 150 ms 1.4 %
/// (0.4).
template <typename Call>
void warm_up(double last_seconds, Call&& call) {
  constexpr double kShort = 60e-3, kWarmUp = 150e-3;  // seconds
  if (last_seconds >= kShort) return;
  for (double spent = 0; spent < kWarmUp;) spent += std::max(call().seconds, 1e-6);
}

/// What the rival's process says when it is ready.
struct Hello {
  Verdict verdict;
  std::string name, version;
};
/// Memory of the rival's process, bytes.
struct MemoryReport {
  Offset peak_bytes = -1;  ///< VmHWM less what was resident before the first analysis and less the bench's own maps
};

void to_json(nlohmann::json& json, const Hello& hello);
void from_json(const nlohmann::json& json, Hello& hello);
void to_json(nlohmann::json& json, const AnalyzeReport& report);
void from_json(const nlohmann::json& json, AnalyzeReport& report);
void to_json(nlohmann::json& json, const FactorReport& report);
void from_json(const nlohmann::json& json, FactorReport& report);
void to_json(nlohmann::json& json, const SolveReport& report);
void from_json(const nlohmann::json& json, SolveReport& report);
void to_json(nlohmann::json& json, const MemoryReport& report);
void from_json(const nlohmann::json& json, MemoryReport& report);

/// "llt", "ldlt", "lu", "automatic" and back. kind_named() throws std::invalid_argument.
std::string kind_name(Kind kind);
Kind kind_named(const std::string& name);

}  // namespace espalier::bench

namespace espalier {

void to_json(nlohmann::json& json, const Inertia& inertia);
void from_json(const nlohmann::json& json, Inertia& inertia);
void to_json(nlohmann::json& json, const DeviceReport& device);
void from_json(const nlohmann::json& json, DeviceReport& device);

}  // namespace espalier
