/// \file
/// Keywords of .inp files that make nodes and elements from others: *NGEN, *NFILL, *NCOPY, *ELGEN, *ELCOPY.
#pragma once

#include <unordered_map>

#include "dynamics/mesh/inp_model.hpp"
#include "dynamics/mesh/read/inp_lines.hpp"
#include "dynamics/mesh/read/inp_system.hpp"

namespace espalier::dynamics {

/// The set of this name, made where there is none. @param name  in any case; the first spelling stays
InpSet& inp_set(InpSets& sets, const std::string& name);
/// The labels first to last of a set, as one entry.
InpMember inp_labels(std::int64_t first, std::int64_t last, std::int64_t line);

class InpGenerator {
 public:
  /// Reads the data lines of `k` and adds to `scope` what they make. @return false where `k` is no such keyword
  /// @throws Error where nodes or elements are not defined, or where more than 5 million are made
  /// @param lines_before  added to the lines that the scope's entries name
  bool generate(LineReader& reader, const InpKeyword& k, const InpSystem& system, InpScope& scope,
                std::int64_t lines_before);
  /// To be called where another scope begins.
  void forget();

 private:
  void lines_of_nodes(LineReader& reader, const InpKeyword& k, const InpSystem& system);
  void fills(LineReader& reader, const InpKeyword& k);
  void copies_of_nodes(LineReader& reader, const InpKeyword& k);
  void rows_of_elements(LineReader& reader, const InpKeyword& k);
  void copies_of_elements(LineReader& reader, const InpKeyword& k);

  [[nodiscard]] Point node(const LineReader& reader, std::int64_t label);
  void add_node(const LineReader& reader, std::int64_t label, const Point& at, InpSet* set);
  void copy_element(const LineReader& reader, std::int64_t from, std::int64_t label, std::int64_t by, InpSet* set);
  [[nodiscard]] std::vector<std::int64_t> members(const LineReader& reader, const InpSets& sets,
                                                  const std::string& name) const;
  void collect(const LineReader& reader, const InpSets& sets, const std::string& name, int depth,
               std::vector<std::int64_t>& out) const;
  void count(const LineReader& reader);
  [[nodiscard]] std::int64_t here(const LineReader& reader) const { return lines_before_ + reader.line(); }

  InpScope* scope_ = nullptr;
  std::int64_t lines_before_ = 0;
  std::unordered_map<std::int64_t, std::size_t> nodes_, elements_;  // label -> place in the scope, as far as seen
  std::size_t nodes_seen_ = 0, elements_seen_ = 0, made_ = 0;
};

}  // namespace espalier::dynamics
