#include "plan/kept_entries.hpp"

namespace espalier::plan {

void SourceMap::move(Offset begin, Offset shift) {
  if (!runs_.empty() && runs_.back().listed < 0 && runs_.back().shift == shift) return;
  runs_.push_back({begin, shift, -1});
}

void SourceMap::list(Offset begin, std::span<const Offset> now) {
  runs_.push_back({begin, 0, static_cast<Offset>(listed_.size())});
  listed_.insert(listed_.end(), now.begin(), now.end());
}

void SourceMap::close(Offset entries) {
  first_run_.resize(at(entries >> kBlock) + 1);
  std::size_t run = 0;
  for (std::size_t b = 0; b < first_run_.size(); ++b) {
    while (run + 1 < runs_.size() && runs_[run + 1].begin <= static_cast<Offset>(b) << kBlock) ++run;
    first_run_[b] = static_cast<Index>(run);
  }
}

}  // namespace espalier::plan
