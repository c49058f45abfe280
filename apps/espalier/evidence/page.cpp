#include "evidence/page.hpp"

#include <fmt/format.h>

#include <cmath>
#include <map>

#include "evidence/plot.hpp"
#include "evidence/table.hpp"

namespace espalier::cli::evidence {

namespace {

void replace(std::string& frame, const std::string& key, const std::string& value) {
  const std::size_t at = frame.find(key);
  if (at != std::string::npos) frame.replace(at, key.size(), value);
}

/// A solver's name may break before each part of its variant.
std::string breakable(const std::string& html) {
  std::string out;
  for (const char c : html) {
    if (c == '+') out += "<wbr>";
    out += c;
  }
  return out;
}

std::string table_html(const DataTable& table) {
  std::string out = table.aside ? fmt::format("<details><summary>{}</summary>", escaped(table.title)) : "";
  out += "<div class=\"scroll\"><table>";
  if (!table.aside) out += fmt::format("<caption>{}</caption>", escaped(table.title));
  out += "<thead><tr>";
  for (const Column& column : table.columns)
    out += fmt::format("<th scope=\"col\"{}><button type=\"button\">{}</button></th>",
                       column.left ? " class=\"left\"" : "", escaped(column.name));
  out += "</tr></thead><tbody>\n";
  for (const Line& line : table.lines) {
    out += fmt::format("<tr{}{}>", line.anchor.empty() ? "" : fmt::format(" id=\"{}\"", line.anchor),
                       line.failed ? " class=\"failed\""
                       : line.best ? " class=\"best\""
                                   : "");
    for (std::size_t k = 0; k < line.cells.size(); ++k) {
      const Cell& cell = line.cells[k];
      out += fmt::format("<td{}{}>{}</td>", table.columns[k].left ? " class=\"left\"" : "",
                         std::isfinite(cell.value) ? fmt::format(" data-v=\"{:.9g}\"", cell.value) : "",
                         k == 1 ? breakable(escaped(cell.text)) : escaped(cell.text));
    }
    out += "</tr>\n";
  }
  out += table.aside ? "</tbody></table></div></details>\n" : "</tbody></table></div>\n";
  if (table.notes.empty()) return out;
  out += fmt::format("<details><summary>{} {} without figures</summary><ul>", table.notes.size(),
                     table.notes.size() == 1 ? "row" : "rows");
  for (const std::string& note : table.notes) out += "<li>" + escaped(note) + "</li>";
  return out + "</ul></details>\n";
}

/// Name of each rival with its version, once.
std::map<std::string, std::string> versions_of(const Results& results) {
  std::map<std::string, std::string> versions;
  for (const Json& row : results.rows())
    if (const std::string version = text(row, "version"); !version.empty()) versions[text(row, "rival")] = version;
  return versions;
}

std::string facts_html(const Results& results) {
  std::string out = "<dl>";
  const auto fact = [&](const char* name, const std::string& value, bool code = false) {
    if (value.empty()) return;
    out += fmt::format("<dt>{}</dt><dd>{}{}{}</dd>", name, code ? "<code>" : "", escaped(value), code ? "</code>" : "");
  };
  fact("Machine",
       machine_of(results) +
           (text(results.data["machine"], "kernel").empty() ? "" : "; " + text(results.data["machine"], "kernel")));
  fact("Load before", text(results.data["machine"], "load_average_before").substr(0, 4));
  fact("Command", text(results.data, "command"), true);
  fact("Date", text(results.data, "date"));
  fact("Commit", text(results.data, "commit"));
  fact("Note", text(results.data, "note"));
  std::string versions;
  for (const auto& [rival, version] : versions_of(results))
    versions += fmt::format("{}{}: {}", versions.empty() ? "" : "; ", rival, version);
  fact("Versions", versions);
  return out + "</dl>\n";
}

std::string section_html(const Results& results) {
  std::string out = fmt::format("<section id=\"{}\"><h2>{}</h2><p class=\"machine\">{}</p><p>{}</p>\n", results.id,
                                escaped(heading_of(results)), escaped(machine_of(results)),
                                escaped(explanation_of(results.experiment())));
  if (const std::string plots = plots_of(results); !plots.empty()) out += "<div class=\"plots\">" + plots + "</div>\n";
  for (const DataTable& table : tables_of(results)) out += table_html(table);
  return out + "<details class=\"facts\"><summary>How it was measured</summary>" + facts_html(results) +
         "</details></section>\n";
}

std::string facts_markdown(const Results& results) {
  std::string out = fmt::format("Machine: {}. Date: {}. Commit: {}.", machine_of(results), text(results.data, "date"),
                                text(results.data, "commit").empty() ? "unknown" : text(results.data, "commit"));
  const double load = number(results.data["machine"], "load_average_before");
  if (std::isfinite(load)) out += fmt::format(" Load average before: {:.1f}.", load);
  if (const std::string note = text(results.data, "note"); !note.empty()) out += " " + note;
  if (const std::string command = text(results.data, "command"); !command.empty()) out += "\n\n    " + command;
  out += "\n";
  for (const auto& [rival, version] : versions_of(results))
    out += fmt::format("\n- `{}`: {}", rival, measure::markdown_text(version));
  return out + "\n";
}

}  // namespace

std::string html_page(const std::vector<Results>& all) {
  std::string contents, body;
  for (const Results& results : all) {
    contents += fmt::format("<li><a href=\"#{}\">{}</a> <span>{}</span></li>", results.id, escaped(heading_of(results)),
                            escaped(machine_of(results) + ", " + text(results.data, "date").substr(0, 10)));
    body += section_html(results);
  }
  std::string page = kPageFrame;
  replace(page, "{{CONTENTS}}", contents);
  replace(page, "{{BODY}}", body);
  return page;
}

std::string markdown(const std::vector<Results>& all) {
  std::string out =
      "# Results\n\nMade by `espalier report --markdown bench/results/*.json --out docs/notebook/results.md`; do not "
      "edit. What the columns mean: [measure.md](../guide/measure.md).\n\n";
  for (const Results& results : all)
    out += fmt::format("- [{}: {}](#{}) ({})\n", heading_of(results), machine_of(results), results.id,
                       text(results.data, "date").substr(0, 10));
  for (const Results& results : all) {
    out += fmt::format("\n<a id=\"{}\"></a>\n\n## {}: {}\n\n{} Source: [{}](../../bench/results/{}).\n\n", results.id,
                       heading_of(results), machine_of(results), explanation_of(results.experiment()), results.file,
                       results.file);
    bool first = true;
    for (const DataTable& table : tables_of(results)) {
      if (table.aside)
        out +=
            fmt::format("<details><summary>{}</summary>\n\n{}\n</details>\n\n", table.title, measure::markdown(table));
      else
        out += (first ? "" : "### " + table.title + "\n\n") + measure::markdown(table) + "\n";
      first = false;
    }
    out += facts_markdown(results);
  }
  return out;
}

}  // namespace espalier::cli::evidence
