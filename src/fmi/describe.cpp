#include "fmi/describe.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace espalier::fmi {
namespace {

using Kind = Variable::Kind;

std::string quoted(std::string_view text) {
  std::string out = "\"";
  for (const char c : text) {
    switch (c) {
      case '&':
        out += "&amp;";
        break;
      case '<':
        out += "&lt;";
        break;
      case '>':
        out += "&gt;";
        break;
      case '"':
        out += "&quot;";
        break;
      case '\n':
      case '\r':
      case '\t':
        out += ' ';
        break;
      default:
        out += c;
    }
  }
  return out + '"';
}

class Writer {
 public:
  Writer(const Description& d, const Contents& c) : d_(d), c_(c), three_(d.version == 3) {}

  std::string run() {
    out_ = "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n";
    add("<fmiModelDescription fmiVersion=\"{}\" modelName={} {}={} description={} generationTool={} "
        "variableNamingConvention=\"flat\"{}>\n",
        three_ ? "3.0" : "2.0", quoted(d_.name), three_ ? "instantiationToken" : "guid", quoted(c_.token),
        quoted(d_.title), quoted(d_.tool), three_ ? "" : " numberOfEventIndicators=\"0\"");
    const char* state = three_ ? "canGetAndSetFMUState=\"true\" canSerializeFMUState=\"true\" "
                                 "providesDirectionalDerivatives=\"true\""
                               : "canGetAndSetFMUstate=\"true\" canSerializeFMUstate=\"true\" "
                                 "providesDirectionalDerivative=\"true\"";
    if (d_.model_exchange)
      add("  <ModelExchange modelIdentifier={} {}{}/>\n", quoted(d_.identifier), state,
          three_ ? "" : " completedIntegratorStepNotNeeded=\"true\"");
    add("  <CoSimulation modelIdentifier={} canHandleVariableCommunicationStepSize=\"true\" {}/>\n",
        quoted(d_.identifier), state);
    units();
    add("  <LogCategories>\n");
    for (const char* name : {"logStatusWarning", "logStatusDiscard", "logStatusError"})
      add("    <Category name=\"{}\"/>\n", name);
    add("  </LogCategories>\n");
    add("  <DefaultExperiment startTime=\"{}\" stopTime=\"{}\" stepSize=\"{}\"/>\n", c_.variables.front().start, c_.end,
        d_.step);
    add("  <ModelVariables>\n");
    // FMI 2 needs no variable for time, and FMI Library finds fault with one; the others then have their places,
    // counted from 1, as value references.
    for (std::size_t k = three_ ? 0 : 1; k < c_.variables.size(); ++k) variable(k);
    add("  </ModelVariables>\n");
    structure();
    return out_ + "</fmiModelDescription>\n";
  }

 private:
  template <class... Values>
  void add(fmt::format_string<Values...> text, Values&&... values) {
    fmt::format_to(std::back_inserter(out_), text, std::forward<Values>(values)...);
  }

  void units() {
    std::vector<std::string> names;
    for (const Variable& v : c_.variables)
      if (!v.unit.empty() && std::find(names.begin(), names.end(), v.unit) == names.end()) names.push_back(v.unit);
    if (names.empty()) return;
    add("  <UnitDefinitions>\n");
    for (const std::string& name : names) add("    <Unit name={}/>\n", quoted(name));
    add("  </UnitDefinitions>\n");
  }

  /// Position among the derivatives is that among the states.
  [[nodiscard]] std::size_t state_of(std::size_t derivative) const {
    std::size_t rank = 0;
    for (std::size_t k = 0; k < derivative; ++k) rank += c_.variables[k].kind == Kind::derivative ? 1 : 0;
    for (std::size_t k = 0; k < c_.variables.size(); ++k)
      if (c_.variables[k].kind == Kind::state && rank-- == 0) return k;
    return 0;
  }

  void variable(std::size_t k) {
    const Variable& v = c_.variables[k];
    std::string head = fmt::format("name={} valueReference=\"{}\" causality=\"{}\" variability=\"{}\"", quoted(v.name),
                                   k, row_of(v.kind).causality, v.kind == Kind::parameter ? "fixed" : "continuous");
    if (v.kind == Kind::output || v.kind == Kind::state || v.kind == Kind::derivative)
      head += " initial=\"calculated\"";
    std::string of_real;
    if (v.kind == Kind::input || v.kind == Kind::parameter) of_real += fmt::format(" start=\"{}\"", v.start);
    if (!v.unit.empty()) of_real += " unit=" + quoted(v.unit);
    if (v.kind == Kind::derivative) of_real += fmt::format(" derivative=\"{}\"", state_of(k));
    if (three_) {
      add("    <Float64 {}{}/>\n", head, of_real);
    } else {
      add("    <ScalarVariable {}><Real{}/></ScalarVariable>\n", head, of_real);
    }
  }

  void unknowns(const char* two, const char* three, std::initializer_list<Kind> kinds) {
    std::string found;
    for (std::size_t k = 0; k < c_.variables.size(); ++k)
      if (std::find(kinds.begin(), kinds.end(), c_.variables[k].kind) != kinds.end())
        found += three_ ? fmt::format("    <{} valueReference=\"{}\"/>\n", three, k)
                        : fmt::format("      <Unknown index=\"{}\"/>\n", k);
    if (found.empty()) return;
    out_ += three_ ? found : fmt::format("    <{0}>\n{1}    </{0}>\n", two, found);
  }

  void structure() {
    add("  <ModelStructure>\n");
    unknowns("Outputs", "Output", {Kind::output});
    unknowns("Derivatives", "ContinuousStateDerivative", {Kind::derivative});
    unknowns("InitialUnknowns", "InitialUnknown", {Kind::output, Kind::state, Kind::derivative});
    add("  </ModelStructure>\n");
  }

  const Description& d_;
  const Contents& c_;
  bool three_;
  std::string out_;
};

}  // namespace

std::string describe(const Description& description, const Contents& contents) {
  return Writer(description, contents).run();
}

}  // namespace espalier::fmi
