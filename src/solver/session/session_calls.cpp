#include "solver/session/session_calls.hpp"

#include <utility>

#include "solver/analysis/analysis_file.hpp"
#include "solver/options/option_check.hpp"
#include "solver/ranks/whole_plan.hpp"
#include "solver/solution/solution.hpp"

namespace espalier::solver {

void check_threads(const char* call, int threads) {
  if (threads < 0 || threads > kMostThreads)
    throw std::invalid_argument(
        fmt::format("{}: {} threads; give 0 (as many as this solver) to {}", call, threads, kMostThreads));
}

void set_refinement(Session& s, int steps, double required_backward_error) {
  Options changed = s.options;
  changed.refinement_steps = steps;
  changed.required_backward_error = required_backward_error;
  check_options(changed);
  s.options.refinement_steps = steps;
  s.options.required_backward_error = required_backward_error;
}

void expect_same_system(Session& s, const MatrixView& pattern, std::size_t values) {
  if (!same_pattern(s.current().system->prepared, pattern, s.pool))
    throw Error(StatusCode::invalid_input,
                "the matrix has another pattern than the one analyzed; call analyze() again");
  if (values == 0 && pattern.nonzeros() > 0)
    throw Error(StatusCode::invalid_input, "the matrix has no values; a pattern cannot be factorized");
}

ChangeResult analyze_change(Session& s, const char* call, const GivenMatrix& a) {
  check_analyzed(s, call);
  ChangeResult result;
  if (s.parts || s.link() != nullptr) {
    AnalysisResult analysis = analysis_by(s, [&] {
      if (s.link() != nullptr) return void(result = s.analyze_change_given(a));
      s.analyze_given(a);
      result.full = true;
      result.why = "the matrix comes in parts";
    });
    result.analysis = std::move(analysis);
    return result;
  }
  Status status = guarded(s, [&] {
    s.expect_usable();
    result = s.analyze_change_given(a);
  });
  result.analysis = status.ok() ? copy_of(s.analysis) : AnalysisResult{};
  result.analysis.status = std::move(status);
  return result;
}

ConditionResult condition_of(Session& s, const char* call) {
  check_factorized(s, call);
  ConditionResult r;
  r.status = guarded(s, [&] {
    s.expect_usable();
    r.estimate = estimate_condition(*s.factor);
  });
  return r;
}

Status save_analysis(Session& s, const char* call, const std::string& path) {
  check_analyzed(s, call);
  return guarded(s, [&] {
    const Analysis& a = s.current();
    const auto& real_form = a.system->real_form;
    analysis::AssemblyTree tree = real_form ? real_form->tree : whole_tree(a.plan, s.link());
    if (s.link() != nullptr && s.link()->rank() != 0) return;  // rank 0 writes for all
    const auto& p = a.system->prepared;
    write_analysis(path, {a.kind(), std::move(tree), p.row_scale, p.col_scale, p.row_of_col}, caller_hash(p, s.pool));
  });
}

Status write_trace(Session& s, const char* call, const std::string& path) {
  if (!s.timeline) throw std::logic_error(fmt::format("{}: Options::record_timeline was not set", call));
  return guarded(s, [&] { s.timeline->write(path); });
}

}  // namespace espalier::solver
