#include "dynamics/page/page.hpp"

#include <fmt/format.h>

#include <chrono>
#include <map>

#include "dynamics/page/json_text.hpp"
#include "dynamics/page/parts.hpp"
#include "dynamics/page/summary_json.hpp"
#include "solver/session/build_info.hpp"

namespace espalier::dynamics::page {
namespace {

std::string plots_json(const RunOfPage& run, const Rows& rows) {
  std::map<std::string, std::string> dimensions;
  for (const SimulationQuantity& q : run.quantities) dimensions[q.name] = q.unit.empty() ? q.dimension : q.unit;
  std::vector<std::string> of_columns;
  for (const std::string& name : rows.names()) {
    const auto known = dimensions.find(name);
    of_columns.push_back(known == dimensions.end() ? "" : known->second);
  }
  JsonObject json;
  json.raw("names", json_texts(rows.names())).raw("dimensions", json_texts(of_columns));
  return json.number("stride", static_cast<double>(rows.stride())).done();
}

std::string response_json(const RunOfPage::Response& response) {
  JsonObject json;
  json.raw("names", json_texts(response.names)).raw("frequencies", json_numbers(response.frequencies));
  return json.raw("columns", json_numbers(response.columns, 12)).done();
}

std::string paths_json(const std::vector<SimulationPath>& paths) {
  std::vector<std::string> all;
  for (const SimulationPath& path : paths) {
    JsonObject json;
    json.text("name", path.name).text("body", path.body).number("t", path.t);
    json.raw("quantities", json_texts(path.quantities)).raw("length", json_numbers(path.length, 9));
    all.push_back(json.raw("values", json_numbers(path.values, 9)).done());
  }
  return json_list(all);
}

std::string model_json(const RunOfPage& run) {
  constexpr std::size_t kMostText = 300'000;
  std::string text = run.text.substr(0, kMostText);
  if (text.size() < run.text.size()) text += "\n# ... and more";
  JsonObject json;
  json.text("name", run.model).text("text", text).raw("set", json_texts(run.set));
  return json.done();
}

std::string data_json(const RunOfPage& run, const Rows& rows, const std::string& scene) {
  const auto now = std::chrono::system_clock::now().time_since_epoch();
  JsonObject json;
  json.text("espalier", solver::version()).flag("running", run.running);
  json.number("written", std::chrono::duration<double>(now).count());
  json.number("begin", run.begin).number("end", run.end);
  if (!run.response.names.empty()) json.raw("response", response_json(run.response));
  if (!run.summary.paths.empty()) json.raw("paths", paths_json(run.summary.paths));
  json.raw("gravity", json_numbers(run.gravity));
  json.raw("summary", summary_json(run.summary, run.status));
  json.raw("model", model_json(run)).raw("plots", plots_json(run, rows)).raw("scene", scene);
  return json.done();
}

void write_block(std::string_view id, std::string_view type, std::string_view content,
                 const std::function<void(std::string_view)>& write) {
  write(fmt::format("<script type=\"{}\" id=\"{}\">", type, id));
  write(content);
  write("</script>\n");
}

}  // namespace

void write_page(const RunOfPage& run, const Rows& rows, Film& shown,
                const std::function<void(std::string_view)>& write) {
  constexpr std::string_view kBytes = "application/octet-stream";
  const Film::Content film = shown.content();
  for (const std::string_view piece : page_head()) write(piece);
  write_block("data", "application/json", data_json(run, rows, film.scene), write);
  write_block("rows", kBytes, base64(compressed(bytes_of(rows.columns()))), write);
  for (std::size_t k = 0; k < film.pieces.size(); ++k)
    write_block(fmt::format("piece{}", k), kBytes, film.pieces[k], write);
  write(fmt::format("<script type=\"{}\" id=\"libraries\">", kBytes));
  for (const std::string_view piece : page_libraries()) write(piece);
  write("</script>\n");
  for (const std::string_view piece : page_tail()) write(piece);
}

}  // namespace espalier::dynamics::page
