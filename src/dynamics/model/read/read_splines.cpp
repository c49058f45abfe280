// The section [splines]: functions given by points, in the text or in CSV files.
#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <charconv>
#include <stdexcept>

#include "base/checksum.hpp"
#include "dynamics/mesh/text_file.hpp"
#include "dynamics/model/description.hpp"

namespace espalier::dynamics::model {
namespace {

struct Points {
  std::vector<double> x, y;
};

/// Fields of one line of a CSV file; blanks and quotes around them are removed.
std::vector<std::string> fields(std::string_view line, char separator) {
  std::vector<std::string> result;
  std::size_t from = 0;
  for (;;) {
    const std::size_t to = std::min(line.find(separator, from), line.size());
    std::string_view field = line.substr(from, to - from);
    while (!field.empty() && (field.front() == ' ' || field.front() == '\t' || field.front() == '"'))
      field.remove_prefix(1);
    while (!field.empty() &&
           (field.back() == ' ' || field.back() == '\t' || field.back() == '"' || field.back() == '\r'))
      field.remove_suffix(1);
    result.emplace_back(field);
    if (to == line.size()) return result;
    from = to + 1;
  }
}

bool to_number(std::string_view text, double& number) {
  if (!text.empty() && text.front() == '+') text.remove_prefix(1);
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  return error == std::errc() && end == text.data() + text.size();
}

constexpr base::Named<char> kSeparators[] = {{"comma", ','}, {"semicolon", ';'}, {"tab", '\t'}, {"space", ' '}};

/// One CSV file: a header or none, columns by name or by number from 1.
class CsvTable {
 public:
  CsvTable(const std::string& path, Section& s) : path_(path), text_(read_whole_file(path)) {
    separator_ = s.one_of("separator", kSeparators, guess());
    x_ = s.value("x");
    y_ = s.value("y");
  }

  [[nodiscard]] Points points() {
    Points result;
    std::size_t from = 0;
    for (int line = 1; from < text_.size(); ++line) {
      const std::size_t to = std::min(text_.find('\n', from), text_.size());
      const std::string_view row = std::string_view(text_).substr(from, to - from);
      from = to + 1;
      if (row.find_first_not_of(" \t\r") == std::string_view::npos || row.front() == '#') continue;
      read_row(fields(row, separator_), line, result);
    }
    return result;
  }

 private:
  [[noreturn]] void refuse(int line, const std::string& what) const {
    throw Error(StatusCode::invalid_input, fmt::format("{}:{}: {}", path_, line, what));
  }
  /// By the first line that is no comment.
  [[nodiscard]] char guess() const {
    std::size_t at = 0;
    while (at < text_.size() && text_[at] == '#') at = std::min(text_.find('\n', at), text_.size() - 1) + 1;
    const std::string_view line = std::string_view(text_).substr(at, text_.find('\n', at) - at);
    for (const char c : {';', '\t', ','})
      if (line.find(c) != std::string_view::npos) return c;
    return ' ';
  }
  void read_row(const std::vector<std::string>& row, int line, Points& out) {
    double x = 0, y = 0;
    if (!has_columns_) {
      has_columns_ = true;
      const bool header = !std::all_of(row.begin(), row.end(), [](const std::string& f) {
        double ignored = 0;
        return to_number(f, ignored);
      });
      x_column_ = column(x_, 0, header ? row : std::vector<std::string>(), row.size());
      y_column_ = column(y_, 1, header ? row : std::vector<std::string>(), row.size());
      if (header) return;
    }
    if (std::max(x_column_, y_column_) >= row.size())
      refuse(line,
             fmt::format("has {} columns, column {} is asked for", row.size(), std::max(x_column_, y_column_) + 1));
    for (const auto& [number, which] : {std::pair{&x, x_column_}, std::pair{&y, y_column_}})
      if (!to_number(row[which], *number))
        refuse(line, fmt::format("'{}' in column {} is not a number", row[which], which + 1));
    out.x.push_back(x);
    out.y.push_back(y);
  }
  [[nodiscard]] std::size_t column(const Value* key, std::size_t otherwise, const std::vector<std::string>& header,
                                   std::size_t count) const {
    if (key == nullptr) return otherwise;
    if (key->type == Value::Type::integer) {
      if (key->integer < 1 || static_cast<std::size_t>(key->integer) > count)
        fail(key->place, fmt::format("must be a column from 1 to {} of '{}'", count, path_));
      return static_cast<std::size_t>(key->integer) - 1;
    }
    if (key->type != Value::Type::text) fail(key->place, "must be the name of a column, or its number from 1");
    for (std::size_t k = 0; k < header.size(); ++k)
      if (header[k] == key->text) return k;
    fail(key->place, fmt::format("'{}' has no column '{}'{}", path_, key->text,
                                 header.empty() ? "; its first line has no names" : suggestion(key->text, header)));
  }

