#include "solve/summary.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "base/memory.hpp"
#include "common/terminal.hpp"
#include "solver/options/option_text.hpp"

namespace espalier::cli {

namespace {

std::string method_name(Kind kind) {
  switch (kind) {
    case Kind::llt:
      return "L L^T";
    case Kind::ldlt:
      return "L D L^T";
    case Kind::lu:
      return "L U";
    case Kind::automatic:
      break;
  }
  return "automatic";
}

std::string storage_name(Storage storage) {
  switch (storage) {
    case Storage::general:
      return "unsymmetric";
    case Storage::symmetric_lower:
      return "symmetric, lower triangle stored";
    case Storage::symmetric_upper:
      return "symmetric, upper triangle stored";
    case Storage::symmetric_both:
      return "symmetric, both triangles stored";
    case Storage::hermitian_lower:
      return "Hermitian, lower triangle stored";
    case Storage::hermitian_upper:
      return "Hermitian, upper triangle stored";
    case Storage::hermitian_both:
      return "Hermitian, both triangles stored";
  }
  return "";
}

std::string bytes(Offset number) { return base::format_bytes(number); }

std::string analysis_parts(const AnalysisResult& a) {
  return fmt::format("ordering {}, matching {}, plan {}", duration(a.ordering_seconds), duration(a.matching_seconds),
                     duration(a.plan_seconds));
}

/// Entries of the factor over the entries that it would have without fill (one triangle for a symmetric matrix).
double fill(const RunRecord& record) {
  Offset entries = record.nonzeros;
  if (record.storage == Storage::symmetric_both) entries = (entries + record.rows) / 2;
  return entries > 0 ? static_cast<double>(record.analysis->nonzeros_factor) / static_cast<double>(entries) : 0;
}

std::string factor_line(const RunRecord& record) {
  const auto& a = *record.analysis;
  return fmt::format("{} entries, fill {:.1f}; {} in {}, the largest with {}", grouped(a.nonzeros_factor), fill(record),
                     counted(a.fronts, "front", "fronts"), counted(a.tiers, "tier", "tiers"),
                     counted(a.largest_front, "row", "rows"));
}

std::string inertia_line(const Inertia& inertia) {
  return fmt::format("{} positive, {} negative, {} zero", grouped(inertia.positive), grouped(inertia.negative),
                     grouped(inertia.zero));
}

std::string rank_line(const FactorReport& factor, Index rows) {
  constexpr std::size_t kMost = 8;
  std::string line = fmt::format("{} of {}", grouped(factor.rank), grouped(rows));
  const auto& dependent = factor.dependent_rows;
  if (dependent.empty()) return line;
  const auto end = dependent.begin() + static_cast<std::ptrdiff_t>(std::min(kMost, dependent.size()));
  line += fmt::format("; linear combinations of others: row {}", fmt::join(dependent.begin(), end, ", "));
  return dependent.size() > kMost ? line + ", ..." : line;
}

std::string pivot_line(const FactorReport& factor) {
  std::string line = fmt::format("{} of 2x2, {} perturbed", grouped(factor.two_by_two), grouped(factor.perturbed));
  if (factor.delayed > 0) line += fmt::format(", {} delayed", grouped(factor.delayed));
  return line;
}

Table phase_table(const RunRecord& record) {
  Table table("<>><");
  const auto& a = *record.analysis;
  table.add({"phase", "time", "rate", ""}, Tone::quiet);
  if (record.read_seconds > 0) table.add({"reading", duration(record.read_seconds), "", record.input});
  table.add({"analysis", duration(a.seconds), "", analysis_parts(a)});
  if (!record.factor) return table;
  const double first = record.first_factor_seconds;
  table.add({"factorization", duration(first), rate(first > 0 ? a.flops / first : 0), operations(a.flops)});
  if (const auto best = record.best_refactor_seconds()) {
    table.add({"refactorization", duration(*best), rate(record.best_rate()),
               fmt::format("best of {}", record.refactor_seconds.size())});
  }
  if (!record.solve) return table;
  table.add({"solve", duration(record.solve->seconds), "",
             fmt::format("{}, {}", counted(record.columns, "right-hand side", "right-hand sides"),
                         counted(record.solve->refinement_steps, "step of refinement", "steps of refinement"))});
  return table;
}

Table result_table(const RunRecord& record) {
  Table table("<<");
  table.add({"factor", factor_line(record)});
  if (!record.factor) return table;
  const FactorReport& factor = *record.factor;
  table.add({"memory", fmt::format("{} used at most, {} predicted", bytes(factor.peak_host_bytes),
                                   bytes(record.analysis->predicted_bytes))});
  for (const DeviceReport& device : factor.devices) {
    std::string line =
        fmt::format("{}: busy {}, waiting {}, idle {:.0f} %, {} at most", device.name, duration(device.busy_seconds),
                    duration(device.waiting_seconds), 100 * device.idle_fraction, bytes(device.peak_bytes));
    if (device.stolen_subtrees > 0) line += ", " + counted(device.stolen_subtrees, "sub-tree", "sub-trees") + " stolen";
    if (device.transferred_bytes > 0)
      line += fmt::format("; {} exchanged with others", bytes(device.transferred_bytes));
    if (device.streamed_out_bytes > 0)
      line +=
          fmt::format("; {} brought to it and {} taken back, which takes the link {}", bytes(device.streamed_in_bytes),
                      bytes(device.streamed_out_bytes), duration(device.link_seconds));
    if (device.disk_written_bytes > 0)
      line += fmt::format("; {} written to disk and {} read", bytes(device.disk_written_bytes),
                          bytes(device.disk_read_bytes));
    table.add({"device", line});
  }
  if (factor.rank >= 0 && factor.rank < record.rows) table.add({"rank", rank_line(factor, record.rows)});
  if (record.storage != Storage::general && factor.inertia.positive >= 0)
    table.add({"inertia", inertia_line(factor.inertia)});
  if (record.analysis->kind != Kind::llt) table.add({"pivots", pivot_line(factor)});
  if (record.condition_estimate) table.add({"condition", fmt::format("{:.1e} (estimate)", *record.condition_estimate)});
  if (record.solve) {
    table.add({"accuracy", fmt::format("backward error {} normwise, {} componentwise",
                                       small(record.solve->backward_error), small(record.solve->componentwise_error))});
  }
  return table;
}

}  // namespace

std::string matrix_summary(const RunRecord& record) {
  Table table("<<");
  table.add({"matrix", fmt::format("{}, {}, {}", counted(record.rows, "unknown", "unknowns"),
                                   counted(record.nonzeros, "entry", "entries"),
                                   (record.complex ? "complex " : "") + storage_name(record.storage))});
  for (const std::string& notice : record.notices) table.add({"notice", notice});
  if (record.analysis && record.analysis->kind != Kind::automatic) {
    table.add({"method", fmt::format("{}, {}", method_name(record.analysis->kind), solver::name_of(record.precision))});
  }
  return toned(Tone::strong, record.input) + "\n" + table.text();
}

std::string solve_summary(const RunRecord& record) {
  std::string text = "\n" + matrix_summary(record);
  if (record.analysis && record.analysis->status.ok()) {
    text += "\n" + phase_table(record).text() + "\n" + result_table(record).text();
  }
  return text;
}

std::string analysis_summary(const RunRecord& record, const std::vector<Solver::TierRow>& tiers) {
  Table tree(">>>>>>");
  tree.add({"tier", "fronts", "largest front", "entries of the factor", "work", "share"}, Tone::quiet);
  for (const auto& row : tiers) {
    const double share = record.analysis->flops > 0 ? 100 * row.flops / record.analysis->flops : 0;
    tree.add({fmt::format("{}", row.tier), grouped(row.fronts), grouped(row.largest_front), grouped(row.factor_entries),
              operations(row.flops), fmt::format("{:.1f} %", share)});
  }
  return "\n" + matrix_summary(record) + "\n" + phase_table(record).text() + "\n" + result_table(record).text() + "\n" +
         tree.text();
}

std::string forecast_summary(const AnalysisResult& analysis, Offset budget_bytes,
                             const std::optional<base::DiskRates>& disk) {
  Table table("<<");
  table.add({"work to come", operations(analysis.flops)});
  table.add({"time", fmt::format("about {}", duration(analysis.predicted_seconds))});
  std::string memory = bytes(analysis.predicted_bytes);
  if (budget_bytes > 0) {
    memory += fmt::format(" ({} {})", analysis.predicted_bytes <= budget_bytes ? "fits" : "does not fit",
                          bytes(budget_bytes));
  }
  table.add({"memory", memory});
  if (disk) {
    const auto seconds = [](Offset size, double rate) { return static_cast<double>(size) / rate; };
    const auto& a = analysis;
    table.add({"disk", fmt::format("{} at most; as measured it takes {} in a second and gives {}",
                                   bytes(a.predicted_disk_bytes), bytes(static_cast<Offset>(disk->write)),
                                   bytes(static_cast<Offset>(disk->read)))});
    table.add({"factorization", fmt::format("{} written and {} read, {} of the disk",
                                            bytes(a.predicted_disk_written_bytes), bytes(a.predicted_disk_read_bytes),
                                            duration(seconds(a.predicted_disk_written_bytes, disk->write) +
                                                     seconds(a.predicted_disk_read_bytes, disk->read)))});
    table.add({"way of a solve", fmt::format("{} read, {}", bytes(a.predicted_way_read_bytes),
                                             duration(seconds(a.predicted_way_read_bytes, disk->read)))});
  }
  return table.text();
}

}  // namespace espalier::cli
