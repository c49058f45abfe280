/// \file
/// What an FMU of ours holds beside its binary: resources/espalier.txt says which model it is, where its files lie, and
/// what the numbers of its variables mean.
#pragma once

#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace espalier::fmi {

/// A variable; its value reference is its place in Contents::variables.
struct Variable {
  enum class Kind { time, input, output, parameter, state, derivative };
  Kind kind = Kind::time;
  std::string name;  ///< input; quantity; path of a number of the model; coordinate
  double start = 0;  ///< its value at the start; of time: the start
  std::string unit;  ///< empty: unknown
};

/// What a kind is called in resources/espalier.txt, and its causality in modelDescription.xml.
struct VariableKind {
  Variable::Kind kind;
  std::string_view name, causality;
};
inline constexpr VariableKind kVariableKinds[] = {
    {Variable::Kind::time, "time", "independent"}, {Variable::Kind::input, "input", "input"},
    {Variable::Kind::output, "output", "output"},  {Variable::Kind::parameter, "parameter", "parameter"},
    {Variable::Kind::state, "state", "local"},     {Variable::Kind::derivative, "derivative", "local"}};
[[nodiscard]] const VariableKind& row_of(Variable::Kind kind);

struct Contents {
  std::string token;                ///< instantiationToken, GUID
  std::string model;                ///< name of the model's text, for messages; its files are looked for beside it
  double end = 1;                   ///< of the model's run
  bool adaptive = false;            ///< the integrator controls its error
  std::vector<std::string> set;     ///< values of the text that are replaced
  std::vector<Variable> variables;  ///< the first one is time
  /// Files that the model reads: the path that its readers ask for, and the name in resources/files.
  std::vector<std::pair<std::string, std::string>> files;
};

[[nodiscard]] std::string to_text(const Contents& contents);
/// @throws Error(invalid_input) for what to_text() does not write
[[nodiscard]] Contents parse_contents(std::string_view text);

}  // namespace espalier::fmi