  std::string path_, text_;
  char separator_ = ',';
  const Value* x_ = nullptr;
  const Value* y_ = nullptr;
  bool has_columns_ = false;
  std::size_t x_column_ = 0, y_column_ = 1;
};

Points read_pairs(const Value& list) {
  Points result;
  if (list.type != Value::Type::array) fail(list.place, "must be a list of points [x, y]");
  for (const Value& item : list.items) {
    if (item.type != Value::Type::array || item.items.size() != 2) fail(item.place, "must be a point [x, y]");
    for (const auto& [number, to] : {std::pair{&item.items[0], &result.x}, std::pair{&item.items[1], &result.y}}) {
      if (number->type != Value::Type::text && number->type != Value::Type::real &&
          number->type != Value::Type::integer)
        fail(number->place, fmt::format("must be a number, not {}", name_of(number->type)));
      static const Scope none;
      to->push_back(number->type == Value::Type::text
                        ? Expression(number->text, number->scope ? *number->scope : none, false).value()
                        : number->real);
    }
  }
  return result;
}

/// For the restart file: what a file held counts, not how it is called.
std::string digest(const Points& p) {
  base::Checksum sum;
  sum.add_list<double>(p.x);
  sum.add_list<double>(p.y);
  return fmt::format("{:016x}", sum.value());
}

CurvePtr read_spline(const std::string& name, const Value& value, const std::string& folder, ModelKeys& keys) {
  Section s(value);
  const auto kind = s.one_of("kind", kCurveKinds, Curve::Kind::akima);
  const auto outside = s.one_of("outside", kCurveOutsides, Curve::Outside::error);
  if (s.has("file") == s.has("points")) fail(s.place(), "needs either 'file' or 'points'");
  Points p;
  try {
    if (const Value* points = s.value("points")) {
      p = read_pairs(*points);
    } else {
      const std::string file = s.text("file");
      CsvTable table(folder.empty() || file.starts_with('/') ? file : folder + "/" + file, s);
      p = table.points();
      keys.emplace_back(fmt::format("splines.{}.file (its content)", name), digest(p));
    }
    const double x_scale = s.number("x_scale", 1), y_scale = s.number("y_scale", 1);
    if (x_scale == 0) fail(s.place("x_scale"), "must not be 0");
    for (double& x : p.x) x *= x_scale;
    for (double& y : p.y) y *= y_scale;
    s.finish();
    return std::make_shared<Curve>(name, p.x, p.y, kind, outside);
  } catch (const std::invalid_argument& error) {
    fail(value.place, error.what());
  } catch (const Error& error) {
    const std::string text = error.what();
    if (text.rfind(value.place.file + ":", 0) == 0) throw;
    fail(value.place, text);
  }
}

class CurveBinder {
 public:
  explicit CurveBinder(const std::map<std::string, CurvePtr>& splines) : splines_(splines) {}
  void operator()(const Place& place, Expression& expression) const {
    for (std::size_t k = 0; k < expression.curves().size(); ++k) {
      const Expression::Unknown& wanted = expression.curves()[k];
      const auto it = splines_.find(wanted.name);
      if (it != splines_.end()) {
        expression.set_curve(k, it->second);
        continue;
      }
      std::vector<std::string> names = Expression::functions();
      for (const auto& [name, curve] : splines_) names.push_back(name);
      fail(place,
           fmt::format("{}unknown function '{}'{}", wanted.complaint, wanted.name, suggestion(wanted.name, names)));
    }
  }

 private:
  const std::map<std::string, CurvePtr>& splines_;
};

}  // namespace

void read_splines(Section& root, Description& model) {
  root.named("splines", [&](const std::string& name, const Value& value) {
    const std::vector<std::string> taken = Expression::functions();
    if (std::find(taken.begin(), taken.end(), name) != taken.end())
      fail(value.place, fmt::format("the name '{}' is taken by a function; choose another", name));
    if (name.find('-') != std::string::npos || std::isdigit(static_cast<unsigned char>(name.front())) != 0)
      fail(value.place,
           "the name of a spline is used like that of a function: letters, digits and _ only, a letter first");
    model.splines[name] = read_spline(name, value, model.folder, model.keys);
  });
}

void bind_curves(Description& model) {
  const CurveBinder bind(model.splines);
  for (JointSpec& joint : model.joints)
    if (joint.function) bind(joint.place, *joint.function);
  for (SupportSpec& support : model.supports)
    for (auto& motion : support.motion)
      if (motion) bind(support.place, *motion);
  for (ForceSpec& force : model.forces) {
    if (force.formula) bind(force.formula->place, force.formula->expression);
    for (auto& component : force.components)
      if (component) bind(component->place, component->expression);
  }
  for (auto& [name, sensor] : model.sensors) bind(sensor.place, sensor.expression);
  for (ControllerSpec& controller : model.controllers)
    for (auto& [name, input] : controller.inputs) bind(input.place, input.expression);
  for (EventSpec& event : model.events) {
    if (event.condition) bind(event.condition->place, event.condition->expression);
    for (auto& [name, value] : event.set) bind(value.place, value.expression);
  }
}

}  // namespace espalier::dynamics::model
